"""The fit of `RearAxle` to a log."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import FilterError, InputError, warn
from jaxveh._core.parameter import put
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.estimators.rear_axle import CHANNEL, RearAxle, rolling_below
from jaxveh.estimators.rear_axle_prior import SPREADS, STOOD, chosen_parameters
from jaxveh.estimators.standing import Offsets
from jaxveh.estimators.variety import variety
from jaxveh.filters import AbstractFilter
from jaxveh.fitting import Fit, PredictionErrorProblem, Target, kit, pose_prediction_error, solve
from jaxveh.statespace import StateSpace

STEPS, TOLERANCE = 60, 0.02
"""Limits of the search: the largest number of steps, and the least gain of log-posterior in two steps."""

SLIDING = ({"grip": 1.02, "slip_error": 3.0, "stiffening": 10.0}, {"grip": 0.77, "slip_error": 5.0, "stiffening": 30.0})
"""Starts of further searches: the grip over the largest force in use, and slow errors over their usual values."""

OVERCONFIDENCE = 24.0
"""The likelihood's information is divided by this, and also by the `disagreement` of the logs' halves where that is above one:
balances of neighbouring rows are correlated but count as independent, and where the equations are wrong, one half finds values
that the other excludes. Chosen together with `parameter_bands.WIDER`, see there.

The disagreement is 0.4 to 3.9 on 94 simulated drives (the middle 80 %, median 1.3), 1.7 and 3.0 on the halves of the Ferrari, 3.8
and 4.1 on those of the F1TENTH, 5.1 on all of it. It tells cars apart, not drives: its rank correlation with the width that each
simulated drive needs is 0.14. Nothing that was tried has more than 0.34: correlation and kurtosis of the innovations, the scores'
variance over the information, the likelihood of the other half, noise levels and values over their priors."""

ALIKE = {"force_noise": 2.0, "slip_noise": 2.0}
"""How much larger these noises are in an estimate than in the fit, for the same reason: what neighbouring rows have in common
counts several times. Errors with factors of 1, 2 and 4, smoothed, and looking back only in brackets (degrees; measured with a
prior of 0.006 rad for `slip_error`):

| | 1 | 2 | 4 |
| --- | --- | --- | --- |
| Ferrari, on its first 60 s | 0.31 (0.41) | 0.23 (0.34) | 0.19 (0.30) |
| Ferrari, mean of four other settings | 0.22 (0.30) | 0.21 (0.30) | 0.21 (0.32) |
| F1TENTH, mean of five settings | 3.6 (5.4) | 3.6 (5.1) | 3.7 (4.7) |
| Genesis, mean of five settings, without the constant part | 0.15 (0.17) | 0.15 (0.18) | 0.15 (0.19) |
| 24 simulated drives (passenger car, SUV, ev), mean | 0.079 (0.091) | 0.080 (0.096) | 0.081 (0.104) |"""

VARIED, POWER, MOST = 6.0, 3.0, 100.0
"""A log whose `variety` is below `VARIED` counts `(VARIED / variety)^POWER` times less against the prior, at most `MOST` times.
On a ramp of steer, a circle or a slalom, gain and stiffness stand for each other, and what the equations lack (the phase of a
body that rolls) has the frequency of what they say, so that noises are found too small and rows count too much. Error over that
of the car's file without a calibration (geometric mean), and the share of rows in the 95 % band, of 12 simulated drives each (14
degrees of freedom), on which this was chosen:

| | counted whole | `VARIED` 6 |
| --- | --- | --- |
| ramp to the limit | 1.8, 41 % | 1.1, 100 % |
| slalom of 0.5 Hz; of 0.2 Hz | 1.0, 71 %; 0.8, 90 % | 0.9, 96 %; 0.7, 100 % |
| slalom between cones | 0.56, 99 % | 0.44, 100 % |

With 8, the slalom has 0.9 (100 %), and the Genesis calibrated on its first 60 s 0.571 instead of 0.560 degrees. Swept sines,
random steering, every drive of a fleet of 24 and logs of a minute or more have 6 or more, short pieces of logs 3 to 7. All logs
counted eight times less made the errors of nine drives of that fleet half as large again."""

UNSURE = 1e-3
"""A variance of the fit may be this share above the prior's; what is more is lost in rounding."""

TARGET_BEND = 0.0035
"""rad: larger errors count less than their square (INS alignment, tyres that warm up)."""


class Reference(NamedTuple):
    """A reference for sideslip: `values` in rad, (T,) for each log, NaN where there is none, and `weight` (rad): the standard
    deviation with which the fit follows it."""

    values: Sequence[jax.Array]
    weight: float


def fit_rear_axle(
    filter: AbstractFilter,
    model: StateSpace,
    logs: Sequence[Recording],
    reference: Reference | None,
    progress: Progress = silent,
    offsets: Offsets | None = None,
    *,
    halves: bool,
) -> Fit:
    """Maximise the posterior of the parameters that `chosen_parameters` picks, given `coarse_logs` of one car.

    A log of a car that slides has two explanations: tyres that saturate at its largest forces, or a road that banks with them.
    The search starts at both, and the better result is returned. The sensors' `offsets`, measured while the car stood, replace
    the prior's zeros. Without a reference, logs of little `variety` count less. The noises of `ALIKE` are larger than the fitted
    ones. The covariance allows for the `disagreement` of the logs' halves, each of which is fitted, too; without `halves` it does
    not, for a fit that gives no bands.

    If the search runs out of steps, a `JaxvehWarning` is given. **Raises** `InputError` for a log without any measured row at
    speed, `FilterError` if the likelihood is not finite.
    """
    forces = np.concatenate([_forces(model, log) for log in logs])
    if not len(forces):
        speeds = np.concatenate([np.asarray(log["v_x"], float) for log in logs])
        raise InputError(
            f"sideslip: no row is fast enough and measured: v_x is {np.nanmin(speeds):.3g} to {np.nanmax(speeds):.3g} m/s, and "
            f"must be above {float(rolling_below(model.system.wheelbase)):.2g} m/s, forward. Take a span in which the car drives."
        )
    # A blind fit has a reference without values: so one compiled function serves all fits.
    nothing = [jnp.full(len(log), jnp.nan) for log in logs]
    values, weight = (nothing, 1.0) if reference is None else reference
    target = Target("reference_sideslip", values, weight, TARGET_BEND)
    if offsets is not None:
        at = lambda m: (m.system.yaw_rate_offset, m.system.a_y_offset)
        model = eqx.tree_at(at, model, [jnp.full_like(old, new) for old, new in zip(at(model), offsets, strict=True)])
    problem = pose_prediction_error(
        filter, model, logs, chosen_parameters, prior=SPREADS if offsets is None else SPREADS | STOOD, target=target
    )
    # A reference sees the car itself.
    less = doubt(variety(logs)) if reference is None else 1.0
    problem = dataclasses.replace(problem, counts=problem.counts / less)
    # The largest force, without single peaks.
    starts = _starts(problem, model, max(float(np.quantile(forces, 0.99)), 1e-3))
    best = _best(problem, starts, progress)
    if not np.isfinite(float(best.cost)):
        raise FilterError(
            "sideslip: the fit's likelihood is not finite: look at the span with `jaxveh check`, or take another."
        )
    if int(best.result) != 0:
        warn(f"sideslip: the fit ended after {int(best.steps)} steps ({best.reason}); its last values are used.")
    spread = np.asarray(problem.spread)
    apart = 1.0
    if halves:
        one, other = (_best(half, starts) for half in _halves(problem))
        apart = disagreement(one, other, spread)
    return _noisier(_widened(best, spread, max(OVERCONFIDENCE / less, 1.0) * max(apart, 1.0)))


def doubt(varied: float) -> float:
    """How many times less a log of this `variety` counts in a fit without a reference; one where it is varied enough."""
    return float(np.clip((VARIED / max(varied, 1.0)) ** POWER, 1.0, MOST))


def _best(problem: PredictionErrorProblem, starts: Sequence[Any], progress: Progress = silent) -> Fit:
    """The best of the searches from all starts."""
    found = []
    for i, start in enumerate(starts):
        progress(
            i, len(starts), "fit the rear axle (compiling first)" if i == 0 else "fit again, from a car that slides"
        )
        found.append(solve(problem, start, max_steps=STEPS, tolerance=TOLERANCE))
    progress(len(starts), len(starts), "fitted")
    return min(found, key=lambda fit: float(jnp.where(jnp.isfinite(fit.cost), fit.cost, jnp.inf)))


def _halves(problem: PredictionErrorProblem) -> list[PredictionErrorProblem]:
    """The same problem with the measurements of the first half of each log alone, and of the second. Its arrays are as long, so
    that all share a compiled program."""
    rows, target = problem.rows, problem.target
    count = jnp.cumsum(jnp.isfinite(getattr(rows.y, CHANNEL)), axis=1)
    late = count > count[:, -1:] // 2

    def without(hidden):
        hide = lambda leaf: jnp.where(hidden, jnp.nan, leaf)
        kept = target._replace(values=hide(target.values))
        return dataclasses.replace(problem, rows=rows._replace(y=jax.tree.map(hide, rows.y)), target=kept)

    return [without(late), without(~late)]


def disagreement(one: Fit, other: Fit, spread: np.ndarray) -> float:
    """The squared distance between the parameters of two fits to different data, over the one that is expected if the equations
    and the fits' covariances are right (a test of J. Hausman's kind, 1978). Infinite where a fit failed. `spread` (p,): the
    standard deviations of the prior that they share.

    It is measured along each parameter, in units of the fits' variances together. A mean that the prior holds moves less than its
    variance says, so the expected value is the number of parameters that both logs tell, about 6 of 15.
    """
    apart = (np.asarray(one.unconstrained, float) - np.asarray(other.unconstrained, float)) / spread
    first, second = (np.asarray(fit.covariance, float) / np.outer(spread, spread) for fit in (one, other))
    variance = np.diag(first + second)
    # The means are shrunk to the prior's: their difference has the covariance A + B - A B - B A, in the prior's units.
    expected = np.sum((variance - 2 * np.sum(first * second, axis=1)) / variance)
    found = float(np.sum(apart**2 / variance) / max(expected, 1.0))
    return found if np.isfinite(found) else np.inf


def _widened(fit: Fit, spread: np.ndarray, overconfidence: float) -> Fit:
    """The fit with the likelihood's information divided by `overconfidence`, and the prior's unchanged."""
    # Relative to the prior, the variances along the principal directions are between 0 and 1. Where data say nothing,
    # rounding in float32 brings them outside, and the information below zero.
    scale = np.outer(spread, spread)
    shares, directions = np.linalg.eigh(np.asarray(fit.covariance, float) / scale)
    if shares[0] < 0 or shares[-1] > 1 + UNSURE:
        warn(
            "sideslip: the covariance of the fit is lost in rounding, its standard deviations are rough. Use float64: "
            'jax.config.update("jax_enable_x64", True).'
        )
    shares = np.clip(shares, np.finfo(fit.covariance.dtype).eps, 1.0)
    told, wide = (
        scale * (directions * one @ directions.T) for one in (shares, 1 / ((1 / shares - 1) / overconfidence + 1))
    )
    named, wider = fit.parameters_std, np.sqrt(np.diag(wide) / np.diag(told))
    std = type(named)({p.name: named[p.name] * ratio for p, ratio in zip(fit.chosen, wider, strict=True)})
    return dataclasses.replace(fit, covariance=jnp.asarray(wide, fit.covariance.dtype), parameters_std=std)


def _noisier(fit: Fit) -> Fit:
    """The fit with the noises of `ALIKE` so much larger."""
    values, std = fit.parameters, fit.parameters_std
    more = {p.name: ALIKE.get(p.name, 1.0) for p in fit.chosen}
    larger = [values[p.name] * more[p.name] for p in fit.chosen]
    return dataclasses.replace(
        fit,
        parameters=type(values)({p.name: value for p, value in zip(fit.chosen, larger, strict=True)}),
        parameters_std=type(std)({p.name: std[p.name] * more[p.name] for p in fit.chosen}),
        unconstrained=kit.on_line(fit.chosen, larger),
        model=put(fit.model, fit.chosen, larger),
    )


def _starts(problem, model: StateSpace, in_use: float) -> list:
    """Coordinates at which to start the search: the prior's, and, where the force `in_use` is below the grip of the car's file,
    those of cars that slide at this force."""
    told = problem.start()
    names = [p.name.split(".")[-1] for p in problem.chosen]
    starts = [told]
    for factors in SLIDING:
        if factors["grip"] * in_use < float(model.system.grip):
            z = told.at[names.index("grip")].set(jnp.log(factors["grip"] * in_use))
            for name in ("slip_error", "stiffening"):
                z = z.at[names.index(name)].add(jnp.log(factors[name]))
            starts.append(z)
    return starts


def _forces(model: StateSpace, log: Recording) -> np.ndarray:
    """Lateral forces over load of the rear axle in the rows that are measured at speed."""
    share = np.abs(np.asarray(_rear_share(model.system, model.rows(log).u)))
    return share[np.isfinite(np.asarray(log[model.channels[0]]))]


@eqx.filter_jit
def _rear_share(system: RearAxle, u: Any) -> Any:
    return system.shares(u)[1]
