"""What resampling schemes, covariance forms and noise laws declare is what they do: each member of `__all__`, both ways."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import left_out, members
from filter_systems import nile_model
from nonlinear_systems import LogChiSquared
from test_every_filter import linear, recordings

from jaxveh import InputError, filters, numerics
from jaxveh import statespace as ss
from jaxveh._core.names import record_type
from jaxveh.filters import kit

N = 40
SCHEMES = {
    "plain": filters.PlainDraw(numerics.stratified),
    "soft": filters.Soft(0.6),
    "transport": filters.Transport(0.5, 60, 0.5),
}
FORMS = {"covariance": filters.Covariance(), "root": filters.SquareRoot(), "singular": filters.SingularValues()}
NORMAL = ss.Gaussian({"x": 0.5})
LAWS = {
    "normal": NORMAL,
    "jointly normal": ss.MultivariateGaussian(("x", "y"), np.array([[0.5, 0.2], [0.2, 0.3]])),
    "normal parts": ss.Independent((NORMAL, ss.MultivariateGaussian(("y",), np.array([[0.3]])))),
    "heavy": ss.StudentT(4.0, {"x": 0.5}),
    "one part heavy": ss.Independent((ss.Gaussian({"y": 0.5}), ss.StudentT(4.0, {"x": 0.5}))),
    "mixed": ss.CauchyGaussianMixture(0.3, {"x": 0.5}, {"x": 0.2}),
    "of a user": LogChiSquared(),
}
ANCESTORS = (
    lambda scheme: filters.AuxiliaryParticleFilter(N, scheme),
    lambda scheme: filters.Guided(N, resampling=scheme),
    lambda scheme: filters.Marginalised(N, ("x",), scheme),
    lambda scheme: filters.AdaptiveNumber(filters.ParticleFilter(N, scheme), {"x": 0.1}),
    lambda scheme: filters.FixedLag(filters.ParticleFilter(N, scheme), 2),
    lambda scheme: filters.Genealogy().check(filters.ParticleFilter(N, scheme), None),
)


def test_all_schemes_and_forms_and_laws_are_here():
    assert not left_out("filters", filters.AbstractResampling, SCHEMES.values(), {})
    assert not left_out("filters", filters.AbstractForm, FORMS.values(), {})
    assert members("statespace", ss.AbstractNoise) | {"LogChiSquared"} == {type(law).__name__ for law in LAWS.values()}


@pytest.mark.parametrize(
    ("base", "flags"),
    [
        (filters.AbstractResampling, ("keeps_ancestors", "reweights")),
        (filters.AbstractForm, ("negative_weights", "keeps_matrix", "triangular")),
    ],
)
def test_what_is_not_declared_is_no(base, flags):
    assert [getattr(base, flag) for flag in flags] == [False] * len(flags)


def weighted(seed=0):
    rng = np.random.default_rng(seed)
    particles = record_type("P", ("x", "y"))(jnp.asarray(rng.normal(size=N)), jnp.asarray(rng.normal(size=N)))
    return particles, jnp.asarray(rng.dirichlet(np.full(N, 0.7)))


@pytest.mark.parametrize("name", SCHEMES)
def test_a_scheme_does_what_it_declares(name):
    scheme, (particles, weights) = SCHEMES[name], weighted()
    of = lambda key: scheme.resample(key, particles, weights, kit.log_of(weights), N, "held")
    many = jax.jit(lambda key: jax.vmap(of)(jax.random.split(key, 400)))(jax.random.key(2))
    found, (particles, weights) = jax.tree.map(np.asarray, (many, (particles, weights)))
    for k in range(400):
        copies = [new[k] == old[found.ancestors[k]] for new, old in zip(found.particles, particles, strict=True)]
        assert bool(np.all(copies)) == scheme.keeps_ancestors
        assert bool(np.any(found.log_weights[k] != 0.0)) == scheme.reweights
    # Drawn or moved, weighted or not, the particles still say the same.
    mean = np.mean(np.exp(found.log_weights) * found.particles.x)
    np.testing.assert_allclose(mean, np.sum(weights * particles.x), atol=0.04)


@pytest.mark.parametrize("name", SCHEMES)
def test_who_needs_ancestors_asks_for_them_by_the_declaration(name):
    scheme = SCHEMES[name]
    for make in ANCESTORS:
        if scheme.keeps_ancestors:
            make(scheme)
            continue
        with pytest.raises(InputError, match=rf"of {type(scheme).__name__} have no ancestors.*\. (Take|Use) \w+"):
            make(scheme)


class Told(kit.AbstractResampling):
    """Of a user, who declares nothing: particles that stay where they are, their weights thrown away."""

    def resample(self, key, particles, weights, logs, n, gradient):
        return kit.Resampled(particles, jnp.arange(n), jnp.zeros_like(logs))


def test_a_scheme_of_a_user_that_declares_nothing_is_taken_by_the_bootstrap_filter_alone():
    model = linear()
    found = filters.scan(
        filters.ParticleFilter(N, Told()), model, model.rows(recordings("linear")[0]), jax.random.key(0)
    )
    assert bool(jnp.all(jnp.isfinite(found.log_likelihood)))
    for make in ANCESTORS:
        with pytest.raises(InputError, match="particles of Told have no ancestors"):
            make(Told())


@pytest.mark.parametrize("name", FORMS)
def test_a_form_does_what_it_declares(name):
    form, rng = FORMS[name], np.random.default_rng(3)
    root = rng.normal(size=(3, 3))
    covariance, deviations = root @ root.T, rng.normal(size=(3, 5))

    @jax.jit
    def spreads(covariance, deviations, root):
        image = kit.Image(jnp.zeros(3), deviations, root, None)
        return form.start(covariance), form.add(image, None, ("a", "b", "c"))

    found = jax.tree.map(np.asarray, spreads(covariance, deviations, root))
    for spread in found:
        assert (spread.matrix is not None) == form.keeps_matrix
        assert np.all(np.triu(spread.factor, 1) == 0.0) == form.triangular
    np.testing.assert_allclose(found[0].factor @ found[0].factor.T, covariance, rtol=1e-9)


@pytest.mark.parametrize("name", FORMS)
def test_a_form_takes_negative_weights_where_it_declares_so(name):
    """A covariance E W E^T with one negative weight, which is still positive definite."""
    form = FORMS[name]
    E, signs = np.hstack([np.eye(2), np.full((2, 1), 0.3)]), np.array([1.0, 1.0, -1.0])
    factor_of = lambda E: form.add(kit.Image(jnp.zeros(2), E, jnp.eye(2), signs), None, ("a", "b")).factor
    factor = np.asarray(jax.jit(factor_of)(E))
    assert np.allclose(factor @ factor.T, E * signs @ E.T, rtol=1e-9) == form.negative_weights


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_normal_and_adds_up_where_it_declares_so(name):
    """By the log-density along a line, a parabola or not; and by the fourth moment of sums of four draws."""
    law = LAWS[name]
    at = lambda r: law.log_prob(dict(zip(law.names, r, strict=True)), dict.fromkeys(law.names, jnp.asarray(True)))
    steps = np.array([0.0, 0.5, 1.0, 2.0])
    line = np.squeeze(jax.jit(jax.vmap(at))(np.tile(steps[:, None], len(law.names))))
    curvature = [(line[i] - line[0]) / steps[i] ** 2 for i in (1, 2, 3)]
    assert bool(np.allclose(curvature, curvature[0], rtol=1e-6)) == law.is_gaussian
    one, four = (np.asarray(next(iter(part.values()))) for part in draws(law))
    assert law.adds_up == (abs(kurtosis(four) - kurtosis(one)) < 0.1 and abs(np.std(four) / np.std(one) - 2.0) < 0.03)


def draws(law, n=200_000):
    """Single draws, and sums of four, of the law's last field by name."""
    name = law.names[-1]
    found = np.asarray(jax.jit(lambda key: law.sample(key, (4, n))[name])(jax.random.key(5)))
    return {name: found[0]}, {name: found.sum(axis=0)}


def kurtosis(values):
    centred = values - values.mean()
    return np.mean(centred**4) / np.mean(centred**2) ** 2


@pytest.mark.parametrize("name", LAWS)
def test_continuous_noise_is_of_laws_that_add_up(name):
    law = LAWS[name]
    if law.adds_up:
        assert ss.Continuous(law).law is law
        return
    with pytest.raises(InputError, match=r"\w+ as process noise is the law of one step: wrap it in Discrete"):
        ss.Continuous(law)


class Doubting(kit.AbstractReweighting):
    """Of a user."""

    inner: filters.AbstractGaussianFilter

    def update(self, model, belief, row):
        return self.inner.update(kit.with_variances(model, 2.0 * kit.variances_of(model)), belief, row)


class Following(kit.AbstractLearnedNoise):
    """Of a user."""

    inner: filters.AbstractGaussianFilter

    def start(self, model):
        return kit.variances_of(model)

    def believed_model(self, model, memory):
        return kit.with_variances(model, memory)

    def update(self, model, belief, row):
        return self.update_inside(model, belief, row)


DEPENDENT = ss.StateDependent(lambda system, t, x, u: {"x": 0.5}, "x")


@pytest.mark.parametrize("law", [*LAWS, "of the state"])
def test_a_user_s_wrapper_of_the_noise_says_which_laws_it_cannot_change(law):
    noise = (LAWS | {"of the state": DEPENDENT})[law]
    model = eqx.tree_at(lambda m: m.measurement_noise, nile_model(), noise, is_leaf=lambda node: node is None)
    kind = rf"measurement noise (is {type(noise).__name__}: must be Gaussian|of x depends on the state)"
    for wrapper in (Doubting, Following):
        if law == "normal":
            wrapper(filters.Kalman()).check(nile_model())
            continue
        with pytest.raises(InputError, match=f"{wrapper.__name__}: the {kind}"):
            wrapper(filters.Kalman()).check(model)
    if law in ("normal", "mixed"):
        np.testing.assert_allclose(kit.variances_of(model), [np.square(float(noise.std.x))])
        changed = kit.with_variances(model, np.array([9.0]))
        np.testing.assert_allclose(changed.measurement_noise.std.x, 3.0)
        return
    for look in (kit.variances_of, lambda model: kit.with_variances(model, np.ones(2))):
        with pytest.raises(InputError, match=r"measurement noise is \w+: must be Gaussian.* kit.AbstractReweighting"):
            look(model)
