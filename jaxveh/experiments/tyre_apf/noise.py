"""The noise that the study's filters assume, chosen by their own likelihood on drives that no table shows.

    python -m jaxveh.experiments.tyre_apf.noise

prints what `settings.Study` holds: for each filter the candidate whose log-likelihood, summed over the drives, is largest; and
what both particle filters would share at each of `settings.LEVELS` as they are compared there, resampling multinomially (what
`LEVELS` holds was chosen with systematic resampling). The truth has no part in it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters, numerics, sweeps
from jaxveh._core.errors import check_at_least
from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.tyre_apf.settings import LEVELS, Level, Noise, Study
from jaxveh.experiments.tyre_apf.sharpness import KINDS, PAPERS_PARTICLES, several_passes
from jaxveh.experiments.tyre_apf.study import drive_once, filter_of, guess_once, model_of

V_Y = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""Candidates: m/s,"""

YAW_RATE = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
"""rad/s,"""

WALK = (0.01, 0.02, 0.05, 0.1, 0.2)
"""and relative, all per root second."""


class Round(NamedTuple):
    """Of a choice: how many candidates to `keep` for it, over how many `drives`, and how often `again` over each."""

    keep: int
    drives: int
    again: int


LEVEL_CANDIDATES = np.array(
    list(itertools.product((0.005, 0.01, 0.02, 0.05, 0.1), (0.001, 0.002, 0.005, 0.01), (0.05, 0.1, 0.2)))
)
"""(m, 3): as above, fewer, for the levels: where a particle filter may lose a drive, fewer drives do not tell."""

ROUNDS = (Round(keep=len(LEVEL_CANDIDATES), drives=24, again=2), Round(keep=12, drives=48, again=4))
"""All of them first, then the best on more drives."""


class Choice(NamedTuple):
    """`noise`: the best of `candidates` (m, 3: v_y, yaw_rate, walk) by the mean over drives of `log_likelihood` (m, drives)."""

    noise: Noise
    candidates: np.ndarray
    log_likelihood: np.ndarray


def choose(study: Study, name: str, *, drives: int = 8, seed: int = 1000, progress: Progress = silent) -> Choice:
    """Choose the noise of the filter `PF`, `APF` or `UKF` on drives of their own seeds, by its likelihood alone.

    `seed` differs from the report's, so that no drive is used twice. A parameter that walks is for particles only: the
    unscented filter's parameters are constants. A candidate for which the filter fails on any drive is out.
    """
    walks = (0.0,) if name == "UKF" else WALK
    candidates = np.array(list(itertools.product(V_Y, YAW_RATE, walks)))
    keys = jax.random.split(jax.random.key(seed), drives)
    likelihood = _drives(study, name, keys)
    found = []
    for i, candidate in enumerate(candidates):
        progress(i, len(candidates), f"{name}: v_y {candidate[0]:g}, yaw rate {candidate[1]:g}, walk {candidate[2]:g}")
        found.append(likelihood(jnp.asarray(candidate)))
    log_likelihood = np.array(found)
    mean = np.where(np.isfinite(log_likelihood), log_likelihood, -np.inf).mean(axis=1)
    return Choice(Noise(*map(float, candidates[mean.argmax()])), candidates, log_likelihood)


def choose_level(
    study: Study,
    level: Level,
    *,
    candidates: np.ndarray = LEVEL_CANDIDATES,
    particles: int = PAPERS_PARTICLES,
    rounds: Sequence[Round] = ROUNDS,
    seed: int = 2000,
    progress: Progress = silent,
) -> Choice:
    """Choose what both particle filters assume at a level of the sensors' noise, resampling as the paper does: the candidate with
    the largest sum of their log-likelihoods, over every pass of each drive. One with which a filter fails is out.

    Each of the `rounds` takes the best of the one before to drives of its own: one pass in which a filter loses the drive weighs
    more than all other differences, so that few drives do not tell which of the best is best. The last round is returned.
    """
    check_at_least("number of rounds", len(rounds), 1)
    both = [kind(particles, numerics.multinomial) for kind in KINDS.values()]
    total = np.zeros(len(candidates))
    for i, (keep, drives, again) in enumerate(rounds):
        # Stable, so that equals stay in the order of the grid.
        candidates = candidates[np.sort(np.argsort(-total, kind="stable")[:keep])]
        told = part(progress, i / len(rounds), (i + 1) / len(rounds), f"round {i + 1}")
        log_likelihood = _of_level(study, level, both, candidates, again, (drives, seed + i), told)
        total = np.where(np.isfinite(log_likelihood), log_likelihood, -np.inf).sum(axis=1)
    return Choice(Noise(*map(float, candidates[total.argmax()])), candidates, log_likelihood)


def _of_level(study: Study, level: Level, both, candidates, again: int, drives: tuple[int, int], progress: Progress):
    """Log-likelihoods (candidates, drives): of all passes by both filters together. `drives`: how many, from which seed."""
    values = jnp.asarray(candidates)

    def run(point, key):
        own = level._replace(noise=Noise(*values[point.candidate.astype(int)]))
        found = [several_passes(study, filter_, own, again, key) for filter_ in both]
        total = sum(jnp.sum(jnp.where(result == 0, likelihood, -jnp.inf)) for _, likelihood, result in found)
        return {"log_likelihood": total}

    design = sweeps.Design(candidate=range(len(candidates)))
    count, seed = drives
    return sweeps.sweep(run, design, count, jax.random.key(seed), progress=progress)["log_likelihood"]


def _drives(study: Study, name: str, keys):
    """The likelihood of every drive as a function of the noise's levels, compiled once."""

    @eqx.filter_jit
    def simulate(keys):
        each = lambda key: (lambda a, b, c: (drive_once(study, a), guess_once(study, b), c))(*jax.random.split(key, 3))
        return jax.vmap(each)(keys)

    kind, _ = filter_of(study, name)

    @eqx.filter_jit
    def likelihood(seen: Any, levels):
        def one(drive, guess, key):
            noise = Noise(levels[0], levels[1], 0.0 if name == "UKF" else levels[2])
            model = model_of(study, guess, noise)
            found = filters.scan(kind, model, model.rows(drive), key)
            return jnp.where(found.result == 0, found.log_likelihood, -jnp.inf)

        return jax.vmap(one)(*seen)

    seen = simulate(keys)
    return lambda levels: np.asarray(likelihood(seen, levels))


def main() -> None:
    """Print the choice for each filter and for each level, and the runners-up."""
    jax.config.update("jax_enable_x64", True)
    study = Study()
    for name in ("UKF", "PF", "APF"):
        _show(name, choose(study, name))
    for level in LEVELS:
        _show(f"PF and APF at {level.yaw_rate:g} rad/s, {level.a_y:g} m/s^2", choose_level(study, level))


def _show(name: str, choice: Choice) -> None:
    mean = choice.log_likelihood.mean(axis=1)
    print(f"{name}: {choice.noise}")
    for i in np.argsort(-mean)[:8]:
        behind = choice.log_likelihood[i] - choice.log_likelihood[mean.argmax()]
        spread = behind.std() / np.sqrt(behind.size)
        print("   v_y {:g}, yaw rate {:g}, walk {:g}".format(*choice.candidates[i]), f"{mean[i]:.2f}, +- {spread:.2f}")


if __name__ == "__main__":
    main()
