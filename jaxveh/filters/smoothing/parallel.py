"""Filter and smoother in parallel over time."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_flags, word_for
from jaxveh._core.parameter import strong
from jaxveh._core.recording import Recording
from jaxveh._core.result import first_failure
from jaxveh.filters.gaussian import AbstractGaussianFilter
from jaxveh.filters.gaussian.parallel import gaussian_at, info_of, pass_over
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate, smoothed_estimate
from jaxveh.statespace import Estimate, Row, Smoothing, StateSpace, kit, parameters_of


def smooth_parallel(
    filter: AbstractGaussianFilter, model: StateSpace, recording: Recording, *, throw: bool = True
) -> SmoothedEstimate:
    """The result of `smooth` by associative scans over the rows: for accelerators, and for long linear problems on many cores.

    `Kalman()`: exact, as in a loop (S. Sarkka & A. Garcia-Fernandez 2021). `Iterated(filter, n)`: n passes, each of
    which linearises every row by the filter's rule at the smoothed path of the pass before (F. Yaghoobi, A. Corenflos,
    S. Hassan & S. Sarkka 2021), the first at the prior. It converges to the fixed point of iterated smoothing, which a
    forward loop does not reach; if the prior is far away it may not converge. The filtered estimate and the
    log-likelihood are those of the last pass's linearised model.

    A measured angle is taken in the turn that is nearest to the point of linearisation; `Kalman`, which has no such
    point, takes no angles.

    On a processor with few cores the loop is faster: here each row takes about twice the work, in matrix products.

    **Raises** as `run`, and `InputError` for filters that do not support it (`linearisations` is None) and forms that
    do not store the covariance.
    """
    check_flags(throw=throw)
    declared = kit.smoothing_of(filter) is Smoothing.gaussian
    if not declared or filter.linearisations is None or not kit.innermost(filter).form.keeps_matrix:
        raise InputError(
            f"smooth_parallel: {word_for(filter)}: must be Kalman() or Iterated(...), not wrapped, with Covariance()."
        )
    kit.check_told(filter, model)
    model = strong(model)
    filter.check(model)
    if model.angles and filter.linearisations == 0:
        raise InputError(
            f"smooth_parallel: {type(filter).__name__} with the angle(s) {', '.join(model.angles)}: innovations are "
            "wrapped, which is not a linear update. Use Iterated(Extended(), 2), or smooth."
        )
    found = parallel_smoother(filter, model, model.rows(recording))
    found = eqx.tree_at(lambda e: (e.time, e.filtered.time), found, (recording.time, recording.time))
    if throw:
        kit.raise_failure(found.filtered, filter, model, recording)
    return found


@eqx.filter_jit
def parallel_smoother(filter, model, rows: Row) -> SmoothedEstimate:
    """The compiled part of `smooth_parallel`, over rows with (T,) leaves.

    In a batch of runs of a linear model with the same noises, of which no row is missing, the covariances are computed
    once."""
    if kit.who_lacks(filter, "shares_covariances") is not None:
        return _smooth_rows(filter, model, rows)

    def many(filter, model, rows):
        of = lambda complete: lambda: _smooth_rows(filter, model, rows, complete)
        return jax.lax.cond(kit.any_run_misses(rows), of(False), of(True))

    return numerics.by_batch(_smooth_rows, many, filter, model, rows, least=2)


def _smooth_rows(filter, model, rows: Row, complete: bool = False) -> SmoothedEstimate:
    """The result for one run; `complete`: nothing in its rows is missing."""
    rule = kit.innermost(filter).rule(len(model.states))
    wide = lambda leaf: jnp.broadcast_to(leaf, (*rows.t.shape, *leaf.shape))
    path = wide(jnp.stack(model.prior.mean)), wide(model.prior.covariance())

    def again(path, _):
        return pass_over(rule, model, rows, *path, complete=complete).smoothed, None

    # The last pass follows below.
    path, _ = jax.lax.scan(jax.checkpoint(again), path, length=max(filter.linearisations - 1, 0))
    passed = pass_over(rule, model, rows, *path, complete=complete)
    info = info_of(model, rows, passed, complete=complete)
    beliefs = lambda gaussians: jax.vmap(lambda row, m, P: gaussian_at(model, rule, row, m, P))(rows, *gaussians)
    filtered, smoothed = beliefs(passed.filtered), beliefs(passed.smoothed)
    moments = jax.vmap(lambda belief: belief.moments(model))
    mean, std = moments(filtered)
    result, failed_at = first_failure(info.result)
    show = lambda report: parameters_of(model, report)
    last = jax.tree.map(lambda leaf: leaf[-1], filtered)
    total = jnp.sum(info.log_likelihood)
    estimate = Estimate(rows.t, mean, std, total, info, result, failed_at, last, show(mean), show(std))
    return smoothed_estimate(model, estimate, moments(smoothed))
