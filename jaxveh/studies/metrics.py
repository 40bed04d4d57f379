"""The metrics that a study reports of each run, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.recording import TRUTH
from jaxveh.diagnostics import kit as bands
from jaxveh.io import kit


class Errors(NamedTuple):
    """The errors of one quantity: (T,) `error`, estimate less truth, and `std`, both in its unit; `counts`: the rows that count;
    `baseline` (T,): the error of doing nothing."""

    error: Any
    std: Any
    counts: Any
    baseline: Any


class Run(NamedTuple):
    """The input of a metric of a whole run: the `estimate` (with `info.nis`), the rows that count as `counts`, (T,), and
    whether the drive or the filter `failed`."""

    estimate: Any
    counts: Any
    failed: Any


class Metric(NamedTuple):
    """How to `compute` it, its `unit` ("=": that of the quantity), a line of `help`; `of_quantity`: its name is followed by a
    quantity, `name.quantity`."""

    compute: Callable[[Any], Any]
    unit: str
    help: str
    of_quantity: bool = True


def _mean(values, counts):
    return jnp.sum(jnp.where(counts, values, 0.0)) / jnp.sum(counts, dtype=values.dtype)


def _rms(error, counts):
    return numerics.sqrt(_mean(error**2, counts))


def _crps(e: Errors):
    away = jnp.abs(e.error) / e.std
    density = jnp.exp(-0.5 * away**2) / (2 * jnp.pi) ** 0.5
    inside = jax.lax.erf(away / 2**0.5)
    return _mean(e.std * (away * inside + 2 * density - jnp.pi**-0.5), e.counts)


def _coverage(half: float) -> Callable[[Errors], Any]:
    return lambda e: _mean(jnp.asarray(jnp.abs(e.error) <= half * e.std, e.error.dtype), e.counts)


METRICS: dict[str, Metric] = {
    "rmse": Metric(lambda e: _rms(e.error, e.counts), "=", "root mean square error"),
    "baseline": Metric(
        lambda e: _rms(e.baseline, e.counts), "=",
        "root mean square error of doing nothing: the told car on linear tyres without sensors (v_y, yaw_rate, sideslip); "
        "otherwise the prior's mean",
    ),
    "bias": Metric(lambda e: _mean(e.error, e.counts), "=", "mean of the error"),
    "worst": Metric(lambda e: numerics.largest(jnp.where(e.counts, jnp.abs(e.error), 0.0)), "=", "largest absolute error"),
    "final": Metric(lambda e: jnp.abs(e.error[-1]), "=", "absolute error in the last row"),
    "coverage_50": Metric(_coverage(bands.NORMAL_HALF), "-", "share of rows inside the central 50 % band"),
    "coverage_95": Metric(_coverage(bands.NORMAL_95), "-", "share of rows inside the central 95 % band"),
    "nees": Metric(lambda e: _mean((e.error / e.std) ** 2, e.counts), "-", "mean of (error / standard deviation)^2, ideally 1"),
    "crps": Metric(_crps, "=", "continuous ranked probability score, smaller is better"),
    "nis": Metric(
        lambda r: _mean(r.estimate.info.nis, r.counts), "-", "mean normalised innovation squared (Gaussian filters)", False
    ),
    "log_likelihood": Metric(lambda r: r.estimate.log_likelihood, "-", "log-likelihood of all measurements", False),
    "failed": Metric(lambda r: r.failed, "-", "1 if the drive or the filter failed, otherwise 0", False),
}  # fmt: skip
"""Metrics by name."""

ALWAYS = ("failed",)
"""The metrics that are always reported."""


class AskedMetric(NamedTuple):
    """A metric's name, and its quantity ("" for a metric of the whole run)."""

    metric: str
    quantity: str

    @property
    def name(self) -> str:
        """The name in the file and in the results: `rmse.sideslip`."""
        return f"{self.metric}.{self.quantity}" if self.quantity else self.metric


def asked_metrics(names: Any) -> tuple[AskedMetric, ...]:
    """The metrics of these names, with the baseline of each rmse, and those that are always reported.

    **Raises** `InputError` for an unknown name, or for one without its quantity.
    """
    if not isinstance(names, list | tuple) or not names:
        raise InputError(f'metrics.names = {names!r}: must be a list of names, such as ["rmse.sideslip", "failed"].')
    found: dict[AskedMetric, None] = {}
    for name in (*names, *ALWAYS):
        metric, _, quantity = str(name).partition(".")
        kit.check_known("metrics.names", "metric", metric, METRICS)
        if METRICS[metric].of_quantity != bool(quantity):
            raise InputError(
                f"metrics.names: {name}: {metric} is "
                + (
                    f"of a quantity: {metric}.sideslip."
                    if METRICS[metric].of_quantity
                    else f"of the whole run: {metric}."
                )
            )
        found[AskedMetric(metric, quantity)] = None
        if metric == "rmse":
            found[AskedMetric("baseline", quantity)] = None
    return tuple(found)


def unit_of_metric(asked: AskedMetric, unit: str) -> str:
    """The metric's unit, if `unit` is that of its quantity."""
    own = METRICS[asked.metric].unit
    return unit if own == "=" else own


def truth_of(recording: Any, car: Any, quantity: str, numbers: Any) -> Any:
    """The truth of a quantity, (T,): a channel of the truth, or a number of the true car."""
    there = [name.removeprefix(TRUTH) for name in recording.names if name.startswith(TRUTH)]
    kit.check_known("metrics.names", f"true quantity of {type(car).__name__}", quantity, [*there, *numbers])
    return (
        recording[f"{TRUTH}{quantity}"] if quantity in there else jnp.broadcast_to(numbers[quantity], (len(recording),))
    )
