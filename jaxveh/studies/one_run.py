"""One run of a study: a drive is simulated, estimated by a filter, and compared with its truth."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import estimators, filters, vehicles
from jaxveh._core.parameter import every_parameter, pick
from jaxveh._core.recording import TRUTH
from jaxveh.io import kit
from jaxveh.studies.channels import hold, renamed_channels
from jaxveh.studies.drives import Drive, car_of, drive_of, simulate
from jaxveh.studies.estimating import estimator_of, model_of, told_car
from jaxveh.studies.metrics import METRICS, AskedMetric, Errors, Run, asked_metrics, truth_of
from jaxveh.studies.named_filters import filter_of
from jaxveh.studies.numbers import with_numbers
from jaxveh.studies.settings import speed_and_steer

OPEN_LOOP = ("v_y", "yaw_rate", "sideslip")
"""Quantities that a linear single track predicts without sensors."""

SHARED = ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg")
"""Numbers of an estimator's own car that its single track takes over."""


def run_of(settings: Mapping[str, Any], key: jax.Array, duration: float | None = None) -> dict[str, Any]:
    """Simulate and estimate according to the settings. Returns the metrics by name. No estimator sees the truth."""
    drive_key, sensor_key, filter_key = jax.random.split(key, 3)
    drive = drive_of(settings, drive_key, duration)
    recording = renamed_channels(simulate(drive, sensor_key), settings["channels"])
    model = model_of(settings, drive)
    asked = asked_metrics(settings["metrics"]["names"])
    keep = ("mean", "std", *(("info.nis",) if AskedMetric("nis", "") in asked else ()))
    log = estimator_of(settings).clean(model, recording)
    found = filters.run(filter_of(settings["filter"]), model, log, key=filter_key, keep=keep, throw=False)
    counts = jnp.asarray(recording.time) >= settings["metrics"]["after"]
    truth = [recording[f"{TRUTH}{name}"] for name in drive.car.state_type._fields if f"{TRUTH}{name}" in recording]
    finite = jnp.stack([jnp.isfinite(leaf).all() for leaf in jax.tree.leaves((truth, found.mean, found.std))]).all()
    failed = jnp.where((found.result == 0) & finite, 0.0, 1.0)
    errors = functools.cache(lambda quantity: _errors(quantity, settings, drive, model, recording, log, found, counts))
    seen = lambda one: errors(one.quantity) if one.quantity else Run(found, counts, failed)
    return {one.name: METRICS[one.metric].compute(seen(one)) for one in asked}


def _errors(
    quantity: str, settings, drive: Drive, model: Any, recording: Any, log: Any, found: Any, counts: Any
) -> Errors:
    """The errors of a quantity, and those of doing nothing; `log`: the recording as the filter read it."""
    known = every_parameter(drive.car)
    numbers = dict(zip(known, pick(drive.car, tuple(known.values())), strict=True))
    truth = truth_of(recording, drive.car, quantity, numbers)
    field = quantity.replace(".", "_")
    kit.check_known("metrics.names", "estimated quantity", field, found.mean._fields)
    estimate, std = getattr(found.mean, field), getattr(found.std, field)
    nothing = _nothing(quantity, settings, model, recording, log)
    return Errors(estimate - truth, std, counts, jnp.broadcast_to(nothing, estimate.shape) - truth)


def _nothing(quantity: str, settings, model: Any, recording: Any, log: Any) -> Any:
    """The prediction of a quantity without any sensor except the steering and the speed: (T,), or one number."""
    if quantity in OPEN_LOOP and "steer" in recording:
        told = told_car(settings)
        car = told if isinstance(told, vehicles.SingleTrack) else _single_track(settings, told)
        speed = speed_and_steer(settings["drive"])[0]
        seen = hold(recording, ("steer", "v_x", "steer_rear"))
        v_x = seen["v_x"] if "v_x" in seen else jnp.full((len(seen),), speed)
        rear = (seen["steer_rear"],) if "steer_rear" in seen else ()
        return estimators.open_loop_of(car, seen.time, seen["steer"], v_x, *rear)[quantity]
    first = jax.tree.map(lambda leaf: leaf[0], model.rows(log))
    return getattr(model.report(first.t, model.prior.mean, first.u), quantity.replace(".", "_"))


def _single_track(settings: Mapping[str, Any], told: Any) -> vehicles.SingleTrack:
    """The single track of the car's file, with the numbers that it shares with the told car."""
    car = car_of(settings["drive"]["vehicle"], "single-track")
    return with_numbers("told", car, {name: getattr(told, name) for name in SHARED if hasattr(told, name)})
