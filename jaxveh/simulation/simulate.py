"""Simulate a drive: exact states, what the sensors say, the truth beside them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import diffrax
import jax
import numpy as np

from jaxveh._core.errors import FilterError, InputError, JaxvehWarning, check_key, check_one_of, is_concrete
from jaxveh._core.names import as_mapping
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import TRUTH, Recording
from jaxveh._core.result import Result
from jaxveh.manoeuvres import AbstractDriver, AbstractManoeuvre
from jaxveh.sensors import AbstractDevice, Instrumented, SensorSet, Suite
from jaxveh.simulation import stiffness
from jaxveh.simulation.driven import Driven, check_inputs, driver_name, vehicle_name, with_pedals
from jaxveh.simulation.events import Event
from jaxveh.simulation.meter import meter_for
from jaxveh.simulation.solve import Solution, even_grid, grid_through, solve
from jaxveh.simulation.stiffness import SolverChoice
from jaxveh.vehicles import AbstractVehicle, Travelling

SOLVERS = ("auto", "explicit", "implicit")

SAME = 1e-9
"""s: instants that differ by less are one."""

ROUNDS = 3
"""Runs at most until equal steps hold the fastest motion of what they show; after them the implicit method."""


REMEDY = (
    ' Try solver = "implicit" or a shorter max_step; where it fails at the same time still, look at the car\'s parameters and '
    "at what the driver does there. throw=False gives the rows."
)
"""What to do about a simulation that did not stay finite."""


def simulate(
    car: AbstractVehicle,
    manoeuvre: AbstractManoeuvre | AbstractDriver,
    sensors: SensorSet | Suite | AbstractDevice | None = None,
    key: jax.Array | None = None,
    *,
    road: Any = None,
    dt: float = 0.01,
    max_step: float = 0.002,
    solver: str | diffrax.AbstractSolver = "auto",
    stepsize_controller: diffrax.AbstractStepSizeController | None = None,
    adjoint: diffrax.AbstractAdjoint | None = None,
    start: Mapping[str, Any] | Any = None,
    until: Event | None = None,
    progress: Progress = silent,
    throw: bool = True,
) -> Recording:
    """Drive `car` through `manoeuvre` and record it: rows at 0, dt, 2 dt, ... up to the manoeuvre's duration.

    **The drive**: `manoeuvre` is open-loop, or a driver who sees the car. A car with engine and brakes whose manoeuvre says a
    speed and no pedals of its own gets a driver who holds it (`manoeuvres.SpeedControl`). `road` (`jaxveh.roads`) has friction
    and slopes along the way (None: level). `start`: state fields that differ from straight running, by name (`{"yaw": 0.05}`),
    world position `x`, `y` included. `until`: an event that ends the simulation early (`simulation.standstill()`); later rows
    are cut off.

    **Channels** with a `SensorSet` (or none): each measured channel by its name, with the sensors' noise, and the car's inputs
    (`steer`, `v_x`, ...) exact unless the sensors measure them. With a `Suite` of devices (or one device): what they say, when
    they say it (its rows instead of `dt`'s, NaN where a device was silent). In both the truth, every output of the car, as
    `true.<name>`. `key` draws all randomness; without a key the measurements carry none.

    **Solvers**: "auto" takes RK4 with equal steps of at most `max_step` (s) that meet every row, shortened to what the fastest
    motion asks for (the spins of wheels at low speed, a sensor's low-pass, the driver), or Kvaerno's implicit method where
    they would become too short; "explicit" and "implicit" insist, and a warning says where equal steps were too long for what
    happened. A diffrax solver takes equal steps, or its own with a `stepsize_controller`. Under jit, vmap or grad nothing can
    be looked at: "auto" is then "explicit". `adjoint`: diffrax's way to differentiate; the default serves reverse mode, and
    forward mode too where steps are equal and no event ends them (else `diffrax.ForwardMode()`). `progress` hears how far it
    is (single runs). All may be jitted, vmapped over keys, cars and manoeuvres, and differentiated by any of their leaves.

    **Raises** `InputError` for arguments out of range, sensors or an event that are none, a manoeuvre that lacks an input of
    the car, rows that are one instant in the car's dtype; `FilterError`, naming time, state and a remedy, where the motion does
    not stay finite. The latter needs `throw=True` and acts on the host; under jit look at the channels.
    """
    sensors = _suite_of(sensors)
    _check_event(until)
    if key is not None:
        check_key("simulate", key)
    driven = driven_car(car, manoeuvre, sensors if isinstance(sensors, SensorSet) else None, road)
    duration, values = driven.driver.duration, {} if start is None else as_mapping(start, "start")
    rows = None if not isinstance(sensors, Suite) else device_rows(sensors, duration)
    grid = lambda step: even_grid(duration, dt, step) if rows is None else grid_through(rows, step)
    times = grid(max_step).rows
    with meter_for(progress) as meter:
        run = lambda choice: solve(driven, values, grid(choice.max_step), choice, until, adjoint, meter)
        found = _run(driven, values, run, _choice(solver, stepsize_controller, max_step), times, max_step)
    if throw:
        _check_finished(found, times)
    source = f"simulation: {vehicle_name(car)}, {driver_name(driven.driver)}"
    if not isinstance(sensors, Suite):
        return _cut(_recording(driven, found, times, key, source), np.arange(len(times)), found, until)
    return _cut(*_devices(driven, found, times, sensors, duration, key, source), found, until)


def _suite_of(sensors: Any) -> SensorSet | Suite | None:
    """The sensors, one device as a suite; raises for what are none."""
    if isinstance(sensors, AbstractDevice):
        return Suite(sensors)
    if sensors is None or isinstance(sensors, SensorSet | Suite):
        return sensors
    raise InputError(
        f"simulate: sensors = {_describe(sensors)}: must be a SensorSet such as sensors.esc(), a Suite of devices such as "
        "sensors.Suite((sensors.IMU(rate=100.0),)), one device, or None. (The key comes after the sensors: key=...)"
    )


def _check_event(until: Any) -> None:
    if not (until is None or isinstance(until, Event)):
        raise InputError(
            f"simulate: until = {_describe(until)}: must be an Event such as simulation.standstill() (called), or None."
        )


def _describe(what: Any) -> str:
    """A short word for what does not belong where it is."""
    if isinstance(what, str):
        return repr(what)
    return getattr(what, "__name__", type(what).__name__)


def driven_car(car: AbstractVehicle, manoeuvre: Any, sensors: SensorSet | None = None, road: Any = None) -> Driven:
    """The car on its road with sensors and driver, as `simulate` integrates it; raises `InputError` where they do not fit."""
    placed = _place_on_road(car, road)
    driven = Driven(Instrumented(placed, sensors), with_pedals(manoeuvre, placed))
    check_inputs(driven)
    return driven


def _place_on_road(car: AbstractVehicle, road: Any) -> Travelling:
    """The car with its place on its road: that of `car` itself, or `road`."""
    if not isinstance(car, Travelling):
        _check_not_placed(car)
        return Travelling(car, road)
    if road is None:
        return car
    if car.road is not None:
        raise InputError(
            f"simulate: road = {type(road).__name__}: the car already travels on a road, {type(car.road).__name__}. "
            "Leave one of them out: simulate(car.vehicle, ..., road=road), or no road."
        )
    return Travelling(car.vehicle, road)


def _check_not_placed(car: AbstractVehicle) -> None:
    inner: Any = car
    while hasattr(inner, "vehicle"):
        inner = inner.vehicle
        if isinstance(inner, Travelling):
            raise InputError(
                f"simulate: the car already travels within {type(car).__name__}: Travelling must be outermost, "
                f"Travelling({type(car).__name__}(...), road)."
            )


def _choice(solver, controller, max_step) -> SolverChoice | None:
    """What the caller insists on; None for "auto"."""
    if not isinstance(solver, str):
        return SolverChoice(solver, controller, max_step)
    check_one_of("solver", solver, SOLVERS)
    if controller is not None:
        raise InputError(
            f'solver = "{solver}" with a stepsize_controller: name the diffrax solver that it shall control.'
        )
    if solver == "auto":
        return None
    return stiffness.explicit(max_step) if solver == "explicit" else stiffness.implicit(max_step)


def _run(driven: Driven, values: dict, run, asked: SolverChoice | None, times: np.ndarray, max_step: float) -> Solution:
    """Run as asked; on "auto" look at the fastest motion before and after, and run again where steps were too long."""
    looks = is_concrete(driven, values) and stiffness.may_be_stiff(driven, max_step)
    if asked is not None or not looks:
        choice = stiffness.explicit(max_step) if asked is None else asked
        found = run(choice)
        if looks and choice.controller is None:
            _warn_of_long_steps(driven, found, choice, times)
        return found
    choice = stiffness.choose(stiffness.at_start(driven, values, times), max_step)
    for _ in range(ROUNDS):
        found = run(choice)
        if choice.controller is not None:
            return found
        pole, _ = stiffness.worst(driven, times, found.x, found.u)
        if not pole * choice.max_step > stiffness.LIMIT:
            return found
        choice = stiffness.choose(pole, max_step)
    # Shorter and shorter steps have shown faster and faster motions: no guess is left.
    return run(stiffness.implicit(max_step))


def _warn_of_long_steps(driven: Driven, found: Solution, choice: SolverChoice, times: np.ndarray) -> None:
    limit, stable = stiffness.limits(choice.solver)
    pole, time = stiffness.worst(driven, times, found.x, found.u)
    if pole * choice.max_step > limit:
        warnings.warn(
            f"simulate: steps of {choice.max_step:g} s are too long for a motion of {pole:.0f} 1/s at t = {time:g} s, so what is "
            f'seen there may be ringing of the solver: take max_step = {stable / pole:.2g} s, or solver = "auto".',
            JaxvehWarning,
            stacklevel=4,
        )


def _check_finished(found: Solution, times: np.ndarray) -> None:
    if not is_concrete(found) or int(found.result) == Result.successful:
        return
    reached = np.arange(len(times)) < int(found.reached)
    leaves = {**found.x.car._asdict(), **found.outputs._asdict()}
    bad = {name: ~np.isfinite(np.asarray(leaf)) & reached for name, leaf in leaves.items()}
    any_bad = np.any(list(bad.values()), axis=0)
    row = int(np.argmax(any_bad)) if any_bad.any() else int(reached.sum()) - 1
    names = [name for name in found.x.car._fields if bad[name][row]] or [name for name in bad if bad[name][row]]
    raise FilterError(
        f"simulation failed at t = {times[row]:g} s ({', '.join(names) or 'outputs'}): {Result(int(found.result)).message}."
        + _last_state(found, row)
        + (REMEDY if int(found.result) == Result.non_finite_state else "")
    )


def _last_state(found: Solution, row: int) -> str:
    if row == 0:
        return ""
    state = ", ".join(f"{name} = {float(leaf[row - 1]):.4g}" for name, leaf in found.x.car._asdict().items())
    return f" The row before: {state}."


def _recording(driven: Driven, found: Solution, times: np.ndarray, key, source: str) -> Recording:
    sensors = driven.car.sensors
    channels = _inputs(driven, found)
    if sensors is not None:
        noise = sensors.noise.sample(key, times.shape) if key is not None else {}
        channels |= {name: v + noise[name] if noise else v for name, v in found.measured._asdict().items()}
    channels |= {TRUTH + name: value for name, value in found.outputs._asdict().items()}
    return Recording(times, channels, _units(driven, channels), source)


def _inputs(driven: Driven, found: Solution) -> dict:
    """The car's inputs; what the driver does not say outright is among the outputs."""
    u, outputs = found.u._asdict(), found.outputs._asdict()
    return {name: u[name] if name in u else outputs[name] for name in driven.car.inputs}


def _units(driven: Driven, channels: Mapping) -> dict:
    units = driven.car.vehicle.units
    return {name: units[name.removeprefix(TRUTH)] for name in channels}


def device_rows(suite: Suite, duration: float) -> np.ndarray:
    """The instants from 0 on at which a device of the suite speaks, or at which one looks (s); the end where there is but one."""
    every = np.unique(np.concatenate([[0.0], suite.sample_times(duration), suite.look_times(duration)]))
    # What differs by rounding alone is one instant.
    rows = every[np.concatenate([[True], np.diff(every) > SAME])]
    # A drive has a beginning and an end, however seldom a device speaks.
    return rows if len(rows) > 1 else np.append(rows, duration)


def _devices(driven: Driven, found: Solution, rows: np.ndarray, suite: Suite, duration, key, source):
    """What the devices say, with the truth, at the instants when any of them speaks; and which of `rows` those are."""
    truth = {**_inputs(driven, found), **found.outputs._asdict()}
    times, said, units = suite.record(rows, truth, duration, key)
    at = np.clip(np.searchsorted(rows, times - SAME), 0, len(rows) - 1)
    shown = {TRUTH + name: value[at] for name, value in truth.items()}
    return Recording(times, {**said, **shown}, {**_units(driven, shown), **units}, source), at


def _cut(recording: Recording, row: np.ndarray, found: Solution, until: Event | None) -> Recording:
    """Without the rows after an event, and with a word about it; under jit they stay, as NaN. `row`: of the solution."""
    if until is None or not is_concrete(found) or not bool(found.event):
        return recording
    reached = int(np.sum(row < int(found.reached)))
    source = f"{recording.source}; {until.name} at t = {float(found.end):.3f} s"
    return recording.rows(slice(0, reached)).replace(source=source)
