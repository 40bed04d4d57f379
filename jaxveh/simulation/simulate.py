"""Simulate a drive through diffrax: exact states, noisy measurements, the truth beside them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import FilterError, InputError, check, check_positive, is_concrete
from jaxveh._core.names import as_mapping
from jaxveh._core.recording import TRUTH, Recording
from jaxveh._core.result import Result
from jaxveh.manoeuvres import AbstractManoeuvre
from jaxveh.sensors import Instrumented, SensorSet
from jaxveh.statespace import RK4
from jaxveh.vehicles import AbstractVehicle

_ADAPTIVE_STEPS_A_ROW = 64


class _Drive(NamedTuple):
    """What a simulation gives by row, each leaf (T,): states, inputs, outputs, noise-free measurements."""

    x: Any
    u: Any
    outputs: Any
    measured: Any
    finished: Any


def simulate(
    car: AbstractVehicle,
    manoeuvre: AbstractManoeuvre,
    sensors: SensorSet | None = None,
    key: jax.Array | None = None,
    *,
    dt: float = 0.01,
    max_step: float = 0.002,
    solver: diffrax.AbstractSolver | None = None,
    stepsize_controller: diffrax.AbstractStepSizeController | None = None,
    adjoint: diffrax.AbstractAdjoint | None = None,
    start: Mapping[str, Any] | Any = None,
    throw: bool = True,
) -> Recording:
    """Drive `car` through `manoeuvre` and record it: rows at 0, dt, 2 dt, ... up to the manoeuvre's duration.

    **Channels**: each measured channel by its name, with the sensors' noise; the car's inputs (`steer`, `v_x`, ...)
    exact unless the sensors measure them; and the truth, every output of the car, as `true.<name>`. Units are in the
    recording.

    **Arguments**: `key` draws the noise; without a key the measurements carry none. `dt` (s): time between rows.
    Without a `stepsize_controller`, the `solver` (default `RK4`) takes equal steps of at most `max_step` (s) that
    meet every row; with one (`diffrax.PIDController` and a solver with an error estimate) it chooses its own.
    `start`: state fields that differ from straight running, by name (`{"yaw": 0.05}`). `adjoint`: diffrax's way to
    differentiate; the default serves reverse mode, `diffrax.ForwardMode()` forward mode.

    It may be jitted, vmapped over keys, cars and manoeuvres, and differentiated with respect to any of their leaves.

    **Raises** `InputError` for arguments out of range or a manoeuvre that lacks an input of the car; `FilterError`,
    naming the time, where the motion does not stay finite. The latter needs `throw=True` and acts on the host; under
    jit look at the channels.
    """
    times, substeps = _times(manoeuvre, dt, max_step)
    instrumented = Instrumented(car, sensors)
    _check_inputs(car, manoeuvre)
    dtype = jnp.result_type(jax.tree.leaves(eqx.filter(car, eqx.is_inexact_array))[0])
    drive = _drive(
        instrumented,
        manoeuvre,
        {} if start is None else as_mapping(start, "start"),
        jnp.asarray(np.linspace(0.0, times[-1], (len(times) - 1) * substeps + 1), dtype),
        substeps,
        RK4() if solver is None else solver,
        stepsize_controller,
        diffrax.RecursiveCheckpointAdjoint() if adjoint is None else adjoint,
    )
    if throw:
        _check_finished(drive, times)
    return _recording(instrumented, manoeuvre, drive, times, key)


def _times(manoeuvre, dt, max_step) -> tuple[np.ndarray, int]:
    check_positive("dt", dt, "s")
    check_positive("max_step", max_step, "s")
    check("dt", dt, lambda v: v <= manoeuvre.duration, f"at most the manoeuvre's duration, {manoeuvre.duration:g} s")
    # A duration that is a whole number of steps but for rounding keeps its last row.
    steps = math.floor(manoeuvre.duration / dt + 1e-9)
    return dt * np.arange(steps + 1), math.ceil(dt / max_step - 1e-9)


def _check_inputs(car, manoeuvre) -> None:
    given = jax.eval_shape(manoeuvre.inputs, 0.0)._fields
    # The car makes the acceleration of the speed's rate by itself.
    known = (*given, "a_x") if "v_x_rate" in given else given
    missing = [name for name in car.inputs if name not in known]
    if missing:
        raise InputError(
            f"{type(manoeuvre).__name__} gives {', '.join(given)}, but {type(car).__name__} needs {', '.join(missing)} "
            "too: add the channel to the manoeuvre (or, for a_x, leave the car's cg_height out)."
        )


def _rates(t, x, args):
    instrumented, manoeuvre = args
    return instrumented.derivatives(t, x, manoeuvre.inputs(t))


@eqx.filter_jit
def _drive(instrumented, manoeuvre, start, fine, substeps, solver, controller, adjoint) -> _Drive:
    rows = fine[::substeps]
    x0 = instrumented.start(fine[0], manoeuvre.inputs(fine[0]), **start)
    x0 = jax.tree.map(lambda leaf: jnp.asarray(leaf, fine.dtype), x0)
    fixed = controller is None
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(_rates),
        solver,
        t0=fine[0],
        t1=fine[-1],
        dt0=None,
        y0=x0,
        args=(instrumented, manoeuvre),
        saveat=diffrax.SaveAt(ts=rows),
        stepsize_controller=diffrax.StepTo(ts=fine) if fixed else controller,
        adjoint=adjoint,
        max_steps=len(fine) if fixed else _ADAPTIVE_STEPS_A_ROW * len(fine),
        throw=False,
    )
    u = jax.vmap(manoeuvre.inputs)(rows)
    outputs, measured = jax.vmap(instrumented.see)(rows, solution.ys, u)
    return _Drive(solution.ys, u, outputs, measured, solution.result == diffrax.RESULTS.successful)


def _check_finished(drive: _Drive, times: np.ndarray) -> None:
    if not is_concrete(drive):
        return
    finite = np.all([np.isfinite(np.asarray(leaf)) for leaf in (*drive.x, *drive.outputs)], axis=0)
    if finite.all() and bool(drive.finished):
        return
    row = int(np.argmin(finite)) if not finite.all() else len(times) - 1
    code = Result.non_finite_state if bool(drive.finished) else Result.too_stiff
    fields = [name for name, leaf in drive.x._asdict().items() if not np.isfinite(np.asarray(leaf)[row])]
    raise FilterError(f"simulation failed at t = {times[row]:g} s ({', '.join(fields) or 'outputs'}): {code.message}.")


def _recording(instrumented, manoeuvre, drive: _Drive, times, key) -> Recording:
    car, sensors = instrumented.vehicle, instrumented.sensors
    outputs, u = drive.outputs._asdict(), drive.u._asdict()
    channels = {name: u[name] if name in u else outputs[name] for name in car.inputs}
    if sensors is not None:
        noise = sensors.noise.sample(key, times.shape) if key is not None else {}
        channels |= {name: v + noise[name] if noise else v for name, v in drive.measured._asdict().items()}
    channels |= {TRUTH + name: value for name, value in outputs.items()}
    units = {name: car.units[name.removeprefix(TRUTH)] for name in channels}
    return Recording(times, channels, units, f"simulation: {type(car).__name__}, {type(manoeuvre).__name__}")
