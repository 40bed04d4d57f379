"""Kalman filters of a rigid body's kinematics: without tyres, and with the size as the only parameter of the car."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh import filters, numerics
from jaxveh._core.names import record_type
from jaxveh.estimators.contract import Need
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.method import Filtered
from jaxveh.estimators.sideslip_methods.common import (
    A_X,
    A_Y,
    A_Z,
    PITCH_RATE,
    ROLL_RATE,
    V_X,
    YAW_RATE,
    Guarded,
    guard,
)
from jaxveh.io import CarSpecification
from jaxveh.statespace import Continuous, Gaussian, Heun, Prior, Propagate, StateSpace
from jaxveh.vehicles import GRAVITY

STRAIGHT_RATE, STRAIGHT_A_Y = 0.01, 0.3
"""rad/s, m/s^2: a car with a smaller yaw rate and lateral acceleration goes straight, and has no lateral velocity."""

UNLEVELLED, ACCELEROMETER, GYROSCOPE = 0.2, 0.05, 0.005
"""m/s per root second, m/s per root second, rad per root second: errors of inertial sensors, as white noise. The first is that of
an accelerometer in a body that leans, whose gravity component is not taken out."""

SPEED, ASIDE, UPWARD = 0.05, 0.1, 0.05
"""m/s: standard deviations of the measured speed, of the lateral velocity of a car that goes straight, and of the vertical
velocity."""

LEAN = 0.05
"""rad: standard deviation of roll and pitch at the start."""


class PlaneState(NamedTuple):
    """Velocity of the centre of gravity (m/s) in the car's axes."""

    v_x: Any
    v_y: Any


class BodyState(NamedTuple):
    """Velocity of the centre of gravity (m/s) in the body's axes, `roll` and `pitch` (rad)."""

    v_x: Any
    v_y: Any
    v_z: Any
    roll: Any
    pitch: Any


class VelocityReport(NamedTuple):
    """Lateral velocity (m/s) and sideslip (rad)."""

    v_y: Any
    sideslip: Any


class GoingStraight(AbstractCleaning):
    """Adds measurements that need no sensor: zero vertical velocity on any road, and zero lateral velocity of a car that goes
    straight, by `STRAIGHT_RATE` and `STRAIGHT_A_Y`."""

    @property
    def channels(self):
        return ()

    def first(self, t, values):
        return self.next(None, t, values)

    def next(self, memory, t, values):
        none = jnp.zeros_like(t)
        straight = (jnp.abs(values["yaw_rate"]) < STRAIGHT_RATE) & (jnp.abs(values["a_y"]) < STRAIGHT_A_Y)
        return memory, values | {"v_y": jnp.where(straight, none, jnp.nan), "v_z": none}


class AtSpeed(Filtered):
    """A filter whose model has the speed among its states; it starts at the speed of the first row."""

    def first(self, t, values):
        start = lambda method: method.model.prior.mean.v_x
        return Filtered.first(eqx.tree_at(start, self, values["v_x"]), t, values)


def plane_drift(system, t, x: PlaneState, u) -> PlaneState:
    """`dv_x/dt = a_x + r v_y`, `dv_y/dt = a_y - r v_x`."""
    del system, t
    return PlaneState(u.a_x + u.yaw_rate * x.v_y, u.a_y - u.yaw_rate * x.v_x)


def body_drift(system, t, x: BodyState, u) -> BodyState:
    """The strapdown equations of a rigid body on a flat earth in ISO 8855 (roll positive with the left side up, pitch with the
    nose down): `dv/dt = f - w x v - g`, and the rates of roll and pitch."""
    del system, t
    p, q, r = u.roll_rate, u.pitch_rate, u.yaw_rate
    s, c = numerics.sin(x.roll), numerics.cos(x.roll)
    nose, level = numerics.sin(x.pitch), numerics.cos(x.pitch)
    return BodyState(
        v_x=u.a_x + r * x.v_y - q * x.v_z + GRAVITY * nose,
        v_y=u.a_y - r * x.v_x + p * x.v_z - GRAVITY * s * level,
        v_z=u.a_z + q * x.v_x - p * x.v_y - GRAVITY * c * level,
        roll=p + (q * s + r * c) * nose / level,
        pitch=q * c - r * s,
    )


class Seen(eqx.Module):
    """An observation that returns the states in `names` unchanged."""

    names: tuple[str, ...] = eqx.field(static=True)

    def __call__(self, system, t, x, u):
        return record_type("Measurements", self.names)(*[getattr(x, name) for name in self.names])


def report(system, t, x, u) -> VelocityReport:
    """Lateral velocity and sideslip."""
    return VelocityReport(x.v_y, numerics.arctan2(x.v_y, x.v_x))


def kinematic_model(
    *, accelerometer: float = UNLEVELLED, speed: float = SPEED, aside: float = ASIDE, start: float = 20.0
) -> StateSpace:
    """The model of the review's [8] (section 1.1): v_x and v_y, driven by accelerometers and gyroscope, with the yaw rate taken
    as known. v_x is measured, and so is v_y where the car goes straight.

    The speed makes the lateral velocity observable only while the car yaws: `d(dv_x/dt) / dv_y = r`. Standard deviations:
    `accelerometer` (m/s per root second), `speed`, `aside` (m/s); `start`: the speed at first (m/s)."""
    return StateSpace(
        transition=Propagate(plane_drift, Heun()),
        observation=Seen(("v_x", "v_y")),
        report=report,
        process_noise=Continuous(Gaussian({"v_x": accelerometer, "v_y": accelerometer})),
        measurement_noise=Gaussian({"v_x": speed, "v_y": aside}),
        prior=Prior(PlaneState(start, 0.0), Gaussian({"v_x": 1.0, "v_y": 0.5})),
        inputs=("a_x", "a_y", "yaw_rate"),
        input_path="linear",
    )


def six_axis_model(
    *, accelerometer: float = ACCELEROMETER, gyroscope: float = GYROSCOPE, speed: float = SPEED, aside: float = ASIDE,
    start: float = 20.0,
) -> StateSpace:  # fmt: skip
    """The model of the review's [9] (section 1.1.2): velocity, roll and pitch, driven by an inertial unit of six axes and
    corrected by the wheels' speed.

    Gravity through body roll, pitch, bank and grade is taken out. Zero vertical velocity, and zero lateral velocity where the car
    goes straight, are measurements, too; without them roll and lateral velocity could not be distinguished there. The rotation
    of the earth is left out.
    """
    noise = dict.fromkeys(("v_x", "v_y", "v_z"), accelerometer) | dict.fromkeys(("roll", "pitch"), gyroscope)
    return StateSpace(
        transition=Propagate(body_drift, Heun()),
        observation=Seen(("v_x", "v_y", "v_z")),
        report=report,
        process_noise=Continuous(Gaussian(noise)),
        measurement_noise=Gaussian({"v_x": speed, "v_y": aside, "v_z": UPWARD}),
        prior=Prior(
            BodyState(start, 0.0, 0.0, 0.0, 0.0),
            Gaussian({"v_x": 1.0, "v_y": 0.5, "v_z": 0.05, "roll": LEAN, "pitch": LEAN}),
        ),
        inputs=("a_x", "a_y", "a_z", "roll_rate", "pitch_rate", "yaw_rate"),
        input_path="linear",
    )


def kinematic_kalman(car: CarSpecification, *, claims: bool = False) -> Guarded:
    """Makes the kinematic filter from a car's file. Its standard deviation ignores bank and sensor offsets, and is therefore
    given only if `claims` is True."""
    return _filtered(car, kinematic_model(), (A_X, A_Y, YAW_RATE), claims=claims)


def six_axis(car: CarSpecification) -> Guarded:
    """Makes the six-axis filter from a car's file."""
    return _filtered(car, six_axis_model(), (A_X, A_Y, A_Z, ROLL_RATE, PITCH_RATE, YAW_RATE))


def _filtered(car: CarSpecification, model: StateSpace, sensors: tuple[Need, ...], *, claims: bool = True) -> Guarded:
    inner = AtSpeed(model, filters.Extended(), (V_X, *sensors), GoingStraight())
    return guard(car, inner, sensors, sensors, anew=True, claims=claims)
