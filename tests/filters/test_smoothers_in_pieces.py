"""A long log is smoothed in pieces: every Gaussian smoother gives the numbers of one piece, as do several models together."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_every_filter import FILTERS, MODELS, recordings

from jaxveh import Result, filters
from jaxveh.filters import kit
from jaxveh.filters.smoothing.pieces import ALONE, Runs, smooth_in_pieces
from jaxveh.statespace import Smoothing
from jaxveh.statespace.kit import smoothing_of

SMOOTHED = [name for name, line in FILTERS.items() if smoothing_of(line.make()) is Smoothing.gaussian]
TOGETHER = ("Kalman", "Extended", "Cubature, square root")
SLOPES = ("Extended", "Unscented, square root", "Gated")
MODEL = MODELS["linear"]()
ROWS = MODEL.rows(recordings("linear")[0])


def other(leaf):
    return jnp.stack([leaf, 1.01 * leaf, 0.98 * leaf]) if eqx.is_inexact_array(leaf) else leaf


MEMBERS = jax.tree.map(other, MODEL)


def first(tree):
    return jax.tree.map(lambda leaf: leaf[0] if eqx.is_array(leaf) else leaf, tree)


def joined(moments):
    """Fields of all members (3, ...) to fields (...)."""
    mean, std = moments
    return jax.tree.map(lambda leaf: leaf[0], mean), jax.tree.map(lambda leaf: jnp.max(leaf, axis=0), std)


def in_pieces(monkeypatch, filter_, models, rows, runs):
    """What the smoother gives in pieces of seven rows."""
    monkeypatch.setattr("jaxveh.numerics.pieces.PIECE", 7)
    return smooth_in_pieces(filter_, models, rows, runs)


def same(found, wanted, rtol=1e-9, atol=1e-10):
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(one, other, rtol, atol)


@pytest.mark.product
@pytest.mark.parametrize("name", SMOOTHED)
def test_pieces_give_what_all_rows_at_once_give(name, monkeypatch):
    assert np.isnan(np.stack(ROWS.y)).any() and len(ROWS.t) % 7 != 1
    filter_ = FILTERS[name].make()
    whole = kit.rauch_tung_striebel(filter_, MODEL, ROWS)
    same(eqx.filter_jit(in_pieces)(monkeypatch, filter_, MODEL, ROWS, ALONE), whole)


@pytest.mark.product
@pytest.mark.parametrize("least", [1, 10_000])
@pytest.mark.parametrize("name", TOGETHER)
def test_pieces_of_several_models_together(name, least, monkeypatch):
    """`least`: the rows from which a batch is written out."""
    monkeypatch.setattr("jaxveh.statespace.driver.WORTH", least)
    filter_ = FILTERS[name].make()
    whole = eqx.filter_jit(lambda: kit.smooth_together.__wrapped__(filter_, MEMBERS, ROWS, joined))()
    same(eqx.filter_jit(in_pieces)(monkeypatch, filter_, MEMBERS, ROWS, Runs(eqx.filter_vmap, first, joined)), whole)


def filled_up(rows):
    """The rows and nine more, in which everything fails."""
    longer = jax.tree.map(lambda leaf: jnp.append(leaf, jnp.full(9, leaf[-1])), rows)
    step = rows.t[-1] - rows.t[-2]
    at_end = slice(len(rows.t), None)
    wild = jax.tree.map(lambda leaf: leaf.at[at_end].set(jnp.inf), longer.y)
    return longer._replace(t=longer.t.at[at_end].add(step * jnp.arange(1.0, 10.0)), y=wild)


def of_the_rows(found):
    """What is of the rows that are there, and of all of them together."""
    rows = {n: getattr(found, n) for n in ("mean", "std")} | {
        f"f {n}": getattr(found.filtered, n) for n in ("mean", "info")
    }
    whole = {n: getattr(found.filtered, n) for n in ("belief", "log_likelihood", "result", "failed_at")}
    return jax.tree.map(lambda leaf: leaf[: len(ROWS.t)], rows), whole


@pytest.mark.product
@pytest.mark.parametrize("pieces", [False, True])
@pytest.mark.parametrize("name", SMOOTHED)
def test_rows_that_only_fill_up_count_for_nothing(name, pieces, monkeypatch):
    filter_, count = FILTERS[name].make(), jnp.asarray(len(ROWS.t))
    smoother = kit.rauch_tung_striebel.__wrapped__
    wanted = eqx.filter_jit(smoother)(filter_, MODEL, ROWS)
    if pieces:
        monkeypatch.setattr("jaxveh.numerics.pieces.PIECE", 7)
    found = eqx.filter_jit(lambda: smoother(filter_, MODEL, filled_up(ROWS), count))()
    same(of_the_rows(found), of_the_rows(wanted))


@pytest.mark.product
@pytest.mark.parametrize("least", [1, 10_000])
@pytest.mark.parametrize("name", TOGETHER)
def test_nor_in_several_models_together(name, least, monkeypatch):
    monkeypatch.setattr("jaxveh.statespace.driver.WORTH", least)
    filter_, count = FILTERS[name].make(), jnp.asarray(len(ROWS.t))
    together = kit.smooth_together.__wrapped__
    wanted = eqx.filter_jit(lambda: together(filter_, MEMBERS, ROWS, joined))()
    found = eqx.filter_jit(lambda: together(filter_, MEMBERS, filled_up(ROWS), joined, count))()
    same(of_the_rows(found), of_the_rows(wanted))


@pytest.mark.product
@pytest.mark.parametrize("name", SLOPES)
def test_gradients_are_those_of_all_rows_at_once(name, monkeypatch):
    filter_ = FILTERS[name].make()

    def slope(smooth):
        def value(model):
            found = smooth(model)
            return sum(jnp.sum(jnp.square(leaf)) for leaf in (*found.mean, *found.std)) + found.filtered.log_likelihood

        return eqx.filter_jit(eqx.filter_grad(value))(MODEL)

    whole = slope(lambda model: kit.rauch_tung_striebel(filter_, model, ROWS))
    found = slope(lambda model: in_pieces(monkeypatch, filter_, model, ROWS, ALONE))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(found))
    same(found, whole, rtol=1e-8, atol=1e-8)


def test_a_failure_is_that_of_its_row(monkeypatch):
    infinite = ROWS._replace(y=ROWS.y._replace(y0=ROWS.y.y0.at[16].set(jnp.inf)))
    found = in_pieces(monkeypatch, filters.Extended(), MODEL, infinite, ALONE).filtered
    assert int(found.failed_at) == 16 and int(found.result) == Result.non_finite_input
