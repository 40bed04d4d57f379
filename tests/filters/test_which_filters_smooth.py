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
from jaxveh.statespace.contract import Smoothing, smoothing_of

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


def by_hand(filter_, model, recording):
    """Rauch, Tung & Striebel in NumPy through the filter's own beliefs and its own predictions."""
    rows = model.rows(recording)
    row = lambda k: jax.tree.map(lambda leaf: leaf[k], rows)

    @eqx.filter_jit
    def look(belief, next_row):
        ahead = gaussian_of(filter_.predict_between(model, belief, next_row.t, next_row.u))
        return ahead, filter_.step(model, belief, next_row)[0]

    belief, _ = filter_.init(model, row(0))
    beliefs, aheads = [gaussian_of(belief)], []
    for k in range(1, ROWS):
        ahead, belief = look(belief, row(k))
        beliefs.append(gaussian_of(belief))
        aheads.append(ahead)
    A, t = np.asarray(model.system["A"]), np.asarray(recording.time)
    m, P = np.asarray(beliefs[-1].vector), np.asarray(beliefs[-1].covariance)
    means, spreads = [m], [np.sqrt(np.diag(P))]
    for k in range(ROWS - 2, -1, -1):
        now, ahead = beliefs[k], aheads[k]
        before, F = np.asarray(now.covariance), np.eye(len(m)) + (t[k + 1] - t[k]) * A
        G = before @ F.T @ np.linalg.inv(np.asarray(ahead.covariance))
        m = np.asarray(now.vector) + G @ (m - np.asarray(ahead.vector))
        P = before + G @ (P - np.asarray(ahead.covariance)) @ G.T
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
