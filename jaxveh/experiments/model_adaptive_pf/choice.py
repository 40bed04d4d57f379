"""The redesigned filters' settings, chosen by their own likelihood on drives that are in no table.

    python -m jaxveh.experiments.model_adaptive_pf.choice

prints log-likelihoods, summed over the drives, relative to the best: the robust cubature filter's by window, start, share
and width of the wild values, and the redesigned particle filter's, which has the same wavelet, by window and alpha.
`settings.Study` holds the best. The truth is not used.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters, sweeps
from jaxveh._core.progress import Progress, silent
from jaxveh.experiments.model_adaptive_pf.contestants import (
    contaminated_cubature,
    dynamics_filter,
    redesigned_particles,
    wary,
)
from jaxveh.experiments.model_adaptive_pf.drives import fiala, model_car
from jaxveh.experiments.model_adaptive_pf.settings import CASES, Study
from jaxveh.experiments.model_adaptive_pf.study import drives_of
from jaxveh.sweeps import IN_MEMORY, Stores

WINDOWS = (8, 16, 32, 64)
"""Windows in rows."""

STARTS = ((None, 1.0), (4, 1.0), (4, 4.0), (2, 16.0), (4, 16.0), (4, 64.0))
"""How many of the first rows (None: all of the window), and the variances until then, times the data sheet's."""

SHARES = (0.01, 0.03, 0.1)
"""Shares of wild values."""

FACTORS = (10.0, 30.0, 100.0)
"""How many times as wide wild values are."""

ALPHAS = (1.1, 1.3, 1.5, 1.7, 1.9)
"""Exponents of the stable law: 1 is Cauchy's, 2 the normal one's."""


def robust_likelihoods(
    study: Study,
    *,
    windows: Sequence[int] = WINDOWS,
    starts: Sequence[tuple[int | None, float]] = STARTS,
    shares: Sequence[float] = SHARES,
    factors: Sequence[float] = FACTORS,
    drives: int = 20,
    seed: int = 1000,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> np.ndarray:
    """Log-likelihoods (windows, starts, shares, factors, drives) of the robust cubature filter with the noise of 'both'."""

    def of(window, start):
        def run(study, car, drive, key, point):
            fewest, initial = start
            own = dataclasses.replace(
                study,
                short_window=window,
                fewest=fewest,
                initial=initial,
                wild_share=point.share,
                wild_factor=point.factor,
            )
            return dynamics_filter(filters.HaarNoise(contaminated_cubature(own), **wary(own)))(own, car, drive, key)

        return run

    choices = {f"{w} rows, {start}": of(w, start) for w, start in itertools.product(windows, starts)}
    numbers = {"share": shares, "factor": factors}
    found = _likelihoods(study, choices, numbers, drives, seed, progress, stores.under("robust"))
    return found.reshape(len(windows), len(starts), len(shares), len(factors), drives)


def redesigned_likelihoods(
    study: Study,
    *,
    windows: Sequence[int] = WINDOWS,
    alphas: Sequence[float] = ALPHAS,
    drives: int = 20,
    seed: int = 1000,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> np.ndarray:
    """Log-likelihoods (windows, alphas, drives) of the redesigned particle filter with the noise of 'both'."""

    def of(window):
        def run(study, car, drive, key, point):
            own = dataclasses.replace(study, short_window=window, heavy_alpha=point.alpha)
            return redesigned_particles(own)(own, car, drive, key)

        return run

    choices = {f"{window} rows": of(window) for window in windows}
    return _likelihoods(study, choices, {"alpha": alphas}, drives, seed, progress, stores.under("redesigned"))


def _likelihoods(
    study: Study,
    choices: dict[str, Callable],
    numbers: dict[str, Any],
    drives: int,
    seed: int,
    progress: Progress,
    stores: Stores,
) -> np.ndarray:
    """(choices, *numbers, drives), on drives whose seed differs from the report's."""
    seen = drives_of(study, {"both": CASES["both"]}, drives, jax.random.key(seed), stores=stores)
    car = model_car(study, fiala(study))

    def run(point, key, drive):
        found = point.choice(study, car, drive, key, point)
        return {"log_likelihood": jnp.where(found.result == 0, found.log_likelihood, -jnp.inf)}

    design = sweeps.Design(choice=choices, **{name: list(values) for name, values in numbers.items()})
    shape = [len(values) for values in numbers.values()]
    data = jax.tree.map(
        lambda leaf: np.broadcast_to(leaf.reshape(*[1] * len(shape), *leaf.shape[1:]), (*shape, *leaf.shape[1:])), seen
    )
    key = jax.random.key(seed + 1)
    return stores.sweep("likelihoods", run, design, drives, key, data=data, progress=progress)["log_likelihood"]


def main() -> None:
    """Print both tables, as differences from their best."""
    jax.config.update("jax_enable_x64", True)
    found = robust_likelihoods(Study())
    total = found.sum(axis=-1)
    print("robust cubature filter: the best of each window and start, with its share and factor")
    for i, window in enumerate(WINDOWS):
        for j, (fewest, initial) in enumerate(STARTS):
            share, factor = np.unravel_index(total[i, j].argmax(), total[i, j].shape)
            start = f"{window:3d} rows, from {fewest or window:3d} on, {initial:3g} until then"
            wild = f"{SHARES[share]:5.2f} wild, {FACTORS[factor]:4g} times as wide"
            print(f"{start}; {wild}: {total[i, j].max() - total.max():.0f}")
    total = redesigned_likelihoods(Study()).sum(axis=-1)
    print("redesigned particle filter")
    print("window  " + "".join(f"alpha {alpha:<6g}" for alpha in ALPHAS))
    for window, row in zip(WINDOWS, total - total.max(), strict=True):
        print(f"{window:6d}  " + "".join(f"{value:<12.0f}" for value in row))


if __name__ == "__main__":
    main()
