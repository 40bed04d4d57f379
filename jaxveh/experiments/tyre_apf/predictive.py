"""The paper's comparison with an auxiliary filter that looks ahead with the process noise instead of to a point.

    python -m jaxveh.experiments.tyre_apf.predictive

chooses the noise of each level by the likelihood of the plain filter and of this one, as `noise` does for the paper's, then
races both with it, on drives of another key than the report's, and prints the quantities of the report's criteria. The
report takes the noise from `settings.LOOKING_AHEAD` and races both on its own drives.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax
import numpy as np

from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.tyre_apf.noise import KEEP, LEVEL_CANDIDATES, ROUNDS, Round, choose_level
from jaxveh.experiments.tyre_apf.settings import LEVELS, NoiseLevel, Study
from jaxveh.experiments.tyre_apf.sharpness import (
    AGAIN,
    PAPERS_PARTICLES,
    PREDICTIVE,
    Sharpness,
    likelihood_ratio,
    run_sharpness,
)
from jaxveh.sweeps import IN_MEMORY, Stores


def race(
    study: Study,
    seeds: int,
    key,
    *,
    levels: Sequence[NoiseLevel] = LEVELS,
    candidates: np.ndarray = LEVEL_CANDIDATES,
    rounds: Sequence[Round] = ROUNDS,
    keep: int = KEEP,
    particles: int = PAPERS_PARTICLES,
    again: int = AGAIN,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> tuple[list[NoiseLevel], Sharpness]:
    """The levels with the chosen noise, and both filters at them over `seeds` drives."""
    chosen, share = [], 0.8 / len(levels)
    for i, level in enumerate(levels):
        told = part(progress, i * share, (i + 1) * share, f"level {i + 1}")
        choice = choose_level(
            study,
            level,
            candidates=candidates,
            particles=particles,
            rounds=rounds,
            keep=keep,
            kinds=PREDICTIVE,
            progress=told,
            stores=stores.under(f"level-{i + 1}"),
        )
        chosen.append(level._replace(noise=choice.noise))
    told = part(progress, 0.8, 1.0, "race")
    raced = run_sharpness(
        study,
        seeds,
        key,
        counts=(particles,),
        again=again,
        kinds=PREDICTIVE,
        levels=chosen,
        progress=told,
        stores=stores,
    )
    return chosen, raced


def main() -> None:
    """Print the noise of each level, with the error, the share of drives won and the interquartile range of the
    log-likelihood."""
    jax.config.update("jax_enable_x64", True)
    chosen, raced = race(Study(), 20, jax.random.key(0))
    compared = raced.found[PAPERS_PARTICLES].compare("error", "filter", "APF", "PF")
    for i, level in enumerate(chosen):
        error, wins = compared.ratio.value[i], compared.wins[i]
        spread = likelihood_ratio(raced, PAPERS_PARTICLES, i)
        print(f"{level.yaw_rate:g} rad/s, {level.a_y:g} m/s^2, {level.noise}")
        print(
            f"   error {error:.3f} of the plain filter's, wins {wins:.0%}, range of log-likelihood {spread:.3f} times as large"
        )


if __name__ == "__main__":
    main()
