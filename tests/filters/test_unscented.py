"""The unscented Kalman filter against the exact answer on linear models, and its gradient against differences."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import kalman, linear_model, linear_recording, nile_model, nile_recording

from jaxveh import InputError, Recording, filters
from jaxveh import statespace as ss


@pytest.mark.parametrize(("n", "m", "alpha"), [(1, 1, 1.0), (3, 2, 1.0), (2, 3, 0.5), (8, 7, 1.0)])
def test_linear_models_give_the_kalman_filter(n, m, alpha):
    model = linear_model(n, m, seed=n)
    recording = linear_recording(model)
    exact = kalman(model, recording)
    estimate = filters.run(filters.Unscented(alpha=alpha), model, recording)
    close = dict(rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(estimate.info.log_likelihood, exact["log_likelihood"], **close)
    np.testing.assert_allclose(estimate.log_likelihood, exact["log_likelihood"].sum(), rtol=1e-9)
    np.testing.assert_allclose(np.stack(estimate.mean, axis=1), exact["mean"], **close)
    variances = np.diagonal(exact["covariance"], axis1=1, axis2=2)
    np.testing.assert_allclose(np.stack(estimate.std, axis=1) ** 2, variances, **close)
    np.testing.assert_allclose(estimate.belief.covariance, exact["covariance"][-1], **close)
    np.testing.assert_allclose(np.stack(estimate.info.innovation, axis=1), exact["innovation"], **close)
    np.testing.assert_allclose(np.stack(estimate.info.innovation_std, axis=1), exact["innovation_std"], **close)
    np.testing.assert_allclose(estimate.info.nis, exact["nis"], **close)
    assert int(estimate.result) == 0
    assert int(estimate.failed_at) == -1


def test_covariance_along_the_way_is_the_kalman_filter_s():
    model = linear_model(3, 2, seed=5)
    recording = linear_recording(model, rows=12)
    exact, rows, filter_ = kalman(model, recording), model.rows(recording), filters.Unscented()
    init, step = eqx.filter_jit(filter_.init), eqx.filter_jit(filter_.step)
    row = lambda k: jax.tree.map(lambda leaf: np.asarray(leaf)[k], rows)
    belief, _ = init(model, row(0))
    for k in range(1, 12):
        belief, _ = step(model, belief, row(k))
        np.testing.assert_allclose(belief.covariance, exact["covariance"][k], rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(belief.vector, exact["mean"][k], rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(belief.factor @ belief.factor.T, belief.covariance, rtol=1e-9, atol=1e-11)


def test_nile_log_likelihood():
    estimate = filters.run(filters.Unscented(), nile_model(), nile_recording())
    assert abs(float(estimate.log_likelihood) + 641.5855784594) < 1e-9


def test_predict_and_update_make_a_step_and_serve_sensors_of_different_rates():
    model = linear_model(2, 2, seed=3)
    recording = linear_recording(model, rows=2)
    rows, filter_ = model.rows(recording), filters.Unscented()
    first, second = (jax.tree.map(lambda leaf, k=k: leaf[k], rows) for k in (0, 1))

    @eqx.filter_jit
    def both(model):
        belief, _ = filter_.init(model, first)
        parted = filter_.update(model, filter_.predict(model, belief, second.t), second)
        return filter_.step(model, belief, second), parted

    (whole, info), (parts, again) = both(model)
    np.testing.assert_allclose(parts.vector, whole.vector, rtol=1e-14)
    np.testing.assert_allclose(parts.covariance, whole.covariance, rtol=1e-14)
    assert float(info.log_likelihood) == float(again.log_likelihood)


def test_an_angle_wraps_in_the_innovation_and_among_the_points():
    model = ss.StateSpace(
        transition=lambda s, t0, t1, x, u: x,
        observation=lambda s, t, x, u: type(x)(jnp.mod(x.heading + jnp.pi, 2 * jnp.pi) - jnp.pi),
        process_noise=None,
        measurement_noise=ss.Gaussian({"heading": 0.1}),
        prior=ss.Prior(ss.model.record("X", {"heading": np.pi - 0.05}), {"heading": 0.2}),
        angles=("heading",),
    )
    estimate = filters.run(filters.Unscented(), model, Recording([0.0], {"heading": [-np.pi + 0.05]}))
    # The measurement is 0.1 ahead of the mean, across the cut: the gain of a scalar Kalman filter is 0.8.
    np.testing.assert_allclose(estimate.info.innovation.heading, [0.1], rtol=1e-9)
    np.testing.assert_allclose(estimate.mean.heading, [np.pi - 0.05 + 0.08], rtol=1e-9)
    np.testing.assert_allclose(estimate.info.innovation_std.heading, [np.hypot(0.1, 0.2)], rtol=1e-9)


def test_a_report_has_the_spread_of_its_points_with_negative_weights_too():
    squares = lambda s, t, x, u: type(x)(jnp.square(x.a), x.a * x.b)
    model = ss.StateSpace(
        transition=lambda s, t0, t1, x, u: x,
        observation=lambda s, t, x, u: ss.model.record("Y", {"y": x.a}),
        process_noise=None,
        measurement_noise=ss.Gaussian({"y": 1e6}),
        prior=ss.Prior(ss.model.record("X", {"a": 1.0, "b": 2.0}), {"a": 0.5, "b": 0.3}),
        report=squares,
    )
    estimate = filters.run(filters.Unscented(alpha=0.5, beta=0.0), model, Recording([0.0], {"y": [1.0]}))
    # n + lambda = 0.5: points half a variance away, weights of 1, and of -3 and -2.25 in the middle.
    steps = np.sqrt(0.5) * np.array([[0, 0.5, 0, -0.5, 0], [0, 0, 0.3, 0, -0.3]])
    a, b = np.array([[1.0], [2.0]]) + steps
    values = np.array([a * a, a * b])
    mean = values @ [-3, 1, 1, 1, 1]
    spread = np.square(values - mean[:, None]) @ [-2.25, 1, 1, 1, 1]
    np.testing.assert_allclose(np.concatenate(estimate.mean), mean, rtol=1e-9)
    np.testing.assert_allclose(np.square(np.concatenate(estimate.std)), spread, rtol=1e-9)


def _differences(function, model, step=1e-6):
    """Central differences in every entry of every array leaf; matrices of covariance are moved symmetrically."""
    leaves, treedef = jax.tree.flatten(jax.tree.map(np.asarray, model))
    paths = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_flatten_with_path(model)[0]]
    for i, leaf in enumerate(leaves):
        for index in np.ndindex(leaf.shape):
            symmetric = "matrix" in paths[i]
            if symmetric and index[0] < index[1]:
                continue
            nudge = np.zeros(leaf.shape)
            nudge[index] = step
            if symmetric:
                nudge[index[::-1]] = step
            ends = [
                float(function(jax.tree.unflatten(treedef, [*leaves[:i], leaf + s * nudge, *leaves[i + 1 :]])))
                for s in (1.0, -1.0)
            ]
            yield i, paths[i], nudge / step, (ends[0] - ends[1]) / (2 * step)


def _value_and_gradient(filter_, model, recording):
    """The log-likelihood as a function of the model, and its gradient's leaves at this one; one program is both."""
    rows = model.rows(recording)
    both = jax.jit(jax.value_and_grad(lambda m: filters.scan(filter_, m, rows).log_likelihood))
    return lambda m: both(m)[0], jax.tree.leaves(both(model)[1])


def test_gradient_equals_differences_in_every_leaf():
    model = linear_model(2, 2, seed=9)
    # A law by field for the prior and the process noise, so that their standard deviations are leaves too.
    model = eqx.tree_at(lambda m: m.prior.law, model, ss.Gaussian({"x0": 0.7, "x1": 1.2}))
    recording = linear_recording(model, rows=12)
    value, gradient = _value_and_gradient(filters.Unscented(), model, recording)
    seen = set()
    for i, path, direction, slope in _differences(value, model):
        seen.add(path)
        np.testing.assert_allclose(np.sum(gradient[i] * direction), slope, rtol=2e-6, atol=2e-7, err_msg=path)
    assert len(seen) == len(gradient) == 10


def test_gradient_of_a_nonlinear_model_with_parameters_as_states_equals_differences():
    def transition(system, t0, t1, x, u):
        return type(x)(x.angle + (t1 - t0) * x.rate, x.rate - (t1 - t0) * system["stiffness"] * jnp.sin(x.angle))

    model = ss.StateSpace(
        system={"stiffness": jnp.asarray(4.0)},
        transition=transition,
        observation=lambda s, t, x, u: ss.model.record("Y", {"angle": jnp.sin(x.angle), "rate": x.rate}),
        process_noise=ss.Continuous(ss.Gaussian({"rate": 0.3})),
        measurement_noise=ss.StudentT(5.0, {"angle": 0.1, "rate": 0.2}),
        prior=ss.Prior(ss.model.record("X", {"angle": 0.3, "rate": 0.0}), {"angle": 0.2, "rate": 0.3}),
    )
    model = ss.with_parameters(model, lambda m: m.system["stiffness"], prior=0.3, walk=0.1)
    time = np.linspace(0, 1, 15)
    angle = np.where(np.arange(15) % 4 == 1, np.nan, 0.3 * np.cos(2 * time))
    recording = Recording(time, {"angle": angle, "rate": np.where(np.arange(15) == 5, np.nan, -0.6 * np.sin(2 * time))})
    value, gradient = _value_and_gradient(filters.Unscented(alpha=0.8), model, recording)
    count = 0
    for i, path, direction, slope in _differences(value, model):
        np.testing.assert_allclose(np.sum(gradient[i] * direction), slope, rtol=2e-6, atol=2e-7, err_msg=path)
        count += 1
    assert count == len(gradient) == 11


def test_laws_without_covariance_are_refused_by_name():
    model = eqx.tree_at(
        lambda m: m.measurement_noise, nile_model(), ss.CauchyGaussianMixture(0.3, {"flow": 100.0}, {"flow": 100.0})
    )
    with pytest.raises(InputError, match="measurement noise CauchyGaussianMixture has no covariance"):
        filters.run(filters.Unscented(), model, nile_recording())
    heavy = eqx.tree_at(lambda m: m.measurement_noise, nile_model(), ss.StudentT(1.5, {"flow": 100.0}))
    with pytest.raises(InputError, match=r"degrees of freedom|no covariance"):
        filters.run(filters.Unscented(), heavy, nile_recording())


def test_bad_sigma_points_are_refused():
    with pytest.raises(InputError, match="must be positive"):
        filters.run(filters.Unscented(kappa=-1.0), nile_model(), nile_recording())
