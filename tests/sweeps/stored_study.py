"""A small study with a store, as a module and as a program: `python stored_study.py STORE [processes N | client ADDRESS]`."""

import sys
import time

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import sweeps

KEY = jax.random.key(3)
DESIGN = sweeps.Design(decay=[0.1, 0.5, 0.9], law={"tanh": jnp.tanh, "sine": jnp.sin})
SEEDS, BATCH = 50, 8


def run(point, key):
    """Some arithmetic whose bits would tell of another order of sums."""
    start = jax.random.normal(key, (6, 6))
    move = lambda x, _: (point.law(x @ x.T * 0.1 + point.decay * x), None)
    end, _ = jax.lax.scan(move, start, None, length=40)
    return {
        "total": jnp.sum(end),
        "deep": {"corner": end[:2, 0]},
        "count": jnp.sum(end > 0),
        "finite": jnp.isfinite(end).all(),
    }


def slowly(point, key):
    """The same, with a wait in each chunk, so that there is time to kill somebody."""
    waited = jax.pure_callback(_wait, jax.ShapeDtypeStruct((), jnp.float64), key_word(key), vmap_method="broadcast_all")
    return jax.tree.map(lambda leaf: leaf + waited.astype(leaf.dtype) if leaf.dtype != bool else leaf, run(point, key))


def key_word(key):
    """A number of a key, so that the callback is given something of each run."""
    return jax.random.key_data(key)[0].astype(jnp.float64) * 0.0


def _wait(word):
    time.sleep(0.15)
    return np.asarray(word)


def sweep(store, function=run, **options):
    """The study into a store."""
    return sweeps.sweep(function, DESIGN, SEEDS, KEY, store=store, batch=BATCH, **options)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    more = {"processes": int(sys.argv[3])} if sys.argv[2] == "processes" else {"client": sys.argv[3]}
    sweep(sys.argv[1], slowly, progress=lambda *told: print(*told, flush=True), **more)
