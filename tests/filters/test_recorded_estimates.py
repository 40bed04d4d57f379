"""What every filter makes of a short recording, by every setting that changes it, as recorded; and the codes of failures.

One of every class of filters runs by default, whatever it takes: of many no other test there runs a step.
Particles, too: their draws are of a key, and rounding moves an ancestor about once in a thousand million draws.
"""

import equinox as eqx
import jax
import numpy as np
import pytest
from recorded_numbers import check_declared, check_recorded, classes_of, unrecorded
from test_every_filter import CHANGES, FILTERS, GROUPS, MODELS, N, batch, noisier, recordings, same

from jaxveh import Recording, Result, filters, numerics, statespace
from jaxveh.filters import SquareRoot

FEW = filters.ParticleFilter(N, threshold=0.6)
MORE = {
    "Unscented, kappa": lambda: filters.Unscented(alpha=0.9, beta=1.5, kappa=1.0),
    "Gauss-Hermite of order 5": lambda: filters.GaussHermite(5),
    "gated, at once": lambda: filters.Gated(filters.Extended(), 1.0),
    "Huber, at once": lambda: filters.Huber(filters.Extended(), 0.5),
    "federated, fixed shares": lambda: filters.Federated(filters.Cubature(), GROUPS, (0.7, 0.3), reset=False),
    "federated, isolating": lambda: filters.Federated(filters.Cubature(), GROUPS, isolate=1.2, forgetting=0.5),
    "interacting, unequal start": lambda: filters.InteractingModels(
        filters.Extended(SquareRoot()), (same, noisier), CHANGES, (0.8, 0.2)
    ),
    "wavelet noise, quickly": lambda: filters.HaarNoise(filters.Extended(), window=4, fewest=2, initial=2.0),
    "Sage-Husa, quickly": lambda: filters.SageHusa(filters.Extended(), 0.7, 0.5, 2.0),
    "variational Bayes, quickly": lambda: filters.VariationalBayes(filters.Extended(), 0.8, 3.0, 2),
    "strong tracking, softly": lambda: filters.StrongTracking(filters.Extended(), 0.5, 1.5, 3.0),
    "matched process, quickly": lambda: filters.MatchedProcess(filters.Extended(), {"x0": 0.1, "x1": 0.2}, 0.6),
    "varying noise": lambda: filters.VaryingNoise(filters.Extended(), {"y0": "force"}, {"x0": "force"}),
    "paused": lambda: filters.Paused(filters.Extended(), "force", {"x0": 0.5}),
    "fixed lag, particles": lambda: filters.FixedLag(FEW, 2),
    "regularised by a bandwidth": lambda: filters.Regularised(FEW, 0.2),
    "Liu-West, all states": lambda: filters.LiuWest(FEW, 0.9, ("x0", "x1", "x2")),
    "bootstrap, seldom resampled": lambda: FEW,
    "bootstrap, multinomial": lambda: filters.ParticleFilter(N, numerics.multinomial),
    "bootstrap, stratified": lambda: filters.ParticleFilter(N, numerics.stratified),
    "bootstrap, residual": lambda: filters.ParticleFilter(N, numerics.residual),
    "softened, seldom resampled": lambda: filters.ParticleFilter(N, filters.Soft(0.7), 0.6),
    "optimal transport, seldom": lambda: filters.ParticleFilter(50, filters.Transport(0.2, 30), 0.6),
    "auxiliary, seldom resampled": lambda: filters.AuxiliaryParticleFilter(N, threshold=0.6),
    "auxiliary, wary": lambda: filters.AuxiliaryParticleFilter(
        N, lookahead=filters.PredictiveLikelihood(defensive=0.6)
    ),
    "auxiliary, to a point, wary": lambda: filters.AuxiliaryParticleFilter(
        N, lookahead=filters.PointLookahead(defensive=0.4)
    ),
    "guided, seldom resampled": lambda: filters.Guided(N, threshold=0.6),
    "guided, fully adapted, seldom": lambda: filters.Guided(N, "extended", auxiliary=True, threshold=0.6),
    "marginalised, seldom resampled": lambda: filters.Marginalised(N, ("x2",), threshold=0.6),
    "adaptive number, rarely many": lambda: filters.AdaptiveNumber(
        filters.ParticleFilter(N), {"x0": 0.5, "x1": 0.5, "x2": 0.5}, (20, 60, N), 0.1, 0.9
    ),
}


def test_every_filter_and_setting_has_numbers():
    """Most of those that `test_every_filter` compares are left to `-m full`."""
    assert not unrecorded("test_every_filter.py", FILTERS)
    assert not unrecorded(__file__, [*FILTERS, *MORE])


MAKERS = {name: line.make for name, line in FILTERS.items()} | MORE
FIRST = list({type(make()): name for name, make in reversed(MAKERS.items())}.values())
"""The first setting of every class."""

ROWS = 12


@eqx.filter_jit
def short(filter_, model, rows, key):
    """A recording's first rows, of which two say nothing."""
    estimate = filters.scan(filter_, model, rows, key)
    kept = estimate.mean, estimate.std, estimate.log_likelihood, estimate.info
    return jax.tree.map(lambda leaf: leaf[2::3] if leaf.ndim else leaf, kept)


@pytest.mark.whole
@pytest.mark.parametrize("name", FIRST)
def test_estimates_are_those_recorded(name):
    check_estimate(name)


@pytest.mark.parametrize("name", [name for name in MAKERS if name not in FIRST])
def test_estimates_by_other_settings_are_those_recorded(name):
    check_estimate(name)


def given(name):
    filter_, linear = MAKERS[name](), name in FILTERS and FILTERS[name].linear
    model, rows = batch("linear" if linear else "pendulum")
    rows = jax.tree.map(lambda leaf: leaf[0, :ROWS], rows)
    rows = rows._replace(u=jax.tree.map(lambda force: 0.1 + abs(force), rows.u))  # some filters take it for a spread
    return filter_, model, rows


def check_estimate(name):
    filter_, model, rows = given(name)
    filter_.check(model)
    check_recorded(__file__, name, short(filter_, model, rows, jax.random.key(5)))


@pytest.mark.whole
@pytest.mark.parametrize("name", FIRST)
def test_what_is_not_finite_has_a_code(name):
    """The estimate is of rows 2, 5, 8 and 11."""

    def codes(**changed):
        """By values, each at its row."""
        filter_, model, rows = given(name)
        for channel, (k, value) in changed.items():
            at = lambda rows, channel=channel: getattr(rows.u if channel == "force" else rows.y, channel)
            rows = eqx.tree_at(at, rows, at(rows).at[k].set(value))
        mean, _, _, info = short(filter_, model, rows, jax.random.key(5))
        told = np.asarray(info.result)
        assert (told != 0)[np.any(np.isnan(mean), axis=0)].all()
        assert (told != 0)[np.isinf(info.log_likelihood)].all()
        return told

    assert codes(y0=(5, np.inf)).tolist() == [0, Result.non_finite_input, 0, 0]
    lost = codes(force=(8, np.nan))
    assert lost[:2].tolist() == [0, 0] and lost[2] == Result.non_finite_input
    push = (4, 1e300)  # finite, its square is not
    assert codes(force=push)[0] == 0
    assert codes(force=push, y0=(5, np.inf))[1] == Result.non_finite_input
    assert codes(y0=(5, 1e200))[0] == 0


SMOOTHERS = {
    "Extended": (filters.Extended(), None, None),
    "Cubature, square root": (filters.Cubature(form=SquareRoot()), None, None),
    "Cubature, singular values": (filters.Cubature(form=filters.SingularValues()), None, None),
    "Gated": (filters.Gated(filters.Extended(), 2.0), None, None),
    "matched process": (filters.MatchedProcess(filters.Extended(), {"x0": 0.1}), None, None),
    "backward sampling": (filters.ParticleFilter(N), filters.BackwardSampling(20), None),
    "genealogy": (filters.AuxiliaryParticleFilter(N), filters.Genealogy(), None),
    "lag": (filters.Extended(), None, 3),
    "lag of particles": (filters.ParticleFilter(N), None, 3),
}


@pytest.mark.parametrize("name", SMOOTHERS)
def test_smoothed_estimates_are_those_recorded(name):
    filter_, method, lag = SMOOTHERS[name]
    model, recording = MODELS["pendulum"](), recordings("pendulum")[0]
    short = Recording(
        np.asarray(recording.time)[:ROWS], {n: np.asarray(recording[n])[:ROWS] for n in ("y0", "y1", "force")}
    )
    found = filters.smooth(filter_, model, short, key=jax.random.key(3), method=method, lag=lag)
    kept = jax.tree.map(lambda leaf: leaf[::3], (found.mean, found.std))
    check_recorded(__file__, f"smoothed: {name}", kept)


DECLARED = classes_of(filters, statespace)


@pytest.mark.parametrize("name", DECLARED)
def test_parameters_are_declared_as_recorded(name):
    check_declared(__file__, name, DECLARED[name])
