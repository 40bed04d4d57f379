"""Every method of every quantity is a contestant, or says why not."""

import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks import methods
from benchmarks.measure import Contestant, Skipped
from jaxveh import estimators

pytestmark = pytest.mark.thorough

QUANTITIES = [getattr(estimators, name) for name in estimators.__all__ if hasattr(getattr(estimators, name), "METHODS")]


@pytest.fixture(scope="module")
def invented():
    """Twenty rows of every channel that a method needs."""
    [car] = methods.told_cars(methods.CAR)
    made = [kind.make(car) for module in QUANTITIES for kind in module.METHODS.values()]
    values = np.random.default_rng(0).normal(size=20)
    drive = {need.channel: jnp.asarray(0.01 * values) for one in made for need in one.needs}
    return drive | {"true.v_x": jnp.asarray(20 + 0.1 * values)}


def test_a_quantity_is_a_case_with_all_its_methods(invented, monkeypatch):
    monkeypatch.setattr(methods, "_drive", lambda: invented)
    cases = methods.cases(smoke=False)
    assert [case.name for case in cases] == [f"methods/{module.NAME}" for module in QUANTITIES]
    for case, module in zip(cases, QUANTITIES, strict=True):
        found = case.build()
        assert [one.name for one in found] == list(module.METHODS)
        assert all(isinstance(one, Contestant) and one.units == 20 for one in found)
        assert case.base in module.METHODS
    answer = cases[0].build()[0].call(0)
    assert all(np.isfinite(values).all() for values in answer.mean)


def test_a_method_without_its_channels_is_left_out_with_the_reason(invented, monkeypatch):
    lacking = {name: values for name, values in invented.items() if name not in ("course", "v_x")}
    monkeypatch.setattr(methods, "_drive", lambda: lacking)
    found = {one.name: one for one in methods._methods(estimators.navigation)}
    reasons = [one.reason for one in found.values() if isinstance(one, Skipped)]
    assert reasons and all("the drive has no course" in reason for reason in reasons)
