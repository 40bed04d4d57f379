"""One step of every particle filter is importance sampling: ancestors, moves and weights beside the densities in NumPy."""

import dataclasses
import functools

import jax
import numpy as np
import pytest
from families import wanting
from test_smoothers_of_one_state import KEY, MODEL, TIME, Q, R

from jaxveh import Recording, filters
from jaxveh.filters import PointLookahead, Soft

pytestmark = pytest.mark.whole

N, SHARE = 6, 0.6
FILTERS = {
    "ParticleFilter": lambda **more: filters.ParticleFilter(N, **more),
    "AuxiliaryParticleFilter": lambda **more: filters.AuxiliaryParticleFilter(N, **more),
    "AuxiliaryParticleFilter, to a point": lambda **more: filters.AuxiliaryParticleFilter(
        N, lookahead=PointLookahead(defensive=0.3), **more
    ),
    "Guided": lambda **more: filters.Guided(N, **more),
    "Guided, auxiliary": lambda **more: filters.Guided(N, "unscented", auxiliary=True, **more),
}
OTHERS = {"Marginalised": "has a Kalman filter within: test_thresholds_of_resampling, on record"}
WAYS = {
    "always": {},
    "never": {"threshold": 1e-9},
    "softly": {"resampling": Soft(SHARE)},
}
ROWS = MODEL.rows(Recording(TIME[:2], {"flow": np.array([9.0, 4.0])}))
DT = TIME[1] - TIME[0]

FORESEEN = {
    "AuxiliaryParticleFilter": (0.3, Q * DT + R),
    "AuxiliaryParticleFilter, to a point": (0.3, R),
    "Guided, auxiliary": (0.0, Q * DT + R),
}
"""The share of ancestors that are drawn by their weights alone (of other filters all are), and the variance with which the next
measurement is foreseen."""


def normal(y, mean, variance):
    return np.exp(-0.5 * (y - mean) ** 2 / variance) / np.sqrt(2.0 * np.pi * variance)


def test_every_filter_that_draws_ancestors_is_here():
    kinds = {name: getattr(filters, name) for name in filters.__all__}
    drawn = {
        name
        for name, kind in kinds.items()
        if dataclasses.is_dataclass(kind) and {"particles", "threshold"} <= kind.__dataclass_fields__.keys()
    }
    assert not wanting(drawn, {name.partition(",")[0] for name in FILTERS} | set(OTHERS), {})


FIRST, ROW = (jax.tree.map(lambda leaf, k=k: leaf[k], ROWS) for k in (0, 1))


@functools.cache
def first_belief(name):
    return jax.jit(lambda: FILTERS[name]().init(MODEL, FIRST, KEY)[0])()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", FILTERS)
def test_weights_are_densities_over_chances(name, way):
    filter_ = FILTERS[name](**WAYS[way])
    belief = first_belief(name)
    before, w = np.asarray(belief.particles.level), np.asarray(belief.weights)
    step = lambda belief: (filter_._predict(MODEL, belief, ROW), *filter_.step(MODEL, belief, ROW))
    predicted, after, info = jax.jit(step)(belief)
    x, chosen = np.asarray(after.particles.level), np.asarray(after.ancestors)
    y, ahead = float(ROW.y.flow), (1.0 - 0.2 * DT) * before[chosen]
    alone, variance = FORESEEN.get(name, (1.0, R))
    foreseen = normal(y, (1.0 - 0.2 * DT) * before, variance)
    chances = w * (alone + (1.0 - alone) * foreseen / np.sum(w * foreseen))
    if hasattr(predicted, "stage"):
        np.testing.assert_allclose(predicted.stage.weights, chances, rtol=1e-9)
    if way == "softly":
        chances = SHARE * chances + (1.0 - SHARE) / N
    # A guided move is drawn from p(x | before, y), so that what is left of the densities is p(y | before).
    density = normal(y, ahead, Q * DT + R) if "Guided" in name else normal(y, x, R)
    kept = w if way == "never" else (w / (N * chances))[chosen]
    np.testing.assert_allclose(after.weights, kept * density / np.sum(kept * density), rtol=1e-9)
    np.testing.assert_allclose(info.log_likelihood, np.log(np.sum(kept * density)), rtol=1e-9)
    assert np.ptp(w) > 0.05 and (way != "never" or (chosen == np.arange(N)).all())
    np.testing.assert_allclose(x - ahead, 0.0, atol=5.0 * np.sqrt(Q * DT))
