"""A batch of runs with 7 to 14 states is those runs one by one: each filter that is `written_out`, in turn."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_model, linear_recording
from test_batches import BATCHED, SMOOTHED, same
from test_every_filter import FILTERS

from jaxveh import filters
from jaxveh import statespace as ss
from jaxveh.filters.smoothing.rauch_tung_striebel import rauch_tung_striebel
from jaxveh.statespace import driver

ROWS = 12
BY_DEFAULT = ("Extended", "Unscented", "contaminated")
"""What is compiled for each filter takes some seconds: these see every primitive of steps but those of square roots."""

DIFFERENTIATED = ("Extended", "Unscented", "Unscented, square root")


def each_of(names, by_default):
    return [name if name in by_default else pytest.param(name, marks=pytest.mark.full) for name in names]


@pytest.fixture(scope="module", autouse=True)
def every_batch_is_worth_it():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jaxveh.statespace.driver.WORTH", 1)
        jax.clear_caches()
        yield
    jax.clear_caches()


def states_of(name):
    """Of the filters in turn, 7 to 14; a rule whose points grow with a power takes fewest."""
    return 7 if name == "Gauss-Hermite" else 7 + BATCHED.index(name) % (driver.SOME - driver.FEW)


def model_and_rows(n, seed=2):
    """A model with independent measurement noises, and two runs with other measurements and inputs, some missing."""
    model = eqx.tree_at(lambda m: m.measurement_noise, linear_model(n, 2, seed), ss.Gaussian({"y0": 0.4, "y1": 0.5}))
    rows = [model.rows(linear_recording(model, ROWS, seed)) for seed in (1, 5)]
    return model, jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *rows)


def of_run(tree, i):
    return jax.tree.map(lambda leaf: leaf[i], tree)


def steps_taken(function, *operands):
    """Whether the program has steps with the batch's axis last."""
    return "jaxveh_steps" in str(jax.make_jaxpr(function)(*operands))


@pytest.mark.parametrize("name", each_of(BATCHED, BY_DEFAULT))
def test_a_batch_is_its_runs(name):
    filter_, (model, rows) = FILTERS[name].make(), model_and_rows(states_of(name))
    prior = lambda shift: jax.tree.map(lambda x: x + shift, model.prior.mean)
    scan = lambda shift, rows: filters.scan(
        filter_, eqx.tree_at(lambda m: m.prior.mean, model, prior(shift)), rows, None, ("mean", "std", "info.nis")
    )
    shifts = jnp.asarray([0.0, 0.1])
    assert bool(jnp.isnan(rows.y.y0).any()) and steps_taken(jax.vmap(scan), shifts, rows)
    batch = jax.jit(jax.vmap(scan))(shifts, rows)
    same(of_run(batch, 1), scan(shifts[1], of_run(rows, 1)), rtol=1e-8)


@pytest.mark.parametrize("name", each_of(SMOOTHED, BY_DEFAULT[:1]))
def test_a_batch_is_smoothed_as_its_runs(name):
    filter_, (model, rows) = FILTERS[name].make(), model_and_rows(states_of(name))
    smooth = lambda rows: rauch_tung_striebel(filter_, model, rows)
    same(of_run(jax.vmap(smooth)(rows), 1), smooth(of_run(rows, 1)), rtol=1e-8)


@pytest.mark.parametrize("name", each_of(DIFFERENTIATED, DIFFERENTIATED[:1]))
def test_the_gradient_of_a_batch_is_that_of_its_runs(name):
    filter_, (model, rows) = FILTERS[name].make(), model_and_rows(9)
    leaves, rest = eqx.partition(model, eqx.is_inexact_array)
    value = lambda leaves, rows: filters.scan(filter_, eqx.combine(leaves, rest), rows, None, ()).log_likelihood
    together = jax.jit(jax.grad(lambda leaves: jnp.sum(jax.vmap(value, in_axes=(None, 0))(leaves, rows))))(leaves)
    alone = jax.jit(jax.grad(value))
    same(together, jax.tree.map(jnp.add, *(alone(leaves, of_run(rows, i)) for i in (0, 1))), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(("states", "last"), [(driver.FEW, False), (driver.SOME, True), (driver.SOME + 1, False)])
def test_which_states_have_their_axis_last(states, last):
    model, rows = model_and_rows(states)
    scan = lambda rows: filters.scan(filters.Extended(), model, rows, None, ())
    assert steps_taken(jax.vmap(scan), rows) == last


def test_a_run_of_a_batch_fails_as_it_does_alone():
    model, rows = model_and_rows(8)
    rows = rows._replace(y=rows.y._replace(y0=rows.y.y0.at[0, 7].set(jnp.inf)))
    batch = jax.vmap(lambda rows: filters.scan(filters.Unscented(), model, rows, None, ()))(rows)
    assert batch.result.tolist()[0] > 0 == batch.result.tolist()[1]
    assert batch.failed_at.tolist() == [7, -1]
    assert np.isfinite(batch.log_likelihood[1])
