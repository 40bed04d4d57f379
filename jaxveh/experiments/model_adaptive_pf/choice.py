"""The redesigned filter's window and tails, chosen by its own likelihood on drives that no table shows.

    python -m jaxveh.experiments.model_adaptive_pf.choice

prints the log-likelihood, summed over the drives, of each window and alpha; `settings.Study` holds the best. The truth has no
part in it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import sweeps
from jaxveh._core.progress import Progress, silent
from jaxveh.experiments.model_adaptive_pf.contestants import redesigned
from jaxveh.experiments.model_adaptive_pf.drives import fiala, model_car
from jaxveh.experiments.model_adaptive_pf.settings import CASES, Study
from jaxveh.experiments.model_adaptive_pf.study import drives_of

WINDOWS = (8, 16, 32, 64)
"""Rows,"""

ALPHAS = (1.1, 1.3, 1.5, 1.7, 1.9)
"""and exponents of the stable law: 1 is Cauchy's, 2 the normal one's."""


def likelihoods(
    study: Study,
    *,
    windows: Sequence[int] = WINDOWS,
    alphas: Sequence[float] = ALPHAS,
    drives: int = 20,
    seed: int = 1000,
    progress: Progress = silent,
) -> np.ndarray:
    """Log-likelihoods (windows, alphas, drives) under the noise of 'both'. `seed` differs from the report's."""
    seen = drives_of(study, {"both": CASES["both"]}, drives, jax.random.key(seed))
    car = model_car(study, fiala(study))

    def of(window):
        def run(alpha, key, drive):
            own = dataclasses.replace(study, short_window=window, heavy_alpha=alpha)
            found = redesigned(own)(own, car, drive, key)
            return {"log_likelihood": jnp.where(found.result == 0, found.log_likelihood, -jnp.inf)}

        return run

    design = sweeps.Design(window={f"{window} rows": of(window) for window in windows}, alpha=list(alphas))
    run = lambda point, key, drive: point.window(point.alpha, key, drive)
    data = jax.tree.map(lambda leaf: np.repeat(leaf, len(alphas), axis=0), seen)
    key = jax.random.key(seed + 1)
    return sweeps.sweep(run, design, drives, key, data=data, progress=progress)["log_likelihood"]


def main() -> None:
    """Print the table, as differences from its best."""
    jax.config.update("jax_enable_x64", True)
    total = likelihoods(Study()).sum(axis=-1)
    print("window  " + "".join(f"alpha {alpha:<6g}" for alpha in ALPHAS))
    for window, row in zip(WINDOWS, total - total.max(), strict=True):
        print(f"{window:6d}  " + "".join(f"{value:<12.0f}" for value in row))


if __name__ == "__main__":
    main()
