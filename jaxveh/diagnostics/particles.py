"""The health of a particle filter's particles."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check
from jaxveh._core.host import on_host
from jaxveh._core.result import Result
from jaxveh.diagnostics.innovations import by_runs_and_rows, check_filtered


class ParticleHealth(NamedTuple):
    """Effective sample sizes as shares of the particles, over rows (and runs).

    `particles`: N; `lowest`, `median`, and `worst_row`, the row of the lowest; `quantiles`: a mapping from a share of rows to the
    quantile of the effective shares; `share_below`: the share of rows below `threshold`; `result`, `failed_at`: the
    first failing code and its row, as in `Estimate`, 0 and -1 without a failure.
    """

    particles: int
    lowest: float
    median: float
    worst_row: int
    quantiles: dict[float, float]
    share_below: float
    threshold: float
    result: Result
    failed_at: int

    @property
    def healthy(self) -> bool:
        """Whether nothing failed and no row fell below the threshold."""
        return self.result == Result.successful and self.share_below == 0


@on_host
def particle_health(estimate: Any, threshold: float = 0.1, particles: int | None = None) -> ParticleHealth:
    """Return the health of the particles behind an estimate.

    **Arguments**: `estimate` of a particle filter, with (T,) or (R, T) leaves in its `info`; `threshold`: the effective share
    below which a row counts as poor (0.1 is our choice: below it a few particles carry nearly all weight); `particles`: N, needed
    if the estimate's belief has no weights.

    **Raises** `InputError` for other filters, which have no effective sample size.
    """
    check_filtered("particle_health", estimate)
    check("threshold", threshold, lambda v: (v > 0) & (v <= 1), "above 0 and at most 1")
    if particles is None:
        weights = getattr(getattr(estimate, "belief", None), "weights", None)
        if weights is None:
            raise InputError(
                "particle_health: the estimate's belief has no weights; only those of particle filters do. Or give particles=."
            )
        particles = int(weights.shape[-1])
    share = by_runs_and_rows(estimate.info.ess) / particles
    codes = np.atleast_2d(np.asarray(estimate.info.result))
    rows = np.isfinite(share)
    if not rows.any():
        raise InputError("particle_health: no row has an effective sample size; only particle filters have one.")
    known = np.where(rows, share, np.inf)
    failed = codes != 0
    first = int(np.argmax(failed.any(axis=0))) if failed.any() else -1
    code = int(codes[np.argmax(failed[:, first]), first]) if failed.any() else 0
    return ParticleHealth(
        particles=particles,
        lowest=float(known.min()),
        median=float(np.median(share[rows])),
        worst_row=int(np.argmin(known.min(axis=0))),
        quantiles={q: float(np.quantile(share[rows], q)) for q in (0.01, 0.05, 0.25, 0.5)},
        share_below=float(np.mean(share[rows] < threshold)),
        threshold=threshold,
        result=Result(code),
        failed_at=first,
    )


class Ancestry(NamedTuple):
    """The ancestry of particles, (T,) each.

    `parents`: number of particles of the previous row with descendants in this row (N in the first); `surviving`: number of
    particles of this row with descendants in the last row.
    """

    parents: np.ndarray
    surviving: np.ndarray

    @property
    def coalescence(self) -> int:
        """Number of rows before the last in which all of its particles have one common ancestor; -1 if there is none."""
        single = np.flatnonzero(self.surviving == 1)
        return -1 if single.size == 0 else int(len(self.surviving) - 1 - single[-1])


@on_host
def ancestry(ancestors: Any) -> Ancestry:
    """Return the degeneracy of a particle filter's paths.

    **Arguments**: `ancestors` (T, N): the parent of each particle in the previous row, as in `ParticleBelief.ancestors` of every
    row (`filters.run_and_keep`); those of the first row are not used.

    Few `surviving` particles far back are normal (P. Jacob, L. Murray & S. Rubenthaler 2015: all paths meet within some N log N
    rows); a smoothed estimate there depends on few particles. Few `parents` mean that one measurement removed most particles.

    **Raises** `InputError` for another shape, or indices out of range.
    """
    ancestors = np.asarray(ancestors)
    if ancestors.ndim != 2 or not np.issubdtype(ancestors.dtype, np.integer):
        raise InputError(f"ancestors: {ancestors.dtype} of shape {ancestors.shape}: must be whole numbers (T, N).")
    rows, n = ancestors.shape
    if ancestors[1:].size and (ancestors[1:].min() < 0 or ancestors[1:].max() >= n):
        raise InputError(f"ancestors: from {ancestors[1:].min()} to {ancestors[1:].max()}: must be from 0 to {n - 1}.")
    parents, surviving = np.full(rows, n), np.full(rows, n)
    alive = np.arange(n)
    for k in range(rows - 1, 0, -1):
        parents[k] = len(np.unique(ancestors[k]))
        alive = np.unique(ancestors[k][alive])
        surviving[k - 1] = len(alive)
    return Ancestry(parents, surviving)
