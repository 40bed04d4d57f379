"""Smoothers against the exact answer on linear models: every rule and form, in parallel, by particles; gradients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import kalman, linear_model, linear_recording
from test_every_filter import linear, recordings

from jaxveh import InputError, Recording, filters
from jaxveh import statespace as ss
from jaxveh._core.names import record
from jaxveh.filters import Covariance, SingularValues, SquareRoot

pytestmark = pytest.mark.product

MODEL = linear_model(3, 2, seed=3)
RECORDING = linear_recording(MODEL)
KEY = jax.random.key(0)


def exact(rows=None):
    """Rauch, Tung & Striebel in NumPy, of the first `rows`: means (T, n) and standard deviations (T, n)."""
    found = {name: values[:rows] for name, values in kalman(MODEL, RECORDING).items()}
    A, B, Q = np.asarray(MODEL.system["A"]), np.asarray(MODEL.system["B"]), np.asarray(MODEL.process_noise.law.matrix)
    t, u = np.asarray(RECORDING.time)[:rows], np.asarray(RECORDING["force"])
    means, covariances = [found["mean"][-1]], [found["covariance"][-1]]
    for k in range(len(t) - 2, -1, -1):
        dt, m, P = t[k + 1] - t[k], found["mean"][k], found["covariance"][k]
        F = np.eye(len(m)) + dt * A
        ahead, spread = F @ m + dt * B * u[k], F @ P @ F.T + Q * dt
        G = P @ F.T @ np.linalg.inv(spread)
        means.insert(0, m + G @ (means[0] - ahead))
        covariances.insert(0, P + G @ (covariances[0] - spread) @ G.T)
    return np.array(means), np.sqrt(np.diagonal(np.array(covariances), axis1=1, axis2=2))


MEANS, SPREADS = exact()
GAUSSIAN = {
    "Kalman": filters.Kalman(),
    "square root": filters.Extended(SquareRoot()),
    "singular values": filters.Cubature(form=SingularValues()),
    "Unscented, negative weight": filters.Unscented(alpha=0.5),
    "Iterated": filters.Iterated(filters.Cubature(form=SquareRoot()), 1),
}


def assert_exact(found):
    np.testing.assert_allclose(np.stack(found.mean, axis=1), MEANS, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(np.stack(found.std, axis=1), SPREADS, rtol=1e-9)


@pytest.mark.parametrize("name", GAUSSIAN)
def test_every_form_gives_the_exact_answer(name):
    found = filters.smooth(GAUSSIAN[name], MODEL, RECORDING)
    assert_exact(found)
    np.testing.assert_array_equal(found.time, RECORDING.time)
    np.testing.assert_allclose(found["x1"], MEANS[:, 1], rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize(
    "filter_", [filters.Kalman(), filters.Iterated(filters.Cubature(), 2)], ids=["Kalman", "iterated"]
)
def test_in_parallel_over_time_it_is_the_same(filter_):
    found = filters.smooth_parallel(filter_, MODEL, RECORDING)
    assert_exact(found)
    loop = filters.run(filters.Kalman(), MODEL, RECORDING)
    np.testing.assert_allclose(np.stack(found.filtered.mean), np.stack(loop.mean), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(found.filtered.info.log_likelihood, loop.info.log_likelihood, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.filtered.info.nis, loop.info.nis, rtol=1e-8, atol=1e-10)


def test_in_parallel_over_time_an_angle_may_be_measured_turns_away():
    def model(angles):
        return ss.StateSpace(
            transition=lambda s, t0, t1, x, u: x._replace(heading=x.heading + (t1 - t0) * x.rate),
            observation=lambda s, t, x, u: record("Y", {"heading": x.heading}),
            process_noise=ss.Continuous(ss.Gaussian({"heading": 0.1, "rate": 0.1})),
            measurement_noise=ss.Gaussian({"heading": 0.1}),
            prior=ss.Prior(record("X", {"heading": np.pi, "rate": 0.3}), {"heading": 0.2, "rate": 0.2}),
            angles=angles,
        )

    time = np.arange(30.0)
    heading = np.pi + np.sin(0.3 * time)  # across the cut, near where it is linearised first
    wrapped = np.mod(heading + np.pi, 2 * np.pi) - np.pi
    about = filters.Iterated(filters.Extended(), 1)
    exact = filters.smooth(filters.Kalman(), model(()), Recording(time, {"heading": heading}))
    found = filters.smooth_parallel(about, model(("heading",)), Recording(time, {"heading": wrapped}))
    np.testing.assert_allclose(np.stack(found.mean), np.stack(exact.mean), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(np.stack(found.std), np.stack(exact.std), rtol=1e-9)


@pytest.mark.parametrize(("method", "most"), [(filters.BackwardSampling(1000), 0.1), (filters.Genealogy(), 0.4)])
def test_particles_find_it_within_their_scatter(method, most):
    """On a recording that is a draw of the model, where particles are not all far out."""
    model, recording = linear(), recordings("linear")[0].rows(slice(0, 15))
    exact = filters.smooth(filters.Kalman(), model, recording)
    found = filters.smooth(filters.ParticleFilter(4000), model, recording, key=jax.random.key(1), method=method)
    error = (np.stack(found.mean) - np.stack(exact.mean)) / np.stack(exact.std)
    assert np.sqrt(np.mean(np.square(error))) < most
    assert found.trajectories.x0.shape[0] == len(recording.time)
    np.testing.assert_allclose(np.sum(found.weights), 1.0)
    # Rows near the end, where paths have not fallen together.
    assert np.sqrt(np.mean(np.square(error[:, -5:]))) < 0.1


def test_a_fixed_lag_is_the_smoother_of_the_rows_so_far():
    filter_ = filters.Kalman(SquareRoot())
    found = filters.smooth(filter_, MODEL, RECORDING, lag=4)
    for k in range(36):
        means, spreads = exact(k + 5)
        np.testing.assert_allclose([m[k] for m in found.mean], means[k], rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose([s[k] for s in found.std], spreads[k], rtol=1e-9)
    np.testing.assert_allclose(np.stack(found.mean, axis=1)[-5:], MEANS[-5:], rtol=1e-9, atol=1e-10)
    # Live, the same, four rows late; in the first rows it is the first.
    live = filters.run(filters.FixedLag(filter_, 4), MODEL, RECORDING)
    np.testing.assert_allclose(np.stack(live.mean)[:, 4:], np.stack(found.mean)[:, :-4], rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose([m[2] for m in live.mean], exact(3)[0][0], rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(live.log_likelihood, found.filtered.log_likelihood, rtol=1e-12)


def test_a_fixed_lag_of_particles_is_near_the_exact_one():
    model, recording = linear(), recordings("linear")[0]
    exact = filters.smooth(filters.Kalman(), model, recording, lag=3)
    found = filters.smooth(filters.ParticleFilter(4000), model, recording, key=jax.random.key(1), lag=3)
    error = (np.stack(found.mean) - np.stack(exact.mean)) / np.stack(exact.std)
    assert np.sqrt(np.mean(np.square(error))) < 0.15


def test_wrapped_filters_smooth_with_the_noise_they_believed():
    wide = filters.Gated(filters.Kalman(), 1e3)
    assert_exact(filters.smooth(wide, MODEL, RECORDING))
    steady = filters.MatchedProcess(filters.Kalman(), {"x0": 1e-9})
    np.testing.assert_allclose(
        np.stack(filters.smooth(steady, MODEL, RECORDING).mean, axis=1), MEANS, rtol=1e-6, atol=1e-6
    )


def test_its_gradient_is_that_of_differences():
    leaf = lambda scale: filters.smooth(
        filters.Kalman(SquareRoot()), ss.cast(_scaled(scale), jnp.float64), RECORDING, throw=False
    )

    @jax.jit
    @jax.value_and_grad
    def total(scale):
        found = leaf(scale)
        return jnp.sum(jnp.sin(found.mean.x0) + found.std.x1)

    difference = (total(1.0 + 1e-6)[0] - total(1.0 - 1e-6)[0]) / 2e-6
    np.testing.assert_allclose(total(1.0)[1], difference, rtol=1e-6)


def _scaled(scale):
    system = {**MODEL.system, "A": MODEL.system["A"] * scale}
    return jax.tree.map(
        lambda leaf: leaf,
        MODEL.__class__(
            system=system,
            transition=MODEL.transition_function,
            observation=MODEL.observation_function,
            process_noise=MODEL.process_noise,
            measurement_noise=MODEL.measurement_noise,
            prior=MODEL.prior,
            inputs=MODEL.inputs,
        ),
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: filters.smooth(filters.Kalman(), MODEL, RECORDING, method=filters.Genealogy()),
            "is for particle filters",
        ),
        (
            lambda: filters.smooth(filters.Ensemble(10), MODEL, RECORDING, key=jax.random.key(0)),
            "smooth: Ensemble has no smoother",
        ),
        (lambda: filters.smooth(filters.ParticleFilter(10), MODEL, RECORDING), "give it a key"),
        (lambda: filters.smooth_parallel(filters.Cubature(), MODEL, RECORDING), r"must be Kalman\(\) or Iterated"),
        (lambda: filters.BackwardSampling(1), "trajectories = 1"),
        (lambda: filters.FixedLag(filters.Kalman(), 0), "lag = 0"),
        (lambda: filters.FixedLag(filters.Ensemble(10), 2), "FixedLag: Ensemble has no smoother"),
        (
            lambda: filters.smooth(
                filters.ParticleFilter(10, filters.Transport()), MODEL, RECORDING, key=KEY, method=filters.Genealogy()
            ),
            "particles of Transport have no ancestors",
        ),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_a_state_without_noise_has_no_density_to_sample_by():
    law = ss.Continuous(ss.Gaussian({"x0": 0.1}))
    model = MODEL.__class__(
        system=MODEL.system, transition=MODEL.transition_function, observation=MODEL.observation_function,
        process_noise=law, measurement_noise=MODEL.measurement_noise, prior=MODEL.prior, inputs=MODEL.inputs,
    )  # fmt: skip
    with pytest.raises(InputError, match="without it: x1, x2"):
        filters.smooth(
            filters.ParticleFilter(10), model, RECORDING, key=jax.random.key(0), method=filters.BackwardSampling()
        )
    assert isinstance(Covariance(), filters.AbstractForm)
