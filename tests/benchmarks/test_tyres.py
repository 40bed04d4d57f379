"""Three times MF-Tyre 6.1: the library, NumPy and the C++ limit give the same forces and moments."""

import jax
import numpy as np
import pytest

from benchmarks import limit, tyres
from benchmarks.mf_tyre_problem import COEFFICIENTS, contacts
from benchmarks.peers import numpy_mf_tyre

FIELDS = ("F_x", "F_y", "M_x", "M_y", "M_z")


@pytest.fixture(scope="module", autouse=True)
def double_precision():
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="module")
def given():
    return contacts(3001)  # no multiple of any vector width, so the last pack is cut


@pytest.fixture(scope="module")
def expected(given):
    return numpy_mf_tyre.forces(COEFFICIENTS, given)


def assert_same(found, expected, relative):
    for name, ours, theirs in zip(FIELDS, found, expected, strict=True):
        error = np.abs(np.asarray(ours) - theirs)
        # Where a force passes through zero, rounding is that of its terms.
        assert (error <= relative * (np.abs(theirs) + 1e-3 * np.abs(theirs).max())).all(), (name, error.max())


def test_ours_equals_numpy(given, expected):
    found = jax.jit(lambda tyre, contact: tyre.forces(contact))(tyres.tyre(np.float64), tyres.contact(given))
    assert_same(found, expected, 1e-9)


@pytest.mark.studies
@pytest.mark.skipif(limit.unavailable() is not None, reason=str(limit.unavailable()))
@pytest.mark.parametrize(
    "flags",
    [
        pytest.param((), id="native"),
        pytest.param(("-mno-avx512f",), id="avx2"),
        pytest.param(("-march=x86-64",), id="plain", marks=pytest.mark.full),
    ],
)
def test_limit_equals_numpy(given, expected, flags):
    assert_same(limit.mf_tyre(given, extra_flags=flags)(), expected, 1e-9)
    single = limit.mf_tyre(given, dtype=np.float32, extra_flags=flags)()
    for name, ours, theirs in zip(FIELDS, single, expected, strict=True):
        assert ours.dtype == np.float32
        assert np.abs(ours - theirs).max() < 1e-5 * np.abs(theirs).max(), name


def test_limits_hold_a_few_contacts_and_every_coefficient_counts(given):
    within = (given.slip_angle > -COEFFICIENTS["ALPMAX"]) & (given.speed > COEFFICIENTS["VXLOW"])
    assert 0.8 < within.mean() < 1
    contact = tyres.contact(given)
    weights = np.random.default_rng(1).standard_normal((5, len(given.load)))
    tyre = tyres.tyre(np.float64)
    gradient = jax.grad(tyres.weighted_sum)(tyre, contact, list(map(jax.numpy.asarray, weights)))
    sections = [getattr(gradient, name) for name in ("longitudinal", "lateral", "aligning", "overturning", "rolling")]
    found = {name: float(value) for section in sections for name, value in vars(section).items()}
    for name, slope in found.items():
        assert np.isfinite(slope), name
        assert (slope != 0) == (name in COEFFICIENTS), name


@pytest.mark.full
def test_gradient_in_blocks_is_the_plain_one(given):
    weights = [jax.numpy.asarray(w) for w in np.random.default_rng(1).standard_normal((5, len(given.load)))]
    arguments = tyres.tyre(np.float64), tyres.contact(given), weights
    found = jax.jit(jax.value_and_grad(tyres.weighted_sum_in_blocks, argnums=(0, 1)))(*arguments)
    expected = jax.jit(jax.value_and_grad(tyres.weighted_sum, argnums=(0, 1)))(*arguments)
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        # A coefficient's slope is a sum of signed terms: rounding is theirs.
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12 * max(1.0, np.abs(theirs).max()))


def test_numpy_in_single_precision_stays_there(given):
    found = numpy_mf_tyre.forces(COEFFICIENTS, contacts(50, dtype=np.float32))
    assert all(force.dtype == np.float32 for force in found)
