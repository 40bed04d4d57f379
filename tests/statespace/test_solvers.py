"""Every solver of the package: its order, where it decays, both modes of differentiation."""

from fractions import Fraction

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import statespace
from jaxveh.simulation import stiffness
from jaxveh.statespace import solvers, stabilised

SOLVERS = [
    kind
    for name in statespace.__all__
    if isinstance(kind := getattr(statespace, name), type) and issubclass(kind, solvers.AbstractOneStep)
]


def tableau():
    """The stabilised method's coefficients: of its stages (8, 8) and of its end (8,)."""
    increment, reached = np.zeros(8), [np.zeros(8)]
    for i, (kept, weight) in enumerate(zip(stabilised.CARRIED, stabilised.WEIGHTS, strict=True)):
        increment = kept * increment + np.eye(8)[i]
        reached.append(reached[-1] + weight * increment)
    return np.stack(reached[:-1]), reached[-1]


def growth(kind, products):
    """The factor by which one step multiplies x where dx/dt = pole x, for products of pole and step (n,)."""

    def step(product):
        term = diffrax.ODETerm(lambda t, x, args: jnp.stack([
            product.real * x[0] - product.imag * x[1], product.imag * x[0] + product.real * x[1]
        ]))  # fmt: skip
        return kind().step(term, 0.0, 1.0, jnp.asarray([1.0, 0.0]), None, None, made_jump=False)[0]

    return np.linalg.norm(jax.jit(jax.vmap(step))(jnp.asarray(products, complex)), axis=1)


def test_all_solvers_are_here():
    assert {kind.__name__ for kind in SOLVERS} >= {"RK4", "RolledRK4", "StabilisedRK4", "Heun"}


@pytest.mark.parametrize("kind", SOLVERS)
def test_the_error_falls_with_the_order(kind):
    """On x' = x cos(t + x), whose right side depends on the time and is not linear."""
    term = diffrax.ODETerm(lambda t, x, args: args * x * jnp.cos(t + x))

    def end(steps, share):
        def one(i, x):
            at = 2.0 * i / steps, 2.0 * (i + 1) / steps
            return kind().step(term, *at, x, share, None, made_jump=False)[0]

        return jax.lax.fori_loop(0, steps, one, 0.7)

    ends = np.asarray(jax.jit(lambda share: jnp.stack([end(steps, share) for steps in (16, 32, 64, 4000)]))(1.0))
    errors = np.abs(ends[:3] - ends[3])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), kind.step_order, atol=0.35)


@pytest.mark.parametrize("kind", SOLVERS)
def test_the_limits_are_those_of_the_method(kind):
    """Up to the stable limit real poles decay; the limit itself is no more than 3 per cent below that of the method."""
    limit, stable = stiffness.limits(kind())
    assert np.max(growth(kind, -np.linspace(0.2, stable, 400))) < 0.85
    assert np.max(growth(kind, -np.linspace(0.2, limit, 400))) <= 1.0
    assert growth(kind, [-1.03 * limit])[0] > 1.0


def test_the_stabilised_method_solves_the_conditions_of_fourth_order():
    """J. C. Butcher, Numerical Methods for Ordinary Differential Equations, table 310(II)."""
    a, b = tableau()
    c = a.sum(axis=1)
    np.testing.assert_allclose(stabilised.abscissae(), c, rtol=1e-14, atol=1e-16)
    found = [b.sum(), b @ c, b @ c**2, b @ a @ c, b @ c**3, (b * c) @ a @ c, b @ a @ c**2, b @ a @ a @ c]
    expected = [float(Fraction(1, n)) for n in (1, 2, 3, 6, 4, 8, 12, 24)]
    np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_the_stabilised_method_decays_where_it_says():
    kind = statespace.StabilisedRK4
    assert np.max(growth(kind, -np.linspace(1.5, 18.1, 500))) < 0.61
    assert np.max(growth(kind, 1j * np.linspace(0.0, 3.7, 200))) <= 1.0 + 1e-12
    for degrees, reach in ((10.0, 10.0), (30.0, 5.0), (45.0, 4.4)):
        along = -np.exp(1j * np.deg2rad(degrees)) * np.linspace(0.01, reach, 200)
        assert np.max(growth(kind, along)) <= 1.0
    a, _ = tableau()
    for product in -np.linspace(0.0, 18.0, 50):
        stages = np.linalg.solve(np.eye(8) - product * a, np.ones(8))
        assert np.max(np.abs(stages)) < 1.05
