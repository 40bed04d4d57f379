"""The contract: rows by name, inputs along a step, points and batches, casts; the solver and the step between rows."""

from collections import namedtuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import EXPLICIT_SOLVERS

from jaxveh import InputError, Recording
from jaxveh import statespace as ss

Pair = namedtuple("Pair", "p v")
Force = namedtuple("Force", "force")
Out = namedtuple("Out", "y")


def pendulum(system, t, x, u):
    return Pair(x.v, -system["k"] * jnp.sin(x.p) - 0.1 * x.v * jnp.cos(t) + u.force)


def see(system, t, x, u):
    return Out(x.p)


def make(**changes):
    settings = dict(
        system={"k": jnp.asarray(4.0)},
        transition=ss.Propagate(pendulum),
        observation=see,
        process_noise=ss.Continuous(ss.Gaussian({"v": 0.1})),
        measurement_noise={"y": 0.1},
        prior=ss.Prior(Pair(0.3, 0.0), {"v": 0.2, "p": 0.1}),
        inputs=("force",),
    )
    return ss.StateSpace(**{**settings, **changes})


TIME = np.array([0.0, 0.1, 0.3])
RECORDING = Recording(TIME, {"force": [1.0, 2.0, 4.0], "y": [0.1, np.nan, 0.3], "unused": [1, 2, 3]})


def test_rows_carry_what_the_model_names():
    rows = make().rows(RECORDING)
    np.testing.assert_array_equal(rows.t, TIME)
    assert rows.u._fields == ("force",)
    assert rows.y._fields == ("y",)
    np.testing.assert_array_equal(rows.y.y, [0.1, np.nan, 0.3])
    row = make().row(0.1, {"force": 2}, {})
    assert row.u.force.dtype == jnp.float64
    assert np.isnan(row.y.y)
    assert jax.tree.structure(row) == jax.tree.structure(rows)


def test_times_of_a_float32_model_count_from_the_first_row():
    model = ss.cast(make(), jnp.float32)
    late = Recording(1.7e9 + TIME, dict(RECORDING.channels))
    rows = model.rows(late)
    assert {leaf.dtype for leaf in jax.tree.leaves(rows)} == {jnp.dtype("float32")}
    np.testing.assert_allclose(rows.t, TIME, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(process_noise=ss.Gaussian({"v": 1.0})), r"process_noise = Gaussian: must be Continuous\(law\)"),
        (
            dict(process_noise=ss.Discrete(ss.Gaussian({"q": 1.0}))),
            r"process noise: unknown name\(s\) q; there are: p, v",
        ),
        (dict(angles=("p",)), r"angles: unknown name\(s\) p; there are: y"),
        (dict(input_path="cubic"), "input_path = 'cubic': must be 'held' or 'linear'"),
        (dict(measurement_noise={"y": 0.0}), r"standard deviation of y = 0\.0"),
    ],
)
def test_construction_names_mistakes(change, message):
    with pytest.raises(InputError, match=message):
        make(**change)


@pytest.mark.parametrize(
    ("mean", "law", "message"),
    [
        (Pair(0.0, 0.0), {"p": 1.0}, "no spread for v"),
        (Pair(0.0, 0.0), {"p": 1.0, "v": 0.0}, r"standard deviation of v = 0\.0"),
        (Pair(0.0, 0.0), {"p": 1.0, "v": 1.0, "w": 1.0}, r"prior law: unknown name\(s\) w"),
        ((0.0, 0.0), {"p": 1.0}, "prior mean = tuple: must be the state's NamedTuple"),
    ],
)
def test_prior_names_mistakes(mean, law, message):
    with pytest.raises(InputError, match=message):
        ss.Prior(mean, law)


def test_prior_s_covariance_follows_the_state_s_order():
    prior = make().prior
    np.testing.assert_allclose(prior.covariance(), np.diag([0.01, 0.04]))
    full = ss.Prior(Pair(1.0, 2.0), ss.MultivariateGaussian(("v", "p"), [[4.0, 1.0], [1.0, 1.0]]))
    np.testing.assert_allclose(full.covariance(), [[1.0, 1.0], [1.0, 4.0]])
    draws = full.sample(jax.random.key(0), (20000,))
    np.testing.assert_allclose(np.cov(draws), [[1.0, 1.0], [1.0, 4.0]], atol=0.1)
    np.testing.assert_allclose(np.mean(draws, axis=1), [1.0, 2.0], atol=0.05)


@pytest.mark.parametrize(
    ("y", "force", "message"),
    [
        ([0.1, np.inf, 0.2], [1.0, 1.0, 1.0], r"channel y is inf at t = 0\.1 s: must be finite, or NaN if missing"),
        ([0.1, 0.1, 0.2], [1.0, 1.0, -np.inf], r"channel force is -inf at t = 0\.3 s"),
        ([0.1, 0.1, 0.2], [1.0, np.nan, np.nan], r"force is NaN in 2 rows, first at t = 0\.1 s.*recording\.fill"),
    ],
)
def test_bad_values_are_named(y, force, message):
    with pytest.raises(InputError, match=message):
        make().rows(Recording(TIME, {"y": y, "force": force}))


def test_missing_channels_and_inputs_are_named():
    with pytest.raises(InputError, match=r"lacks a channel the model needs: unknown name\(s\) force; there are: y"):
        make().rows(RECORDING.select(["y"]))
    with pytest.raises(InputError, match=r"no value for the input\(s\) force"):
        make().row(0.0, {}, {"y": 1.0})
    with pytest.raises(InputError, match=r"measurements: unknown name\(s\) z; there are: y"):
        make().row(0.0, {"force": 1.0}, {"z": 1.0})


def test_what_the_functions_return_is_looked_at():
    other = lambda system, t0, t1, x, u: Force(x.p)
    with pytest.raises(InputError, match=r"transition returned Force\(force\): must be the state, with p, v"):
        make(transition=other).transition(0.0, 0.1, Pair(0.0, 0.0), Force(0.0))
    plain = lambda system, t0, t1, x, u: (x.p, x.v)
    with pytest.raises(InputError, match="transition returned tuple: must be the state"):
        make(transition=plain).transition(0.0, 0.1, Pair(0.0, 0.0), Force(0.0))
    blind = lambda system, t, x, u: Force(x.p)
    with pytest.raises(
        InputError, match=r"observation returned Force.force., without y: must have every channel .*\(y\)"
    ):
        make(observation=blind).observation(0.0, Pair(0.0, 0.0), Force(0.0))


def test_a_stamp_without_digits_left_for_a_step_is_refused():
    model, given = ss.cast(make(), jnp.float32), ({"force": 1.0}, {"y": 0.1})
    with pytest.raises(InputError, match=r"row: t = 1700000000\.0 s has a resolution of 128 s in float32: count time"):
        model.row(1.7e9, *given)
    assert float(model.row(86400.0, *given).t) == 86400.0
    assert float(make().row(1.7e9, *given).t) == 1.7e9


def test_per_point_is_the_function_at_each_point():
    def single(system, t0, t1, x, u):
        matrix = jnp.array([[1.0, 0.1], [-0.2, 0.9]])
        return Pair(*(matrix @ jnp.stack(x) + u.force))

    batch = Pair(jnp.arange(6.0).reshape(2, 3), jnp.asarray(1.0))
    out = ss.PerPoint(single)(None, 0.0, 0.1, batch, Force(2.0))
    assert out.p.shape == out.v.shape == (2, 3)
    np.testing.assert_allclose(out.p, batch.p + 0.1 + 2.0)
    np.testing.assert_allclose(out.v, -0.2 * batch.p + 0.9 + 2.0)


def test_cast_changes_every_float_but_a_recording_s_stamps():
    model = ss.cast(make(), jnp.float32)
    assert {leaf.dtype.name for leaf in jax.tree.leaves(model)} == {"float32"}
    assert {leaf.dtype.name for leaf in jax.tree.leaves(ss.cast(model, jnp.float64))} == {"float64"}
    recording = ss.cast(RECORDING, jnp.float32)
    assert recording["y"].dtype == jnp.float32
    assert recording.time.dtype == np.float64


def test_rk4_is_of_fourth_order():
    """One second of the pendulum in ever more steps, against a tight diffrax solution."""
    x, u = Pair(jnp.asarray(1.0), jnp.asarray(0.2)), Force(jnp.asarray(0.5))
    system = {"k": jnp.asarray(4.0)}
    term = diffrax.ODETerm(lambda t, y, args: pendulum(system, t, y, u))
    exact = diffrax.diffeqsolve(
        term, diffrax.Dopri8(), 0.0, 1.0, 0.01, x, stepsize_controller=diffrax.PIDController(rtol=1e-12, atol=1e-12)
    ).ys
    ours = lambda steps: ss.Propagate(pendulum, steps=steps)(system, jnp.asarray(0.0), jnp.asarray(1.0), x, u)
    errors = [abs(float(ours(steps).p - exact.p[-1])) for steps in (8, 16, 32)]
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (np.abs(rates - 4) < 0.35).all()
    assert errors[-1] < 1e-6


class _Classical(diffrax.AbstractERK):
    """The same method through diffrax's own Butcher tableau."""

    tableau = diffrax.ButcherTableau(
        a_lower=(np.array([0.5]), np.array([0.0, 0.5]), np.array([0.0, 0.0, 1.0])),
        b_sol=np.array([1, 2, 2, 1]) / 6,
        b_error=np.array([1, 2, 2, 1]) / 6 - np.array([1.0, 0, 0, 0]),
        c=np.array([0.5, 0.5, 1.0]),
    )
    interpolation_cls = diffrax.ThirdOrderHermitePolynomialInterpolation.from_k

    def order(self, terms):
        return 4


def test_rk4_equals_the_tableau_in_diffeqsolve_and_alone_and_both_derivative_modes_work():
    term = diffrax.ODETerm(lambda t, y, k: pendulum({"k": k}, t, y, Force(0.5)))
    x = Pair(jnp.asarray(np.linspace(0.1, 1.0, 5)), jnp.zeros(5))

    def solve(k, solver):
        return diffrax.diffeqsolve(term, solver, 0.0, 0.4, 0.1, x, args=k).ys.p[-1]

    ours, theirs = jax.jit(lambda k: (solve(k, ss.RK4()), solve(k, _Classical())))(4.0)
    np.testing.assert_allclose(ours, theirs, rtol=1e-14)
    direct = ss.Propagate(pendulum, steps=4)

    @jax.jit
    def once(k):
        """Values, and the slope of their sum in both modes."""
        of = lambda k: direct({"k": k}, jnp.asarray(0.0), jnp.asarray(0.4), x, Force(0.5)).p
        total = lambda k: of(k).sum()
        return of(k), jax.grad(total)(k), jax.jvp(total, (k,), (jnp.ones_like(k),))[1]

    (alone, reverse, forward), (more, *_), (less, *_) = (once(np.float64(k)) for k in (4.0, 4.0 + 1e-5, 4.0 - 1e-5))
    np.testing.assert_allclose(alone, ours, rtol=1e-13)
    np.testing.assert_allclose(forward, reverse, rtol=1e-10)
    np.testing.assert_allclose(reverse, (np.sum(more) - np.sum(less)) / 2e-5, rtol=1e-7)


SOME = (diffrax.Euler, diffrax.Heun, diffrax.Tsit5)
"""One without stages, one without a memory, one that keeps its last slopes."""


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=() if k in SOME else pytest.mark.thorough) for k in EXPLICIT_SOLVERS]
)
def test_steps_of_every_explicit_solver_of_diffrax_differentiate_in_both_modes(kind):
    """The Kalman filters take slopes in forward mode, a likelihood's gradient in reverse mode."""
    step = ss.Propagate(pendulum, kind(), steps=2)
    of = lambda k: step({"k": k}, jnp.asarray(0.0), jnp.asarray(0.1), Pair(jnp.ones(()), jnp.zeros(())), Force(0.5)).p
    once = jax.jit(lambda k: (of(k), jax.grad(of)(k), jax.jvp(of, (k,), (jnp.ones_like(k),))[1]))
    (_, reverse, forward), (more, *_), (less, *_) = (once(np.float64(k)) for k in (4.0, 4.0 + 1e-4, 4.0 - 1e-4))
    np.testing.assert_allclose(forward, reverse, rtol=1e-10)
    np.testing.assert_allclose(reverse, (more - less) / 2e-4, rtol=1e-7)


def test_the_explicit_solvers_of_diffrax_are_found():
    assert len(EXPLICIT_SOLVERS) >= 8 and set(SOME) < set(EXPLICIT_SOLVERS)


def test_another_solver_with_a_state_of_its_own():
    x, u = Pair(jnp.asarray(1.0), jnp.asarray(0.2)), Force(jnp.asarray(0.5))
    at = (jnp.asarray(0.0), jnp.asarray(0.5))
    fine = ss.Propagate(pendulum, steps=50)({"k": 4.0}, *at, x, u)
    other = ss.Propagate(pendulum, diffrax.Dopri5(), steps=8)({"k": 4.0}, *at, x, u)
    np.testing.assert_allclose(other, fine, rtol=1e-7)


def _ramp(path, rows):
    """The double integral of force = 2 t + 1 over one second in `rows` steps: 1/2 + 1/3 exactly."""

    def moving(system, t, x, u):
        return Pair(x.v, u.force)

    model = make(transition=ss.Propagate(moving), input_path=path)
    time = jnp.linspace(0.0, 1.0, rows + 1)
    force, x = 2 * time + 1, Pair(jnp.asarray(0.0), jnp.asarray(0.0))
    for k in range(rows):
        u = model.step_inputs(time[k], time[k + 1], Force(force[k]), Force(force[k + 1]))
        x = model.transition(time[k], time[k + 1], x, u)
    return float(x.p), float(x.v)


def test_linear_inputs_are_exact_on_a_ramp_and_held_ones_are_of_first_order():
    np.testing.assert_allclose(_ramp("linear", 3), [0.5 + 1 / 3, 2.0], rtol=1e-14)
    held = np.array([_ramp("held", rows)[1] - 2.0 for rows in (4, 8, 16)])
    np.testing.assert_allclose(held[:-1] / held[1:], 2.0, rtol=1e-9)


def test_linear_input_at_its_ends_and_between():
    path = ss.LinearInput(jnp.asarray(1.0), jnp.asarray(3.0), Force(2.0), Force(6.0))
    np.testing.assert_allclose([path.at(t).force for t in (1.0, 1.5, 3.0)], [2.0, 3.0, 6.0])
