"""Square-root forms in float32 where a covariance loses its digits: sharp sensors, little process noise, a wide prior."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_model, linear_recording

from jaxveh import Recording, filters
from jaxveh import statespace as ss
from jaxveh.filters import SingularValues, SquareRoot


def stressed():
    """R x 1e-6, Q x 1e-4, P0 x 100, of a stable system: states that grow for ever lose their digits by themselves."""
    model = linear_model(4, 2, seed=16)
    assert np.linalg.eigvals(np.asarray(model.system["A"])).real.max() < 0
    times = lambda law, factor: law.times(jnp.asarray(factor**0.5))
    return eqx.tree_at(
        lambda m: (m.measurement_noise, m.process_noise.law, m.prior.law),
        model,
        (
            times(model.measurement_noise, 1e-6),
            times(model.process_noise.law, 1e-4),
            times(model.prior.law, 1e2),
        ),
    )


def drawn(model):
    """A recording of the model itself, so that innovations have the size that the filter expects."""
    return ss.draw(model, linear_recording(model, rows=200, seed=4), jax.random.key(6)).recording


def cast(recording):
    """The channels in float32; the stamps keep their digits."""
    return Recording(np.asarray(recording.time), {n: np.asarray(recording[n], np.float32) for n in recording.names})


@functools.cache
def exact_answer():
    model = stressed()
    recording = drawn(model)
    return model, recording, filters.run(filters.Kalman(SquareRoot()), model, recording)


FORMS = {"square root": SquareRoot(), "singular values": SingularValues()}
FILTERS = {
    "Extended": lambda form: filters.Extended(form),
    "Unscented": lambda form: filters.Unscented(form=form),
    "Cubature": lambda form: filters.Cubature(form=form),
    "degree 5": lambda form: filters.Cubature(degree=5, form=form),
    "Iterated": lambda form: filters.Iterated(filters.Extended(form), 2),
}


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("form", FORMS)
def test_it_stays_within_a_thousandth_of_float64(form, name):
    model, recording, exact = exact_answer()
    single = filters.run(FILTERS[name](FORMS[form]), ss.cast(model, jnp.float32), cast(recording))
    spread = np.stack(exact.std)
    assert np.isfinite(single.log_likelihood) and not int(single.result)
    np.testing.assert_allclose(np.stack(single.std), spread, rtol=1e-3)
    error = np.abs(np.stack(single.mean) - np.stack(exact.mean)) / (np.abs(np.stack(exact.mean)) + spread)
    assert np.max(error) < 1e-3
