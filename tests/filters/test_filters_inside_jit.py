"""What every filter checks inside jit, and what it may not be given there: each of `FILTERS` and what it has inside."""

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest
from families import made_again, refuses_arrays_as_settings
from filter_systems import nile_model, see_level
from test_copies_of_filters import OTHERS
from test_every_filter import FILTERS, MODELS, pendulum, recordings

from jaxveh import InputError, filters
from jaxveh import statespace as ss

NOISE = lambda model: model.measurement_noise.std.y0


@pytest.mark.parametrize("dtype", [jnp.float64, jnp.float32])
@pytest.mark.parametrize("name", FILTERS)
def test_a_model_passes_with_a_traced_noise_and_in_either_dtype(name, dtype):
    """One number of the model is traced, as in a likelihood over noise levels, and the others are known."""
    filter_, model = FILTERS[name].make(), ss.cast(MODELS["straight"](), dtype)

    def check(noise):
        filter_.check(eqx.tree_at(NOISE, model, noise))
        return noise

    jax.eval_shape(check, NOISE(model))
    filter_.check(model)


@pytest.mark.parametrize("filter_", [filters.Kalman(), filters.Marginalised(20, ("x0",))])
def test_a_nonlinear_model_is_refused_though_its_noise_is_traced(filter_):
    model = pendulum()
    with pytest.raises(InputError, match=r"state x0 is not (a )?linear"):
        jax.eval_shape(lambda noise: filter_.check(eqx.tree_at(NOISE, model, noise)), NOISE(model))


def test_a_model_whose_functions_are_of_traced_numbers_passes():
    model = nile_model()

    def check(scale):
        grow = lambda system, t0, t1, x, u: type(x)(scale * x.level)
        noises = {"process_noise": model.process_noise, "measurement_noise": model.measurement_noise}
        filters.Kalman().check(ss.StateSpace(transition=grow, observation=see_level, prior=model.prior, **noises))
        return scale

    jax.eval_shape(check, 1.0)


def parts():
    """Each class of filter, form, scheme, ... once."""
    seen = set()
    for name, make in ({name: line.make for name, line in FILTERS.items()} | OTHERS).items():
        for made, given in made_again(make(), seen) if "model" not in name else ():
            yield pytest.param(made, given, id=made.__name__)


@pytest.mark.filterwarnings("ignore:A JAX array is being set as static:UserWarning")
@pytest.mark.parametrize(("made", "given"), list(parts()))
def test_no_setting_is_an_array(made, given):
    refuses_arrays_as_settings(made, given)


def test_a_batch_of_no_runs_has_no_results():
    """Also within a batch; particle filters have no other form for batches."""
    model = MODELS["straight"]()
    rows = model.rows(recordings("straight")[0])
    run = lambda noise: filters.scan(filters.Extended(), eqx.tree_at(NOISE, model, noise), rows, None, ())
    for empty, shape in ((run, (0,)), (jax.vmap(run), (0, 3)), (jax.vmap(run), (3, 0))):
        assert jax.eval_shape(jax.vmap(empty), jnp.zeros(shape)).log_likelihood.shape == shape
