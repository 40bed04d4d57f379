"""One place decides by platform, and a barrier changes nothing but speed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics


def _with_barrier(x):
    first, second = numerics.barrier((x * x, jnp.sin(x)))
    return jnp.sum(first * second)


def _without(x):
    return jnp.sum(x * x * jnp.sin(x))


X = jnp.asarray([0.3, -1.2, 2.0])


@pytest.mark.parametrize(
    "transform",
    [
        lambda f: f,
        jax.jit,
        jax.grad,
        jax.jacfwd,
        jax.hessian,
        lambda f: jax.grad(jax.checkpoint(f)),
        lambda f: lambda x: jax.vmap(f)(jnp.stack((x, 2.0 * x))),
        lambda f: lambda x: jax.vmap(jax.grad(f))(jnp.stack((x, 2.0 * x))),
        lambda f: lambda x: jax.linearize(f, x)[1](x),
    ],
    ids=["call", "jit", "grad", "jacfwd", "hessian", "checkpoint", "vmap", "vmap_grad", "linearize"],
)
def test_barrier_is_the_identity_under(transform):
    np.testing.assert_allclose(transform(_with_barrier)(X), transform(_without)(X), rtol=1e-14)


def test_barrier_keeps_structure_and_types():
    tree = {"a": (jnp.ones(2, jnp.float32), jnp.arange(3, dtype=jnp.int32)), "b": [jnp.asarray(True)]}
    result = numerics.barrier(tree)
    assert jax.tree.structure(result) == jax.tree.structure(tree)
    assert [leaf.dtype for leaf in jax.tree.leaves(result)] == [leaf.dtype for leaf in jax.tree.leaves(tree)]


def test_the_platform_is_the_default_device_s():
    assert numerics.on_cpu() == (jax.default_backend() == "cpu")
    with jax.default_device(jax.devices("cpu")[0]):
        assert numerics.on_cpu()
    with jax.default_device("cpu"):
        assert numerics.on_cpu()


def test_elsewhere_there_is_no_barrier(monkeypatch):
    assert "optimization_barrier" in str(jax.make_jaxpr(lambda x: numerics.barrier(x))(X))
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert not numerics.on_cpu()
    assert numerics.barriers_hold()
    assert "optimization_barrier" not in str(jax.make_jaxpr(lambda x: numerics.barrier(x))(X))
