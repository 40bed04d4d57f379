"""The bootstrap: standard errors as the information gives them, all fits in one program, and its errors."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rig_sweeps import brush, measured_of, small_plan, table

from jaxveh import InputError, fitting, tyres

COLUMNS, RUN = small_plan()


@pytest.fixture(scope="module")
def rig():
    return table(measured_of(brush(), COLUMNS, ("F_x", "F_y", "M_z")), COLUMNS, RUN, 0.02, 1)


@pytest.fixture(scope="module")
def fit(rig):
    start = tyres.Brush(jnp.asarray(5e4), jnp.asarray(5e4), jnp.asarray(0.7), jnp.asarray(0.04))
    return fitting.fit_rig(start, rig)


def test_two_hundred_rigs_spread_as_the_information_says(fit):
    found = jax.jit(lambda key: fitting.bootstrap(fit.problem, key))(jax.random.key(0))
    assert found.parameters.array().shape == (4, 200) and bool(found.converged.all())
    np.testing.assert_allclose(found.parameters_std.array(), fit.parameters_std.array(), rtol=0.3)
    np.testing.assert_allclose(
        found.parameters_std.array(), np.std(found.parameters.array(), axis=1, ddof=1), rtol=1e-9
    )
    np.testing.assert_allclose(np.mean(found.parameters.array(), axis=1), fit.parameters.array(), rtol=0.01)


def test_runs_are_drawn_whole(fit):
    """Rows of which each is there three times know no more than one of them, where they are drawn as one."""
    wide = lambda leaf: jnp.repeat(leaf, 3, axis=-1)
    parts = lambda p: (p.contact.slip_angle, p.contact.slip_ratio, p.contact.load, p.contact.camber, p.contact.speed,
                       p.contact.pressure, p.measured, p.weight)  # fmt: skip
    thrice = eqx.tree_at(parts, fit.problem, [wide(leaf) for leaf in parts(fit.problem)])
    key = jax.random.key(1)
    by_row = fitting.bootstrap(thrice, key, count=60)
    by_group = fitting.bootstrap(thrice, key, count=60, groups=np.repeat(np.arange(RUN.size), 3))
    np.testing.assert_allclose(by_group.parameters_std.array(), fit.parameters_std.array(), rtol=0.4)
    assert np.all(by_row.parameters_std.array() < 0.8 * by_group.parameters_std.array())


def test_errors_are_named(fit):
    key = jax.random.key(0)
    with pytest.raises(InputError, match="count = 1: must be a whole number of at least 2"):
        fitting.bootstrap(fit.problem, key, count=1)
    with pytest.raises(InputError, match=r"groups has shape \(3,\): must be \(270,\)"):
        fitting.bootstrap(fit.problem, key, groups=[0, 1, 2])
    with pytest.raises(InputError, match="the data have 3 parts to resample"):
        fitting.bootstrap(fit.problem, key, groups=RUN % 3)


def test_fits_that_did_not_converge_are_left_out(fit):
    found = fitting.bootstrap(fit.problem, jax.random.key(2), count=60, max_steps=4)
    ended = np.asarray(found.converged)  # half of them, in four steps
    assert 5 < ended.sum() < 55
    np.testing.assert_allclose(
        found.parameters_std.array(), np.std(found.parameters.array()[:, ended], axis=1, ddof=1), rtol=1e-9
    )
