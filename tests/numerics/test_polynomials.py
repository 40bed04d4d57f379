"""The stored coefficients are those of the recipe, and are as accurate as their precision asks."""

import importlib.util
import itertools
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from jaxveh.numerics import polynomials


def _recipe() -> ModuleType:
    specification = importlib.util.spec_from_file_location("coefficients", Path(__file__).with_name("coefficients.py"))
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


RECIPES = _recipe().RECIPES


@pytest.mark.parametrize("name", RECIPES)
def test_coefficients_are_those_of_the_recipe(name):
    bound = RECIPES[name][1]
    recomputed = _recipe().chebyshev_interpolant(*RECIPES[name])
    stored = np.asarray(getattr(polynomials, name))
    assert stored.shape == recomputed.shape
    t = np.linspace(0.0, bound, 1001)
    difference = np.polynomial.polynomial.polyval(t, (stored - recomputed).astype(float))
    assert np.max(np.abs(difference)) < 1e-16


@pytest.mark.parametrize("name", RECIPES)
def test_error_of_the_polynomial_is_below_the_type_s(name):
    function, bound = RECIPES[name][:2]
    t = np.linspace(0.0, bound, 20001).astype(np.longdouble)
    stored = np.asarray(getattr(polynomials, name), np.longdouble)
    error = t * np.abs(np.polynomial.polynomial.polyval(t, stored) - function(t))
    if "COSINE" not in name:
        error = error * np.sqrt(t)
    assert np.max(error) < (3e-8 if name.endswith("32") else 1e-16)


def test_evaluation_is_that_of_the_polynomial():
    coefficients = (1.0, -2.0, 3.0, 0.5, -0.25)
    t = np.linspace(-1.0, 1.0, 11)
    for count in (1, 3, 4, 5):
        expected = np.polynomial.polynomial.polyval(t, coefficients[:count])
        np.testing.assert_allclose(polynomials.evaluate(coefficients[:count], t), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("fused", list(itertools.product((False, True), repeat=3)))
def test_the_sine_of_a_quarter_turn_is_one_in_float32_fused_or_not(fused):
    """As `elementary` evaluates it; products of float32 are exact in float64."""
    of_pairs, of_halves, last = fused
    wide = lambda value: np.float64(np.float32(value))
    multiply = lambda a, b: wide(a * b)
    add = lambda a, b, c, fused: wide(a * b + c) if fused else wide(multiply(a, b) + c)
    c, r = [wide(one) for one in polynomials.SINE_32], wide(np.pi / 2)
    t = multiply(r, r)
    even, odd = (add(c[k + 2], multiply(t, t), c[k], of_pairs) for k in (0, 1))
    assert add(multiply(r, t), add(odd, t, even, of_halves), r, last) == 1.0
