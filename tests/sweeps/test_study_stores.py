"""`sweeps.Stores`: a study's sweeps in a folder, the same as in memory, and computed once."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, sweeps
from jaxveh._core.names import record
from jaxveh.sweeps import IN_MEMORY, Design, Stores, study_stores
from jaxveh.sweeps.store import Store

COUNT = 5


class Spring(eqx.Module):
    stiffness: jax.Array
    law: str = eqx.field(static=True)


def pull(spring, key, start):
    """A tree of all that a study's results have: numbers, whole numbers, truth values, nothing, a module and a key."""
    x = start + jax.random.normal(key, (3,))
    force = jnp.sin(x) if spring.law == "sine" else x
    moved = eqx.tree_at(lambda s: s.stiffness, spring, spring.stiffness * jnp.sum(force))
    return (
        record("Pulled", {"x": force, "count": jnp.sum(x > 0), "lost": jnp.any(x > 9)}),
        moved,
        None,
        jax.random.fold_in(key, 1),
    )


@pytest.fixture
def rows(monkeypatch):
    """Arguments of `pull`, rows in front; in a store they are three chunks."""
    monkeypatch.setattr(study_stores, "RUNS", 2)
    springs = Spring(jnp.arange(1.0, 1.0 + COUNT), "sine")
    return springs, jax.random.split(jax.random.key(2), COUNT), np.linspace(0.0, 1.0, COUNT)


def assert_same(found, plain):
    assert jax.tree.structure(found) == jax.tree.structure(plain)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(plain), strict=True):
        assert one.dtype == other.dtype and one.shape == other.shape
        if jnp.issubdtype(one.dtype, jax.dtypes.prng_key):
            one, other = jax.random.key_data(one), jax.random.key_data(other)
        np.testing.assert_allclose(one, other, rtol=1e-12)


def test_each_row_is_computed_once_and_comes_back_in_its_tree(tmp_path, rows, monkeypatch):
    plain = jax.vmap(pull)(*rows)
    assert_same(IN_MEMORY.each("pulled", pull, *rows), plain)
    told = []
    found = Stores(tmp_path).each("pulled", pull, *rows, progress=lambda done, total, stage: told.append((done, total)))
    assert_same(found, plain)
    assert told == [(k, 3) for k in range(4)]
    monkeypatch.setattr(Store, "write", None)
    assert_same(Stores(tmp_path).each("pulled", pull, *rows), plain)


@pytest.mark.studies
def test_other_processes_find_the_same(tmp_path, rows):
    assert_same(Stores(tmp_path, processes=2).each("pulled", pull, *rows), jax.vmap(pull)(*rows))


def test_a_sweep_has_what_it_has_in_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(study_stores, "RUNS", 4)
    design = Design(scale=[1.0, 2.0], law={"sine": jnp.sin, 7: jnp.tanh})

    def run(point, key):
        return {"x": point.law(point.scale * jax.random.normal(key, (3,)))}

    plain = IN_MEMORY.sweep("x", run, design, COUNT, jax.random.key(0), devices=jax.devices()[:1])
    found = Stores(tmp_path).under("part").sweep("x", run, design, COUNT, jax.random.key(0), devices=jax.devices()[:1])
    assert found.design is design and found.seeds == plain.seeds == COUNT
    np.testing.assert_allclose(found.at("x", law=7, scale=2.0), plain.at("x", law=7, scale=2.0), rtol=1e-12)
    # In chunks of four: as many seeds as that holds.
    assert Store(tmp_path / "part" / "x.zarr").plan.block == (1, 4)
    assert sweeps.read_sweep(tmp_path / "part" / "x.zarr").design.axis("law").labels == ("sine", "7")
    Stores(tmp_path).sweep("own", run, design, COUNT, jax.random.key(0), batch=2)
    assert Store(tmp_path / "own.zarr").plan.block == (1, 2)


@pytest.mark.parametrize("folder", [False, True])
def test_a_score_of_values_and_data_is_what_a_run_would_return(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(study_stores, "RUNS", 4)
    design, data = Design(scale=[1.0, 2.0, 3.0]), {"x": np.random.default_rng(0).normal(size=(3, COUNT, 6))}
    run = lambda point, drive: {"said": {"mean": point.scale * jnp.cumsum(drive["x"]), "std": drive["x"] ** 2}}
    score = lambda said, drive: {
        "rmse": jnp.sqrt(jnp.mean((said["said.mean"] - drive["x"]) ** 2)),
        "std": said["said.std"],
    }
    stores = Stores(tmp_path) if folder else IN_MEMORY
    found = stores.sweep("scored", run, design, data=data, score=score)
    whole = sweeps.sweep(
        lambda point, drive: score(sweeps.running.arrays_of(run(point, drive)), drive), design, data=data
    )
    assert set(found.values) == {"rmse", "std"} and found["rmse"].shape == (3, COUNT)
    for name in whole.values:
        np.testing.assert_allclose(found[name], whole[name], rtol=1e-12)
    if folder:
        # Values in between are not stored.
        assert set(sweeps.read_sweep(tmp_path / "scored.zarr").values) == {"rmse", "std"}


@pytest.mark.parametrize("folder", [False, True])
def test_a_score_needs_data_and_numbers(folder, tmp_path):
    stores = Stores(tmp_path) if folder else IN_MEMORY
    run, score = lambda point, key: {"x": jnp.zeros(3)}, lambda said, drive: said
    with pytest.raises(InputError, match=r"score: needs data, and a design of numbers"):
        stores.sweep("x", run, Design(scale=[1.0]), 2, jax.random.key(0), score=score)
    choices = Design(law={"one": 1, "two": 2})
    with pytest.raises(InputError, match=r"score: needs data, and a design of numbers"):
        stores.sweep("x", lambda point, drive: {"x": drive}, choices, data=np.zeros((2, 3)), score=score)
