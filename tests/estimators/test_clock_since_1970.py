"""In float32, stamps of a clock since 1970 are a hundred seconds apart: whatever reads a log counts from its first row."""

from types import ModuleType

import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
import test_sideslip

from jaxveh import Recording, estimators, vehicles

QUANTITIES = {
    name: module
    for name in estimators.__all__
    if isinstance(module := getattr(estimators, name), ModuleType) and hasattr(module, "METHODS")
}
SINCE_1970 = 1.7e9


@pytest.fixture(scope="module")
def drive():
    """Time and channels; made in float64, as they are kept for other tests."""
    log = test_sideslip.log(300).without("v_y")
    return np.asarray(log.time), {name: np.asarray(values, np.float32) for name, values in log.channels.items()}


@pytest.fixture(autouse=True)
def float32(drive):
    with jax.enable_x64(False):
        yield


def late(log):
    return Recording(np.asarray(log.time) + SINCE_1970, dict(log.channels))


def assert_the_same(read, log):
    """The stamps are rounded to a quarter of a microsecond, a step of a log to some 3e-5."""
    near, far = read(log), read(late(log))
    leaves = [leaf for leaf in jax.tree.leaves(near) if jnp.issubdtype(leaf.dtype, jnp.inexact)]
    assert leaves and all(np.isfinite(leaf).any() for leaf in leaves)
    for one, other in zip(jax.tree.leaves(near), jax.tree.leaves(far), strict=True):
        scale = np.nanmax(np.abs(one), initial=1e-6)
        np.testing.assert_allclose(other, one, rtol=2e-3, atol=2e-3 * scale)


@pytest.mark.product
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_method(quantity):
    module = QUANTITIES[quantity]
    log = method_logs.log(module.METHODS[module.RECOMMENDED].make(method_logs.CAR).needs)
    assert_the_same(lambda log: module.estimate(method_logs.CAR, log, method=module.RECOMMENDED).mean, log)


@pytest.mark.parametrize("smoothed", [pytest.param(True, marks=pytest.mark.thorough), False])
def test_an_estimate_with_bands(smoothed, drive):
    def read(log):
        found = estimators.sideslip.estimate(test_sideslip.CAR, log, smoothed=smoothed)
        return found.mean.sideslip, found.std.sideslip

    assert_the_same(read, Recording(*drive))


def test_an_open_loop(drive):
    car = vehicles.linear_single_track(vehicles.passenger_car())
    assert_the_same(lambda log: estimators.open_loop(car, log), Recording(*drive))
