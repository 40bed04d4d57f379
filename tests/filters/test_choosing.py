"""Choosing particles in ways that let derivatives through, in numbers that adapt, and beside Kalman filters of their own.

What is looked at of one filter and model comes from one program: values and slopes, at a point and beside it, for all seeds.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn_systems import drawn, exact, linear
from filter_systems import linear_model
from test_every_filter import pendulum

from jaxveh import InputError, filters, numerics
from jaxveh import statespace as ss
from jaxveh._core.names import record, record_type
from jaxveh.filters.choosing import log_of, score
from jaxveh.filters.gaussian.linear import _nonlinear_parts
from jaxveh.filters.marginalised import _nonlinear_in
from jaxveh.filters.transport import distances, transport_plan

SEEDS = 60


def runs(filter_, model, rows, seeds=SEEDS):
    """Log-likelihoods (seeds,), last means (seeds, n) and effective numbers of particles (seeds, T)."""
    of = lambda key: filters.scan(filter_, model, rows, key)
    found = jax.jit(jax.vmap(of))(jax.random.split(jax.random.key(3), seeds))
    return np.asarray(found.log_likelihood), np.stack(found.mean, axis=-1)[:, -1], np.asarray(found.info.ess)


def one():
    return linear(), linear().rows(drawn()), exact()


def values_and_slopes(filter_, scales):
    """Log-likelihoods of one key with the dynamics times each of `scales`, and their derivatives by it."""
    model, rows, _ = one()
    with_ = lambda scale: eqx.tree_at(lambda m: m.system["A"], model, scale * model.system["A"])
    value = lambda scale: filters.scan(filter_, with_(scale), rows, jax.random.key(2)).log_likelihood
    both = jax.jit(jax.value_and_grad(value))
    return np.array([both(scale) for scale in scales]).T


def moved(scheme, particles, weights):
    return jax.jit(scheme.move_particles)(particles, weights)


def test_scores_carry_derivatives_of_every_order_through_a_scan():
    """A mean over draws with held chances and their scores has the derivatives of the mean itself."""
    gains = np.array([1.0, -2.0, 0.5])
    chances = lambda x: jax.nn.softmax(jnp.stack([x, x * x, 1 - x]))

    def drawn(x):
        chance = chances(x)
        return jnp.sum(jax.lax.stop_gradient(chance) * jnp.exp(score(jnp.log(chance))) * gains)

    def three_steps(mean):
        return lambda x: jax.lax.scan(lambda c, _: (x + 0.3 * mean(c), None), x, None, length=3)[0]

    def derivatives(of):
        first = jax.grad(of)
        second = jax.grad(first)
        return lambda x: (first(x), second(x), jax.grad(second)(x))

    ours, exact = derivatives(three_steps(drawn)), derivatives(three_steps(lambda x: jnp.sum(chances(x) * gains)))
    found, expected = jax.jit(lambda x: (ours(x), exact(x)))(np.float64(0.4))
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert score(jnp.asarray(-jnp.inf)) == 0.0


class TestTransport:
    def test_the_plan_s_margins_are_the_weights(self):
        rng = np.random.default_rng(0)
        points, weights = rng.normal(size=(2, 40)), rng.dirichlet(np.ones(40))
        of = lambda points, weights: transport_plan(distances(points), log_of(weights), 0.05, 200)
        plan = np.asarray(jax.jit(of)(points, weights))
        np.testing.assert_allclose(plan.sum(axis=1), 1.0, rtol=1e-12)
        np.testing.assert_allclose(plan.sum(axis=0) / 40, weights, atol=1e-5)

    def test_with_little_smoothing_it_is_the_transport_in_order(self):
        """In one dimension the optimal map keeps the order: quantiles go to quantiles."""
        rng = np.random.default_rng(1)
        x = np.sort(rng.normal(size=20))
        # Whole numbers of twentieths: particle i takes the place of as many.
        counts = rng.multinomial(20, np.full(20, 1 / 20))
        found, _ = moved(filters.Transport(1e-4, 3000), record_type("P", ("x",))(x), counts / 20)
        np.testing.assert_allclose(found.x, np.repeat(x, counts), atol=0.02)

    def test_the_mean_stays_and_a_field_that_does_not_vary_is_left_alone(self):
        rng = np.random.default_rng(2)
        particles = record_type("P", ("x", "y"))(rng.normal(size=30), np.full(30, 7.0))
        weights = rng.dirichlet(np.ones(30))
        found, _ = moved(filters.Transport(0.2, 300), particles, weights)
        np.testing.assert_allclose(np.mean(found.x), np.sum(weights * particles.x), atol=1e-4)
        np.testing.assert_allclose(found.y, 7.0, rtol=1e-12)

    @pytest.mark.parametrize("unit", [1e-12, 1e12])
    def test_units_do_not_matter(self, unit):
        rng = np.random.default_rng(4)
        particles, weights = record_type("P", ("x", "y"))(*rng.normal(size=(2, 30))), rng.dirichlet(np.ones(30))
        transport = filters.Transport(0.2, 300)
        plain, converged = moved(transport, particles, weights)
        scaled, also = moved(transport, particles._replace(y=unit * particles.y), weights)
        assert converged and also
        np.testing.assert_allclose(scaled.x, plain.x, rtol=1e-9)
        np.testing.assert_allclose(scaled.y / unit, plain.y, rtol=1e-9)

    def test_its_bias_falls_with_the_smoothing(self):
        model, total, bias = linear(n=3), exact(n=3)["log_likelihood"].sum(), {}
        for epsilon in (2.0, 0.1):
            logs, *_ = runs(
                filters.ParticleFilter(60, filters.Transport(epsilon, 40)), model, model.rows(drawn(n=3)), 40
            )
            bias[epsilon] = abs(np.mean(logs) - total)
        assert bias[0.1] < 0.25 * bias[2.0]

    def test_its_gradient_is_that_of_differences(self):
        """Of one key the likelihood is smooth; with little smoothing so steep that differences do not tell."""
        filter_ = filters.ParticleFilter(40, filters.Transport(0.5, 20))
        values, slopes = values_and_slopes(filter_, [1.0, 1.0 + 1e-6, 1.0 - 1e-6])
        np.testing.assert_allclose(slopes[0], (values[1] - values[2]) / 2e-6, rtol=1e-5)

    def test_a_plan_that_misplaces_weight_is_told_however_far_the_particles_are_spread(self):
        rng = np.random.default_rng(3)
        particles, weights = record_type("P", ("x",))(rng.normal(size=30)), rng.dirichlet(np.full(30, 0.2))
        few, many = filters.Transport(1e-3, 1), filters.Transport(0.3, 500)
        assert not moved(few, particles, weights)[1] and moved(many, particles, weights)[1]
        # All weight on one particle: nothing is misplaced by a plan that is of other weights.
        assert not moved(filters.Transport(0.3, 500, 10.0), particles, np.eye(30)[4])[1]

    def test_without_a_plan_it_is_the_bootstrap_filter_value_and_gradient(self):
        never = filters.Transport(0.3, 1, 1e-12)
        found, plain = (values_and_slopes(filters.ParticleFilter(40, s), [1.0]) for s in (never, numerics.systematic))
        np.testing.assert_allclose(found, plain, rtol=1e-9)

    def test_it_is_for_the_bootstrap_filter_alone(self):
        for make in (
            filters.AuxiliaryParticleFilter,
            filters.Guided,
            lambda n, resampling: filters.Marginalised(n, ("x",), resampling),
        ):
            with pytest.raises(InputError, match="particles of Transport have no ancestors.* or ParticleFilter"):
                make(10, resampling=filters.Transport())


class TestSoft:
    def test_the_likelihood_stays_unbiased(self):
        model, rows, exact = one()
        logs, *_ = runs(filters.ParticleFilter(800, filters.Soft(0.7)), model, rows)
        ratio = np.exp(logs - exact["log_likelihood"].sum())
        assert abs(ratio.mean() - 1.0) < 3.0 * ratio.std() / np.sqrt(SEEDS)

    @pytest.mark.full
    def test_with_scores_its_gradient_is_exact_within_scatter_and_held_it_is_biased_less_than_no_share(self):
        model, rows, _ = one()
        leaves, rest = eqx.partition(model, eqx.is_inexact_array)

        def slopes(filter_, seeds):
            of = lambda leaves, key: filters.scan(filter_, eqx.combine(leaves, rest), rows, key).log_likelihood
            found = jax.jit(jax.vmap(jax.grad(of), in_axes=(None, 0)))(
                leaves, jax.random.split(jax.random.key(1), seeds)
            )
            return np.asarray(found.system["A"]).reshape(seeds, -1)

        exact = slopes(filters.Kalman(), 1)[0]
        scored = slopes(filters.ParticleFilter(800, filters.Soft(0.7)), SEEDS)
        scatter = scored.std(axis=0) / np.sqrt(SEEDS)
        assert (np.abs(scored.mean(axis=0) - exact) < 4.0 * scatter + 0.05 * np.abs(exact) + 0.05).all()
        off = lambda filter_: np.linalg.norm(slopes(filter_, SEEDS).mean(axis=0) - exact)
        held = off(filters.ParticleFilter(800, gradient="held"))
        soft = off(filters.ParticleFilter(800, filters.Soft(0.5), gradient="held"))
        assert soft < 0.9 * held

    @pytest.mark.parametrize("share", [-0.1, 1.0])
    def test_a_share_outside_its_range_is_refused(self, share):
        with pytest.raises(InputError, match="Soft.share"):
            filters.Soft(share)


class TestAdaptiveNumber:
    def test_a_wide_belief_takes_more_than_a_sharp_one_as_fox_says(self):
        filter_ = filters.AdaptiveNumber(filters.ParticleFilter(2000), {"x0": 0.1}, sizes=(100, 500, 2000))

        @jax.jit
        def bins_and_number(spread, key):
            x = record_type("P", ("x0",))(spread * jax.random.normal(key, (2000,)))
            weights, themselves = jnp.full(2000, 1 / 2000), jnp.arange(2000)
            belief = filters.ParticleBelief(x, weights, themselves, key, 0.0, (), jnp.int32(1))
            return filter_.filled_bins(belief), filter_.number(belief)

        (few, sharp), (many, wide) = (bins_and_number(spread, jax.random.key(1)) for spread in (0.02, 3.0))
        assert int(few) == 2 and int(many) > 60
        k = int(many) - 1
        part = 2 / (9 * k)
        expected = k / 0.1 * (1 - part + 2.3263478740408408 * part**0.5) ** 3
        np.testing.assert_allclose(wide, expected, rtol=1e-12)
        assert float(sharp) < 100 < float(wide)

    @pytest.mark.parametrize(
        "kind", [filters.ParticleFilter, pytest.param(filters.AuxiliaryParticleFilter, marks=pytest.mark.full)]
    )
    def test_the_likelihood_stays_unbiased_while_the_number_changes(self, kind):
        model, rows, exact = one()
        filter_ = filters.AdaptiveNumber(kind(1000), {"x0": 0.4, "x1": 0.4}, sizes=(200, 500, 1000), error=0.1)
        logs, _, alive = runs(filter_, model, rows)
        ratio = np.exp(logs - exact["log_likelihood"].sum())
        assert abs(ratio.mean() - 1.0) < 3.5 * ratio.std() / np.sqrt(SEEDS)
        assert alive.max() <= 1000

    def test_sizes_that_do_not_rise_to_the_filter_s_number_are_refused(self):
        with pytest.raises(InputError, match=r"sizes = \(50, 20\)"):
            filters.AdaptiveNumber(filters.ParticleFilter(50), {"x": 1.0}, sizes=(50, 20))
        with pytest.raises(InputError, match="so that it resamples in every step"):
            filters.AdaptiveNumber(filters.ParticleFilter(50, threshold=0.5), {"x": 1.0})
        with pytest.raises(InputError, match="bins is empty"):
            filters.AdaptiveNumber(filters.ParticleFilter(50), {})


class TestMarginalised:
    def test_of_a_linear_model_only_the_drawn_states_scatter(self):
        """With all but one state linear it is nearer to the exact answer than a filter that draws all."""
        model, rows, exact = one()
        total = exact["log_likelihood"].sum()
        drawn, *_ = runs(filters.ParticleFilter(100), model, rows)
        marginal, means, _ = runs(filters.Marginalised(100, ("x1",)), model, rows)
        assert np.std(marginal) < 0.5 * np.std(drawn)
        ratio = np.exp(marginal - total)
        assert abs(ratio.mean() - 1.0) < 3.5 * ratio.std() / np.sqrt(SEEDS)
        scatter = means.std(axis=0) / np.sqrt(SEEDS)
        spread = np.sqrt(np.diagonal(exact["covariance"][-1]))
        assert (np.abs(means.mean(axis=0) - exact["mean"][-1]) < 4.0 * scatter + 0.02 * spread).all()

    def test_what_is_not_linear_or_carries_no_noise_is_refused_by_name(self):
        with pytest.raises(InputError, match="state x0 is not linear in x0"):
            filters.Marginalised(10, ("x0",)).check(pendulum())
        filters.Marginalised(10, ("x2",)).check(pendulum())
        model = eqx.tree_at(lambda m: m.process_noise, linear_model(2, 1), ss.Continuous(ss.Gaussian({"x0": 0.1})))
        with pytest.raises(InputError, match="the drawn states x1 have no process noise"):
            filters.Marginalised(10, ("x0",)).check(model)

    def test_a_function_of_the_states_within_is_found_nonlinear_wherever_it_is(self):
        """At their means, which are zero, the last two seem linear; where all states move alike, the difference. The exact
        Kalman filter's check of all states finds the same, whatever the units are."""
        functions = {
            "straight": lambda x: 3.0 * x.a - 0.7 * x.z + 5.0,
            "huge": lambda x: 1e9 * x.a - 0.3e9 * x.z,
            "tiny": lambda x: 1e-9 * x.a + 1e-12 * x.a**2,
            "linear": lambda x: x.z**2 * x.a - 3.0 * jnp.sin(x.z) * x.b + 5.0,
            "square": lambda x: x.a**2,
            "product": lambda x: x.a * x.b,
            "difference": lambda x: (x.a - x.b) ** 2,
            "small": lambda x: 1e-6 * x.b**2 + 1e3 * x.a,
            "square_and_drawn": lambda x: x.z * x.a**2,
            "product_and_drawn": lambda x: x.a * x.b * x.z,
        }
        names = ("z", "a", "b")
        model = ss.StateSpace(
            transition=lambda system, t0, t1, x, u: x._replace(b=x.z * x.a**2),
            observation=lambda system, t, x, u: record("Seen", {name: f(x) for name, f in functions.items()}),
            process_noise=ss.Continuous(ss.Gaussian(dict.fromkeys(names, 0.1))),
            measurement_noise=ss.Gaussian(dict.fromkeys(functions, 0.1)),
            prior=ss.Prior(record_type("Drawn", names)(0.0, 0.0, 0.0), dict.fromkeys(names, 2.0)),
        )
        states, channels = _nonlinear_in(("a", "b"), model)
        np.testing.assert_array_equal(states, [False, False, True])
        linear = {name for name, curved in zip(functions, channels, strict=True) if not curved}
        assert linear == {"straight", "huge", "linear"}
        for states, channels in _nonlinear_parts(model):
            np.testing.assert_array_equal(states, [False, False, True])
            assert {name for name, curved in zip(functions, channels, strict=True) if not curved} == {
                "straight",
                "huge",
            }
        with pytest.raises(InputError, match="state b is not linear in a, b"):
            filters.Marginalised(10, ("a", "b")).check(model)

    def test_spreads_count_those_within_and_between_particles(self):
        model, rows, exact = one()

        @jax.jit
        def spreads(key):
            belief = filters.scan(filters.Marginalised(2000, ("x1",)), model, rows, key).belief
            return belief.covariance, belief.moments(model)[1]

        covariance, std = spreads(jax.random.key(5))
        np.testing.assert_allclose(covariance, exact["covariance"][-1], rtol=0.35, atol=0.01)
        np.testing.assert_allclose(std, np.sqrt(np.diagonal(covariance)), rtol=1e-9)
