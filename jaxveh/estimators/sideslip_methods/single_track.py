"""Single-track models for filters and observers: lateral velocity and yaw rate, driven by the steer, with any tyre law of the
review."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import filters, numerics, tyres
from jaxveh._core.errors import check_one_of
from jaxveh._core.names import record_type
from jaxveh._core.parameter import UNNAMED, positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.live import AbstractCleaning, AsItIs
from jaxveh.estimators.method import AbstractMethod, Filtered
from jaxveh.estimators.sideslip_methods.common import (
    A_Y,
    SLOWEST,
    STEER,
    V_X,
    YAW_RATE,
    Guarded,
    guard,
    sideslip_answer,
    slowest_of,
    straight_steer,
)
from jaxveh.estimators.sideslip_methods.stiff_step import StiffStep
from jaxveh.io import CarSpecification
from jaxveh.statespace import AbstractFilter, Continuous, Gaussian, Prior, StateSpace
from jaxveh.tyres import AbstractTyre, Contact, MagicFormula
from jaxveh.vehicles import GRAVITY, AbstractVehicle, LinearSingleTrack, SingleTrack, from_specification, linear

FORCE_ERROR = 0.02
"""s^0.5: error of an axle's tyre law over the axle load, as white noise: force errors of 3 % of the load that last 0.4 s."""

YAW_RATE_NOISE, A_Y_NOISE = 0.003, 0.3
"""rad/s, m/s^2: noise of the gyroscope, its offset included; noise of the accelerometer, with gravity through roll and bank, and
with the errors of both axles' forces."""

USUAL_SPEED = 20.0
"""m/s, for a car of the usual wheelbase: speed at which a standard deviation of v_y is converted to one of sideslip."""

CHANNELS = ("yaw_rate", "a_y")
SENSORS = (YAW_RATE, A_Y)


class LateralState(NamedTuple):
    """Lateral velocity of the centre of gravity (m/s) and yaw rate (rad/s)."""

    v_y: Any
    yaw_rate: Any


class LinearState(NamedTuple):
    """Sideslip of the centre of gravity (rad) and yaw rate (rad/s)."""

    sideslip: Any
    yaw_rate: Any


class LateralReport(NamedTuple):
    """Lateral velocity (m/s) and sideslip (rad) of the centre of gravity."""

    v_y: Any
    sideslip: Any


class Lateral(eqx.Module):
    """A `car` at a given speed, and the speed `slowest` (m/s) below which its wheels roll without slip."""

    car: AbstractVehicle = eqx.field(metadata=UNNAMED)
    slowest: jax.Array = positive("m/s")


class OpenLoopMemory(NamedTuple):
    """The state, the inputs and the time (s) of the previous row."""

    state: LateralState
    u: Any
    t: Any


def full_state(car: AbstractVehicle, x: Any) -> Any:
    """The car's full state, with zero for the components that `x` lacks (position, heading)."""
    none = jnp.zeros_like(x.yaw_rate)
    known = x._asdict()
    return car.state_type(*[known.get(name, none) for name in car.state_type._fields])


def derivatives(system: Lateral, t, x, u):
    """The state's time derivative."""
    rates = system.car.derivatives(t, full_state(system.car, x), u)
    return type(x)(*[getattr(rates, name) for name in x._fields])


STEP = StiffStep(derivatives)


def transition(system: Lateral, t0, t1, x, u):
    """The state after a step with the inputs of its first row. Below `slowest`, and backwards, it is that of the kinematic single
    track: `r = v_x delta / l`, `v_y = l_r r`."""
    return rolling_below(system, STEP(system, t0, t1, x, u), u)


def rolling_below(system: Lateral, moved, u):
    """The state `moved`, or below `slowest` that of a car whose wheels roll without slip."""
    car: Any = system.car
    # Only lateral velocity and yaw rate are replaced; other states (roll) are left as they are.
    sideslip = numerics.as_wide_as(car.rear_axle_to_cg / car.wheelbase * u.steer, moved.yaw_rate)
    aside = {"sideslip": sideslip} if "sideslip" in moved._fields else {"v_y": u.v_x * sideslip}
    yaw_rate = numerics.as_wide_as(u.v_x * u.steer / car.wheelbase, moved.yaw_rate)
    rolling = moved._replace(yaw_rate=yaw_rate, **aside)
    return jax.tree.map(lambda a, b: jnp.where(u.v_x >= system.slowest, a, b), moved, rolling)


def observation(system: Lateral, t, x, u):
    """Yaw rate and lateral acceleration."""
    outputs = system.car.outputs(t, full_state(system.car, x), u)
    return record_type("Measurements", CHANNELS)(x.yaw_rate, outputs.a_y)


def report(system: Lateral, t, x, u) -> LateralReport:
    """Lateral velocity and sideslip of the centre of gravity."""
    moves = system.car.motion(full_state(system.car, x), u)
    return LateralReport(moves.v_y, numerics.arctan2(moves.v_y, jnp.broadcast_to(moves.v_x, jnp.shape(moves.v_y))))


def process_noise(car: Any, force_error: float = FORCE_ERROR) -> dict[str, float]:
    """The process noise of v_y (m/s per root second) and of the yaw rate (rad/s per root second) of this car, from white errors
    of the axles' forces of `force_error` (s^0.5) times their loads."""
    a, b = float(car.front_axle_to_cg), float(car.rear_axle_to_cg)
    push = GRAVITY * force_error / (a + b)
    return {
        "v_y": push * (a**2 + b**2) ** 0.5,
        "yaw_rate": push * 2.0**0.5 * a * b * float(car.mass) / float(car.yaw_inertia),
    }


def lateral_model(
    car: AbstractVehicle, slowest: float, *, force_error: float = FORCE_ERROR, yaw_rate: float = YAW_RATE_NOISE,
    a_y: float = A_Y_NOISE, inputs: tuple[str, ...] = ("steer", "v_x"),
) -> StateSpace:  # fmt: skip
    """The state space of a car at a given speed. The states are v_y (for a `LinearSingleTrack` sideslip) and yaw rate, the
    measurements those of a gyroscope and an accelerometer.

    Standard deviations: `force_error` (`process_noise`), `yaw_rate` (rad/s), `a_y` (m/s^2).
    """
    noise, spread, state = process_noise(car, force_error), 0.5, LateralState
    if isinstance(car, LinearSingleTrack):
        usual = USUAL_SPEED * float(slowest) / SLOWEST
        noise["sideslip"], spread, state = noise.pop("v_y") / usual, spread / usual, LinearState
    return StateSpace(
        system=Lateral(car, slowest),
        transition=transition,
        observation=observation,
        report=report,
        process_noise=Continuous(Gaussian(noise)),
        measurement_noise=Gaussian({"yaw_rate": yaw_rate, "a_y": a_y}),
        prior=Prior(state(0.0, 0.0), Gaussian(dict(zip(state._fields, (spread, 0.1), strict=True)))),
        inputs=inputs,
    )


class Axle(NamedTuple):
    """An axle at rest: its `tyre` from the car's file, `stiffness` (N/rad), `grip` (N) and `load` (N)."""

    tyre: MagicFormula
    stiffness: Any
    grip: Any
    load: Any


def _arctangent(axle: Axle) -> AbstractTyre:
    # The law's force is zero at four times the static load, and three quarters are left at the static load; pi / 2 of that is
    # the grip.
    reduction = axle.grip / axle.load * 8.0 / (3.0 * jnp.pi)
    return tyres.Arctangent(4.0 * axle.load, axle.stiffness / (0.75 * reduction * axle.load), reduction)


TYRES: dict[str, Callable[[Axle], AbstractTyre]] = {
    "magic_formula": lambda axle: axle.tyre,
    "linear": lambda axle: tyres.Linear(axle.stiffness),
    "hsri": lambda axle: tyres.HSRI(axle.stiffness, axle.stiffness, axle.grip / axle.load),
    "parabolic": lambda axle: tyres.Parabolic(axle.stiffness, axle.grip / axle.load),
    "exponential": lambda axle: tyres.Exponential(axle.stiffness / axle.grip, axle.grip / axle.load),
    "arctangent": _arctangent,
    "unitire": lambda axle: tyres.UniTire(axle.stiffness, axle.stiffness, axle.grip / axle.load),
}
"""Tyre laws of section 1.2.2 by name, each with the cornering stiffness and the grip of the file's axle at its static load: eqs
3 to 7 with their errata, which are in the docstrings of the laws. Laws with a longitudinal part have the same stiffness in both
directions."""


def single_track(car: CarSpecification, tyre: str = "magic_formula") -> SingleTrack:
    """The single track of a car's file on a tyre law of `TYRES`, with static axle loads (section 1.2.1)."""
    check_one_of("sideslip: tyre", tyre, TYRES)
    found = from_specification(dataclasses.replace(car, cg_height=None))
    return eqx.tree_at(lambda c: (c.front, c.rear), found, tuple(TYRES[tyre](axle) for axle in axles_of(found)))


def axles_of(car: Any) -> tuple[Axle, Axle]:
    """The front and the rear axle of a single track on Magic Formulas."""
    found = []
    for tyre, load in zip((car.front, car.rear), car.static_loads(), strict=True):
        stiffness = tyres.cornering_stiffness(tyre, Contact(slip_angle=jnp.zeros_like(load), load=load))
        grip = tyre.D * (1.0 if tyre.nominal_load is None else load / tyre.nominal_load)
        found.append(Axle(tyre, stiffness, grip, load))
    return found[0], found[1]


def in_filter(
    car: CarSpecification, model: StateSpace, filter: AbstractFilter, *, more: tuple[Need, ...] = (), key: Any = None,
    claims: bool = False, cleaning: AbstractCleaning = AsItIs(),
) -> Guarded:  # fmt: skip
    """A filter or an observer as a method, on a model whose inputs are steer, speed and the channels in `more`."""
    inner = Filtered(model, filter, (V_X, STEER, *SENSORS, *more), cleaning, shown=LateralReport._fields, key=key)
    return guard(car, inner, SENSORS, claims=claims)


def single_track_filter(
    filter: AbstractFilter, tyre: str = "magic_formula", *, random: bool = False, claims: bool = False
) -> Callable[[CarSpecification], Guarded]:
    """A function that makes a filter on the single track with a tyre law of `TYRES` from a car's file. `random`: the filter draws
    samples, with one fixed key.

    The filter's standard deviation assumes white errors about the file's curves. It is too small wherever the road or the car
    changes the curve for seconds; the method therefore gives it only if `claims` is True.
    """

    def make(car: CarSpecification) -> Guarded:
        model = lateral_model(single_track(car, tyre), slowest_of(car))
        return in_filter(car, model, filter, key=jax.random.key(0) if random else None, claims=claims)

    return make


def linear_kalman(car: CarSpecification) -> Guarded:
    """Makes the Kalman filter on the linear single track from a car's file: section 1.2.2, its [17]."""
    plain = linear(single_track(car))
    known = {name: getattr(plain, name) for name in ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg")}
    stiffness = dict(front_stiffness=plain.front.cornering_stiffness, rear_stiffness=plain.rear.cornering_stiffness)
    model = lateral_model(LinearSingleTrack(**known, **stiffness), slowest_of(car))
    return in_filter(car, model, filters.Kalman(), cleaning=straight_steer(car))


class OpenLoop(AbstractMethod):
    """The linear single track, driven by the steer from straight running, without correction by a sensor. It is the baseline of
    the other methods (section 1.2.2: its accuracy is that of the model and of its parameters)."""

    system: Lateral

    @property
    def needs(self):
        return (V_X, STEER)

    def first(self, t, values):
        none = jnp.zeros_like(t)
        return self._said(LateralState(none, none), t, values)

    def next(self, memory, t, values):
        return self._said(transition(self.system, memory.t, t, memory.state, memory.u), t, values)

    def _said(self, state: LateralState, t, values):
        u = record_type("Inputs", ("steer", "v_x"))(values["steer"], values["v_x"])
        return OpenLoopMemory(state, u, t), sideslip_answer(state.v_y, u.v_x)


def open_loop(car: CarSpecification) -> Guarded:
    """Makes the open-loop linear single track from a car's file."""
    return guard(car, OpenLoop(Lateral(linear(single_track(car)), slowest_of(car))))
