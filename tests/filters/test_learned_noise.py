"""Noise that filters learn or are told: wavelet variances, process noise that shrinks or follows the corrections."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_model, linear_recording, nile_model

from jaxveh import InputError, Recording, filters
from jaxveh import statespace as ss
from jaxveh.filters.wrappers import wavelet


def walk(rows, seed, noise, drift=0.1):
    """A slow level, measured with standard deviations `noise` (rows,): the level, and the recording."""
    rng = np.random.default_rng(seed)
    level = np.cumsum(drift * rng.normal(size=rows))
    return level, Recording(np.arange(float(rows)), {"flow": level + noise * rng.normal(size=rows)})


def model(noise=1.0, drift=0.1):
    return eqx.tree_at(
        lambda m: (m.measurement_noise, m.process_noise),
        nile_model(0.0, 1.0),
        (ss.Gaussian({"flow": noise}), ss.Discrete(ss.Gaussian({"level": drift}))),
    )


ROWS = 1200


def run(filter_, model, recording, **more):
    """`filters.run` with rows that say nothing behind the last, up to `ROWS`: recordings of all lengths are one program, and what
    is learned of measurements stays as it was after the last."""
    count = len(recording.time)
    flow = np.append(recording["flow"], np.full(ROWS - count, np.nan))
    return filters.run(filter_, model, Recording(np.arange(float(ROWS)), {"flow": flow}), **more)


def rmse(estimate, level, start=100):
    return float(np.sqrt(np.mean((np.asarray(estimate.mean.level)[: len(level)] - level)[start:] ** 2)))


class TestHaarNoise:
    def test_it_finds_the_sensor_s_noise_without_the_model(self):
        stds = np.where(np.arange(1200) < 600, 0.5, 4.0)
        _, recording = walk(1200, 0, stds)
        belief = run(filters.HaarNoise(filters.Kalman()), model(1.0), recording).belief
        np.testing.assert_allclose(np.sqrt(belief.memory.variances[0]), 4.0, rtol=0.2)
        half = Recording(recording.time[:600], {"flow": recording["flow"][:600]})
        belief = run(filters.HaarNoise(filters.Kalman()), model(1.0), half).belief
        np.testing.assert_allclose(np.sqrt(belief.memory.variances[0]), 0.5, rtol=0.2)

    def test_it_makes_good_a_noise_level_that_is_wrong(self):
        found, plain, right = [], [], []
        for seed in range(5):
            level, recording = walk(600, seed, np.full(600, 5.0))
            found.append(rmse(run(filters.HaarNoise(filters.Kalman()), model(0.5), recording), level))
            plain.append(rmse(run(filters.Kalman(), model(0.5), recording), level))
            right.append(rmse(run(filters.Kalman(), model(5.0), recording), level))
        # Three quarters of what the right number would bring.
        assert np.mean(found) - np.mean(right) < 0.25 * (np.mean(plain) - np.mean(right))

    def test_the_window_is_the_last_values_that_were_there(self):
        flow = np.arange(12.0) ** 2
        flow[3:7] = np.nan
        recording = Recording(np.arange(12.0), {"flow": flow})
        belief = filters.run(filters.HaarNoise(filters.Kalman(), 4, 0.0, 1e-6, 1e9), model(), recording).belief
        values = flow[np.isfinite(flow)][-4:]
        np.testing.assert_array_equal(belief.memory.values[:, 0], values)
        details = (values[1::2] - values[::2]) / np.sqrt(2)
        expected = (np.median(np.abs(details)) / 0.6744897501960817) ** 2
        np.testing.assert_allclose(belief.memory.variances[0], expected, rtol=1e-12)

    def test_from_its_fewest_rows_on_what_is_there_of_a_window_counts(self):
        flow = np.array([1.0, 3.0, np.nan, 8.0, 4.0, 9.0, 1.0, 2.0, 2.5, 7.0])
        filter_ = filters.HaarNoise(filters.Kalman(), 6, 0.75, 1e-6, 1e9, fewest=4, initial=25.0)
        base, given = model(2.0), []
        expected = 25.0 * 4.0
        step, belief = eqx.filter_jit(filter_.step), None
        rows = jax.tree.map(np.asarray, base.rows(Recording(np.arange(10.0), {"flow": flow})))
        for k, value in enumerate(flow):
            row = jax.tree.map(lambda leaf, k=k: leaf[k], rows)
            belief = filter_.init(base, row)[0] if k == 0 else step(base, belief, row)[0]
            if np.isfinite(value):
                given.append(value)
                last = np.array(given[-6:])
                last = last[len(last) % 2 :]
                if len(given) >= 4:
                    median = np.median(np.abs(last[1::2] - last[::2]) / np.sqrt(2))
                    expected = 0.75 * expected + 0.25 * (median / 0.6744897501960817) ** 2
            np.testing.assert_allclose(belief.memory.variances[0], expected, rtol=1e-12)

    def test_a_wary_start_saves_what_the_first_rows_of_a_poor_sensor_spoil(self):
        errors = {"told": [], "wary": [], "as the data sheet says": []}
        poor = {
            "told": (filters.Kalman(), 8.0),
            "wary": (filters.HaarNoise(filters.Kalman(), 16, fewest=4, initial=16.0), 1.0),
            "as the data sheet says": (filters.HaarNoise(filters.Kalman(), 16), 1.0),
        }
        for seed in range(10):
            level, recording = walk(60, seed, np.full(60, 8.0))
            for name, (filter_, noise) in poor.items():
                errors[name].append(rmse(run(filter_, model(noise), recording), level, start=0))
        told, wary, sheet = (np.mean(values) for values in errors.values())
        assert wary - told < 0.4 * (sheet - told)

    @pytest.mark.parametrize(
        ("more", "message"),
        [({"fewest": 1}, "fewest = 1"), ({"fewest": 9}, "to the window, 8"), ({"initial": 0.001}, "initial = 0.001")],
    )
    def test_a_start_that_makes_no_sense_is_refused(self, more, message):
        with pytest.raises(InputError, match=message):
            filters.HaarNoise(filters.Kalman(), 8, **more)

    @pytest.mark.parametrize(("window", "memory"), [(5, 0.9), (2, 0.9), (8, 1.0)])
    def test_bad_settings_are_refused(self, window, memory):
        with pytest.raises(InputError, match="HaarNoise"):
            filters.HaarNoise(filters.Kalman(), window, memory)


PARTICLES = filters.ParticleFilter(10)


class TestHaarParticles:
    def test_what_it_learns_is_what_haar_noise_learns(self):
        _, recording = walk(200, 2, np.full(200, 3.0))
        particles = run(filters.HaarParticles(PARTICLES), model(1.0), recording, key=jax.random.key(0))
        gaussian = run(filters.HaarNoise(filters.Kalman()), model(1.0), recording)
        np.testing.assert_array_equal(particles.belief.memory.values, gaussian.belief.memory.values)
        np.testing.assert_allclose(particles.belief.memory.variances, gaussian.belief.memory.variances, rtol=1e-12)
        # Particles are weighed with it: nine times the variance is three times the spread.
        np.testing.assert_allclose(particles.info.innovation_std.flow[199], 3.0, rtol=0.4)

    @pytest.mark.parametrize(("follows", "scale"), [("gaussian", 0.7), ("both", 0.7 * 3.0)])
    def test_of_a_mixture_the_gaussian_part_follows_and_the_other_where_asked(self, follows, scale):
        law = ss.CauchyGaussianMixture(0.1, {"flow": 0.7}, {"flow": 2.0})
        mixed = eqx.tree_at(lambda m: m.measurement_noise, model(), law)
        filter_ = filters.HaarParticles(filters.ParticleFilter(10), follows=follows)
        filter_.check(mixed)
        own = jnp.array([4.0])
        memory = wavelet.first_window(filter_, own)._replace(variances=9.0 * own)
        told = filter_._with_memory(mixed, memory).measurement_noise
        np.testing.assert_allclose((told.std.flow, told.scale.flow), (6.0, scale))

    def test_draws_of_what_it_knows_are_its_particles(self):
        _, recording = walk(20, 2, np.full(20, 3.0))
        filter_ = filters.HaarParticles(PARTICLES)
        belief = run(filter_, model(1.0), recording, key=jax.random.key(0)).belief
        drawn = belief.sample(jax.random.key(1), 50).level
        assert np.isin(drawn, belief.inside.particles.level).all()

    def test_what_it_cannot_is_refused(self):
        with pytest.raises(InputError, match="use HaarNoise"):
            filters.HaarParticles(filters.Kalman())
        with pytest.raises(InputError, match="follows"):
            filters.HaarParticles(filters.ParticleFilter(10), follows="neither")
        heavy = eqx.tree_at(lambda m: m.measurement_noise, model(), ss.StudentT(4.0, {"flow": 1.0}))
        with pytest.raises(InputError, match="StudentT"):
            filters.HaarParticles(filters.ParticleFilter(10)).check(heavy)


class TestShrinkingProcess:
    def test_the_extra_noise_at_least_halves_whatever_the_data_say(self):
        _, recording = walk(40, 1, np.ones(40))
        filter_ = filters.ShrinkingProcess(filters.Kalman(), {"level": 3.0})
        step, base = eqx.filter_jit(filter_.step), model()
        rows = jax.tree.map(np.asarray, base.rows(recording))
        row = lambda k: jax.tree.map(lambda leaf: leaf[k], rows)
        belief, _ = filter_.init(base, row(0))
        for k in range(1, 40):
            after, _ = step(base, belief, row(k))
            q, d = float(belief.memory[0]), float(after.mean.level - belief.mean.level) ** 2
            np.testing.assert_allclose(after.memory[0], q * abs(q - 0.5 * (d + q)) / (q + d), rtol=1e-6, atol=1e-300)
            assert float(after.memory[0]) <= 0.5 * q
            belief = after

    def test_it_amounts_to_a_larger_prior(self):
        """A level that starts far off is found as by an honest prior, and not by the model's own."""
        level = np.full(60, 8.0)
        rng = np.random.default_rng(2)
        recording = Recording(np.arange(60.0), {"flow": level + rng.normal(size=60)})
        small = eqx.tree_at(lambda m: m.prior.law.std.level, model(drift=0.01), jnp.asarray(0.2))
        honest = eqx.tree_at(lambda m: m.prior.law.std.level, small, jnp.asarray(8.0))
        error = lambda f, m: abs(float(run(f, m, recording).mean.level[59]) - 8.0)
        shrinking = filters.ShrinkingProcess(filters.Kalman(), {"level": 8.0})
        assert error(filters.Kalman(), small) > 2.0
        assert error(shrinking, small) < error(filters.Kalman(), honest) + 0.2


class TestMatchedProcess:
    def test_it_follows_a_jump_that_the_model_does_not_know(self):
        level = np.where(np.arange(300) < 150, 0.0, 30.0)
        rng = np.random.default_rng(3)
        recording = Recording(np.arange(300.0), {"flow": level + rng.normal(size=300)})
        plain = run(filters.Kalman(), model(drift=0.05), recording)
        found = run(filters.MatchedProcess(filters.Kalman(), {"level": 10.0}), model(drift=0.05), recording)
        after = slice(155, 200)
        error = lambda e: np.abs(np.asarray(e.mean.level)[:300] - level)[after].mean()
        assert error(found) < 0.2 * error(plain)

    def test_the_first_row_teaches_nothing_and_most_is_the_most(self):
        recording = Recording(np.arange(4.0), {"flow": np.array([500.0, 500.0, 900.0, 900.0])})
        filter_ = filters.MatchedProcess(filters.Kalman(), {"level": 2.0}, forgetting=0.5)
        base = model()
        rows = jax.tree.map(np.asarray, base.rows(recording))
        row = lambda k: jax.tree.map(lambda leaf: leaf[k], rows)
        step, (belief, _) = eqx.filter_jit(filter_.step), filter_.init(base, row(0))
        np.testing.assert_array_equal(belief.memory[0], [0.0])
        for k in range(1, 4):
            belief, _ = step(base, belief, row(k))
        np.testing.assert_allclose(belief.memory[0], [4.0], rtol=1e-12)

    def test_a_process_noise_with_correlations_gets_the_same_more(self):
        """Written as a matrix without correlations it gives the same numbers; what it does not name is added."""
        base, extra = linear_model(3, 2, seed=4), {"x0": 0.3, "x2": 0.2}
        stds, recording = {"x0": 0.2, "x1": 0.1}, linear_recording(base, rows=20, seed=2)
        matrix = ss.MultivariateGaussian(tuple(stds), np.diag(np.square(list(stds.values()))))
        for wrap in (filters.MatchedProcess, filters.ShrinkingProcess):
            both = []
            for law in (ss.Gaussian(stds), matrix):
                changed = eqx.tree_at(lambda m: m.process_noise, base, ss.Continuous(law))
                both.append(filters.run(wrap(filters.Kalman(), extra), changed, recording))
            np.testing.assert_allclose(both[0].log_likelihood, both[1].log_likelihood, rtol=1e-10)
            np.testing.assert_allclose(np.stack(both[0].std), np.stack(both[1].std), rtol=1e-9)

    def test_bad_input_is_named(self):
        with pytest.raises(InputError, match="most is empty"):
            filters.MatchedProcess(filters.Kalman(), {})
        with pytest.raises(InputError, match="unknown name.* speed"):
            filters.MatchedProcess(filters.Kalman(), {"speed": 1.0}).check(model())
        with pytest.raises(InputError, match="extra of level = -1"):
            filters.ShrinkingProcess(filters.Kalman(), {"level": -1.0})
