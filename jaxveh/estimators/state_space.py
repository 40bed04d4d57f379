"""A vehicle and its sensors as the state space that a filter sees."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.bijectors import AbstractBijector
from jaxveh._core.errors import InputError, check_at_least
from jaxveh._core.names import check_names, record_type
from jaxveh._core.parameter import Where
from jaxveh.sensors import Instrumented, SensorSet
from jaxveh.statespace import (
    RK4,
    AbstractProcessNoise,
    Continuous,
    Gaussian,
    LinearInput,
    Prior,
    Propagate,
    StateSpace,
    with_parameters,
)
from jaxveh.vehicles import AbstractVehicle

PROCESS_NOISE = {"v_y": 0.1, "yaw_rate": 0.05}
"""Default spreads of what the single track leaves out: m/s and rad/s, per root second."""

START_SPREAD = {"v_y": 0.2, "yaw": 0.02, "yaw_rate": 0.02}
"""Default spreads of the start state: m/s, rad, rad/s."""


def state_space(
    car: AbstractVehicle,
    sensors: SensorSet,
    *,
    estimate: Where | None = None,
    prior: float | Mapping[str, float] = 0.1,
    walk: float | Mapping[str, float] = 0.0,
    domain: AbstractBijector | None = None,
    process_noise: Mapping[str, float] | AbstractProcessNoise | None = None,
    start: Mapping[str, float] | None = None,
    start_spread: Mapping[str, float] | None = None,
    minimum_speed: float = 2.0,
    report: tuple[str, ...] = ("sideslip",),
    solver: diffrax.AbstractSolver | None = None,
    steps: int = 1,
    input_path: str = "held",
) -> StateSpace:
    """The state space of a car with sensors, its `estimate`d parameters among the states.

    - `estimate(car)`: the parameters to estimate (`lambda car: (car.front.B, car.front.D)`), `prior` their relative
      spread and `walk` their random walk's, one number or by name; see `statespace.with_parameters`.
    - `process_noise`: standard deviations by state in unit per root second (default `PROCESS_NOISE`, for the states the
      car has), or a `Continuous` or `Discrete` law. `start`, `start_spread`: mean and spread of the start state.
    - `minimum_speed` (m/s): below it the lateral states are held (Estimate.held says where); a single track has no
      steady slip angle at standstill.
    - `report`: outputs of the car to show beside its states, such as `sideslip`, `F_yf`, `slip_angle_front`.
    - `solver`, `steps`: fixed steps between two rows; `input_path`: inputs `held` over a step or `linear`.

    The estimate's fields are the states, then `report`, then the parameters (`front_B`), in physical units.
    **Raises** `InputError` for unknown names and spreads that are not positive.
    """
    check_at_least("steps", steps, 1)
    check_at_least("minimum_speed", minimum_speed, 0)
    system = Instrumented(car, _without_noise(sensors))
    states = system.state_type._fields
    _check_report(system, report)
    model = StateSpace(
        system=system,
        transition=HeldBelow(Propagate(_derivatives, solver or RK4(), steps), minimum_speed),
        observation=_observation,
        report=ReportOutputs(tuple(report), states),
        process_noise=_process_noise(process_noise, states),
        measurement_noise=sensors.noise,
        prior=_start(system, start or {}, start_spread or {}),
        inputs=system.inputs,
        input_path=input_path,
    )
    if estimate is None:
        return model
    return with_parameters(model, estimate, prior, walk, inside="vehicle", domain=domain)


def _derivatives(system: Instrumented, t, x, u):
    return system.derivatives(t, x, u)


def _observation(system: Instrumented, t, x, u):
    return system.observation(t, x, u)


class HeldBelow(eqx.Module):
    """A transition that holds the state while the speed is below `minimum_speed` (m/s); the input must name `v_x`."""

    transition: Callable = eqx.field(static=True)
    minimum_speed: float = eqx.field(static=True)

    def __call__(self, system, t0, t1, x, u):
        if self.minimum_speed == 0:
            return self.transition(system, t0, t1, x, u)
        speed = jnp.abs((u.at(t0) if isinstance(u, LinearInput) else u).v_x)
        moves = speed >= self.minimum_speed
        moved = self.transition(system, t0, t1, x, u)
        return jax.tree.map(lambda new, old: jnp.where(moves, new, old), moved, x)


class ReportOutputs(eqx.Module):
    """The states, and the named outputs of the vehicle."""

    names: tuple[str, ...] = eqx.field(static=True)
    states: tuple[str, ...] = eqx.field(static=True)

    def __call__(self, system: Instrumented, t, x, u):
        shown = x._asdict()
        if self.names == ("sideslip",):
            # By far the most common report needs no tyre force.
            moves = system.vehicle.motion(system.split(x)[0], u)
            shown["sideslip"] = numerics.arctan2(moves.v_y, jnp.broadcast_to(moves.v_x, jnp.shape(moves.v_y)))
        elif self.names:
            outputs = system.outputs(t, x, u)
            shown |= {name: getattr(outputs, name) for name in self.names}
        return record_type("Report", shown)(*shown.values())


def _process_noise(given, states):
    if isinstance(given, AbstractProcessNoise):
        return given
    if given is None:
        given = {name: std for name, std in PROCESS_NOISE.items() if name in states}
    check_names("process_noise", given, states)
    return Continuous(Gaussian(given)) if given else None


def _start(system: Instrumented, mean: Mapping, spread: Mapping) -> Prior:
    states = system.state_type._fields
    check_names("start", mean, states)
    check_names("start_spread", spread, states)
    means = [mean.get(name, 0.0) for name in states]
    # What is neither told nor known by name is a sensor's filter state: one unit is wide, and forgotten at once.
    spreads = {name: spread.get(name, START_SPREAD.get(name, 1.0)) for name in states}
    return Prior(system.state_type(*means), Gaussian(spreads))


def _without_noise(sensors: SensorSet) -> SensorSet:
    """The sensors with the noise's levels taken out: the state space holds them, and each parameter stands once."""
    levels = sensors.noise.std
    return eqx.tree_at(lambda s: s.noise.std, sensors, type(levels)(*[None] * len(levels)))


def _check_report(system: Instrumented, report) -> None:
    dtype = jnp.result_type(system.vehicle.mass)
    number = jax.ShapeDtypeStruct((), dtype)
    state = system.state_type(*[number] * len(system.state_type._fields))
    inputs = record_type("Inputs", system.inputs)(*[number] * len(system.inputs))
    outputs = eqx.filter_eval_shape(system.outputs, number, state, inputs)
    check_names("report", report, outputs._fields)


def held_rows(model: StateSpace, recording) -> jax.Array:
    """(T,) booleans: where the lateral states were held because the car was slower than the model's minimum speed."""
    function = model.transition_function
    while not isinstance(function, HeldBelow):
        function = getattr(function, "function", None)
        if function is None:
            raise InputError("held_rows: this model holds no states at low speed.")
    return jnp.abs(jnp.asarray(recording["v_x"])) < function.minimum_speed
