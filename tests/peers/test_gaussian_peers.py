"""Kalman filters and smoothers say what those of every library that has the same one say, on the benchmarks' problems.

What the comparisons step around. dynamax adds 1e-9 to the diagonal of every matrix that it solves with (hence its
tolerance); next to this linear problem's process noise of 1e-8 that is a tenth, so that its linear smoothers are left out,
as is its parallel filter's log-likelihood. Its iterated filter uses the measurement in every iteration anew. filterpy's
cubature filter updates with the points of before the process noise, which the test draws anew; its linear smoother knows no
inputs, its square-root and ensemble filters no likelihood, and the latter's first spread takes what the drawn members have
learnt off the covariance that was given. cuthbert's first state has no measurement: the
benchmark's adapter applies it first.
"""

import dataclasses
import importlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks import gaussian_filters as compared
from benchmarks.compared import LOOPS, PROBLEMS
from jaxveh import filters

pytestmark = pytest.mark.peers
ROWS = 40
EXACT = 1e-8
TOLERANCES = {"dynamax": 2e-3, "filterpy": 1e-6}
LEFT_OUT = {
    ("kalman-smoother", "dynamax"),
    ("kalman-parallel", "dynamax"),
    ("kalman-smoother", "filterpy"),
    ("cubature-3", "filterpy"),
}
NAMES = [
    "kalman",
    "kalman-square-root",
    "kalman-smoother",
    "kalman-parallel",
    "extended-3",
    "extended-smoother-11",
    "unscented-11",
    "unscented-smoother-3",
    "cubature-3",
    "gauss-hermite-3",
    "interacting",
    "h-infinity",
]
PAIRS = [(name, peer) for name in NAMES for peer in compared.COMPARED[name].peers if (name, peer) not in LEFT_OUT]


def adapter(peer):
    pytest.importorskip(peer)
    return importlib.import_module(f"benchmarks.peers.{peer}_filters")


@pytest.fixture(scope="module")
def ours():
    """What ours says: means (rows, n), spreads and log-likelihood, by the comparison's name, each computed once."""
    found = {}

    def of(name):
        if name not in found:
            entry = compared.COMPARED[name]
            problem = PROBLEMS[entry.problem]
            plain = problem.plain(ROWS, 1)
            model, recording = problem.model(plain.problem, np.float64), problem.recording(plain.problem)
            done = (entry.smoother or filters.run)(entry.filter, model, recording)
            total = (done.filtered if entry.smoother else done).log_likelihood
            found[name] = plain, np.stack(done.mean, axis=1), np.stack(done.std, axis=1), float(total)
        return found[name]

    return of


def assert_same(ours, theirs, tolerance):
    _, mean, std, total = ours
    their_mean, their_std, their_total = (np.asarray(value) for value in theirs)
    assert np.abs((their_mean - mean) / std).max() < tolerance
    assert np.abs(their_std / std - 1).max() < tolerance
    if not np.isnan(their_total):
        assert abs(float(their_total) - total) < 100 * tolerance


@pytest.mark.parametrize(("name", "peer"), PAIRS, ids=lambda value: value)
def test_what_ours_says_a_peer_says(name, peer, ours):
    module, expected = adapter(peer), ours(name)
    entry, plain = compared.COMPARED[name], expected[0]
    build = getattr(module, entry.peers[peer])
    if peer in LOOPS:
        theirs = build(plain, **entry.settings)(plain.measured[0])
    else:
        with jax.numpy_dtype_promotion("standard"):
            theirs = build(plain, np.float64)(jnp.asarray(plain.measured[0]))
    assert_same(expected, theirs, TOLERANCES.get(peer, EXACT))


def test_filterpys_cubature_filter_with_points_drawn_anew(ours):
    expected = ours("cubature-3")
    plain = expected[0]
    theirs = adapter("filterpy").cubature(plain, regenerate=True)(plain.measured[0])
    assert_same(expected, theirs, EXACT)


def test_filterpys_fixed_lag_smoother_is_right_as_a_filter_alone(ours):
    plain, filtered, std, _ = ours("kalman")
    _, exact, _, _ = ours("fixed-lag")
    entry = compared.COMPARED["fixed-lag"]
    smoothed, theirs = adapter("filterpy").fixed_lag(plain, **entry.settings)(plain.measured[0])
    assert np.abs((theirs - filtered) / std).max() < 1e-6
    # When this fails the library has been mended, and the comparison is one of equals.
    assert np.abs((smoothed - exact) / std).max() > 0.1


@pytest.mark.parametrize("peer", ["cuthbert", "filterpy"])
def test_ensembles_agree_within_their_sampling_errors(peer):
    members = 3000
    module, entry = adapter(peer), compared.COMPARED["ensemble-11"]
    problem = PROBLEMS["speed"]
    plain = problem.plain(15, 1)
    filter_ = dataclasses.replace(entry.filter, members=members)
    model, recording = problem.model(plain.problem, np.float64), problem.recording(plain.problem)
    done = filters.run(filter_, model, recording, key=jax.random.key(0))
    if peer == "filterpy":
        np.random.seed(0)  # noqa: NPY002  the library draws from the global generator
        mean, std, _ = module.ensemble(plain, members)(plain.measured[0])
    else:
        with jax.numpy_dtype_promotion("standard"):
            run = module.ensemble(plain, np.float64, members)
            mean, std, total = run(jnp.asarray(plain.measured[0]), jax.random.key(1))
        assert abs(float(total) - float(done.log_likelihood)) < 0.3
    spread = np.stack(done.std, axis=1)
    assert np.abs((mean - np.stack(done.mean, axis=1)) / spread).max() < 0.15
    first = 1 if peer == "filterpy" else 0
    assert np.abs(std / spread - 1)[first:].max() < 0.1
