"""A car's numbers out of the file that describes it, and what a file would say of numbers."""

from __future__ import annotations

import math
from typing import Any

from jaxveh._core.errors import InputError
from jaxveh.io import AxleTyre, CarSpecification
from jaxveh.vehicles.base import GRAVITY
from jaxveh.vehicles.sets.numbers import NAMED_ALIKE, SHARES, CarNumbers, TyreNumbers, named_alike
from jaxveh.vehicles.sets.tyres import axle_tyre
from jaxveh.vehicles.steering import specification_of_steering, steering_of


def numbers_of(specification: Any) -> CarNumbers:
    """The numbers of a `jaxveh.io.CarSpecification`, for `build`: cars on four wheels out of the file of a single track.

    A wheel's tyre is its property file's (`front_tyre`, `rear_tyre`) where there is one; else a typical one with half the axle's
    cornering stiffness, and with the friction D over the axle's load where the axle's D is given, else 1. What the file
    leaves out `build` asks for by name. `steer_offset` is what the steer channel shows when the car runs straight, so that the
    car's own is the negative of it.

    **Raises** `InputError` where an axle has neither coefficients nor cornering stiffness.
    """
    s = specification
    weight = s.mass * GRAVITY / (s.front_axle_to_cg + s.rear_axle_to_cg)
    return CarNumbers(
        name=s.name or "car",
        source="the car's file",
        **named_alike(s),
        front=_tyre(s, "front", weight * s.rear_axle_to_cg),
        rear=_tyre(s, "rear", weight * s.front_axle_to_cg),
        # A file may hold 0 for a car whose loads stay.
        cg_height=s.cg_height or None,
        drag=s.drag,
        rolling_resistance=s.rolling_resistance,
        steer_offset=0.0 if s.steer_offset is None else -s.steer_offset,
        steering=steering_of(s),
    )


def _tyre(s: Any, axle: str, load: float) -> TyreNumbers:
    formula, stiffness = getattr(s, axle), getattr(s, f"{axle}_cornering_stiffness")
    if stiffness is None:
        raise InputError(f"{axle} axle: the specification has neither coefficients nor {axle}_cornering_stiffness.")
    friction = 1.0 if formula is None else formula.D / (load if formula.nominal_load is None else formula.nominal_load)
    return TyreNumbers(cornering_stiffness=0.5 * stiffness, friction=friction, property_file=getattr(s, f"{axle}_tyre"))


def specification_of(numbers: CarNumbers) -> CarSpecification:
    """What a car's file would say of these numbers: the inverse of `numbers_of`, with each axle's tyres as a Magic Formula.

    A file knows of a suspension how the body leans (`leaning_numbers`), nothing of trailers, and of four motors no more than the
    front axle's share.

    **Raises** `InputError` for a car without mass, yaw inertia or tyres, which no file can leave out, or a steering that none can
    say.
    """
    missing = [name for name in ("mass", "yaw_inertia", "front", "rear") if getattr(numbers, name) is None]
    if missing:
        raise InputError(f"{numbers.name}: {', '.join(missing)} must be known for a car's file, and is not.")
    loads = {axle: 2.0 * load for axle, load in zip(("front", "rear"), numbers.wheel_loads(), strict=True)}
    tyres = {axle: axle_tyre(getattr(numbers, axle), load) for axle, load in loads.items()}
    optional = ("cg_height", "drag", "rolling_resistance")
    told: dict[str, Any] = leaning_numbers(numbers) | specification_of_steering(numbers.steering)
    return CarSpecification(
        name=numbers.name,
        **{name: getattr(numbers, name) for name in (*NAMED_ALIKE, *SHARES, *optional)},
        **{axle: AxleTyre(*map(float, (t.B, t.C, t.D, t.E)), nominal_load=loads[axle]) for axle, t in tyres.items()},
        steer_offset=-numbers.steer_offset or None,
        **told,
    )


def leaning_numbers(numbers: CarNumbers) -> dict[str, float]:
    """How the body leans over the road: `roll_gradient`, `pitch_gradient` (rad per m/s^2), `roll_frequency` (Hz) and
    `roll_damping` (-) of a small roll about the roll axis; nothing where the suspension or the tracks are not known.

    With roll stiffness K and damping C of both axles, the sprung mass m at h above the roll axis and its inertia J about it:
    `m h / (K - m g h)`, `sqrt((K - m g h) / J) / 2 pi`, `C / (2 sqrt((K - m g h) J))`. Pitch: all of the longitudinal transfer of
    the sprung mass goes through springs and tyres, as without anti-dive.
    """
    s, known = numbers.suspension, numbers.values()
    names = [f"roll_{what}_{axle}" for what in ("stiffness", "damping") for axle in ("front", "rear")]
    if s is None or any(name not in known for name in names):
        return {}
    parts = [float(known[name]) for name in names]
    a, b, mass, height = s.front_axle_to_cg, s.rear_axle_to_cg, s.sprung_mass, s.cg_height
    arm = height - (b * s.roll_centre_front + a * s.roll_centre_rear) / (a + b)
    stiffness, damping = parts[0] + parts[1] - mass * GRAVITY * arm, parts[2] + parts[3]
    inertia = s.roll_inertia + mass * arm**2
    wheel = lambda spring: 2.0 * spring * s.tyre_stiffness / (spring + s.tyre_stiffness)
    pitching = wheel(s.spring_front) * a**2 + wheel(s.spring_rear) * b**2 - mass * GRAVITY * height
    return {
        "roll_gradient": mass * arm / stiffness,
        "roll_frequency": math.sqrt(stiffness / inertia) / (2.0 * math.pi),
        "roll_damping": damping / (2.0 * math.sqrt(stiffness * inertia)),
        "pitch_gradient": mass * height / pitching,
    }
