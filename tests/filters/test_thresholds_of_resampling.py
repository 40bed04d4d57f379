"""A particle filter resamples where the effective sample size is below its threshold times the number of particles."""

import dataclasses
import inspect

import jax
import numpy as np
import pytest
from families import wanting
from test_lost_particles import GAPS, model_with

from jaxveh import filters, numerics

pytestmark = pytest.mark.whole

N, KEY = 40, jax.random.key(4)
FILTERS = {
    "ParticleFilter": lambda **more: filters.ParticleFilter(N, **more),
    "AuxiliaryParticleFilter": lambda **more: filters.AuxiliaryParticleFilter(N, **more),
    "Guided": lambda **more: filters.Guided(N, **more),
    "Marginalised": lambda **more: filters.Marginalised(N, ("drift",), **more),
}
MODEL = model_with(np.array(-1e9))
FIRST, NEXT = (jax.tree.map(lambda leaf, k=k: leaf[k], MODEL.rows(GAPS)) for k in (0, 2))


def fields(name):
    one = getattr(filters, name)
    return (
        {field.name for field in dataclasses.fields(one)}
        if inspect.isclass(one) and dataclasses.is_dataclass(one)
        else set()
    )


def test_every_filter_with_a_threshold_has_a_line():
    assert not wanting(
        {name for name in filters.__all__ if {"particles", "threshold"} <= fields(name)}, set(FILTERS), {}
    )


@pytest.mark.parametrize("name", FILTERS)
def test_it_resamples_below_its_threshold_alone(name):
    make = FILTERS[name]
    belief = jax.jit(lambda: make().init(MODEL, FIRST, KEY)[0])()
    judges = jax.jit(lambda belief: make()._predict(MODEL, belief, NEXT).stage.weights)
    judged = judges(belief) if name == "AuxiliaryParticleFilter" else belief.weights
    share = float(numerics.ess(judged)) / N
    assert 0.1 < share < 0.98
    for threshold, resamples in ((0.99 * share, False), (1.01 * share, True)):
        after = jax.jit(lambda belief, by=threshold: make(threshold=by).step(MODEL, belief, NEXT)[0])(belief)
        assert np.any(np.asarray(after.ancestors) != np.arange(N)) == resamples
