"""The noise of the study's filters, chosen by their own likelihood on drives that are in no table.

    python -m jaxveh.experiments.tyre_apf.noise

prints the numbers of `settings.Study`: for each filter the candidate whose log-likelihood, summed over the drives, is
largest; and those of `settings.LEVELS`: the noise that both particle filters share at each level, with multinomial
resampling as in their comparison. The truth is not used.
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
from jaxveh._core.errors import InputError, check_at_least
from jaxveh._core.progress import Progress, part, silent
from jaxveh._core.recording import Recording
from jaxveh.experiments.tyre_apf.settings import LEVELS, NoiseLevel, Study, StudyNoise
from jaxveh.experiments.tyre_apf.sharpness import KINDS, PAPERS_PARTICLES, Kinds, drive_at, several_passes
from jaxveh.experiments.tyre_apf.study import drive_once, filter_of, guess_once, model_of
from jaxveh.sweeps import IN_MEMORY, Stores

V_Y = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""Candidates: m/s per root second."""

YAW_RATE = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
"""Candidates: rad/s per root second."""

WALK = (0.01, 0.02, 0.05, 0.1, 0.2)
"""Candidates: relative, per root second."""


class Round(NamedTuple):
    """One round of a choice: the number of `drives`, and how often each filter runs over each of them, `again`."""

    drives: int
    again: int


LEVEL_CANDIDATES = np.array(
    list(itertools.product((0.005, 0.01, 0.02, 0.05, 0.1), (0.001, 0.002, 0.005, 0.01), (0.01, 0.02, 0.05, 0.1)))
)
"""(m, 3): the same for the levels. A walk of 0.2 with the best of the rest is worse at each of them, by 60 to 1300."""

ROUNDS = (Round(drives=8, again=3), Round(drives=40, again=4))
"""First all candidates, then the best on more drives."""

KEEP = 12
"""The number of candidates kept after a round."""


class Choice(NamedTuple):
    """`noise`: the best of `candidates` (m, 3: v_y, yaw_rate, walk) by the mean over drives of `log_likelihood` (m, drives)."""

    noise: StudyNoise
    candidates: np.ndarray
    log_likelihood: np.ndarray


def choose(study: Study, name: str, *, drives: int = 8, seed: int = 1000, progress: Progress = silent) -> Choice:
    """Choose the noise of the filter `PF`, `APF` or `UKF` on drives with their own seeds, only by its likelihood.

    `seed` differs from the report's, so that no drive is used twice. Only particle filters have parameters that walk: the
    unscented filter's parameters are constants. A candidate with which the filter fails on any drive is excluded.
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
    return _best(candidates, log_likelihood)


def choose_level(
    study: Study,
    level: NoiseLevel,
    *,
    candidates: np.ndarray = LEVEL_CANDIDATES,
    particles: int = PAPERS_PARTICLES,
    rounds: Sequence[Round] = ROUNDS,
    keep: int = KEEP,
    seed: int = 2000,
    kinds: Kinds | None = None,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Choice:
    """Choose the process noise of both particle filters at a level of the sensors' noise, with the paper's resampling: the
    candidate with the largest mean of their log-likelihoods, over every pass of each drive. One with which a filter fails is
    excluded.

    A pass whose likelihood is lower than that of the measurements' mean and standard deviation alone
    (`unexplained_likelihood`) is lost, and counts with the latter. With sharp sensors 300 particles lose some drives with
    any noise: how badly (log-likelihoods of -1e9 where others have 4e3) would otherwise decide alone, while medians would
    ignore a third of all drives lost.

    `kinds`: the filters, by default the paper's. Each of the `rounds` (at least one) takes the `keep` best of the one before
    to drives of its own, and the last is returned.
    """
    check_at_least("number of rounds", len(rounds), 1)
    both = [kind(particles, numerics.multinomial) for kind in (KINDS if kinds is None else kinds).values()]
    for i, (drives, again) in enumerate(rounds):
        told = part(progress, i / len(rounds), (i + 1) / len(rounds), f"round {i + 1}")
        own = stores.under(f"round-{i + 1}")
        log_likelihood = _of_level(study, level, both, candidates, again, (drives, seed + i), told, own)
        found = _best(candidates, log_likelihood)
        # In the order of the grid.
        candidates = candidates[np.sort(np.argsort(-log_likelihood.mean(axis=1), kind="stable")[:keep])]
    return found


def unexplained_likelihood(drive: Recording) -> jax.Array:
    """The greatest log-likelihood of the drive's measurements as normal numbers, independent of time, inputs and each
    other."""
    each = [len(drive[name]) * (jnp.log(2 * jnp.pi * jnp.var(drive[name])) + 1) / 2 for name in ("yaw_rate", "a_y")]
    return -jnp.sum(jnp.stack(each))


def _best(candidates: np.ndarray, log_likelihood: np.ndarray) -> Choice:
    mean = log_likelihood.mean(axis=1)
    mean = np.where(np.isfinite(mean), mean, -np.inf)
    if not np.isfinite(mean).any():
        raise InputError(
            f"all {len(candidates)} candidates fail on a drive: give other candidates, or the filters more particles."
        )
    return Choice(StudyNoise(*map(float, candidates[mean.argmax()])), candidates, log_likelihood)


def _of_level(
    study: Study,
    level: NoiseLevel,
    both,
    candidates,
    again: int,
    drives: tuple[int, int],
    progress: Progress,
    stores: Stores,
) -> np.ndarray:
    """Log-likelihoods (candidates, drives): both filters' means over passes, summed. `drives`: their number and their seed."""
    values = jnp.asarray(candidates)

    def run(point, key):
        own = level._replace(noise=StudyNoise(*values[point.candidate.astype(int)]))
        found = [several_passes(study, filter_, own, again, key) for filter_ in both]
        least = unexplained_likelihood(drive_at(study, own, key))
        each = [jnp.where(result == 0, jnp.maximum(passes, least), -jnp.inf) for _, passes, result in found]
        return {"log_likelihood": sum(map(jnp.mean, each))}

    design = sweeps.Design(candidate=range(len(candidates)))
    count, seed = drives
    found = stores.sweep("likelihoods", run, design, count, jax.random.key(seed), progress=progress)
    return found["log_likelihood"]


def _drives(study: Study, name: str, keys):
    """The likelihood of every drive as a function of the noise levels, compiled once."""

    @eqx.filter_jit
    def simulate(keys):
        each = lambda key: (lambda a, b, c: (drive_once(study, a), guess_once(study, b), c))(*jax.random.split(key, 3))
        return jax.vmap(each)(keys)

    kind, _ = filter_of(study, name)

    @eqx.filter_jit
    def likelihood(seen: Any, levels):
        def one(drive, guess, key):
            noise = StudyNoise(levels[0], levels[1], 0.0 if name == "UKF" else levels[2])
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
        what = "   v_y {:g}, yaw rate {:g}, walk {:g}".format(*choice.candidates[i])
        print(f"{what}: {behind.mean():.2f} +- {spread:.2f}")


if __name__ == "__main__":
    main()
