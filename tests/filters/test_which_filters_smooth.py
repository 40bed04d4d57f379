"""Every filter of the package declares that it can be smoothed, and is, by the equations, or is refused."""

import inspect
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_recording
from test_every_filter import FILTERS, linear

from jaxveh import InputError, filters
from jaxveh.filters.gaussian.wrapper import AbstractStateless
from jaxveh.filters.wrappers.base import gaussian_of
from jaxveh.statespace.capabilities import smoothing_of
from jaxveh.statespace.contract import Smoothing

ROWS = 8
TABLE = {name: line.make for name, line in FILTERS.items()} | {
    "paused": lambda: filters.Paused(filters.Cubature(), "force", {"x0": 1.0}),
    "varying noise": lambda: filters.VaryingNoise(filters.Cubature(), {"y0": "force"}),
}
SMOOTHED = [name for name, make in TABLE.items() if smoothing_of(make()) is Smoothing.gaussian]
DRAWN = [name for name, make in TABLE.items() if smoothing_of(make()) is Smoothing.particles]
REFUSED = [name for name in TABLE if name not in SMOOTHED and name not in DRAWN]


def short():
    return linear_recording(linear(), rows=ROWS, seed=2)


def test_the_table_has_every_filter_of_the_package():
    kinds = {type(make()) for make in TABLE.values()}
    public = [getattr(filters, name) for name in filters.__all__]
    concrete = [
        k for k in public if inspect.isclass(k) and issubclass(k, filters.AbstractFilter) and not inspect.isabstract(k)
    ]
    assert {k.__name__ for k in concrete} <= {k.__name__ for k in kinds}


def test_what_the_package_smooths():
    """A new filter that declares nothing stands among the refused, and this list says so."""
    assert {type(TABLE[name]()).__name__ for name in REFUSED} == {
        "AdaptiveNumber", "Consider", "Delayed", "Ensemble", "Federated", "FixedLag", "HInfinity", "HaarParticles",
        "InteractingModels", "LiuWest", "Marginalised", "Paused", "Regularised", "StrongTracking", "VaryingNoise",
    }  # fmt: skip
    # Tested in test_smoothers.py: paths of particles against the exact answer.
    assert {type(TABLE[name]()).__name__ for name in DRAWN} == {"AuxiliaryParticleFilter", "Guided", "ParticleFilter"}


@pytest.mark.parametrize("name", REFUSED)
def test_what_declares_nothing_is_refused(name):
    filter_, model = TABLE[name](), linear()
    message = f"{type(filter_).__name__} has no smoother: its class does not declare one"
    with pytest.raises(InputError, match=message):
        filters.smooth(filter_, model, short(), key=jax.random.key(0))
    with pytest.raises(InputError, match=message):
        filters.FixedLag(filter_, 2)


@eqx.filter_jit
def forwards(filter_, model, rows):
    """Vectors and covariances of each row's belief, and of what was predicted of each row but the first."""
    first, rest = jax.tree.map(lambda leaf: leaf[0], rows), jax.tree.map(lambda leaf: leaf[1:], rows)
    shown = lambda belief: (gaussian_of(belief).vector, gaussian_of(belief).covariance)
    belief, _ = filter_.init(model, first)

    def onward(belief, row):
        ahead = filter_.predict_between(model, belief, row.t, row.u)
        after, _ = filter_.update(model, ahead, row)
        return after, (shown(after), shown(ahead))

    _, (after, ahead) = jax.lax.scan(onward, belief, rest)
    return jax.tree.map(lambda one, others: jnp.concatenate([one[None], others]), shown(belief), after), ahead


def by_hand(filter_, model, recording):
    """Rauch, Tung & Striebel in NumPy through the filter's own beliefs and its own predictions."""
    found = jax.tree.map(np.asarray, forwards(filter_, model, model.rows(recording)))
    (vectors, covariances), (ahead_vectors, ahead_covariances) = found
    A, t = np.asarray(model.system["A"]), np.asarray(recording.time)
    m, P = vectors[-1], covariances[-1]
    means, spreads = [m], [np.sqrt(np.diag(P))]
    for k in range(ROWS - 2, -1, -1):
        before, F = covariances[k], np.eye(len(m)) + (t[k + 1] - t[k]) * A
        G = before @ F.T @ np.linalg.inv(ahead_covariances[k])
        m = vectors[k] + G @ (m - ahead_vectors[k])
        P = before + G @ (P - ahead_covariances[k]) @ G.T
        means.insert(0, m)
        spreads.insert(0, np.sqrt(np.diag(P)))
    return np.array(means), np.array(spreads)


@pytest.mark.product
@pytest.mark.parametrize("name", SMOOTHED)
def test_what_declares_it_is_smoothed_by_the_equations(name):
    filter_, model, recording = TABLE[name](), linear(), short()
    means, spreads = by_hand(filter_, model, recording)
    found = filters.smooth(filter_, model, recording)
    np.testing.assert_allclose(np.stack(found.mean, 1), means, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(np.stack(found.std, 1), spreads, rtol=1e-7)


class Inflated(AbstractStateless):
    """Of a user: predictions wider by a factor; nothing is declared."""

    inner: filters.AbstractGaussianFilter
    factor: float = eqx.field(static=True, default=1.1)

    def predict_between(self, model, belief, t, u_next):
        return self.inner.predict_between(model, belief, t, u_next).inflate(jnp.asarray(self.factor))

    def update(self, model, belief, row):
        return self.inner.update(model, belief, row)


class Shifted(filters.Extended):
    """Of a user: a filter of the package that predicts otherwise; the declaration is not inherited."""

    def predict_between(self, model, belief, t, u_next):
        return super().predict_between(model, belief, t, u_next).inflate(jnp.asarray(1.1))


class Renamed(Inflated):
    """Of a user who has looked: nothing is inflated, and it says that it can be smoothed."""

    smooths: ClassVar[Smoothing] = Smoothing.gaussian

    def predict_between(self, model, belief, t, u_next):
        return self.inner.predict_between(model, belief, t, u_next)


def test_a_wrapper_of_a_user_is_smoothed_only_where_it_says_so():
    model, recording = linear(), short()
    for filter_, name in (
        (Inflated(filters.Kalman()), "Inflated"),
        (Shifted(), "Shifted"),
        (filters.Gated(Inflated(filters.Kalman())), "Inflated"),
        (filters.Iterated(Shifted()), "Shifted"),
    ):
        for call in (
            lambda: filters.smooth(filter_, model, recording),  # noqa: B023
            lambda: filters.smooth(filter_, model, recording, lag=2),  # noqa: B023
            lambda: filters.FixedLag(filter_, 2),  # noqa: B023
        ):
            with pytest.raises(InputError, match=f"{name} has no smoother"):
                call()
    with pytest.raises(InputError, match=r"must be Kalman\(\) or Iterated"):
        filters.smooth_parallel(filters.Iterated(Shifted()), model, recording)
    found = filters.smooth(Renamed(filters.Kalman()), model, recording)
    np.testing.assert_allclose(found.std.x0, filters.smooth(filters.Kalman(), model, recording).std.x0, rtol=1e-9)
