"""The numbers of a car from the file that describes it, and the file's content from the numbers."""

from __future__ import annotations

import math
from typing import Any

from jaxveh._core.errors import InputError, check_has, word_for
from jaxveh._core.plain import plain_float
from jaxveh.io import AxleTyre, CarSpecification
from jaxveh.vehicles.base import GRAVITY
from jaxveh.vehicles.sets.numbers import NAMED_ALIKE, SHARES, CarNumbers, TyreNumbers, named_alike
from jaxveh.vehicles.sets.tyres import axle_tyre
from jaxveh.vehicles.steering import specification_of_steering, steering_of


def numbers_of(specification: Any) -> CarNumbers:
    """The numbers of a `jaxveh.io.CarSpecification`, for `build`: cars on four wheels from the file of a single track.

    The tyre of a wheel is that of its property file (`front_tyre`, `rear_tyre`) if there is one. Otherwise it is a typical one
    with half the axle's cornering stiffness; its friction is the axle's D over its load if D is given, otherwise 1. If the file
    lacks a number that a vehicle needs, the error of `build` names it. The `steer_offset` of the file is the value of the steer
    channel when the car runs straight; that of the car has the opposite sign.

    **Raises** `InputError` for an axle with neither coefficients nor a cornering stiffness.
    """
    s = specification
    check_has("specification", s, NAMED_ALIKE, "io.read_car reads one from a file.")
    weight = s.mass * GRAVITY / (s.front_axle_to_cg + s.rear_axle_to_cg)
    return CarNumbers(
        name=s.name or "car",
        source="the car's file",
        **named_alike(s),
        front=_tyre(s, "front", weight * s.rear_axle_to_cg),
        rear=_tyre(s, "rear", weight * s.front_axle_to_cg),
        # A file may have 0 for a car with constant loads.
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
    """The content of a car's file with these numbers: the inverse of `numbers_of`, with each axle's tyres as a Magic Formula.

    Of a suspension a file has only the `leaning_numbers`, and of four motors only the front axle's share. It has no trailer.

    **Raises** `InputError` for a car without mass, yaw inertia or tyres, which every file needs, or a steering that no file can
    describe.
    """
    if not isinstance(numbers, CarNumbers):
        raise InputError(
            f"specification_of: numbers = {word_for(numbers)}: must be CarNumbers, such as numbers_of returns."
        )
    missing = [name for name in ("mass", "yaw_inertia", "front", "rear") if getattr(numbers, name) is None]
    if missing:
        raise InputError(f"{numbers.name}: a car's file needs {', '.join(missing)}, missing from its numbers.")
    loads = {axle: 2.0 * load for axle, load in zip(("front", "rear"), numbers.wheel_loads(), strict=True)}
    tyres = {axle: axle_tyre(getattr(numbers, axle), load) for axle, load in loads.items()}
    optional = ("cg_height", "drag", "rolling_resistance")
    told: dict[str, Any] = leaning_numbers(numbers) | specification_of_steering(numbers.steering)
    return CarSpecification(
        name=numbers.name,
        **{name: getattr(numbers, name) for name in (*NAMED_ALIKE, *SHARES, *optional)},
        **{
            axle: AxleTyre(*map(plain_float, (t.B, t.C, t.D, t.E)), nominal_load=loads[axle])
            for axle, t in tyres.items()
        },
        steer_offset=-numbers.steer_offset or None,
        **told,
    )


def leaning_numbers(numbers: CarNumbers) -> dict[str, float]:
    """The lean of the body: `roll_gradient`, `pitch_gradient` (rad per m/s^2), and `roll_frequency` (Hz) and `roll_damping` (-)
    of small roll about the roll axis; empty if the suspension or the tracks are unknown.

    With roll stiffness K and damping C of both axles, the sprung mass m at h above the roll axis and its inertia J about it, the
    roll gradient is `m h / (K - m g h)`, the frequency `sqrt((K - m g h) / J) / 2 pi` and the damping ratio
    `C / (2 sqrt((K - m g h) J))`. For pitch the whole longitudinal load transfer of the sprung mass acts on springs and tyres, as
    without anti-dive.
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
