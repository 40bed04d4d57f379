"""Every filter, path smoother and model equals its copies and what a pickle of it gives back."""

import copy
import pickle

import pytest
from copies import check_copies, unset_fields
from families import left_out
from test_every_filter import FILTERS, MODELS

from jaxveh import filters, numerics

SCHEMES = (numerics.systematic, numerics.stratified, numerics.multinomial, numerics.residual)
OTHERS = {
    "paused": lambda: filters.Paused(filters.Kalman(), "braking", {"level": 100.0}),
    "varying noise": lambda: filters.VaryingNoise(filters.Extended(), {"y0": "force"}, {"x0": "force"}),
    "drawn paths": filters.BackwardSampling,
    "followed paths": filters.Genealogy,
    **{f"particles, {one.__name__}": lambda one=one: filters.ParticleFilter(10, one) for one in SCHEMES},
    **{f"the model, {name}": make for name, make in MODELS.items()},
}
ALL = {**{name: line.make for name, line in FILTERS.items()}, **OTHERS}


def test_every_filter_and_path_smoother_is_here():
    made = [make() for make in ALL.values()]
    assert not left_out("filters", filters.AbstractFilter, made, {})
    assert not left_out("filters", filters.AbstractPathSmoother, made, {})


@pytest.mark.parametrize("name", ALL)
def test_it_equals_its_copies(name):
    value = ALL[name]()
    check_copies(value)
    assert not unset_fields(value)


@pytest.mark.parametrize("name", ["ess", "normalise", *[one.__name__ for one in SCHEMES]])
def test_what_resampling_consists_of_is_a_plain_function(name):
    one = getattr(numerics, name)
    assert copy.deepcopy(one) is one and pickle.loads(pickle.dumps(one)) is one
