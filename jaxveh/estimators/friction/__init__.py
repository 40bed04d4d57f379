"""The road's friction from the tyre forces: section 3 of the review (Chen, Gao, Xu 2013).

It is the friction over that of the road on which the car's tyre parameters hold; for a file without tyre curves it is the peak
force over the load. **It is not observable while the tyres work in their linear range**: the force grows with ln mu only by
`F - s dF/ds` (`laws.SimilarCurve.sensitivity`). Every method therefore reports with `known` whether the drive excites it.
"""

from __future__ import annotations

import jax.numpy as jnp

from jaxveh.estimators.car_file import keys_of, number_of, numbers_in
from jaxveh.estimators.friction.along import AlongEvidence, WheelForces
from jaxveh.estimators.friction.augmented import augmented_filter
from jaxveh.estimators.friction.axles import AligningTorque, Axles, HybridObserver, LateralCurve
from jaxveh.estimators.friction.bank import FrictionBank
from jaxveh.estimators.friction.curve_doubt import CurveDoubt
from jaxveh.estimators.friction.curve_follower import CurveFollower
from jaxveh.estimators.friction.laws import planar_car
from jaxveh.estimators.friction.scalar import Follower
from jaxveh.estimators.friction.slipping_wheels import SidesApart, WheelObserver
from jaxveh.estimators.friction.stiffness_doubt import with_doubt
from jaxveh.estimators.friction.wheels import Reconstruction, SlipSlope, WheelSlips
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.quantity import constant_of, estimate_of, live_of
from jaxveh.estimators.rear_steer import with_rear_steer
from jaxveh.io import CarSpecification
from jaxveh.tyres import LuGre

NAME = "friction"

SHOWN = {"friction": "-"}

COUNT, LEAST, MOST = 36, 0.06, 1.65
"""Number of filters of the recommended method, from the least to the largest friction in equal logarithmic steps. Frictions of
0.07 to 1.37 can be known."""


def _wheels(car: CarSpecification, who: str) -> WheelForces:
    wheels = keys_of(car, f"friction: {who}", {"wheel_radius": "m", "wheel_inertia": "kg m^2"})
    return WheelForces(**wheels, **numbers_in(car, "rolling_resistance"))


def _slips(car: CarSpecification, who: str) -> WheelSlips:
    return WheelSlips(planar_car(car), _wheels(car, who))


def _bank(car: CarSpecification) -> CurveDoubt:
    planar = planar_car(car)
    frictions = jnp.exp(jnp.linspace(jnp.log(LEAST), jnp.log(MOST), COUNT))
    wheels = None if car.wheel_radius is None or car.wheel_inertia is None else _wheels(car, "bank")
    along = None if wheels is None else AlongEvidence(planar, wheels)
    return CurveDoubt(FrictionBank(planar, frictions, frictions, along=along))


def _lateral(car: CarSpecification) -> LateralCurve:
    return LateralCurve(Axles(planar_car(car)), CurveFollower())


def _aligning(car: CarSpecification) -> AligningTorque:
    ratio = number_of(car, "steering_ratio", "friction: aligning_torque", "-")
    return AligningTorque(Axles(planar_car(car)), Follower(), ratio)


def _lugre(car: CarSpecification) -> WheelObserver:
    slips = _slips(car, "lugre")
    front = slips.car.front
    # The slip stiffness of the bristles over load is sigma_0 L / 2.
    per_load = float(front.stiffness / slips.car.static_loads()[0])
    friction = float(front.peak / slips.car.static_loads()[0])
    law = LuGre(
        stiffness_x=2.0 * per_load / 0.2, stiffness_y=2.0 * per_load / 0.2, static_friction=1.05 * friction,
        kinetic_friction=0.8 * friction, stribeck_speed=6.0,
    )  # fmt: skip
    return WheelObserver(slips, law)


METHODS = {
    "bank": MethodOfCar(
        lambda car: with_rear_steer(_bank(car), car),
        "one filter of the lateral motion per friction, with wheel slips where the log has them; known only near the limit, and "
        "where the file's curve and the brush model's agree",
        "section 3.1.2.1, joint with reference [99]; interacting multiple models (Blom & Bar-Shalom 1988)",
        any_steering=True,
    ),
    "lateral_curve": MethodOfCar(
        _lateral,
        "the front axle's force and slip angle on a brush curve; known only near the limit",
        "section 3.1.2.1, by tyre response",
    ),
    "aligning_torque": MethodOfCar(
        _aligning,
        "the pneumatic trail from the steering torque, which shrinks before the force saturates; the trails are a guess",
        "section 3.1.2.1, lateral and self-aligning",
    ),
    "hybrid": MethodOfCar(
        lambda car: HybridObserver(_lateral(car)),
        "the observer of lateral_curve, with nonlinear least squares over two seconds where these are better; known only near "
        "the limit",
        "section 3.1.1.1, figure 3, reference [101]",
    ),
    "augmented": MethodOfCar(
        with_doubt(lambda car: augmented_filter(planar_car(car))),
        "friction as a slow state of a nonlinear single track; known only near the limit",
        "section 3.1.2.1.4, mu-dot = 0",
    ),
    "slip_slope": MethodOfCar(
        lambda car: SlipSlope(_slips(car, "slip_slope")),
        "the slope of force over slip at small slip, known only where torques vary; no friction without a calibration of the "
        "tyre",
        "section 3.1.2.1, references [112-116]",
    ),
    "reconstruction": MethodOfCar(
        with_doubt(lambda car: Reconstruction(_slips(car, "reconstruction"))),
        "used friction over slip and its slope, extrapolated to the peak; known only where the slope falls",
        "section 3.2, equations 18 and 19, figure 6 (d lambda / dt guarded near 0)",
    ),
    "wheel_observer": MethodOfCar(
        with_doubt(lambda car: WheelObserver(_slips(car, "wheel_observer"))),
        "an adaptive observer of the wheels, linear in friction; known only while wheels slip",
        "section 3.1.2.1.3, equation 14, reference [118]",
    ),
    "lugre": MethodOfCar(
        with_doubt(_lugre),
        "an adaptive observer of the wheels on LuGre's bristles; known only while wheels slip",
        "section 3.1.2.1.3, reference [119]",
    ),
    "sides_apart": MethodOfCar(
        with_doubt(lambda car: SidesApart(_slips(car, "sides_apart"), Follower())),
        "left and right wheels separately; known only while wheels slip",
        "section 3.2, equation 18 by wheel",
    ),
}

RECOMMENDED = "bank"

do_nothing = constant_of(
    NAME, lambda car: {"friction": 1.0}, "Friction 1 in all rows: that of the road on which the tyre parameters hold."
)
estimate = estimate_of(NAME, SHOWN, METHODS, RECOMMENDED)
live = live_of(NAME, SHOWN, METHODS, RECOMMENDED)

__all__ = ["METHODS", "NAME", "RECOMMENDED", "SHOWN", "do_nothing", "estimate", "live"]
