"""Kalman filters and smoothers side by side with every library that has the same one: one run, and 64 at once.

Of the linear filters for 64 runs: where a library knows no missing values (dynamax, smcx), the covariances of a linear filter
do not depend on the measurements, and `vmap` over these alone leaves them out of the batch: all 64 runs share one recursion of
matrices, and only means are computed for each. Ours, as cuthbert's, may miss another channel in each run and does the whole
work. As soon as anything but the measurements differs between runs, so do they (see the extended filters).
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

import jaxveh
from jaxveh import filters, statespace

from . import ours, plain
from .measure import Bound, Case, Contestant, Skipped

__all__ = ["COMPARED", "PROBLEMS", "Compared", "Problem", "cases"]

OURS = "jaxveh"
MEMBERS = 300


@dataclass(frozen=True)
class Problem:
    """A problem as other libraries want it, as a model of ours, and as a recording of its first run."""

    title: str
    plain: Callable[..., plain.Plain]
    model: Callable[..., statespace.StateSpace]
    recording: Callable[..., jaxveh.Recording]
    # Of one measurement (m,) the channel's names, in the order of the plain problem.
    channels: tuple[str, ...]


PROBLEMS = {
    "linear": Problem("4 states, linear", plain.linear, ours.linear_model, ours.linear_recording, ("yaw_rate", "a_y")),
    "speed": Problem("3 states", plain.speed, ours.speed_model, ours.speed_recording, ("v",)),
    "track": Problem(
        "11 states", plain.track, ours.single_track_model, ours.single_track_recording, ("yaw_rate", "a_y")
    ),
}


@dataclass(frozen=True)
class Compared:
    """A filter of ours and the peers that have it: the name of their function by library.

    ``smoother``: None, or how ours smooths. A function of `LOOPS` is a Python loop over one run of NumPy arrays. ``equal``:
    whether the peers compute the same thing; where they do not, there is no bound.
    """

    title: str
    filter: filters.AbstractFilter
    problem: str
    peers: dict[str, str]
    smoother: Callable | None = None
    equal: bool = True

    @property
    def random(self) -> bool:
        """Whether it needs keys."""
        return isinstance(self.filter, filters.Ensemble)


LOOPS = ("filterpy", "particles")
ALL = ("dynamax", "smcx", "cuthbert", "filterpy")


def _same(name: str, *libraries: str) -> dict[str, str]:
    return dict.fromkeys(libraries, name)


COMPARED = {
    "kalman": Compared("Kalman filter", filters.Kalman(), "linear", _same("kalman", *ALL, "particles")),
    "kalman-square-root": Compared(
        "Square-root Kalman filter",
        filters.Kalman(form=filters.SquareRoot()),
        "linear",
        {"cuthbert": "kalman", "filterpy": "square_root"},
    ),
    "kalman-smoother": Compared(
        "Rauch-Tung-Striebel smoother",
        filters.Kalman(),
        "linear",
        _same("kalman_smoother", *ALL),
        filters.smooth,
    ),
    "kalman-parallel": Compared(
        "Kalman filter and smoother in parallel over time",
        filters.Kalman(),
        "linear",
        _same("parallel_smoother", "dynamax", "cuthbert"),
        filters.smooth_parallel,
    ),
    "extended-3": Compared("Extended Kalman filter", filters.Extended(), "speed", _same("extended", *ALL)),
    "extended-11": Compared("Extended Kalman filter", filters.Extended(), "track", _same("extended", *ALL)),
    "extended-square-root-11": Compared(
        "Extended square-root Kalman filter",
        filters.Extended(form=filters.SquareRoot()),
        "track",
        _same("extended", "cuthbert"),
    ),
    "extended-smoother-11": Compared(
        "Extended Rauch-Tung-Striebel smoother",
        filters.Extended(),
        "track",
        _same("extended_smoother", "dynamax", "smcx", "cuthbert"),
        filters.smooth,
    ),
    "iterated-11": Compared(
        "Extended Kalman filter with five linearisations",
        filters.Iterated(filters.Extended(), 4),
        "track",
        _same("iterated", "dynamax"),
        equal=False,
    ),
    "unscented-11": Compared(
        "Unscented Kalman filter",
        filters.Unscented(),
        "track",
        _same("unscented_filter", "dynamax", "smcx", "filterpy"),
    ),
    "unscented-smoother-3": Compared(
        "Unscented Rauch-Tung-Striebel smoother",
        filters.Unscented(),
        "speed",
        _same("unscented_smoother", "dynamax"),
        filters.smooth,
    ),
    "unscented-smoother-11": Compared(
        "Unscented Rauch-Tung-Striebel smoother",
        filters.Unscented(),
        "track",
        _same("unscented_smoother", "dynamax"),
        filters.smooth,
    ),
    "cubature-3": Compared(
        "Cubature Kalman filter", filters.Cubature(), "speed", _same("cubature", "dynamax", "filterpy")
    ),
    "cubature-11": Compared(
        "Cubature Kalman filter", filters.Cubature(), "track", _same("cubature", "dynamax", "filterpy")
    ),
    "gauss-hermite-3": Compared(
        "Gauss-Hermite Kalman filter of 27 points", filters.GaussHermite(3), "speed", _same("gauss_hermite", "dynamax")
    ),
    "ensemble-11": Compared(
        f"Ensemble Kalman filter of {MEMBERS} members",
        filters.Ensemble(MEMBERS, perturbed=True),
        "track",
        _same("ensemble", "cuthbert", "filterpy"),
    ),
}

# What the smoke run builds, and beside whom: each peer once.
SMOKE = {"kalman": ("particles", "cuthbert"), "extended-3": ("dynamax", "filterpy"), "unscented-11": ("smcx",)}


def cases(smoke: bool) -> list[Case]:
    """Every filter for one run and for 64."""
    made = []
    for name, compared in COMPARED.items():
        if smoke and name not in SMOKE:
            continue
        for runs in (1,) if smoke else (1, 64):
            problem = PROBLEMS[compared.problem].title
            peers = SMOKE[name] if smoke else tuple(p for p in compared.peers if runs == 1 or p not in LOOPS)
            bounds = (Bound(OURS, peers, 1.0),) if compared.equal else ()
            made.append(
                Case(
                    name=f"gaussian_filters/{name}-{runs}",
                    title=f"{compared.title}, {problem}, {runs} run{'s' if runs > 1 else ''}, float64{_shared(compared, runs)}",
                    unit="us a run-step",
                    build=functools.partial(_build, compared, peers, runs, smoke),
                    base=OURS,
                    bounds=bounds,
                )
            )
    return made


def _shared(compared: Compared, runs: int) -> str:
    """What the title of a linear filter's many runs says (see the module's text)."""
    return "; dynamax and smcx share covariances" if runs > 1 and compared.problem == "linear" else ""


def _build(compared: Compared, peers: Sequence[str], runs: int, smoke: bool) -> Sequence[Contestant | Skipped]:
    problem = PROBLEMS[compared.problem]
    rows = 12 if smoke else 3000 if runs == 1 else 300
    whole, short = problem.plain(rows, runs), problem.plain(min(rows, 60), 1)
    work = runs * (rows - 1)
    made: list[Contestant | Skipped] = [_ours(compared, problem, whole, work)]
    for peer in peers:
        try:
            made.append(_peer(compared, peer, whole, short, work))
        except ImportError as error:
            made.append(Skipped(peer, f"not installed here ({error.name})"))
    return made


def _ours(compared: Compared, problem: Problem, whole: plain.Plain, work: int) -> Contestant:
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
        # What the peers give, too; XLA leaves out the rest, the infos of every row.
        total = done.filtered.log_likelihood if compared.smoother else done.log_likelihood
        return done.mean, done.std, total

    many = jax.jit(jax.vmap(one))
    return Contestant(OURS, ours.blocked(lambda index: many(measured, _keys(index, len(measured)))), work)


def _peer(compared: Compared, name: str, whole: plain.Plain, short: plain.Plain, work: int) -> Contestant:
    module = importlib.import_module(f".peers.{name}_filters", __package__)
    build = getattr(module, compared.peers[name])
    extra = {"members": MEMBERS} if compared.random else {}
    if name in LOOPS:  # slow ones see fewer rows; a time per step does not depend on their number
        run, y = build(short, **extra), short.measured[0]
        return Contestant(name, lambda index: run(y), len(y) - 1)
    run = build(whole, np.float64, **extra)
    runs = len(whole.measured)
    measured = jnp.asarray(whole.measured[0] if runs == 1 else whole.measured)
    if compared.random:
        keys = (lambda index: jax.random.key(index)) if runs == 1 else (lambda index: _keys(index, runs))
        return Contestant(name, ours.blocked(lambda index: run(measured, keys(index))), work)
    return Contestant(name, ours.blocked(lambda index: run(measured)), work)


def _keys(index: int, runs: int) -> jax.Array:
    return jax.random.split(jax.random.key(index), runs)
