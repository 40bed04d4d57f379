"""Every fit of `fitting.__all__`: one shape of result; its core under jit, vmap and grad, against differences.

A new fit is one line in `CASES`: its problem, its program on the same problem, and where the problem keeps data, noise and prior.

What compiles is shared: one `fitting.solve` a case, at the case's tolerance, and one linearisation for derivatives in both modes.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
from fit_systems import drive, plain
from nile import NILE
from rig_sweeps import brush, measured_of, small_plan, table
from test_maximum_likelihood import LEVELS
from test_maximum_likelihood import model as diffuse

from jaxveh import InputError, Parameters, Recording, filters, fitting, io, tyres
from jaxveh.fitting.solve import MOST_STEPS, optimum

FILTER = filters.Unscented()
YEARS = Recording(np.arange(1871.0, 1911.0), {"flow": NILE[:40]})
PENDULUM = lambda m: (m.system.k, m.system.d)
NOISE = {"F_x": 60.0, "F_y": 50.0, "M_z": 3.0}
FRICTION = lambda tyre: {"along": tyre.slip_stiffness, "friction": tyre.friction}


def nile():
    """The Nile's level, of which something is known before: what that is shows in the fit."""
    known = jnp.asarray(1000.0, float), jnp.asarray(150.0, float)
    return eqx.tree_at(lambda m: (m.prior.mean.level, m.prior.law.std.level), diffuse(), known)


def a_rig(points=8):
    columns, run = small_plan(points)
    return table(measured_of(brush(), columns, tuple(NOISE)), columns, run, 0.02, 1)


def a_law():
    return tyres.Brush(jnp.asarray(8e4), jnp.asarray(7e4), jnp.asarray(0.9), jnp.asarray(0.06))


class Case(NamedTuple):
    """`pose(prior)` makes the problem, `fit(max_steps)` runs the program; `data`, `noise` and `prior` pick one leaf each of the
    problem."""

    pose: Callable
    fit: Callable
    data: Callable
    noise: Callable
    prior: Callable
    tolerance: float


PIECES = [drive(21, seed=1), drive(21, seed=2)]
CASES = {
    "fit_rig": Case(
        lambda prior=0.02: fitting.pose_rig(a_law(), a_rig(), noise=NOISE, where=FRICTION, prior=prior),
        lambda **more: fitting.fit_rig(a_law(), a_rig(), where=FRICTION, prior=0.02, **more),
        lambda p: p.measured, lambda p: p.weight, lambda p: p.spread, 1e-12,
    ),
    "multiple_shooting": Case(
        lambda prior=0.5: fitting.pose_shooting(plain(), fitting.cut(plain(), PIECES, 1.0), PENDULUM, prior=prior, tie=0.1),
        lambda max_steps=MOST_STEPS: fitting.multiple_shooting(
            plain(), PIECES, PENDULUM, prior=0.5, window=1.0, tie=0.1, max_steps=max_steps
        ),
        lambda p: p.segments.rows.y.rate, lambda p: p.model.measurement_noise.std.rate, lambda p: p.prior, 1e-12,
    ),
    "maximum_likelihood": Case(
        lambda prior=0.3: fitting.pose_likelihood(FILTER, nile(), YEARS, LEVELS, prior=prior),
        lambda **more: fitting.maximum_likelihood(FILTER, nile(), YEARS, LEVELS, prior=0.3, **more),
        lambda p: p.rows[0].y.flow, lambda p: p.model.prior.law.std.level, lambda p: p.spread, 1e-12,
    ),
    "prediction_error": Case(
        lambda prior=0.3: fitting.pose_prediction_error(FILTER, nile(), YEARS, LEVELS, prior=prior),
        lambda **more: fitting.prediction_error(FILTER, nile(), YEARS, LEVELS, prior=0.3, tolerance=1e-6, **more),
        lambda p: p.rows.y.flow, lambda p: p.model.prior.law.std.level, lambda p: p.spread, 1e-12,
    ),
}  # fmt: skip


def returned(name):
    """What a function says that it returns, as text."""
    return str(getattr(getattr(fitting, name), "__annotations__", {}).get("return", ""))


FITS = [name for name in fitting.__all__ if name != "solve" and returned(name).endswith("Fit")]
PROBLEMS = [
    one
    for one in map(vars(fitting).get, fitting.__all__)
    if isinstance(one, type) and issubclass(one, fitting.AbstractProblem) and one is not fitting.AbstractProblem
]


@pytest.fixture(scope="module", params=sorted({*FITS, *CASES}))
def case(request):
    return CASES[request.param]


@pytest.fixture(scope="module")
def problem(case):
    return case.pose()


@pytest.fixture(scope="module")
def changed(case, problem):
    """The problem with its data, noise and prior changed by the three numbers of an array, data each by another share."""

    def change(by):
        data, noise, prior = case.data(problem), case.noise(problem), case.prior(problem)
        wave = 1 + by[0] * jnp.sin(jnp.arange(data.size, dtype=data.dtype)).reshape(data.shape)
        new = jnp.where(jnp.isfinite(data), data, 0) * wave
        new = jnp.where(jnp.isfinite(data), new, data), noise * jnp.exp(by[1]), prior * jnp.exp(by[2])
        return eqx.tree_at(lambda p: (case.data(p), case.noise(p), case.prior(p)), problem, new)

    return change


@pytest.fixture(scope="module")
def core(case, changed):
    """The fitted parameters (p,) on their line, a function of the three numbers."""
    return lambda by: fitting.solve(changed(by), tolerance=case.tolerance).unconstrained


@pytest.fixture(scope="module")
def own(case):
    """What the fit's own program found."""
    return case.fit()


@pytest.fixture(scope="module")
def solved(case, problem):
    return fitting.solve(problem, tolerance=case.tolerance)


@pytest.fixture(scope="module")
def slopes(core):
    """The program of the derivatives (p, 3) of the fitted parameters: in forward mode, and in reverse mode."""

    def both(by):
        along = jax.linearize(core, by)[1]
        against = jax.linear_transpose(along, by)
        return jax.vmap(along, out_axes=1)(jnp.eye(3)), jax.vmap(against)(jnp.eye(2))[0]

    return jax.jit(both).lower(jnp.zeros(3))


@pytest.mark.parametrize("suffix", io.kit.RESULT_SUFFIXES)
def test_a_fit_comes_back_from_a_file(own, suffix, tmp_path):
    pytest.importorskip({".nc": "h5netcdf", ".parquet": "pyarrow"}[suffix])
    own.save(tmp_path / f"fit{suffix}")
    again = type(own).load(tmp_path / f"fit{suffix}")
    for name in ("parameters", "parameters_std", "unconstrained", "covariance", "cost", "steps", "result"):
        first, second = jax.tree.leaves(getattr(own, name)), jax.tree.leaves(getattr(again, name))
        assert all(
            type(a) is type(b) and np.array_equal(a, b, equal_nan=True) for a, b in zip(first, second, strict=True)
        ), name
    assert again.chosen == own.chosen and repr(again) == repr(own)
    pytest.importorskip("pandas").testing.assert_frame_equal(again.to_pandas(), own.to_pandas())
    # Any model of its structure will do: all of its numbers are those of the fit.
    model = again.with_model(jax.tree.map(jnp.zeros_like, own.model)).model
    assert jax.tree.structure(model) == jax.tree.structure(own.model)
    assert all(np.array_equal(a, b) for a, b in zip(jax.tree.leaves(model), jax.tree.leaves(own.model), strict=True))


def test_every_fit_and_every_problem_has_a_case():
    assert set(FITS) == set(CASES)
    assert {type(case.pose()) for case in CASES.values()} == set(PROBLEMS)


@pytest.mark.parametrize("by", ["program", "core"])
def test_results_have_one_shape(problem, own, solved, by):
    fit = own if by == "program" else solved
    p = len(fit.names)
    assert isinstance(fit, fitting.AbstractFit) and p == 2 == len(fit.chosen)
    for found in (fit.parameters, fit.parameters_std):
        assert isinstance(found, Parameters) and tuple(found) == fit.names == tuple(q.name for q in problem.chosen)
    values, std = fit.parameters.array(), fit.parameters_std.array()
    assert values.shape == std.shape == fit.unconstrained.shape == (p,) and (std > 0).all()
    assert fit.covariance.shape == (p, p)
    np.testing.assert_allclose(fit.covariance, fit.covariance.T, rtol=1e-6)
    lines = [q.domain.forward(z) for q, z in zip(fit.chosen, fit.unconstrained, strict=True)]
    np.testing.assert_allclose(values, lines, rtol=1e-12)
    slopes = [q.domain.slope(value) for q, value in zip(fit.chosen, values, strict=True)]
    np.testing.assert_allclose(std, np.abs(slopes) * np.sqrt(np.diagonal(fit.covariance)), rtol=1e-9)
    assert bool(fit.converged) and int(fit.steps) > 0 and fit.reason == "successful" and np.isfinite(fit.cost)


def test_a_search_that_stops_short_says_so(case, problem):
    fit = fitting.solve(problem, max_steps=1, tolerance=1e-14, standard_errors=False)
    assert not bool(fit.converged) and "stopped before its tolerance" in fit.reason
    assert all(np.isnan(leaf) for leaf in jax.tree.leaves(fit.parameters_std))


@pytest.mark.thorough
def test_what_a_search_says_of_its_end_is_so(case, problem):
    """Cost and uncertainty that a search knows are used as they are, also where it stops short of the optimum."""
    found = jax.jit(lambda start: problem.search(start, 3, case.tolerance))(problem.start())
    np.testing.assert_allclose(found.cost, jax.jit(lambda z: problem.cost(z))(found.z), rtol=1e-10)
    if found.uncertainty is not None:
        there = jax.jit(lambda z: problem.covariance(z))(found.z)
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-7, atol=1e-14), found.uncertainty, there)


def test_no_step_at_all_is_refused(case, problem):
    """A search that takes no step knows nothing of its end."""
    with pytest.raises(InputError, match="max_steps = 0: must be"):
        case.fit(max_steps=0)
    with pytest.raises(InputError, match="max_steps = 0: must be"):
        fitting.bootstrap(problem, jax.random.key(0), max_steps=0)
    for most in (0, 2.5):
        with pytest.raises(InputError, match=f"max_steps = {most}: must be a whole number of at least 1"):
            fitting.solve(problem, max_steps=most)


def test_derivatives_equal_differences(problem, changed, slopes):
    """With respect to data, noise and prior, of parameters: in reverse mode, and in forward mode."""
    h = 2e-3
    cost = jax.jit(jax.value_and_grad(lambda z, by: changed(by).cost(z)))
    steepness = lambda z, by: np.asarray(cost(z, by)[1])
    # A search ends where its cost shows no more gain, at half of the digits: steps of Newton's are the rest.
    middle, step = least(lambda z: cost(z, np.zeros(3)), np.asarray(problem.start())), 1e-5
    sides = [
        (steepness(middle + step * e, np.zeros(3)), steepness(middle - step * e, np.zeros(3)))
        for e in np.eye(middle.size)
    ]
    inverse = np.linalg.inv([np.subtract(*ends) / (2 * step) for ends in sides])

    def exactly(by):
        z = middle
        for _ in range(12):
            z = z - steepness(z, by) @ inverse
        return np.asarray(problem.line(z))

    near, back, far, behind = ([exactly(share * e) for e in np.eye(3)] for share in (h, -h, 2 * h, -2 * h))
    differences = ((8 * np.subtract(near, back) - np.subtract(far, behind)) / (12 * h)).T
    forward, reverse = slopes.compile()(jnp.zeros(3))
    assert (np.abs(differences) > 1e-5).all()
    np.testing.assert_allclose(reverse, differences, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(forward, reverse, rtol=1e-8)


def test_cost_and_uncertainty_are_those_of_the_problem_at_the_optimum(case, problem, solved):
    """Whether the search knew them or not."""
    z = eqx.filter_jit(optimum)(problem, problem.start(), max_steps=MOST_STEPS, tolerance=jnp.asarray(case.tolerance)).z
    cost, (covariance, _) = eqx.filter_jit(lambda problem: (problem.cost(z), problem.covariance(z)))(problem)
    np.testing.assert_allclose(solved.cost, cost, rtol=1e-10)
    np.testing.assert_allclose(solved.covariance, covariance, rtol=1e-6)


def test_derivatives_of_cost_and_uncertainty_equal_differences(case, changed):
    """With respect to data, noise and prior together."""

    def fitted(share):
        fit = fitting.solve(changed(share * jnp.asarray([0.3, 1.0, -0.5])), tolerance=case.tolerance)
        return jnp.append(fit.covariance.ravel(), fit.cost)

    compiled, h = jax.jit(fitted), 2e-3
    _, slope = jax.jit(lambda: jax.jvp(fitted, (jnp.asarray(0.0),), (jnp.asarray(1.0),)))()
    near, back, far, behind = (compiled(jnp.asarray(share)) for share in (h, -h, 2 * h, -2 * h))
    difference = (8 * (near - back) - (far - behind)) / (12 * h)
    assert (np.abs(difference) > 1e-9).all()
    np.testing.assert_allclose(slope, difference, rtol=1e-3, atol=1e-3 * np.abs(difference[:-1]).max())


def least(cost_and_slope, start):
    """The optimum by scipy."""
    both = lambda z: tuple(np.asarray(one) for one in cost_and_slope(z))
    return scipy.optimize.minimize(both, start, jac=True, method="BFGS").x


def test_a_batch_is_its_members(case, solved, changed, core):
    points = np.asarray([[0.0, 0.0, 0.0], [0.02, -0.1, 0.1]])
    other = fitting.solve(eqx.filter_jit(changed)(points[1]), tolerance=case.tolerance)
    alone = [solved.unconstrained, other.unconstrained]
    np.testing.assert_allclose(jax.jit(jax.vmap(core))(points), alone, rtol=1e-6)


def test_derivatives_are_a_program_of_at_most_three_fits(case, changed, slopes):
    fit = lambda by: jax.tree.leaves(eqx.filter(fitting.solve(changed(by), tolerance=case.tolerance), eqx.is_array))
    assert len(slopes.as_text()) < 3 * len(jax.jit(fit).lower(jnp.zeros(3)).as_text())


def test_parts_of_the_data_count_as_often_as_they_are_told(problem):
    units = problem.units()
    one, other = np.random.default_rng(0).integers(0, 4, (2, units)).astype(float)
    cost = jax.jit(lambda counts: problem.with_counts(counts).cost(problem.start()))
    assert cost(one) + cost(other) == pytest.approx(float(cost(one + other) + cost(0 * one)), rel=1e-9)
    assert cost(np.ones(units)) == pytest.approx(float(jax.jit(lambda: problem.cost(problem.start()))()), rel=1e-12)


def test_program_and_core_end_alike(case, problem, own, solved):
    if isinstance(problem, fitting.RigProblem):
        # Where the fit ended, with its noise: its last round pulled to where it began.
        solved = fitting.solve(own.problem, tolerance=case.tolerance)
    off = np.subtract(jax.tree.leaves(solved.parameters), jax.tree.leaves(own.parameters))
    assert (np.abs(off) < 0.05 * np.asarray(jax.tree.leaves(own.parameters_std))).all()


@pytest.mark.parametrize(("prior", "message"), [(-1.0, "prior spread of"), ({"nothing": 1.0}, "prior: unknown")])
def test_a_prior_is_a_number_or_numbers_by_name(case, problem, prior, message):
    with pytest.raises(InputError, match=message):
        case.pose(prior)
    by_name = case.pose(dict.fromkeys([p.name for p in problem.chosen], 0.4))
    for one, other in zip(
        *(jax.tree.leaves(eqx.filter(p, eqx.is_array)) for p in (by_name, case.pose(0.4))), strict=True
    ):
        np.testing.assert_array_equal(one, other)


RIG = a_rig()
REFUSED = {
    "fit_rig": lambda value: fitting.fit_rig(
        dataclasses.replace(a_law(), friction=value), RIG, where=FRICTION, prior=0.02
    )
}
"""Programs that run on the host, as a function of a number."""


TRACED = {
    "multiple_shooting": lambda: (
        jnp.asarray(PIECES[0]["rate"]),
        lambda rate: fitting.multiple_shooting(
            plain(),
            [PIECES[0].replace(rate=rate), PIECES[1]],
            PENDULUM,
            prior=0.5,
            window=1.0,
            tie=0.1,
            tolerance=1e-12,
        ),
    ),
    "maximum_likelihood": lambda: (
        jnp.asarray(YEARS["flow"]),
        lambda flow: fitting.maximum_likelihood(
            FILTER, nile(), YEARS.replace(flow=flow), LEVELS, prior=0.3, tolerance=1e-10
        ),
    ),
    "prediction_error": lambda: (
        jnp.asarray(YEARS["flow"]),
        lambda flow: fitting.prediction_error(
            FILTER, nile(), YEARS.replace(flow=flow), LEVELS, prior=0.3, tolerance=1e-10
        ),
    ),
}
"""Programs that work under jit, vmap and grad: data, and the fit as a function of them."""


def test_every_program_is_traced_or_refused():
    assert {*REFUSED, *TRACED} == set(FITS)


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("how", [jax.jit, jax.grad, jax.jacfwd], ids=lambda how: how.__name__)
def test_a_program_of_the_host_says_what_to_do_under_a_transformation(name, how):
    with pytest.raises(InputError, match=rf"{name}: is given numbers that jit.*fitting\.solve"):
        how(lambda value: REFUSED[name](value).cost)(0.9)
    with pytest.raises(InputError, match=r"RigTable\.F_y: is given numbers that jit.*tree_at"):
        how(lambda value: dataclasses.replace(RIG, F_y=value * jnp.asarray(RIG.F_y)).load.sum())(0.9)


@pytest.mark.full
@pytest.mark.parametrize("name", TRACED)
def test_a_program_s_fit_has_the_slope_of_differences(name):
    at, fit = TRACED[name]()
    of = lambda data: fit(data).unconstrained
    way = jnp.asarray(np.random.default_rng(0).normal(size=at.shape)) * jnp.std(at)
    _, slope = jax.jit(lambda data: jax.jvp(of, (data,), (way,)))(at)
    h = 1e-3
    np.testing.assert_allclose(slope, (of(at + h * way) - of(at - h * way)) / (2 * h), rtol=2e-3, atol=1e-6)
    backward = jax.grad(lambda data: of(data)[0])(at)
    np.testing.assert_allclose(jnp.sum(backward * way), slope[0], rtol=1e-6)
