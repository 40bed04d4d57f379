"""Noise laws against scipy: densities, marginals over what is present, moments of samples, scaling, errors."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from families import members

from jaxveh import InputError
from jaxveh import statespace as ss
from jaxveh.statespace.independent import combine, whiten
from jaxveh.statespace.process import Together, join

MATRIX = np.array([[2.0, 0.6, -0.3], [0.6, 1.0, 0.2], [-0.3, 0.2, 0.5]])
LAWS = {
    "gaussian": (ss.Gaussian({"a": 0.5, "b": 2.0}), [scipy.stats.norm(scale=0.5), scipy.stats.norm(scale=2.0)]),
    "student": (ss.StudentT(4.5, {"a": 0.5, "b": 2.0}), [scipy.stats.t(4.5, scale=0.5), scipy.stats.t(4.5, scale=2.0)]),
}
RESIDUAL = {"a": np.linspace(-3, 3, 7), "b": np.linspace(5, -4, 7), "c": np.linspace(0, 1, 7)}


def present(*names):
    return {name: np.asarray(name in names) for name in "abc"}


def residual(absent=()):
    return {name: np.where(name in absent, np.nan, values) for name, values in RESIDUAL.items()}


@jax.jit
def log_prob(law, residual, present):
    return law.log_prob(residual, present)


@pytest.mark.parametrize("kind", LAWS)
def test_log_prob_is_scipy_s_and_marginal_over_what_is_present(kind):
    law, (a, b) = LAWS[kind]
    np.testing.assert_allclose(
        log_prob(law, residual(), present("a", "b")), a.logpdf(RESIDUAL["a"]) + b.logpdf(RESIDUAL["b"]), rtol=1e-12
    )
    np.testing.assert_allclose(log_prob(law, residual("a"), present("b")), b.logpdf(RESIDUAL["b"]), rtol=1e-12)
    np.testing.assert_array_equal(log_prob(law, residual("ab"), present()), 0.0)


@pytest.mark.parametrize("weight", [0.0, 0.3, 1.0])
def test_mixture_log_prob(weight):
    law = ss.CauchyGaussianMixture(weight, {"a": 0.7}, {"a": 0.4})
    density = weight * scipy.stats.cauchy.pdf(RESIDUAL["a"], scale=0.7)
    density += (1 - weight) * scipy.stats.norm.pdf(RESIDUAL["a"], scale=0.4)
    np.testing.assert_allclose(log_prob(law, residual(), present("a")), np.log(density), rtol=1e-12)


@pytest.mark.parametrize("names", ["abc", "ac", "b", ""])
def test_multivariate_log_prob_is_the_marginal(names):
    law = ss.MultivariateGaussian(("a", "b", "c"), MATRIX)
    which = ["abc".index(name) for name in names]
    values = np.stack([RESIDUAL[name] for name in "abc"], axis=1)[:, which]
    expected = np.zeros(7)
    if which:
        expected = scipy.stats.multivariate_normal.logpdf(values, cov=MATRIX[np.ix_(which, which)])
    absent = [name for name in "abc" if name not in names]
    np.testing.assert_allclose(log_prob(law, residual(absent), present(*names)), expected, rtol=1e-12, atol=1e-14)
    scalar = {name: values[2] for name, values in residual(absent).items()}
    assert log_prob(law, scalar, present(*names)).shape == ()
    # Presence of its own for each element of a batch.
    here = {name: np.array([(name in names) == (k % 2 == 0) for k in range(7)]) for name in "abc"}
    mixed = np.asarray(log_prob(law, residual(), here))
    np.testing.assert_allclose(mixed[::2], expected[::2], rtol=1e-12, atol=1e-14)


def test_gradients_do_not_see_absent_values():
    laws = [law for law, _ in LAWS.values()]
    laws += [ss.MultivariateGaussian(("a", "b", "c"), MATRIX), ss.CauchyGaussianMixture(0.3, {"a": 1.0}, {"a": 0.4})]
    of = lambda laws: sum(law.log_prob(residual("a"), present("b", "c")).sum() for law in laws)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(jax.jit(jax.grad(of))(laws)))


@jax.jit
def draws_of(law, key):
    return law.sample(key, (40000,))


def _samples(law):
    return {name: np.asarray(values) for name, values in draws_of(law, jax.random.key(1)).items()}


def test_samples_have_the_law_s_moments():
    draws = _samples(LAWS["gaussian"][0])
    np.testing.assert_allclose([draws[n].std() for n in "ab"], [0.5, 2.0], rtol=0.02)
    assert abs(np.corrcoef(draws["a"], draws["b"])[0, 1]) < 0.02
    law = ss.MultivariateGaussian(("a", "b", "c"), MATRIX)
    draws = _samples(law)
    np.testing.assert_allclose(np.cov([draws[n] for n in "abc"]), MATRIX, atol=0.05)
    assert law.sample(jax.random.key(0), (2, 3))["b"].shape == (2, 3)
    assert law.sample(jax.random.key(0))["b"].shape == ()


@pytest.mark.parametrize(
    ("law", "distribution"),
    [
        (ss.Gaussian({"a": 0.5}), scipy.stats.norm(scale=0.5).cdf),
        (ss.StudentT(3.5, {"a": 0.5}), scipy.stats.t(3.5, scale=0.5).cdf),
        (
            ss.CauchyGaussianMixture(0.3, {"a": 2.0}, {"a": 0.4}),
            lambda x: 0.3 * scipy.stats.cauchy.cdf(x, scale=2.0) + 0.7 * scipy.stats.norm.cdf(x, scale=0.4),
        ),
        (ss.StudentT(3.5, {"a": 0.5}).times(jnp.asarray(3.0)), scipy.stats.t(3.5, scale=1.5).cdf),
        (
            ss.CauchyGaussianMixture(0.3, {"a": 2.0}, {"a": 0.4}).times(jnp.asarray(0.5)),
            lambda x: 0.3 * scipy.stats.cauchy.cdf(x, scale=1.0) + 0.7 * scipy.stats.norm.cdf(x, scale=0.2),
        ),
    ],
)
def test_samples_have_the_law_s_distribution(law, distribution):
    assert scipy.stats.kstest(_samples(law)["a"], distribution).pvalue > 0.01


def test_covariances_and_scaling():
    np.testing.assert_allclose(LAWS["gaussian"][0].covariance(), np.diag([0.25, 4.0]))
    np.testing.assert_allclose(LAWS["student"][0].covariance(), np.diag([0.25, 4.0]) * 4.5 / 2.5)
    np.testing.assert_allclose(LAWS["student"][0].times(2.0).covariance(), np.diag([1.0, 16.0]) * 4.5 / 2.5)
    law = ss.MultivariateGaussian(("a", "b", "c"), MATRIX)
    np.testing.assert_allclose(law.times(jnp.asarray(2.0)).covariance(), 4 * MATRIX)
    both = ss.Independent((law, ss.Gaussian({"d": 3.0})))
    np.testing.assert_allclose(both.times(2.0).covariance(), 4 * scipy.linalg.block_diag(MATRIX, 9.0))
    assert both.names == ("a", "b", "c", "d")
    assert both.has_covariance
    assert not ss.Independent(
        (ss.CauchyGaussianMixture(0.5, {"a": 1.0}, {"a": 1.0}), ss.Gaussian({"d": 1.0}))
    ).has_covariance


def test_a_covariance_that_does_not_exist():
    heavy = ss.StudentT(2.0, {"a": 1.0})
    assert not heavy.has_covariance
    assert ss.StudentT(2.1, {"a": 1.0}).has_covariance
    with pytest.raises(InputError, match=r"degrees of freedom = 2\.0: must be above 2 for a covariance to exist"):
        heavy.covariance()
    assert np.isnan(jax.jit(lambda law: law.covariance())(heavy)).all()
    with pytest.raises(InputError, match="CauchyGaussianMixture has no covariance"):
        ss.CauchyGaussianMixture(0.5, {"a": 1.0}, {"a": 1.0}).covariance()


def test_combine_merges_gaussians_and_keeps_others():
    merged = combine(ss.Gaussian({"a": 1.0}), None, ss.Gaussian({"b": 2.0}))
    assert isinstance(merged, ss.Gaussian)
    assert merged.names == ("a", "b")
    mixed = combine(ss.Gaussian({"a": 1.0}), ss.StudentT(3.0, {"c": 1.0}))
    assert isinstance(mixed, ss.Independent)
    assert set(mixed.names) == {"a", "c"}
    assert combine(None, None) is None
    expected = scipy.stats.norm.logpdf(RESIDUAL["a"]) + scipy.stats.t.logpdf(RESIDUAL["c"], 3.0)
    np.testing.assert_allclose(log_prob(mixed, residual(), present("a", "c")), expected, rtol=1e-12)
    assert sorted(_samples(mixed)) == ["a", "c"]


def test_whiten_decorrelates_what_is_present():
    law = ss.Independent((ss.MultivariateGaussian(("a", "b"), MATRIX[:2, :2]), ss.StudentT(4.0, {"c": 0.5})))
    here = {"a": np.array([True] * 6 + [False]), "b": np.asarray(True), "c": np.asarray(False)}
    white = jax.jit(whiten)(law, {**residual(), "c": np.full(7, np.nan)}, here)
    pair = np.stack([RESIDUAL["a"], RESIDUAL["b"]])
    distance = np.einsum("ik,ij,jk->k", pair, np.linalg.inv(MATRIX[:2, :2]), pair)
    np.testing.assert_allclose((white["a"] ** 2 + white["b"] ** 2)[:6], distance[:6], rtol=1e-12)
    np.testing.assert_allclose([white["a"][6], white["b"][6]], [0.0, RESIDUAL["b"][6]], rtol=1e-12)
    np.testing.assert_array_equal(white["c"], 0.0)
    alone = whiten(law.laws[1], residual(), present("c"))
    np.testing.assert_allclose(alone["c"], RESIDUAL["c"] / (0.5 * 2**0.5), rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: ss.Gaussian({"a": 0.0}),
            r"standard deviation of a = 0\.0: must be positive.*without noise is left out",
        ),
        (lambda: ss.Gaussian({"a": -1}), r"standard deviation of a = -1\.0"),
        (lambda: ss.Gaussian({}), "standard deviation is empty"),
        (lambda: ss.Gaussian(0.1), "must be a NamedTuple or a mapping"),
        (lambda: ss.StudentT(0.0, {"a": 1.0}), r"degrees of freedom = 0\.0"),
        (lambda: ss.StudentT(3.0, {"a": np.inf}), "scale of a = inf"),
        (lambda: ss.CauchyGaussianMixture(1.5, {"a": 1.0}, {"a": 1.0}), r"weight = 1\.5: must be from 0 to 1"),
        (lambda: ss.CauchyGaussianMixture(0.5, {"a": 1.0}, {"b": 1.0}), "must agree"),
        (
            lambda: ss.MultivariateGaussian(("a", "b"), MATRIX),
            r"covariance has shape \(3, 3\): must be \(2, 2\) for a, b",
        ),
        (lambda: ss.MultivariateGaussian(("a",), [[-1.0]]), "must be symmetric and positive definite"),
        (
            lambda: ss.MultivariateGaussian(("a", "b"), [[1.0, 0.5], [0.0, 1.0]]),
            "must be symmetric and positive definite",
        ),
        (lambda: ss.Independent((ss.Gaussian({"a": 1.0}), ss.Gaussian({"a": 1.0}))), "noise laws share fields"),
        (lambda: combine(ss.Gaussian({"a": 1.0}), ss.Gaussian({"a": 2.0})), "noise laws share fields"),
        (lambda: ss.Continuous(ss.StudentT(3.0, {"a": 1.0})), "StudentT as process noise is the law of one step"),
        (
            lambda: ss.Continuous(ss.Independent((ss.Gaussian({"b": 1.0}), ss.StudentT(3.0, {"a": 1.0})))),
            "wrap it in Discrete",
        ),
    ],
)
def test_errors(make, message):
    with pytest.raises(InputError, match=message):
        make()


CONCRETE = [getattr(ss, name) for name in sorted(members("statespace", ss.AbstractNoise))]


@pytest.mark.parametrize("kind", CONCRETE, ids=lambda kind: kind.__name__)
def test_a_law_of_the_package_cannot_be_changed_in_part(kind):
    """What a filter reads of it, its numbers, would be another law than what the class says."""
    type(kind)("Renamed", (kind,), {"__module__": __name__, "__annotations__": {}, "more": lambda self: 1.0})
    for name in ("log_prob", "sample", "covariance", "factor", "times", "names", "is_gaussian", "adds_up", "parts"):
        with pytest.raises(TypeError, match=rf"Own\.{name}: cannot replace that of {kind.__name__}: .*AbstractNoise"):
            type(kind)("Own", (kind,), {"__module__": __name__, "__annotations__": {}, name: lambda self: None})


def test_a_law_of_ones_own_can_be_changed_in_part():
    methods = dict.fromkeys(("sample", "log_prob", "covariance", "times"), lambda self, *given: None)
    body = {"__module__": __name__, "__annotations__": {}, "names": ("a",), "has_covariance": False}
    own = type(ss.AbstractNoise)("Own", (ss.AbstractNoise,), body | methods)
    changed = type(own)(
        "Changed", (own,), {"__module__": __name__, "__annotations__": {}, "sample": lambda self, *given: 1.0}
    )
    assert changed().sample(None) == 1.0 and own().sample(None) is None


@pytest.mark.parametrize("kind", [ss.Continuous, ss.Discrete])
def test_a_process_noise_of_a_derived_class_stays_itself_when_joined(kind):
    class Half(kind):
        def over(self, dt):
            return super().over(dt).times(0.5)

    for both in (
        join(Half(ss.Gaussian({"a": 2.0})), kind(ss.Gaussian({"b": 2.0}))),
        join(kind(ss.Gaussian({"b": 2.0})), Half(ss.Gaussian({"a": 2.0}))),
    ):
        law = both.over(jnp.asarray(1.0))
        assert dict(zip(law.names, np.diagonal(law.covariance()), strict=True)) == {"a": 1.0, "b": 4.0}


def test_process_noise_over_time_and_joined():
    dt = jnp.asarray(0.25)
    continuous, discrete = ss.Continuous(ss.Gaussian({"a": 2.0})), ss.Discrete(ss.StudentT(5.0, {"b": 3.0}))
    np.testing.assert_allclose(continuous.over(dt).std.a, 1.0)
    np.testing.assert_allclose(discrete.over(dt).scale.b, 3.0)
    both = join(continuous, discrete)
    assert isinstance(both, Together)
    assert set(both.law.names) == {"a", "b"}
    assert set(both.over(dt).names) == {"a", "b"}
    again = join(both, ss.Continuous(ss.Gaussian({"c": 4.0})))
    assert set(again.law.names) == {"a", "b", "c"}
    np.testing.assert_allclose(again.over(dt).laws[0].std.c, 2.0)
    assert join(None, continuous) is continuous
    assert join(None, None) is None
    assert isinstance(join(continuous, ss.Continuous(ss.Gaussian({"c": 1.0}))), ss.Continuous)
    assert isinstance(join(discrete, ss.Discrete(ss.Gaussian({"c": 1.0}))), ss.Discrete)


def test_strict_float32(float32):
    residuals = {name: jnp.asarray(value.astype(np.float32)) for name, value in residual().items()}
    laws = (ss.Gaussian({"a": 1.0}), ss.StudentT(4.0, {"a": 1.0}), ss.MultivariateGaussian(("a", "b", "c"), MATRIX))
    for law in (*laws, ss.Independent((ss.Gaussian({"b": 1.0}), ss.StudentT(4.0, {"a": 1.0})))):
        found = (
            jax.eval_shape(
                lambda law=law: (law.log_prob(residuals, present("a", "b", "c")), law.covariance()),
            ),
            jax.eval_shape(lambda law=law: law.sample(jax.random.key(0), (3,))),
        )
        assert {leaf.dtype.name for leaf in jax.tree.leaves(found)} == {"float32"}
