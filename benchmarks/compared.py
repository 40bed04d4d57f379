"""A filter of jaxveh beside the libraries that have the same filter: the problems, and the contestants of one comparison.

A peer's adapter has one function per filter, `build(plain, dtype, **settings)`, which returns a jitted function of measurements
(rows, m) of one run or (runs, rows, m), and, if the filter is random, of a key or of one key per run. In `LOOPS` it is
`build(plain, **settings)`, which returns a Python loop over one run in NumPy, a function of the measurements and of a seed.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np

import jaxveh
from jaxveh import filters, statespace
from jaxveh.filters import AbstractFilter

from . import ours, plain
from .measure import Contestant, Skipped

__all__ = ["LOOPS", "OURS", "PROBLEMS", "Compared", "Problem", "contestants", "same"]

OURS = "jaxveh"
LOOPS = ("filterpy", "particles")


@dataclass(frozen=True)
class Problem:
    """A problem in the form for other libraries, as a model of jaxveh, and as a recording of its first run."""

    title: str
    plain: Callable[..., plain.Plain]
    model: Callable[..., statespace.StateSpace]
    recording: Callable[..., jaxveh.Recording]
    # The names of the channels of one measurement (m,), in the order of the plain problem.
    channels: tuple[str, ...]


TRACK = (ours.single_track_recording, ("yaw_rate", "a_y"))
PROBLEMS = {
    "linear": Problem("4 states, linear", plain.linear, ours.linear_model, ours.linear_recording, ("yaw_rate", "a_y")),
    "speed": Problem("3 states", plain.speed, ours.speed_model, ours.speed_recording, ("v",)),
    "track": Problem("11 states", plain.track, ours.single_track_model, *TRACK),
    "parameters": Problem("3 states and 8 parameters", plain.track, ours.constant_parameters_model, *TRACK),
}


@dataclass(frozen=True)
class Compared:
    """A filter of jaxveh and the peers that have it: the name of their function by library, and its settings.

    ``smoother``: None, or the smoother of jaxveh. ``random``: whether it needs keys. ``equal``: whether the peers compute the
    same result; if they do not, there is no bound.
    """

    title: str
    filter: AbstractFilter
    problem: str
    peers: dict[str, str]
    smoother: Callable | None = None
    settings: Mapping[str, object] = field(default_factory=dict)
    random: bool = False
    equal: bool = True


def same(name: str, *libraries: str) -> dict[str, str]:
    """Return the peers, whose functions all have this name."""
    return dict.fromkeys(libraries, name)


def contestants(
    compared: Compared, peers: Sequence[str], whole: plain.Plain, short: plain.Plain, particles: int = 1
) -> list[Contestant | Skipped]:
    """Return jaxveh and the peers on the runs of `whole`, and the loops on `short`; work is steps of runs times `particles`."""
    work = whole.measured.shape[0] * (whole.measured.shape[1] - 1) * particles
    made: list[Contestant | Skipped] = [_ours(compared, whole, work)]
    for peer in peers:
        try:
            made.append(_peer(compared, peer, whole, short, work, particles))
        except ImportError as error:
            made.append(Skipped(peer, f"not installed here ({error.name})"))
    return made


def _ours(compared: Compared, whole: plain.Plain, work: int) -> Contestant:
    problem = PROBLEMS[compared.problem]
    model, recording = problem.model(whole.problem, np.float64), problem.recording(whole.problem)
    drive = compared.smoother or filters.run
    if len(whole.measured) == 1:

        def call(index: int) -> object:
            key = {"key": jax.random.key(index)} if compared.random else {}
            return drive(compared.filter, model, recording, **key)

        return Contestant(OURS, ours.blocked(call), work)
    measured = jnp.asarray(whole.measured)

    def one(y: jax.Array, key: jax.Array) -> object:
        channels = {name: y[:, i] for i, name in enumerate(problem.channels)}
        given = {"key": key} if compared.random else {}
        done = drive(compared.filter, model, recording.replace(**channels), **given)
        # The same results as those of the peers; XLA omits the rest, the info of every row.
        total = done.filtered.log_likelihood if compared.smoother else done.log_likelihood
        return done.mean, done.std, total

    many = jax.jit(jax.vmap(one))
    return Contestant(OURS, ours.blocked(lambda index: many(measured, _keys(index, len(measured)))), work)


def _peer(
    compared: Compared, name: str, whole: plain.Plain, short: plain.Plain, work: int, particles: int
) -> Contestant:
    module = importlib.import_module(f".peers.{name}_filters", __package__)
    build = getattr(module, compared.peers[name])
    if name in LOOPS:  # slow ones have fewer rows; a time per step does not depend on their number
        run, y = build(short, **compared.settings), short.measured[0]
        given = (lambda index: (y, index)) if compared.random else (lambda index: (y,))
        return Contestant(name, lambda index: run(*given(index)), (len(y) - 1) * particles)
    run = build(whole, np.float64, **compared.settings)
    runs = len(whole.measured)
    measured = jnp.asarray(whole.measured[0] if runs == 1 else whole.measured)
    if compared.random:
        keys = (lambda index: jax.random.key(index)) if runs == 1 else (lambda index: _keys(index, runs))
        return Contestant(name, ours.blocked(lambda index: run(measured, keys(index))), work)
    return Contestant(name, ours.blocked(lambda index: run(measured)), work)


def _keys(index: int, runs: int) -> jax.Array:
    return jax.random.split(jax.random.key(index), runs)
