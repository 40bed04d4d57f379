"""What holds for every filter, each in turn: a new one is a line in `FILTERS` that says what it can.

Each filter is one program, which the tests share: log-likelihood, estimate and gradient of a batch of two recordings with
irregular steps, missing channels and rows without any measurement. A linear and a nonlinear model differ in numbers alone
(`straight`, `swinging`), so that the program is one for both. By default every filter, but for those that vary another
(`seldom`), meets both, and every third float32, or a live loop. `pytest -m full` runs the rest of the product.

Gradients are two thirds of a program's compilation, so that float32 goes without (a gradient has its leaf's dtype), and so does
what has no slope to compare with, but for every third.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import left_out
from filter_systems import kalman, linear_model, linear_observation, linear_recording, linear_transition
from recorded_numbers import check_recorded

from jaxveh import InputError, Recording, filters
from jaxveh import statespace as ss
from jaxveh._core.names import record_type
from jaxveh.filters import Covariance, SingularValues, SquareRoot
from jaxveh.numerics import sigma_points

N = 200
NAMES = ("x0", "x1", "x2")


class Line(NamedTuple):
    """A filter and what it can: `exact` on linear models; `linear` models only; `differentiable`, with gradients that are slopes
    of its value; `drawn` with a key; `late`: an estimate is of an earlier row; `seldom`: a variant of another."""

    make: Callable[[], filters.AbstractFilter]
    exact: bool = True
    linear: bool = False
    differentiable: bool = True
    drawn: bool = False
    late: bool = False
    seldom: bool = False


def same(model):
    return model


def noisier(model):
    return eqx.tree_at(lambda m: m.measurement_noise.std, model, type(model.measurement_noise.std)(1.0, 1.0))


GROUPS = (("y0",), ("y1",))
PARTICLES = filters.ParticleFilter(N)
CHANGES = ((0.95, 0.05), (0.1, 0.9))
FILTERS = {
    "Kalman": Line(lambda: filters.Kalman(), linear=True),
    "Kalman, square root": Line(lambda: filters.Kalman(SquareRoot()), linear=True, seldom=True),
    "Extended": Line(lambda: filters.Extended()),
    "Extended, square root": Line(lambda: filters.Extended(SquareRoot()), seldom=True),
    "Unscented": Line(lambda: filters.Unscented()),
    "Unscented, negative weight": Line(lambda: filters.Unscented(alpha=0.5), seldom=True),
    "Unscented, square root": Line(lambda: filters.Unscented(form=SquareRoot())),
    "Simplex": Line(lambda: filters.Simplex(), seldom=True),
    "Cubature": Line(lambda: filters.Cubature()),
    "Cubature, square root": Line(lambda: filters.Cubature(form=SquareRoot()), seldom=True),
    "Cubature, singular values": Line(lambda: filters.Cubature(form=SingularValues()), differentiable=False),
    "Cubature of degree 5": Line(lambda: filters.Cubature(degree=5), seldom=True),
    "own points": Line(lambda: filters.SigmaPointFilter(sigma_points.unscented), seldom=True),
    "Gauss-Hermite": Line(lambda: filters.GaussHermite(), seldom=True),
    "Iterated Extended": Line(lambda: filters.Iterated(filters.Extended()), seldom=True),
    "Iterated Cubature": Line(lambda: filters.Iterated(filters.Cubature(form=SquareRoot()), 2)),
    "Ensemble": Line(lambda: filters.Ensemble(N), exact=False, drawn=True),
    "Ensemble, perturbed": Line(lambda: filters.Ensemble(N, perturbed=True), exact=False, drawn=True, seldom=True),
    "Gated": Line(lambda: filters.Gated(filters.Cubature(), 50.0)),
    "Huber": Line(lambda: filters.Huber(filters.Cubature(), 50.0), seldom=True),
    "contaminated": Line(lambda: filters.Contaminated(filters.Cubature(), 0.1, 3.0), exact=False),
    "Student-t": Line(lambda: filters.RobustStudentT(filters.Cubature(), 4.0), exact=False),
    "Sage-Husa": Line(lambda: filters.SageHusa(filters.Cubature()), exact=False),
    "variational Bayes": Line(lambda: filters.VariationalBayes(filters.Cubature()), exact=False),
    "strong tracking": Line(lambda: filters.StrongTracking(filters.Cubature()), exact=False),
    "federated": Line(lambda: filters.Federated(filters.Cubature(), GROUPS)),
    "federated, common": Line(lambda: filters.Federated(filters.Cubature(), GROUPS, common=True)),
    "federated by trace": Line(
        lambda: filters.Federated(filters.Cubature(form=SquareRoot()), GROUPS, by_trace=True), seldom=True
    ),
    "interacting, equal": Line(
        lambda: filters.InteractingModels(filters.Cubature(), (same, same), CHANGES), seldom=True
    ),
    "interacting": Line(lambda: filters.InteractingModels(filters.Cubature(), (same, noisier), CHANGES), exact=False),
    "wavelet noise": Line(lambda: filters.HaarNoise(filters.Cubature(), window=8), exact=False),
    "wavelet noise, contaminated": Line(
        lambda: filters.HaarNoise(filters.Contaminated(filters.Cubature()), window=8, fewest=2, initial=4.0),
        exact=False,
    ),
    "wavelet noise, particles": Line(
        lambda: filters.HaarParticles(PARTICLES, window=8), exact=False, differentiable=False, drawn=True
    ),
    "shrinking process": Line(
        lambda: filters.ShrinkingProcess(filters.Cubature(), {"x0": 0.1}), exact=False, seldom=True
    ),
    "matched process": Line(lambda: filters.MatchedProcess(filters.Cubature(), {"x0": 0.1}), exact=False),
    "delayed, in order": Line(lambda: filters.Delayed(filters.Cubature(), depth=3)),
    "fixed lag": Line(lambda: filters.FixedLag(filters.Cubature(), 2), late=True),
    "H-infinity, no bound": Line(lambda: filters.HInfinity(filters.Cubature(), 0.0, {}), seldom=True),
    "H-infinity": Line(lambda: filters.HInfinity(filters.Cubature(), 0.1, {"x0": 1.0, "x2": 1.0}), exact=False),
    "consider": Line(lambda: filters.Consider(filters.Cubature(), ("x1",)), exact=False),
    "dual": Line(lambda: filters.Dual(filters.Cubature(), (("x0",),)), exact=False),
    "guided": Line(lambda: filters.Guided(N), exact=False, differentiable=False, drawn=True),
    "guided, fully adapted": Line(
        lambda: filters.Guided(N, "unscented", auxiliary=True),
        exact=False,
        differentiable=False,
        drawn=True,
        seldom=True,
    ),
    "Liu-West": Line(lambda: filters.LiuWest(PARTICLES, names=("x2",)), exact=False, differentiable=False, drawn=True),
    "regularised": Line(
        lambda: filters.Regularised(PARTICLES), exact=False, differentiable=False, drawn=True, seldom=True
    ),
    "marginalised": Line(lambda: filters.Marginalised(N, ("x2",)), exact=False, differentiable=False, drawn=True),
    "adaptive number": Line(
        lambda: filters.AdaptiveNumber(PARTICLES, {"x0": 0.1, "x1": 0.1}, sizes=(100, N)),
        exact=False,
        differentiable=False,
        drawn=True,
    ),
    "softened weights": Line(
        lambda: filters.ParticleFilter(N, filters.Soft(0.5)), exact=False, differentiable=False, drawn=True
    ),
    "optimal transport": Line(
        lambda: filters.ParticleFilter(100, filters.Transport(0.1, 40)), exact=False, differentiable=False, drawn=True
    ),
    "bootstrap": Line(lambda: PARTICLES, exact=False, differentiable=False, drawn=True),
    "auxiliary": Line(lambda: filters.AuxiliaryParticleFilter(N), exact=False, differentiable=False, drawn=True),
    "auxiliary, to a point": Line(
        lambda: filters.AuxiliaryParticleFilter(N, lookahead=filters.PointLookahead()),
        exact=False,
        differentiable=False,
        drawn=True,
        seldom=True,
    ),
}


EXEMPT = {
    "Paused": "what it says after a pause is another answer: test_wrapper_answers, on record, and test_every_capability",
    "VaryingNoise": "its input must be a spread, which the force of these recordings is not: test_data_reality, and around each "
    "filter here test_every_capability",
}


def test_every_filter_form_and_look_ahead_of_the_package_is_here():
    made = [line.make() for line in FILTERS.values()]
    assert not left_out("filters", filters.AbstractFilter, made, EXEMPT)
    assert not left_out("filters", filters.AbstractForm, made, {})
    default = {"PredictiveLikelihood": "what the auxiliary filter looks ahead with unless it is told"}
    assert not left_out("filters", filters.AbstractLookahead, made, default)


def linear(seed=3):
    """Independent noises, so that every filter takes them."""
    model = linear_model(3, 2, seed=seed)
    return eqx.tree_at(lambda m: m.measurement_noise, model, ss.Gaussian({"y0": 0.4, "y1": 0.3}))


def swing(system, t0, t1, x, u):
    """A pendulum under a force, by Heun's method."""
    dt, (angle, rate) = t1 - t0, (x.x0, x.x1)
    pull = lambda angle, rate: u.force - system["pull"] * jnp.sin(angle) - 0.1 * rate
    half_angle, half_rate = angle + 0.5 * dt * rate, rate + 0.5 * dt * pull(angle, rate)
    return type(x)(angle + dt * half_rate, rate + dt * pull(half_angle, half_rate), x.x2)


def see_swing(system, t, x, u):
    return record_type("Y", ("y0", "y1"))(jnp.sin(x.x0) + x.x2, jnp.cos(x.x0))


def pendulum():
    return ss.StateSpace(
        system={"pull": jnp.asarray(np.array(9.0))},
        transition=swing,
        observation=see_swing,
        process_noise=ss.Continuous(ss.Gaussian({"x0": 0.1, "x1": 0.5, "x2": 0.05})),
        measurement_noise=ss.Gaussian({"y0": 0.1, "y1": 0.2}),
        prior=ss.Prior(record_type("X", NAMES)(0.5, 0.0, 0.1), dict(zip(NAMES, (0.3, 0.5, 0.1), strict=True))),
        inputs=("force",),
    )


def straight_or_swung(system, t0, t1, x, u):
    """x + dt (A x + B force), and the pull of a pendulum."""
    moved = linear_transition(system, t0, t1, x, u)
    return moved._replace(x1=moved.x1 - (t1 - t0) * system["pull"] * jnp.sin(x.x0))


def see_bent(system, t, x, u):
    """H x + D force, and what is seen of a pendulum."""
    y = linear_observation(system, t, x, u)
    return type(y)(y.y0 + system["bend"] * jnp.sin(x.x0), y.y1 + system["bend"] * jnp.cos(x.x0))


def straight():
    """`linear`, as the tree of numbers that `swinging` is."""
    model = linear()
    return ss.StateSpace(
        system={**model.system, "pull": jnp.asarray(np.array(0.0)), "bend": jnp.asarray(np.array(0.0))},
        transition=straight_or_swung, observation=see_bent, process_noise=model.process_noise,
        measurement_noise=model.measurement_noise, prior=model.prior, inputs=model.inputs,
    )  # fmt: skip


def swinging():
    """A pendulum under a force, whose angle is seen with an offset."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.0]])
    system = {
        "A": A, "B": np.array([0.0, 1.0, 0.0]), "H": np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]), "D": np.zeros(2),
        "pull": np.array(9.0), "bend": np.array(1.0),
    }  # fmt: skip
    spread, law = np.array([[1.0, 0.2, 0.0], [0.2, 1.0, 0.1], [0.0, 0.1, 1.0]]), ss.MultivariateGaussian
    process, prior = (np.outer(std, std) * spread for std in ([0.1, 0.5, 0.05], [0.3, 0.5, 0.1]))
    return ss.StateSpace(
        system=jax.tree.map(jnp.asarray, system), transition=straight_or_swung, observation=see_bent,
        process_noise=ss.Continuous(law(NAMES, process)), measurement_noise=ss.Gaussian({"y0": 0.1, "y1": 0.2}),
        prior=ss.Prior(record_type("X", NAMES)(0.5, 0.0, 0.1), law(NAMES, prior)), inputs=("force",),
    )  # fmt: skip


MODELS = {"linear": linear, "pendulum": pendulum, "straight": straight, "swinging": swinging}
BOTH = ("straight", "swinging")
"""What every filter meets; other files take the first two."""


@functools.cache
def recordings(name):
    """Two drawn from the model itself, with steps of 0.02 to 0.2 s, channels missing and two rows without any."""
    model, made = MODELS[name](), []
    for seed in (1, 2):
        recording = linear_recording(model, rows=25, seed=seed)
        drawn = draw(model, model.rows(recording), np.array(seed))
        values = {
            channel: np.where(np.isfinite(recording[channel]), drawn[channel], np.nan) for channel in model.channels
        }
        made.append(Recording(np.array(recording.time), {**values, "force": np.array(recording["force"])}))
    return made


@eqx.filter_jit
def draw(model, rows, seed):
    """What is measured of a draw of the model, (T,) by channel, at the times and with the inputs of `rows`."""
    prior, process, measurement = jax.random.split(jax.random.key(seed), 3)

    def move(x, given):
        k, last, row = given
        noise = model.process_noise.over(row.t - last.t).sample(jax.random.fold_in(process, k))
        x = model.transition(last.t, row.t, x, last.u)
        x = x._replace(**{name: getattr(x, name) + value for name, value in noise.items()})
        return x, see(k, row, x)

    def see(k, row, x):
        error = model.measurement_noise.sample(jax.random.fold_in(measurement, k))
        y = model.observation(row.t, x, row.u)._asdict()
        return {channel: y[channel] + error[channel] for channel in model.channels}

    before, after = (jax.tree.map(lambda leaf: leaf[:-1], rows), jax.tree.map(lambda leaf: leaf[1:], rows))
    first = model.prior.sample(prior)
    _, rest = jax.lax.scan(move, first, (jnp.arange(1, rows.t.size), before, after))
    start = see(0, jax.tree.map(lambda leaf: leaf[0], rows), first)
    return jax.tree.map(lambda one, others: jnp.append(one, others), start, rest)


def value(filter_, model, rows, key):
    estimate = filters.scan(filter_, model, rows, key)
    return estimate.log_likelihood, estimate


@eqx.filter_jit
def batch_of_values(filter_, model, rows, keys):
    return jax.vmap(lambda rows, key: value(filter_, model, rows, key))(rows, keys)


@eqx.filter_jit
def batch_with_gradients(filter_, model, rows, keys):
    """((value, estimate), gradient with respect to every number of the model), each of a batch of recordings."""
    leaves, rest = eqx.partition(model, eqx.is_inexact_array)
    one = lambda leaves, rows, key: value(filter_, eqx.combine(leaves, rest), rows, key)
    return jax.vmap(jax.value_and_grad(one, has_aux=True), in_axes=(None, 0, 0))(leaves, rows, keys)


def batch(name, dtype=None):
    model = MODELS[name]()
    rows = [model.rows(r) for r in recordings(name)]
    rows = jax.tree.map(lambda *leaves: np.stack(leaves), *rows)
    if dtype is None:
        return model, jax.tree.map(jnp.asarray, rows)
    rows = rows._replace(t=rows.t - rows.t[:, :1])
    return ss.cast(model, dtype), jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), rows)


KEYS = jax.random.split(jax.random.key(7), 2)


@functools.cache
def found(filter_name, model_name):
    return of_batch(filter_name, *batch(model_name))


def of_batch(filter_name, model, rows):
    line = FILTERS[filter_name]
    if line.differentiable or turn(filter_name) == "gradient":
        return batch_with_gradients(line.make(), model, rows, KEYS)
    return batch_of_values(line.make(), model, rows, KEYS), ()


NEXT = ("gradient", "float32", "live")
"""What a filter meets besides both models, in turn; the first is for those that are not differentiable."""


def turn(name):
    usual = [n for n, line in FILTERS.items() if not line.seldom]
    return NEXT[usual.index(name) % len(NEXT)] if name in usual else ""


def case(name, what, *more):
    """A parameter: of the default run where it is this filter's turn, else of the full one."""
    mine = not FILTERS[name].seldom and what in (*BOTH, turn(name))
    return pytest.param(name, *more, marks=[] if mine else pytest.mark.full)


def names(what, condition=lambda line: True):
    return [case(name, what) for name, line in FILTERS.items() if condition(line)]


def cases(condition=lambda line: True):
    pairs = [(name, model) for name, line in FILTERS.items() for model in BOTH if condition(line)]
    return [case(name, model, model) for name, model in pairs if not (FILTERS[name].linear and model != "straight")]


@pytest.mark.parametrize("name", names("straight", lambda line: line.exact))
def test_on_linear_models_it_is_the_exact_answer(name):
    (value, estimate), _ = found(name, "straight")
    for i, recording in enumerate(recordings("straight")):
        exact = kalman_of(recording)
        np.testing.assert_allclose(value[i], exact["log_likelihood"].sum(), rtol=1e-9)
        if FILTERS[name].late:
            continue
        np.testing.assert_allclose(np.stack(estimate.mean)[:, i].T, exact["mean"], rtol=1e-9, atol=1e-9)
        variances = np.diagonal(exact["covariance"], axis1=1, axis2=2)
        np.testing.assert_allclose(np.stack(estimate.std)[:, i].T ** 2, variances, rtol=1e-9)


def kalman_of(recording):
    model = linear()
    matrix = ss.MultivariateGaussian(model.channels, np.diag(np.square([0.4, 0.3])))
    return kalman(eqx.tree_at(lambda m: m.measurement_noise, model, matrix), recording)


@pytest.mark.parametrize(("name", "model"), cases())
def test_it_succeeds_and_a_row_without_measurements_says_nothing(name, model):
    (value, estimate), gradient = found(name, model)
    assert not np.asarray(estimate.result).any()
    for leaf in jax.tree.leaves((value, estimate.mean, estimate.std, gradient)):
        assert np.isfinite(leaf).all()
    # Softened weights are unbiased, and with it their sum is one on average only.
    loose = 0.1 if name == "softened weights" else 1e-12
    np.testing.assert_allclose(estimate.info.log_likelihood[:, 7:9], 0.0, atol=loose)
    assert np.isnan(np.stack(estimate.info.innovation)[:, :, 7:9]).all()
    # Uncertainty grows while nothing is heard.
    total = sum(np.square(np.asarray(s)) for s in estimate.std)
    assert (total[:, 8] > total[:, 6]).all() or name == "dual" or FILTERS[name].late


@pytest.mark.parametrize(("name", "model"), cases(lambda line: not line.exact))
def test_it_stays_near_the_best_answer(name, model):
    (value, estimate), _ = found(name, model)
    (best, reference), _ = found("Cubature", model)
    spread = np.stack(reference.std)
    error = (np.stack(estimate.mean) - np.stack(reference.mean)) / spread
    assert np.sqrt(np.mean(np.square(error))) < 1.0
    assert (np.abs(value - best) < 0.3 * np.abs(best) + 10.0).all()


@pytest.mark.parametrize(("name", "model"), cases(lambda line: line.differentiable))
def test_its_gradient_is_that_of_differences(name, model):
    _, gradient = found(name, model)
    leaves, rest = eqx.partition(MODELS[model](), eqx.is_inexact_array)
    rng = np.random.default_rng(5)
    flat, tree = jax.tree.flatten(leaves)
    # Of matrices the symmetric part.
    flat = [np.asarray(leaf) for leaf in flat]
    steps = [rng.normal(size=leaf.shape) * (1e-2 + np.abs(leaf)) for leaf in flat]
    steps = [0.5 * (s + s.T) if s.ndim == 2 and s.shape[0] == s.shape[1] else s for s in steps]
    slope = sum(
        np.sum(np.asarray(g) * np.asarray(s), axis=tuple(range(1, g.ndim)))
        for g, s in zip(jax.tree.leaves(gradient), steps, strict=True)
    )
    h, values = 1e-5, []
    _, rows = batch(model)
    for sign in (1, -1):
        moved = [jnp.asarray(leaf + sign * h * s) for leaf, s in zip(flat, steps, strict=True)]
        moved = jax.tree.unflatten(tree, moved)
        values.append(batch_with_gradients(FILTERS[name].make(), eqx.combine(moved, rest), rows, KEYS)[0][0])
    np.testing.assert_allclose(slope, (values[0] - values[1]) / (2 * h), rtol=2e-5, atol=1e-5)


@pytest.mark.parametrize("name", names("gradient", lambda line: not line.differentiable))
def test_a_gradient_that_is_no_slope_is_a_number(name):
    """Of `found` where it has one; where this is not the filter's turn, of a program more."""
    _, gradient = found(name, "straight")
    if not gradient:
        _, gradient = batch_with_gradients(FILTERS[name].make(), *batch("straight"), KEYS)
    for leaf in jax.tree.leaves(gradient):
        assert np.isfinite(leaf).all()


@pytest.mark.parametrize("name", names("straight"))
def test_its_estimates_are_those_recorded(name):
    """Of both models; of a short recording they are on record in test_recorded_estimates, too."""
    kept = {}
    for model in BOTH if not FILTERS[name].linear else BOTH[:1]:
        (value, estimate), _ = found(name, model)
        rows = lambda leaf: leaf[:, 2::9]  # of which one says nothing
        kept[model] = value, jax.tree.map(rows, (estimate.mean, estimate.std, estimate.info))
    check_recorded(__file__, name, kept)


@pytest.mark.parametrize("name", names("live", lambda line: not line.drawn))
def test_a_live_loop_gives_the_scan_s_answer(name):
    filter_, (model, rows) = FILTERS[name].make(), batch("straight")
    (value, estimate), _ = found(name, "straight")
    step = eqx.filter_jit(filter_.step)
    rows = jax.tree.map(np.asarray, rows)
    row = lambda k: jax.tree.map(lambda leaf: jnp.asarray(leaf[0, k]), rows)
    belief, info = filter_.init(model, row(0))
    total = float(info.log_likelihood)
    for k in range(1, 25):
        belief, info = step(model, belief, row(k))
        total += float(info.log_likelihood)
    np.testing.assert_allclose(total, value[0], rtol=1e-12)
    np.testing.assert_allclose(belief.moments(model)[0], [leaf[0, -1] for leaf in estimate.mean], rtol=1e-10)


@pytest.mark.parametrize("name", names("float32"))
def test_float32_stays_float32_and_says_the_same(name):
    (value, estimate), _ = found(name, "straight")
    model, rows = batch("straight", jnp.float32)
    single, short = batch_of_values(FILTERS[name].make(), model, rows, KEYS)
    assert {leaf.dtype for leaf in (single, *short.mean, *short.std)} == {np.dtype("float32")}
    assert not np.asarray(short.result).any()
    if not FILTERS[name].drawn:
        np.testing.assert_allclose(single, value, rtol=2e-4)
        np.testing.assert_allclose(np.stack(short.mean), np.stack(estimate.mean), atol=2e-3)


def check_outliers(of, model, rows):
    """Numbers that are not finite have a code, from the row of the outlier on."""
    for outlier in (1e10, -1e20, 1e30, 1e160, 1e200):
        if outlier > float(jnp.finfo(rows.t.dtype).max):
            continue
        spiked = rows._replace(y=rows.y._replace(y0=rows.y.y0.at[:, 10].set(outlier)))
        value, estimate = of(model, spiked)
        told = (value, estimate.mean, estimate.std, estimate.info.log_likelihood)
        whole = np.all([np.isfinite(leaf).reshape(2, -1).all(axis=1) for leaf in jax.tree.leaves(told)], axis=0)
        whole &= ~np.isinf(estimate.info.nis).any(axis=1)
        failed, at = np.asarray(estimate.result) != 0, np.asarray(estimate.failed_at)
        assert (failed | whole).all(), outlier
        assert (at[failed] >= 10).all() and (at[~failed] == -1).all(), (outlier, at)


@pytest.mark.parametrize("name", names("straight"))
def test_an_outlier_that_the_numbers_do_not_bear_is_a_code(name):
    check_outliers(lambda model, rows: of_batch(name, model, rows)[0], *batch("straight"))


@pytest.mark.parametrize("name", names("float32"))
def test_so_it_is_in_float32(name):
    check_outliers(
        lambda model, rows: batch_of_values(FILTERS[name].make(), model, rows, KEYS), *batch("straight", jnp.float32)
    )


@pytest.mark.parametrize("name", [name for name, line in FILTERS.items() if line.linear])
def test_what_is_for_linear_models_refuses_others(name):
    with pytest.raises(InputError, match="state x0 is not a linear function"):
        FILTERS[name].make().check(pendulum())


@pytest.mark.parametrize("form", [SquareRoot(), SingularValues()])
def test_forms_that_need_positive_weights_say_so(form):
    with pytest.raises(InputError, match="a weight is negative for 3 states"):
        filters.Unscented(alpha=0.5, form=form).check(pendulum())
    filters.Unscented(alpha=0.5, form=Covariance()).check(pendulum())
