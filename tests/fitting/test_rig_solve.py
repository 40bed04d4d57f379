"""Normal equations of rig data against automatic differentiation, and the solver against scipy and the truth."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

from jaxveh._core.parameter import resolve
from jaxveh.fitting import rig_problem
from jaxveh.fitting.rig_problem import PULL, RigProblem, loss, normal_equations, spread_of, start_of
from jaxveh.tyres import Contact, MagicFormula

TRUE = MagicFormula(B=9.0, C=1.4, D=4000.0, E=-0.6, S_h=0.004, S_v=60.0, nominal_load=4000.0)
START = MagicFormula(B=13.0, C=1.1, D=2500.0, E=0.3, nominal_load=4000.0)


def made(rows, noise=20.0, robust=False, start=START):
    rng = np.random.default_rng(rows)
    contact = Contact(
        slip_angle=jnp.asarray(rng.uniform(-0.25, 0.25, rows)),
        slip_ratio=jnp.zeros(rows),
        load=jnp.asarray(rng.uniform(2000, 6000, rows)),
        camber=0.0,
    )
    measured = TRUE.forces(contact).F_y[None] + noise * rng.standard_normal((1, rows))
    weight = jnp.full((1, rows), 1 / 20.0).at[0, ::7].set(0.0)
    parameters = resolve(start, lambda law: (law.B, law.C, law.D, law.E, law.S_h, law.S_v))
    origin, scale = start_of(start, parameters)
    none = jnp.full_like(origin, jnp.inf)
    return RigProblem(
        start, contact, measured, weight, jnp.ones(1), origin, scale, origin, none, jnp.asarray(PULL), parameters, ("F_y",),
        robust,
    )  # fmt: skip


@eqx.filter_jit
def solve(problem, z, max_steps, tolerance):
    return problem.search(z, max_steps, tolerance)


def residuals(z, problem):
    force = problem.forces(problem.model_at(z))
    return problem.bend(problem.weight * (force - problem.measured))[0].reshape(-1)


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("rows", [60, 61])
def test_normal_equations_are_those_of_all_rows_at_once(rows, robust, monkeypatch):
    monkeypatch.setattr(rig_problem, "BLOCK", 20)
    problem, z = made(rows, robust=robust), jnp.asarray([0.1, -0.05, 0.2, 0.3, -0.4, 0.1])
    found = eqx.filter_jit(normal_equations)(z, problem)
    value, jacobian = eqx.filter_jit(lambda z: (residuals(z, problem), jax.jacfwd(residuals)(z, problem)))(z)
    total, gradient = eqx.filter_jit(lambda z: jax.value_and_grad(loss)(z, problem))(z)
    np.testing.assert_allclose(found.cost, 0.5 * value @ value + 0.5 * PULL**2 * z @ z, rtol=1e-13)
    np.testing.assert_allclose(found.cost, total, rtol=1e-13)
    np.testing.assert_allclose(found.gradient, gradient, rtol=1e-10)
    np.testing.assert_allclose(found.gradient, jacobian.T @ value + PULL**2 * z, rtol=1e-10)
    np.testing.assert_allclose(found.matrix, jacobian.T @ jacobian + PULL**2 * np.eye(6), rtol=1e-10, atol=1e-8)
    information = jacobian.T @ jacobian
    spread, known = eqx.filter_jit(spread_of)(z, problem)
    np.testing.assert_allclose(spread, np.linalg.inv(information + PULL**2 * np.eye(6)), rtol=1e-8, atol=1e-12)
    assert known == np.sum(np.linalg.eigvalsh(information) > 1)


def test_finds_the_least_squares_of_scipy():
    problem = made(300)
    solved = solve(problem, jnp.zeros(6), 100, 1e-12)
    both = lambda z: np.concatenate([residuals(jnp.asarray(z), problem), PULL * z])
    exact = scipy.optimize.least_squares(both, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-12)
    assert bool(solved.converged) and int(solved.steps) < 40
    np.testing.assert_allclose(loss(solved.z, problem), exact.cost, rtol=1e-10)
    np.testing.assert_allclose(solved.z, exact.x, atol=1e-4)


def test_finds_the_truth_without_noise():
    problem = made(300, noise=0.0)
    solved = solve(problem, jnp.zeros(6), 100, 1e-10)
    found = problem.model_at(solved.z)
    # What is left is the pull to the start.
    for name, tolerance in (("B", 2e-3), ("C", 2e-3), ("D", 1e-3), ("E", 1e-2), ("S_h", 2e-3), ("S_v", 2e-2)):
        assert float(getattr(found, name)) == pytest.approx(float(getattr(TRUE, name)), rel=tolerance), name


def test_stops_where_it_starts_and_where_it_is_told():
    problem = made(300)
    end = solve(problem, jnp.zeros(6), 100, 1e-10).z
    again = solve(problem, end + 1e-6, 100, 1e-7)
    assert bool(again.converged) and int(again.steps) == 1
    np.testing.assert_allclose(again.z, end, atol=1e-4)
    short = solve(problem, jnp.zeros(6), 2, 1e-10)
    assert not bool(short.converged) and int(short.steps) == 2
    assert loss(end, problem) < loss(short.z, problem) < loss(jnp.zeros(6), problem)


def test_a_step_into_nowhere_is_refused():
    # All but no force: the first steps go where D's exponential overflows.
    problem = made(300, start=MagicFormula(B=200.0, C=0.05, D=1.0, E=0.9, nominal_load=4000.0))
    solved = solve(problem, jnp.zeros(6), 200, 1e-7)
    assert np.isfinite(solved.z).all()
    assert loss(solved.z, problem) < loss(jnp.zeros(6), problem)
