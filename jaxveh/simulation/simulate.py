"""Simulate a drive: exact states, the sensors' measurements, and the truth beside them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import diffrax
import jax
import numpy as np

from jaxveh._core.errors import (
    FilterError,
    InputError,
    check_flags,
    check_key,
    check_kind,
    check_one_of,
    is_concrete,
    warn,
    word_for,
)
from jaxveh._core.names import as_mapping
from jaxveh._core.parameter import strong
from jaxveh._core.progress import Progress, check_progress, silent
from jaxveh._core.recording import TRUTH, Recording
from jaxveh._core.result import Result
from jaxveh._core.time_order import SAME_INSTANT
from jaxveh.manoeuvres import AbstractDriver, AbstractManoeuvre
from jaxveh.sensors import AbstractDevice, Instrumented, SensorSet, Suite
from jaxveh.simulation import stiffness
from jaxveh.simulation.driven import (
    SEVERAL,
    Driven,
    car_itself,
    check_inputs,
    check_one_drive,
    driver_name,
    dtype_of,
    first_motion,
    inputs_of,
    vehicle_name,
    with_pedals,
)
from jaxveh.simulation.events import Event
from jaxveh.simulation.meter import meter_for
from jaxveh.simulation.solve import Solution, even_grid, grid_through, solve
from jaxveh.simulation.steered import warn_of_steer
from jaxveh.simulation.stiffness import SolverChoice
from jaxveh.statespace import cast
from jaxveh.vehicles import AbstractVehicle, Travelling

SOLVERS = ("auto", "explicit", "implicit")

ROUNDS = 3
"""Most runs until equal steps hold the fastest motion of their result; after them the implicit method takes over."""


REMEDY = (
    ' Try solver = "implicit" or a shorter max_step. If it fails at the same time again, check the car\'s parameters and '
    "the driver's inputs at that time. throw=False returns the rows."
)
"""The remedy in the message about a simulation that did not stay finite."""


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
    """Drive `car` through `manoeuvre` and record it: rows at 0, `dt`, 2 `dt`, ... (s) up to the manoeuvre's duration.

    **The drive**: `manoeuvre` is open-loop, or a driver who sees the car. If the car has an engine and brakes and the manoeuvre
    gives only a speed, a driver holds it (`manoeuvres.SpeedControl`). `road` (`jaxveh.roads`) has friction and slopes along the
    way (None: level). `start`: state fields that differ from straight running, by name (`{"yaw": 0.05}`), also the world position
    `x`, `y`. `until`: an event that ends the drive (`simulation.standstill()`); later rows are cut off.

    **Returns** a `Recording`: `true.<name>`, every output of the car, and the channels. With a `SensorSet` (or without sensors)
    these are what the sensors measure, with noise, and the car's inputs (`steer`, `v_x`, ...), exact unless measured. With a
    `Suite` of devices (or one device) they are its measurements; the rows are the instants at which these arrive, instead of
    every `dt`, with NaN where a device has none. `key` draws all randomness; without a key there is none.

    **Solver** "auto": RK4 with equal steps of at most `max_step` (s), shortened as the fastest motion requires (a sensor's
    low-pass, the driver, a crawl). If the car's wheels turn: `statespace.StabilisedRK4`, whose steps of at most 2 ms hold down to
    standstill. Where steps would be too short: Kvaerno's implicit method. Under jit, vmap or grad the fastest motion is unknown:
    steps are then short enough for all that this kind of car can do, those of RK4 at most 2.5 ms. "explicit" (RK4) and "implicit"
    are always obeyed: for a car whose wheels turn "explicit" is enough above 5 m/s, and twice as fast. A diffrax solver takes
    equal steps, or its own with a `stepsize_controller`. Outside jit a warning says where equal steps were too long.
    `adjoint`: diffrax's way to differentiate; the default serves reverse mode, and forward mode with equal steps and no event
    (otherwise `diffrax.ForwardMode()`). `progress` gets the share done (single runs). All may be jitted, vmapped over keys, cars
    and manoeuvres, and differentiated. Outside jit a steer of more than 1.6 rad gets a warning.

    **Raises** `InputError` for arguments out of range, sensors or an event of a wrong type, a manoeuvre without an input that the
    car needs, rows that coincide in the car's dtype; `FilterError`, with time, state and a remedy, if the motion does not stay
    finite (with `throw`, and not under jit: check the channels there).
    """
    check_flags(throw=throw)
    sensors = _suite_of(sensors)
    _check_asked(until, key, adjoint, progress)
    driven = driven_car(car, manoeuvre, sensors if isinstance(sensors, SensorSet) else None, road)
    duration, values = driven.driver.duration, _start_values(start)
    rows = device_rows(sensors, duration) if isinstance(sensors, Suite) else None
    grid = lambda step: even_grid(duration, dt, step) if rows is None else grid_through(rows, step)
    times = grid(max_step).rows
    with meter_for(progress) as meter:
        run = lambda choice: solve(driven, values, grid(choice.max_step), choice, until, adjoint, meter)
        found = _run(driven, values, run, _choice(solver, stepsize_controller, max_step), times, max_step)
    _look_at(found, times, throw)
    source = f"simulation: {vehicle_name(car)}, {driver_name(driven.driver)}"
    if isinstance(sensors, Suite):
        return _cut(*_devices(driven, found, times, sensors, duration, key, source), found, until)
    return _cut(_recording(driven, found, times, key, source), np.arange(len(times)), found, until)


def _start_values(start: Any) -> Mapping[str, Any]:
    """The given fields of the start state. Raises `InputError` for one that is no single number."""
    values = {} if start is None else as_mapping(start, "start")
    for name, value in values.items():
        if np.ndim(value) > 0:
            raise InputError(f"simulate: start: {name} has shape {np.shape(value)}: must be one number. {SEVERAL}")
    return values


def _suite_of(sensors: Any) -> SensorSet | Suite | None:
    """The sensors, one device as a suite. Raises `InputError` for anything else."""
    if isinstance(sensors, AbstractDevice):
        return Suite(sensors)
    if sensors is None or isinstance(sensors, SensorSet | Suite):
        return sensors
    raise InputError(
        f"simulate: sensors = {word_for(sensors)}: must be a SensorSet such as sensors.esc(), a Suite of devices such as "
        "sensors.Suite((sensors.IMU(rate=100.0),)), one device, or None. (The key comes after the sensors: key=...)"
    )


def _check_asked(until: Any, key: Any, adjoint: Any, progress: Any) -> None:
    if key is not None:
        check_key("simulate", key)
    if adjoint is not None:
        advice = "Take one of diffrax, such as diffrax.ForwardMode() (called), or None."
        check_kind("simulate: adjoint", adjoint, diffrax.AbstractAdjoint, advice)
    check_progress(progress)
    if not (until is None or isinstance(until, Event)):
        raise InputError(
            f"simulate: until = {word_for(until)}: must be an Event such as simulation.standstill() (called), or None."
        )


def driven_car(car: AbstractVehicle, manoeuvre: Any, sensors: SensorSet | None = None, road: Any = None) -> Driven:
    """The car on its road with sensors and driver, as `simulate` integrates it. Raises `InputError` if they do not fit."""
    if not isinstance(car, AbstractVehicle):
        order = " The order is simulate(car, manoeuvre)." if isinstance(manoeuvre, AbstractVehicle) else ""
        raise InputError(f"simulate: car = {word_for(car)}: must be a car, such as vehicles.passenger_car().{order}")
    # Everything around the car has the precision of the car itself, also the road on which it may travel.
    car = strong(car)
    car, manoeuvre, sensors, road = cast((car, manoeuvre, sensors, road), dtype_of(car_itself(car)))
    placed = _place_on_road(car, road)
    check_one_drive("manoeuvre", manoeuvre, lambda: inputs_of(manoeuvre, placed))
    driven = Driven(Instrumented(placed, sensors), with_pedals(manoeuvre, placed))
    check_inputs(driven)
    check_one_drive("car", car, lambda: first_motion(driven))
    return driven


def _place_on_road(car: AbstractVehicle, road: Any) -> Travelling:
    """The car with its position on its road: the road of `car` itself, or `road`."""
    if not isinstance(car, Travelling):
        _check_not_placed(car)
        return Travelling(car, road)
    if road is None:
        return car
    if car.road is not None:
        raise InputError(
            f"simulate: road = {word_for(road)}: the car already travels on a road, {type(car.road).__name__}. "
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
    """The solver that the caller asks for; None for "auto"."""
    if controller is not None:
        advice = "Take one of diffrax, such as diffrax.PIDController(rtol=1e-6, atol=1e-6), or None."
        check_kind("simulate: stepsize_controller", controller, diffrax.AbstractStepSizeController, advice)
    if not isinstance(solver, str):
        check_kind("simulate: solver", solver, diffrax.AbstractSolver, f"Or one of {', '.join(map(repr, SOLVERS))}.")
        return SolverChoice(solver, controller, max_step)
    check_one_of("solver", solver, SOLVERS)
    if controller is not None:
        raise InputError(f'solver = "{solver}" with a stepsize_controller: give the diffrax solver that it controls.')
    if solver == "auto":
        return None
    return stiffness.explicit(max_step) if solver == "explicit" else stiffness.implicit(max_step)


def _run(driven: Driven, values: dict, run, asked: SolverChoice | None, times: np.ndarray, max_step: float) -> Solution:
    """Run as asked; on "auto" check the fastest motion before and after, and run again where steps were too long."""
    known = is_concrete(driven, values)
    looks = known and stiffness.may_be_stiff(driven, max_step)
    if asked is not None or not looks:
        unasked = stiffness.explicit(max_step) if known else stiffness.blind_choice(driven, max_step)
        found = run(choice := unasked if asked is None else asked)
        if looks and choice.controller is None:
            _warn_of_long_steps(driven, found, choice, times)
        return found
    choice = stiffness.first_choice(driven, values, times, max_step)
    for _ in range(ROUNDS):
        found = run(choice)
        if choice.controller is not None:
            return found
        pole, _ = stiffness.worst(driven, times, found.x, found.u)
        if not pole * choice.max_step > stiffness.limits(choice.solver)[0]:
            return found
        choice = stiffness.next_choice(choice, pole, max_step)
    # Shorter and shorter steps have shown faster and faster motions: there is no better guess.
    return run(stiffness.implicit(max_step))


def _warn_of_long_steps(driven: Driven, found: Solution, choice: SolverChoice, times: np.ndarray) -> None:
    limit, stable = stiffness.limits(choice.solver)
    pole, time = stiffness.worst(driven, times, found.x, found.u)
    if pole * choice.max_step > limit:
        warn(
            f"simulate: steps of {choice.max_step:g} s are too long for a motion of {pole:.0f} 1/s at t = {time:g} s; the result "
            f'there may be ringing of the solver. Take max_step = {stable / pole:.2g} s, or solver = "auto".'
        )


def _look_at(found: Solution, times: np.ndarray, throw: bool) -> None:
    if throw:
        _check_finished(found, times)
    warn_of_steer(found, times)


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
    """The car's inputs; those that the driver does not give are among the outputs."""
    u, outputs = found.u._asdict(), found.outputs._asdict()
    return {name: u[name] if name in u else outputs[name] for name in driven.car.inputs}


def _units(driven: Driven, channels: Mapping) -> dict:
    vehicle = driven.car.vehicle
    lacking = dict.fromkeys(name for channel in channels if (name := channel.removeprefix(TRUTH)) not in vehicle.units)
    if lacking:
        raise InputError(
            f"{vehicle_name(vehicle)}.units: has no {', '.join(lacking)}: each input and output must have a unit."
        )
    return {name: vehicle.units[name.removeprefix(TRUTH)] for name in channels}


def device_rows(suite: Suite, duration: float) -> np.ndarray:
    """The instants from 0 on at which a device of the suite samples or reports (s); with only one instant also the end."""
    every = np.unique(np.concatenate([[0.0], suite.sample_times(duration), suite.look_times(duration)]))
    # Instants that differ only by rounding are one.
    rows = every[np.concatenate([[True], np.diff(every) > SAME_INSTANT])]
    # A drive has a beginning and an end, however rarely a device reports.
    return rows if len(rows) > 1 else np.append(rows, duration)


def _devices(driven: Driven, found: Solution, rows: np.ndarray, suite: Suite, duration, key, source):
    """The devices' measurements, with the truth, at the instants of any device; and the indices of these instants in `rows`."""
    truth = {**_inputs(driven, found), **found.outputs._asdict()}
    times, said, units = suite.record(rows, truth, duration, key)
    at = np.clip(np.searchsorted(rows, times - SAME_INSTANT), 0, len(rows) - 1)
    shown = {TRUTH + name: value[at] for name, value in truth.items()}
    return Recording(times, {**said, **shown}, {**_units(driven, shown), **units}, source), at


def _cut(recording: Recording, row: np.ndarray, found: Solution, until: Event | None) -> Recording:
    """The recording without the rows after an event, named in its source; under jit they stay, as NaN. `row`: of the solution."""
    if until is None or not is_concrete(found) or not bool(found.event):
        return recording
    reached = int(np.sum(row < int(found.reached)))
    source = f"{recording.source}; {until.name} at t = {float(found.end):.3f} s"
    return recording.rows(slice(0, reached)).replace(source=source)
