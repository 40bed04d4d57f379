"""Named parameter sets, and cars from a specification. They are functions, so that importing creates no arrays."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_has, check_kind, check_positive
from jaxveh.tyres import AbstractTyre, Contact, Linear, MagicFormula, cornering_stiffness, kit
from jaxveh.vehicles.base import GRAVITY
from jaxveh.vehicles.single_track import SingleTrack
from jaxveh.vehicles.steering import steering_of

FIELDS = (
    *("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg", "front", "rear", "cg_height", "steer_offset"),
    *("front_cornering_stiffness", "rear_cornering_stiffness"),
)
"""What a specification of a car has, for a single track."""


def passenger_car() -> SingleTrack:
    """The passenger car of Bao, Sabbioni et al. (2015), with the centre of gravity 0.96 m behind the front axle.

    1420 kg, 2124 kg m^2, wheelbase 2.55 m, Magic Formula axles (B C D is 88 kN/rad in front and 127 kN/rad behind).

    **Erratum**: the paper prints the two distances in exchanged order (`passenger_car_as_printed`). The front axle would then
    need a friction coefficient of 1.5, and the car would spin in a double lane change at 25 m/s with 2 degrees of steer.
    Swapped, as here, it is an ordinary understeering car. The paper also prints cornering stiffnesses of 117 and 144; its
    coefficients give the two above.
    """
    return _printed_car(front_axle_to_cg=0.96, rear_axle_to_cg=1.59)


def passenger_car_as_printed() -> SingleTrack:
    """The passenger car of Bao, Sabbioni et al. (2015) with the distances as printed: front 1.59 m, rear 0.96 m.

    Only for reproducing the paper: the car oversteers and spins easily; see `passenger_car` for the erratum.
    """
    return _printed_car(front_axle_to_cg=1.59, rear_axle_to_cg=0.96)


def _printed_car(front_axle_to_cg: float, rear_axle_to_cg: float) -> SingleTrack:
    return SingleTrack(
        mass=1420.0,
        yaw_inertia=2124.0,
        front_axle_to_cg=front_axle_to_cg,
        rear_axle_to_cg=rear_axle_to_cg,
        front=MagicFormula(B=6.9986, C=1.6, D=7872.0, E=-0.0542),
        rear=MagicFormula(B=14.1636, C=1.6, D=5609.0, E=1.0073),
    )


def axle_from_stiffness(stiffness, load) -> MagicFormula:
    """A generic Magic Formula axle with a given cornering stiffness (N/rad) at a static load (N).

    The peak force D is the load (friction coefficient 1), C = 1.3 and E = -0.5 are those of an ordinary tyre, and
    `B = stiffness / (C D)`. The force scales with load (`nominal_load` is the static load).
    """
    check_positive("stiffness", stiffness, "N/rad")
    check_positive("load", load, "N")
    return kit.GENERIC_TYRE.magic_formula(stiffness, load)


def linear(car: SingleTrack) -> SingleTrack:
    """The same car with linear tyres of the same cornering stiffness at the static loads: the open-loop baseline.

    The stiffness is the slope of each axle's force at zero slip angle, including shifts.
    """
    check_kind("linear: car", car, SingleTrack, "Of other cars linear_single_track(car) makes one.")
    axles = [_linear_axle(tyre, load) for tyre, load in zip((car.front, car.rear), car.static_loads(), strict=True)]
    return eqx.tree_at(lambda c: (c.front, c.rear), car, axles)


def _linear_axle(tyre: AbstractTyre, load: jax.Array) -> Linear:
    if type(tyre) is Linear:
        return tyre
    return Linear(cornering_stiffness(tyre, Contact(slip_angle=jnp.zeros_like(load), load=load)))


def from_specification(spec) -> SingleTrack:
    """A single track from the specification of a car: a `jaxveh.io.CarSpecification`, or anything with its fields.

    - `mass` (kg), `yaw_inertia` (kg m^2), `front_axle_to_cg`, `rear_axle_to_cg` (m).
    - Each axle: its Magic Formula coefficients (`front`, `rear`: B, C, D, E, S_h, S_v, nominal_load) or, if they are None, its
      cornering stiffness (`front_cornering_stiffness`, `rear_cornering_stiffness`, N/rad) for a generic axle by
      `axle_from_stiffness`.
    - `cg_height` (m) or None: with a height, axle loads depend on the longitudinal acceleration, which becomes an input.
    - `steer_offset` (rad) or None: the value of the steer channel when the car runs straight. The car's own `steer_offset` is
      added to the channel and therefore has the opposite sign.
    - `steering`, `rear_steer_ratio`, `rear_steer_ratio_fast`, `rear_steer_speed` or None: the steering system.

    **Raises** `InputError` for an axle that has neither coefficients nor a stiffness, and where `SingleTrack` and `MagicFormula`
    do.
    """
    check_has("spec", spec, FIELDS, "io.read_car reads one from a file.")
    mass, a, b = spec.mass, spec.front_axle_to_cg, spec.rear_axle_to_cg
    static = {"front": mass * GRAVITY * b / (a + b), "rear": mass * GRAVITY * a / (a + b)}
    return SingleTrack(
        mass=mass,
        yaw_inertia=spec.yaw_inertia,
        front_axle_to_cg=a,
        rear_axle_to_cg=b,
        front=_axle(spec, "front", static["front"]),
        rear=_axle(spec, "rear", static["rear"]),
        cg_height=spec.cg_height,
        steer_offset=0.0 if spec.steer_offset is None else -spec.steer_offset,
        steering=steering_of(spec),
    )


def _axle(spec, axle: str, load: float) -> MagicFormula:
    tyre = getattr(spec, axle)
    if tyre is not None:
        return MagicFormula(tyre.B, tyre.C, tyre.D, tyre.E, tyre.S_h, tyre.S_v, tyre.nominal_load)
    stiffness = getattr(spec, f"{axle}_cornering_stiffness")
    if stiffness is None:
        raise InputError(
            f"{axle} axle: the specification has neither coefficients [{axle}] (B, C, D, E) nor "
            f"{axle}_cornering_stiffness (N/rad per axle); one of them is needed."
        )
    return axle_from_stiffness(stiffness, load)
