"""A vehicle and its sensors as the state space that a filter uses."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.bijectors import AbstractBijector
from jaxveh._core.errors import InputError, check_at_least, check_kind, word_for
from jaxveh._core.names import check_names, record, record_type
from jaxveh._core.parameter import Where, strong
from jaxveh._core.recording import check_recording
from jaxveh.sensors import Instrumented, SensorSet
from jaxveh.statespace import (
    RK4,
    AbstractNoise,
    AbstractProcessNoise,
    Continuous,
    Gaussian,
    LinearInput,
    MeasurementNoise,
    Prior,
    Propagate,
    StabilisedRK4,
    StateDependent,
    StateSpace,
    kit,
    with_parameters,
)
from jaxveh.vehicles import AbstractVehicle
from jaxveh.vehicles import kit as vehicles_kit

TOLD_SPEED = "v_x"
"""The speed: an input of some cars, and a state of others."""

PROCESS_NOISE = {"v_x": 0.1, "v_y": 0.1, "yaw_rate": 0.05}
"""Default standard deviations of effects missing from a car's equations: m/s and rad/s, per root second."""

DIRECTIONS = ("yaw", "course")
"""Outputs that are directions in the world: sensors give them modulo a whole turn, so their innovations wrap."""

START_SPREAD = {"v_x": 0.5, "v_y": 0.2, "yaw": 0.02, "yaw_rate": 0.02}
"""Default standard deviations of the start state: m/s, rad, rad/s."""


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
    measurement_noise: MeasurementNoise | None = None,
    minimum_speed: float = 2.0,
    report: tuple[str, ...] | None = None,
    solver: diffrax.AbstractSolver | None = None,
    steps: int = 1,
    input_path: str = "held",
) -> StateSpace:
    """The state space of a car with sensors, with the parameters chosen by `estimate` among the states.

    - `estimate(car)`: the parameters to estimate (`lambda car: (car.front.B, car.front.D)`), `prior` their relative standard
      deviation and `walk` that of their random walk, one number or by name; see `statespace.with_parameters`.
    - `process_noise`: standard deviations by state in unit per root second (default `PROCESS_NOISE`, for the states the
      car has), or a `Continuous` or `Discrete` law. `start`, `start_spread`: mean and standard deviation of the start state.
    - A car whose speed is a state (`SevenDOF`, `TwoTrack3DOF`, ... under torques) needs `start={"v_x": ...}` (m/s), the speed
      in the first row, and starts straight ahead with rolling wheels.
    - `measurement_noise`: another noise law than the sensors' own (say, a `StateDependent` one that grows with slip).
    - `minimum_speed` (m/s): below it all states of a car whose speed is the input `v_x` are held (`held_rows` returns where): a
      single track has no steady slip angle at standstill. The states of a car whose speed is a state are never held.
    - `report`: outputs of the car to show beside its states, such as `F_yf`; by default the sideslip of a car that has one.
    - `solver`, `steps` between two rows (one), by default `statespace.RK4`, short enough at 10 Hz from 6 m/s on, at 25 Hz from
      2.5 m/s; for a car whose wheels turn `statespace.StabilisedRK4`, at 100 Hz from 3 m/s on, with four steps from standstill.
      `run` warns where they are too long. `input_path`: inputs `held` from one row to the next, or `linear`.
    - A measured `yaw` or `course` may be given modulo a whole turn (within -pi to pi): their innovations wrap.

    The estimate's fields are the states, then `report`, then the parameters (`front_B`), in physical units.
    **Raises** `InputError` for unknown names, standard deviations that are not positive, and sensors that do not fit.
    """
    check_at_least("steps", steps, 1)
    check_at_least("minimum_speed", minimum_speed, 0)
    _check_kinds(car, sensors, estimate)
    system = Instrumented(strong(car), _without_noise(sensors))
    states = system.state_type._fields
    usual = StabilisedRK4() if vehicles_kit.has_fast_states(car) else RK4()
    transition = Propagate(_derivatives, usual if solver is None else solver, steps)
    model = StateSpace(
        system=system,
        transition=HeldBelow(transition, minimum_speed) if TOLD_SPEED in system.inputs else transition,
        observation=_observation,
        report=ReportOutputs(_report_names(system, report), states),
        process_noise=_process_noise(process_noise, states),
        measurement_noise=_noise(sensors, measurement_noise),
        prior=_start(system, start or {}, start_spread or {}),
        inputs=system.inputs,
        input_path=input_path,
        angles=tuple(name for name in sensors.channels if name in DIRECTIONS),
    )
    if estimate is None:
        return model
    return with_parameters(model, lambda model: estimate(model.system.vehicle), prior, walk, domain=domain)


def _derivatives(system: Instrumented, t, x, u):
    return system.derivatives(t, x, u)


def _observation(system: Instrumented, t, x, u):
    return system.observation(t, x, u)


def _check_kinds(car, sensors, estimate) -> None:
    if not (estimate is None or callable(estimate)):
        raise InputError(f"estimate = {estimate!r}: must be a function, such as lambda car: (car.front.B, car.rear.B).")
    if not isinstance(car, AbstractVehicle):
        raise InputError(f"state_space: car = {word_for(car)}: must be a vehicle of jaxveh.vehicles.")
    if not isinstance(sensors, SensorSet):
        raise InputError(
            f"state_space: sensors = {word_for(sensors)}: must be a SensorSet, which states the noise of each channel for a "
            "filter: sensors.esc(yaw_rate=0.005, a_y=0.1), or SensorSet(Gaussian({...})) with the devices' channels."
        )


def _noise(sensors: SensorSet, given: MeasurementNoise | None) -> MeasurementNoise:
    if given is None:
        return sensors.noise
    check_kind("measurement_noise", given, AbstractNoise | StateDependent, "Take a noise law of jaxveh.statespace.")
    if sorted(given.names) != sorted(sensors.channels):
        raise InputError(
            f"measurement_noise is of {', '.join(given.names)}: must be of the sensors' channels, {', '.join(sensors.channels)}."
        )
    return given


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
            # By far the most common report; it needs no tyre force.
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
    usual = dict.fromkeys(states, 0.0)
    if TOLD_SPEED not in system.inputs and TOLD_SPEED in states:
        usual = _rolling(system, mean)._asdict()
    means = [mean.get(name, usual[name]) for name in states]
    # All other states are filter states of a sensor: a standard deviation of one is wide, and forgotten at once.
    spreads = {name: spread.get(name, START_SPREAD.get(name, 1.0)) for name in states}
    return Prior(system.state_type(*means), Gaussian(spreads))


def _rolling(system: Instrumented, mean: Mapping):
    """The state of straight running at the given speed, without driving or braking."""
    if TOLD_SPEED not in mean:
        raise InputError(
            f"start: the speed of {type(system.vehicle).__name__} is a state, v_x, which needs a mean: give the speed in the "
            'first row, start={"v_x": 20.0} (m/s).'
        )
    zero = jnp.zeros((), _dtype(system))
    values = {name: jnp.asarray(value, zero.dtype) for name, value in mean.items()}
    return system.start(zero, record("Inputs", dict.fromkeys(system.inputs, zero)), **values)


def _without_noise(sensors: SensorSet) -> SensorSet:
    """The sensors without the noise levels: the state space holds them, so that each parameter exists only once."""
    levels = sensors.noise.std
    return eqx.tree_at(lambda s: s.noise.std, sensors, type(levels)(*[None] * len(levels)))


def _dtype(system: Instrumented):
    return jnp.result_type(*jax.tree.leaves(eqx.filter(system, eqx.is_inexact_array)))


def _report_names(system: Instrumented, report: tuple[str, ...] | None) -> tuple[str, ...]:
    number = jax.ShapeDtypeStruct((), _dtype(system))
    state = system.state_type(*[number] * len(system.state_type._fields))
    inputs = record_type("Inputs", system.inputs)(*[number] * len(system.inputs))
    outputs = eqx.filter_eval_shape(system.outputs, number, state, inputs)
    if report is None:
        return tuple(name for name in ("sideslip",) if name in outputs._fields)
    check_names("report", report, outputs._fields)
    return tuple(report)


def held_rows(model: StateSpace, recording) -> jax.Array:
    """(T,) booleans: where the states were held because the car was slower than the model's minimum speed."""
    kit.check_model("held_rows", model)
    check_recording("held_rows", recording)
    function = model.transition_function
    while not isinstance(function, HeldBelow):
        function = getattr(function, "function", None)
        if function is None:
            raise InputError("held_rows: this model holds no states at low speed.")
    return jnp.abs(jnp.asarray(recording["v_x"])) < function.minimum_speed
