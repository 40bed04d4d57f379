"""One compilation serves a live loop and the scan, bit for bit; new numbers, keys and recordings never compile anew."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_model, linear_observation, linear_recording, linear_transition

from jaxveh import Recording, filters
from jaxveh import statespace as ss

FILTERS = {
    "UKF": filters.Unscented(),
    "PF": filters.ParticleFilter(64),
    "APF": filters.AuxiliaryParticleFilter(64, threshold=0.5),
}
KEY = jax.random.key(8)


def _counted(dtype, seed=2, n=2):
    """The linear model with a transition that counts how often it is traced."""
    traces = []

    def transition(system, t0, t1, x, u):
        traces.append(x)
        return linear_transition(system, t0, t1, x, u)

    base = linear_model(n, 2, seed=seed, dtype=dtype)
    model = ss.StateSpace(
        system=base.system,
        transition=transition,
        observation=linear_observation,
        process_noise=base.process_noise,
        measurement_noise=base.measurement_noise,
        prior=base.prior,
        inputs=base.inputs,
    )
    return model, traces


@functools.cache
def once(name, dtype=jnp.float64, n=2):
    """A model that counts, the counts after a filter's first run over a recording, the recording and the estimate."""
    model, traces = _counted(dtype, n=n)
    recording = linear_recording(model, rows=15)
    estimate = filters.run(FILTERS[name], model, recording, key=KEY)
    assert traces
    return model, traces, recording, estimate


@eqx.filter_jit
def step(filter_, model, belief, row):
    return filter_.step(model, belief, row)


@pytest.mark.parametrize(
    ("name", "dtype", "n"),
    [
        *[pytest.param(name, jnp.float64, 2, id=f"{name}-float64") for name in FILTERS],
        *[pytest.param(name, jnp.float32, 2, id=f"{name}-float32") for name in FILTERS],
        pytest.param("UKF", jnp.float64, 5, id="UKF-5-states"),
    ],
)
def test_rows_one_by_one_give_the_scan_bit_for_bit(name, dtype, n):
    filter_, (model, traces, recording, estimate) = FILTERS[name], once(name, dtype, n)
    assert {leaf.dtype for leaf in jax.tree.leaves((estimate.mean, estimate.std, estimate.info.nis))} == {
        jnp.dtype(dtype)
    }
    # Stamps count from the start in float32, as the scan does it.
    start = recording.time[0] if dtype == jnp.float32 else 0.0
    spoken = lambda k: {name: recording[name][k] for name in model.channels if np.isfinite(recording[name][k])}
    rows = [model.row(recording.time[k] - start, {"force": float(recording["force"][k])}, spoken(k)) for k in range(15)]
    del traces[:]
    belief, info = eqx.filter_jit(filter_.init)(model, rows[0], KEY)
    assert not traces
    every_info = [info]
    for row in rows[1:]:
        belief, info = step(filter_, model, belief, row)
        every_info.append(info)
    # The program that the scan traced serves the live loop.
    assert not traces
    together = jax.tree.map(lambda *leaves: np.stack(leaves), *every_info)
    for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(estimate.info), strict=True):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(jax.tree.leaves(belief), jax.tree.leaves(estimate.belief), strict=True):
        assert a.dtype == b.dtype
        bits = jax.random.key_data if jnp.issubdtype(a.dtype, jax.dtypes.prng_key) else np.asarray
        np.testing.assert_array_equal(bits(a), bits(b))


@pytest.mark.parametrize("name", ["UKF", "PF"])
def test_run_compiles_once_for_other_numbers_keys_and_recordings(name):
    model, traces, _, first = once(name)
    del traces[:]
    other = linear_recording(model, rows=15, seed=77).replace(source="another drive", units={"force": "N"})
    weak = jax.jit(lambda: jnp.exp(1.0))()
    assert weak.weak_type
    changed = [
        eqx.tree_at(lambda m: m.system["B"], model, model.system["B"] * 2.0),
        eqx.tree_at(lambda m: m.prior.law, model, ss.MultivariateGaussian(model.states, np.diag([0.5, 2.0]))),
        ss.start_from(model, x0=0.3, x1=np.float32(2)),
        ss.start_from(model, x0=1, x1=weak),
        eqx.tree_at(lambda m: m.measurement_noise, model, ss.MultivariateGaussian(model.channels, 2.0 * np.eye(2))),
    ]
    results = [
        filters.run(FILTERS[name], m, other, key=jax.random.key(i)).log_likelihood for i, m in enumerate(changed)
    ]
    assert not traces
    assert len({float(value) for value in (first.log_likelihood, *results)}) == 6


def test_numbers_of_every_kind_in_constructors_give_one_structure():
    traces = []

    @eqx.filter_jit
    def traced(model):
        traces.append(model)
        return model.prior.mean[0]

    weak = jax.jit(lambda: jnp.exp(1.0))()
    assert weak.weak_type
    for value in (0.3, 1, np.float64(0.4), np.int32(2), jnp.asarray(0.6), jnp.asarray(2), weak):
        prior = ss.Prior(ss.model.record("X", {"x0": value}), {"x0": value})
        law = ss.StudentT(value, {"y0": value})
        mixed = ss.CauchyGaussianMixture(0.5, {"y0": value}, {"y0": value})
        model = ss.StateSpace(
            transition=linear_transition,
            observation=linear_observation,
            process_noise=ss.Discrete(ss.Gaussian({"x0": value})),
            measurement_noise=law,
            prior=prior,
            system=mixed,
        )
        traced(model)
    assert len(traces) == 1


def test_a_belief_goes_on_where_it_stopped():
    model, _, recording, whole = once("PF")
    rows = jax.tree.map(np.asarray, model.rows(recording))
    half = filters.scan(FILTERS["PF"], model, jax.tree.map(lambda leaf: leaf[:6], rows), KEY)
    belief = half.belief
    for k in range(6, 15):
        row = jax.tree.map(lambda leaf, k=k: jnp.asarray(leaf[k]), rows)
        belief, _ = step(FILTERS["PF"], model, belief, row)
    np.testing.assert_array_equal(belief.weights, whole.belief.weights)
    np.testing.assert_array_equal(belief.particles.x0, whole.belief.particles.x0)


@pytest.mark.parametrize("name", ["UKF", "APF"])
def test_without_x64_everything_is_float32(name, float32):
    filter_ = FILTERS[name]
    model, _ = _counted(None, seed=6)
    recording = linear_recording(model, rows=15)
    # Stamps of a clock since 1970: float32 alone would not tell them apart.
    late = Recording(recording.time + 1.7e9, dict(recording.channels))

    def of(model, recording):
        found = filters.run(filter_, model, recording, key=jax.random.key(0))
        return found.log_likelihood, found

    gradient, near = jax.grad(of, has_aux=True)(model, recording)
    _, estimate = jax.grad(of, has_aux=True)(model, late)
    kinds = {leaf.dtype.name for leaf in jax.tree.leaves(eqx.filter(estimate, eqx.is_inexact_array)) if leaf.ndim < 2}
    assert "float32" in kinds
    assert estimate.mean.x0.dtype == estimate.log_likelihood.dtype == jnp.float32
    assert int(estimate.result) == 0
    np.testing.assert_allclose(estimate.log_likelihood, near.log_likelihood, rtol=1e-4)
    np.testing.assert_array_equal(estimate.time, late.time)
    assert {leaf.dtype.name for leaf in jax.tree.leaves(gradient)} == {"float32"}
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradient))
