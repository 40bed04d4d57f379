"""Missing and bad data, and failures as data: codes that travel with the results, errors on the host that name things."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_model, linear_recording, nile_model, nile_recording, see_level
from nile import NILE

from jaxveh import FilterError, InputError, Recording, Result, filters, numerics
from jaxveh import statespace as ss
from jaxveh.statespace import driver

PF = filters.ParticleFilter(50)
APF = filters.AuxiliaryParticleFilter(50)
KEY = jax.random.key(0)


def _with_flow(k, value):
    flow = NILE[:8].copy()
    flow[k] = value
    return flow


def _rows(flow):
    """Rows as a live loop or a jitted caller could hand them over: without the host's checks."""
    flow = flow if isinstance(flow, jax.Array) else np.asarray(flow)
    return ss.Row(np.arange(float(len(flow))), (), ss.model.record("Measurements", {"flow": flow}))


@eqx.filter_jit
def _estimate_and_gradient(filter_, model, rows):
    """One program for everything that is looked at of eight rows."""

    def of(model):
        estimate = filters.scan(filter_, model, rows, KEY)
        return estimate.log_likelihood, estimate

    gradient, estimate = jax.grad(of, has_aux=True)(model)
    return estimate, gradient


@pytest.mark.parametrize("filter_", [filters.Unscented(), PF, APF], ids=lambda f: type(f).__name__)
class TestEveryFilter:
    model = nile_model(1000.0, 300.0)

    def test_a_row_without_measurements_leaves_the_prediction(self, filter_):
        estimate, _ = _estimate_and_gradient(filter_, self.model, _rows(_with_flow(1, np.nan)))
        info = jax.tree.map(lambda leaf: leaf[1], jax.tree.map(np.asarray, estimate.info))
        assert float(info.log_likelihood) == pytest.approx(0.0, abs=1e-12)
        assert np.isnan(info.innovation.flow)
        assert np.isnan(info.innovation_std.flow)
        assert int(info.result) == 0
        (before, after), spreads = estimate.mean.level[:2], np.asarray(estimate.std.level)
        loose = 0 if isinstance(filter_, filters.Unscented) else 60.0
        assert float(after) == pytest.approx(float(before), abs=loose)
        expected = float(np.hypot(spreads[0], 1469.1**0.5))
        assert float(spreads[1]) == pytest.approx(expected, rel=1e-12 if loose == 0 else 0.35)

    def test_an_infinite_measurement_is_a_code_and_an_error_of_the_row(self, filter_):
        estimate, _ = _estimate_and_gradient(filter_, self.model, _rows(_with_flow(5, np.inf)))
        assert Result(int(estimate.result)) is Result.non_finite_input
        assert int(estimate.failed_at) == 5
        codes = np.asarray(estimate.info.result)
        assert codes[5] == Result.non_finite_input
        assert (np.delete(codes, 5) == 0).all()
        # It counts as missing, so that what follows stays finite.
        assert np.isfinite(estimate.mean.level).all()
        with pytest.raises(InputError, match=r"channel flow is inf at t = 5\.0 s"):
            filters.run(filter_, self.model, Recording(np.arange(8.0), {"flow": _with_flow(5, np.inf)}), key=KEY)

    def test_raised_failures_name_row_time_channel_and_reason(self, filter_):
        recording = Recording(np.arange(8.0) / 4, {"flow": _with_flow(5, 1234.5)})
        failed, _ = _estimate_and_gradient(filter_, self.model, _rows(_with_flow(5, np.inf)))
        expected = (
            rf"{type(filter_).__name__} failed in row 5 \(t = 1\.25 s; flow = 1234\.5\): an input or a measurement"
        )
        with pytest.raises(FilterError, match=expected):
            driver.raise_failure(failed, filter_, self.model, recording)

    def test_gradients_stay_finite_with_missing_data(self, filter_):
        _, gradient = _estimate_and_gradient(filter_, self.model, _rows(_with_flow(3, np.nan)))
        leaves = np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(gradient)])
        assert np.isfinite(leaves).all()
        assert np.abs(leaves).max() > 0


def test_gaps_in_an_input_are_refused_with_channel_count_time_and_remedy():
    model = linear_model(1, 1)
    recording = linear_recording(model, rows=10)
    gap = np.array(recording["force"])
    gap[[4, 6]] = np.nan
    message = rf'force is NaN in 2 rows, first at t = {recording.time[4]} s.*recording\.fill\("force"'
    with pytest.raises(InputError, match=message):
        filters.run(filters.Unscented(), model, recording.replace(force=gap))


def test_an_input_that_is_not_finite_inside_jit_is_a_code():
    model = linear_model(1, 1)
    rows = model.rows(linear_recording(model, rows=10))
    force = np.where(np.arange(10) == 4, np.nan, rows.u.force)
    rows = eqx.tree_at(lambda r: r.u.force, rows, force)
    estimate = filters.scan(filters.Unscented(), model, rows)
    assert Result(int(estimate.result)) is Result.non_finite_input
    assert int(estimate.failed_at) == 4


def _dead_model():
    """A bounded law: what is more than four standard deviations off has no density at all."""

    class Bounded(ss.AbstractNoise):
        inside: ss.Gaussian
        has_covariance = False
        names = ("flow",)

        def log_prob(self, residual, present):
            near = jnp.abs(residual["flow"]) < 4 * self.inside.std.flow
            return jnp.where(near | ~present["flow"], self.inside.log_prob(residual, present), -jnp.inf)

        def sample(self, key, shape=()):
            return self.inside.sample(key, shape)

        def covariance(self):
            raise NotImplementedError

        def times(self, factor):
            return Bounded(self.inside.times(factor))

    law = Bounded(ss.Gaussian({"flow": 123.0}))
    return eqx.tree_at(lambda m: m.measurement_noise, nile_model(1000.0, 300.0), law)


class Lost(filters.ParticleFilter):
    """A filter of a user's own that does not look at its likelihood."""

    said: jax.Array = eqx.field(converter=jnp.asarray, default=-np.inf)

    def _init(self, model, row, key):
        belief, info = super()._init(model, row, key)
        return belief, info._replace(log_likelihood=self.said)

    def _step(self, model, belief, row):
        after, info = super()._step(model, belief, row)
        return after, info._replace(log_likelihood=self.said)


@pytest.mark.parametrize(("said", "code"), [(-np.inf, Result.measurement_too_far), (np.nan, 0), (-3.0, 0)])
def test_an_infinite_likelihood_is_a_code_of_whatever_filter(said, code):
    """NaN says that there is none. A failure that the filter tells of itself stays its own."""
    filter_, model = Lost(50, said=said), nile_model(1000.0, 300.0)
    assert np.asarray(filters.scan(filter_, model, _rows(NILE[:8]), KEY).info.result).tolist() == [int(code)] * 8
    bad = filters.scan(filter_, model, _rows(_with_flow(1, np.inf)), KEY).info.result
    assert np.asarray(bad)[:2].tolist() == [int(code), Result.non_finite_input]


@pytest.mark.parametrize("filter_", [PF, filters.AuxiliaryParticleFilter(50, threshold=0.5)], ids=["PF", "APF"])
def test_all_particles_dead(filter_):
    model, rows = _dead_model(), _rows(_with_flow(4, 1e5))
    recording = Recording(np.arange(8.0), {"flow": _with_flow(4, 1e5)})

    def of(model):
        estimate = filters.scan(filter_, model, rows, KEY)
        return jnp.stack([estimate.log_likelihood, estimate.mean.level.sum(), estimate.info.ess.sum()]), estimate

    gradients, estimate = jax.jit(jax.jacrev(of, has_aux=True))(model)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradients))
    assert np.abs(gradients.measurement_noise.inside.std.flow).max() > 0
    assert Result(int(estimate.result)) is Result.all_particles_dead
    assert int(estimate.failed_at) == 4
    assert np.asarray(estimate.info.log_likelihood)[4] == -np.inf
    assert np.asarray(estimate.info.ess)[4] == pytest.approx(50.0)
    assert np.isfinite(estimate.mean.level).all()
    assert (np.asarray(estimate.info.result)[5:] == 0).all()
    with pytest.raises(FilterError, match=r"row 4 .*flow = 100000\): every particle has zero weight"):
        driver.raise_failure(estimate, filter_, model, recording)


def _scalar_model(transition, observation=see_level, **kwargs):
    law = kwargs.pop("prior", {"level": 1.0})
    return ss.StateSpace(
        transition=transition,
        observation=observation,
        process_noise=ss.Discrete(ss.Gaussian({"level": 0.1})),
        measurement_noise=ss.Gaussian({"flow": 0.1}),
        prior=ss.Prior(ss.model.record("Level", {"level": 1.0}), law),
        **kwargs,
    )


def test_a_model_that_diverges_is_told_from_a_covariance_that_loses_definiteness():
    recording = Recording(np.arange(6.0), {"flow": np.zeros(6)})
    blown = _scalar_model(lambda s, t0, t1, x, u: type(x)(jnp.where(t1 == 3.0, jnp.inf, x.level)))
    estimate = filters.run(filters.Unscented(), blown, recording, throw=False)
    assert Result(int(estimate.result)) is Result.non_finite_state
    assert int(estimate.failed_at) == 3
    blind = _scalar_model(
        lambda s, t0, t1, x, u: x, lambda s, t, x, u: ss.model.record("Flow", {"flow": x.level / (t - 2.0)})
    )
    estimate = filters.run(filters.Unscented(), blind, recording, throw=False)
    assert Result(int(estimate.result)) is Result.non_finite_state
    assert int(estimate.failed_at) == 2
    with pytest.raises(FilterError, match=r"row 2 \(t = 2 s; flow = 0\): the state is no longer finite"):
        filters.run(filters.Unscented(), blind, recording)


def test_lost_definiteness_is_its_own_code():
    # By hand: points 1, 1.5, 0.5 become 1, 2.25, 0.25; weights of the mean -3, 2, 2 and of the covariance -7.25, 2, 2
    # give the mean 2 and the variance -1.
    model = _scalar_model(lambda s, t0, t1, x, u: type(x)(x.level**2))
    filter_ = filters.Unscented(alpha=0.5, beta=-5.0)
    estimate = filters.run(filter_, model, Recording(np.arange(6.0), {"flow": np.full(6, np.nan)}), throw=False)
    assert Result(int(estimate.result)) is Result.not_positive_definite
    assert int(estimate.failed_at) == 1


def test_first_failure_is_kept_over_a_batch_of_runs():
    flows = jnp.asarray(np.stack([NILE[:8], _with_flow(3, np.inf), _with_flow(6, -np.inf)]))
    model = nile_model(1000.0, 300.0)
    batch = jax.jit(jax.vmap(lambda flow: filters.scan(filters.Unscented(), model, _rows(flow))))(flows)
    np.testing.assert_array_equal(batch.failed_at, [-1, 3, 6])
    np.testing.assert_array_equal(batch.result, [0, 3, 3])


def test_settings_are_checked():
    with pytest.raises(InputError, match="particles = 1: must be a whole number of at least 2"):
        filters.ParticleFilter(1)
    with pytest.raises(InputError, match=r"particles = 10\.0"):
        filters.AuxiliaryParticleFilter(10.0)
    with pytest.raises(InputError, match=r"Unscented\.alpha = SquareRoot\(\): is a form; pass it by keyword"):
        filters.Unscented(filters.SquareRoot())
    for kind in (filters.ParticleFilter, filters.AuxiliaryParticleFilter):
        with pytest.raises(InputError, match=r"threshold = 1\.5: must be from 0"):
            kind(10, threshold=1.5)
        with pytest.raises(InputError, match=f"{kind.__name__} draws random numbers: give it a key"):
            filters.run(kind(10), nile_model(), nile_recording())


def test_missing_channel_is_named():
    with pytest.raises(InputError, match=r"unknown name\(s\) flow; there are: level"):
        filters.run(filters.Unscented(), nile_model(), Recording(np.arange(3.0), {"level": np.ones(3)}))


def test_heavy_tails_without_variance_work_in_particle_filters():
    model = eqx.tree_at(lambda m: m.measurement_noise, nile_model(1000.0, 300.0), ss.StudentT(1.5, {"flow": 100.0}))
    assert not model.measurement_noise.has_covariance
    _, info = eqx.filter_jit(PF.init)(model, model.row(0.0, {}, {"flow": 1100.0}), KEY)
    assert np.isnan(info.innovation_std.flow)
    assert np.isfinite(info.log_likelihood)


def test_the_schemes_named_in_the_docstring_exist():
    assert {"systematic", "stratified", "multinomial", "residual"} <= set(numerics.__all__)
    assert "**bias**" in filters.AbstractParticleFilter.__doc__
