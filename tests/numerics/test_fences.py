"""One place decides by platform, and a fence changes nothing but speed."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics
from jaxveh.numerics import fences

pytestmark = pytest.mark.product


def holds(f, x, barriers):
    """Whether the program of `f` holds something, by a barrier or by a branch."""
    return ("optimization_barrier" if barriers else "stablehlo.case") in jax.jit(f).lower(x).as_text()


def firm(tree):
    return numerics.fence(tree, firm=True)


def _with_fence(x):
    first, second = numerics.fence((x * x, jnp.sin(x)))
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
def test_a_fence_is_the_identity_under(transform):
    np.testing.assert_allclose(transform(_with_fence)(X), transform(_without)(X), rtol=1e-14)


@functools.partial(jax.custom_jvp, nondiff_argnums=(2,))
def product(x, known, fenced):
    """Of a fenced function of `x` and one of what is known."""
    return _product(x, known, fenced)


@product.defjvp
def _(fenced, primals, tangents):
    return jax.jvp(lambda x, known: _product(x, known, fenced), primals, tangents)


def _product(x, known, fenced):
    square, three_times = fenced((x * x, 3.0 * known))
    return square * three_times


@pytest.mark.parametrize(
    "transform",
    [
        jax.grad,
        lambda f: jax.jit(jax.grad(f)),
        lambda f: jax.grad(jax.checkpoint(f)),
        jax.hessian,
        lambda f: lambda x: jax.linear_transpose(jax.linearize(f, x)[1], x)(jnp.asarray(1.0))[0],
    ],
    ids=["grad", "jit", "checkpoint", "hessian", "transpose"],
)
@pytest.mark.parametrize("fenced", [numerics.fence, firm, numerics.fence_blocks], ids=["fence", "firm", "blocks"])
@pytest.mark.parametrize("scanned", [False, True])
def test_what_is_not_differentiated_may_be_fenced_beside_what_is(transform, fenced, scanned):
    """A `custom_jvp` makes arrays of the zeros that are the tangents of what is known."""
    known = jnp.full((4, 3), 0.7)

    def of(step):
        last = lambda x: (
            jax.lax.scan(lambda x, row: (step(x, row), None), x, known)[0] if scanned else step(x, known[0])
        )
        return lambda x: jnp.sum(last(x))

    found = transform(of(lambda x, row: product(x, row, fenced)))(X)
    np.testing.assert_allclose(found, transform(of(lambda x, row: x * x * 3.0 * row))(X), rtol=1e-13)


def test_a_fence_keeps_structure_and_types():
    tree = {"a": (jnp.ones(2, jnp.float32), jnp.arange(3, dtype=jnp.int32)), "b": [jnp.asarray(True)]}
    result = numerics.fence(tree)
    assert jax.tree.structure(result) == jax.tree.structure(tree)
    assert [leaf.dtype for leaf in jax.tree.leaves(result)] == [leaf.dtype for leaf in jax.tree.leaves(tree)]


def test_the_platform_is_the_default_device_s():
    assert numerics.on_cpu() == (jax.default_backend() == "cpu")
    with jax.default_device(jax.devices("cpu")[0]):
        assert numerics.on_cpu()
    with jax.default_device("cpu"):
        assert numerics.on_cpu()


def test_elsewhere_there_is_no_fence(monkeypatch):
    assert "jaxveh_fence" in str(jax.make_jaxpr(lambda x: numerics.fence(x))(X))
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert not numerics.on_cpu()
    assert numerics.barriers_hold()
    assert "jaxveh_fence" not in str(jax.make_jaxpr(lambda x: numerics.fence(x))(X))


@pytest.mark.parametrize("barriers", [True, False])
def test_blocks_fenced_are_what_fits_the_cache_alone(barriers, monkeypatch):
    monkeypatch.setattr(fences, "barriers_hold", lambda: barriers)

    def held(size):
        return holds(lambda x: numerics.fence_blocks((x, 1.0)), jnp.ones(size), barriers)

    # A barrier costs a short array nothing, a branch does.
    assert [held(size) for size in (1, 31, 32, 4096, 4097)] == [barriers, barriers, True, True, False]
    assert numerics.fence_blocks((2.0, None)) == (2.0, None)


@pytest.mark.parametrize("barriers", [True, False])
@pytest.mark.parametrize("scale", [1.0, np.full(31, 0.7), np.full(4097, 0.7)], ids=np.size)
def test_what_is_differentiated_is_fenced_however_short_it_is(barriers, scale, monkeypatch):
    """Values, tangents and cotangents: a derivative has several times as many operations as its formula."""
    monkeypatch.setattr(fences, "barriers_hold", lambda: barriers)
    law = lambda x: jnp.sum(jnp.prod(jnp.stack(numerics.fence_blocks((jnp.sin(x * scale), x * scale))), axis=0))
    x, ways = jnp.asarray(0.3), (jax.grad, jax.jacfwd, jax.hessian, lambda f: lambda x: jax.linearize(f, x)[1](x))
    fits = np.size(scale) <= 4096
    assert [holds(way(law), x, barriers) for way in ways] == [fits] * 4
    assert holds(law, x, barriers) == (fits and barriers)


@pytest.mark.parametrize("barriers", [True, False])
@pytest.mark.parametrize("hold", [numerics.fence_blocks, firm])
def test_what_is_fenced_is_decided_of_the_whole_batch(barriers, hold, monkeypatch):
    """A scalar that is one of forty is as long as an array of forty; and a branch stays one."""
    monkeypatch.setattr(fences, "barriers_hold", lambda: barriers)
    law = lambda x: jnp.prod(jnp.stack(hold((jnp.sin(x), x * x))))
    assert holds(jax.vmap(law), jnp.ones(40), barriers)
    assert holds(jax.vmap(jax.grad(law)), jnp.ones(40), barriers)
    assert holds(law, jnp.asarray(1.0), barriers) == (hold is firm or barriers)
    x = jnp.linspace(-2.0, 2.0, 40)
    np.testing.assert_allclose(jax.vmap(jax.grad(law))(x), jnp.cos(x) * x**2 + 2 * x * jnp.sin(x), rtol=1e-13)
    twice = jax.vmap(jax.vmap(law, in_axes=0), in_axes=1)(jnp.stack([x, 2 * x]))
    np.testing.assert_allclose(twice[:, 1], jnp.sin(2 * x) * 4 * x**2, rtol=1e-13)


def test_what_is_fenced_may_be_split_over_devices():
    mesh, along = jax.sharding.Mesh(np.asarray(jax.devices()[:1]), ("runs",)), jax.sharding.PartitionSpec("runs")
    for checked in (True, False):
        split = jax.shard_map(jax.vmap(firm), mesh=mesh, in_specs=along, out_specs=along, check_vma=checked)
        np.testing.assert_array_equal(jax.jit(split)(X), X)


@pytest.mark.parametrize("barriers", [True, False])
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_fenced_blocks_change_no_number_and_no_derivative(barriers, dtype, monkeypatch):
    monkeypatch.setattr(fences, "barriers_hold", lambda: barriers)
    x = np.linspace(-2, 2, 200).astype(dtype)
    x[0] = np.nan

    def curve(x, between):
        a, b, c = between((jnp.sin(x), x * x, 3))
        return jnp.exp(a) * b + c * a

    @jax.jit
    def derivatives(x):
        """With the fence and without it."""
        ways = (
            lambda f: f(x),
            lambda f: jax.vjp(f, x)[1](x[::-1]),
            lambda f: jax.jvp(f, (x,), (x[::-1],)),
            lambda f: jax.vmap(f)(jnp.stack([x, x[::-1]])),
            lambda f: jax.jvp(jax.grad(lambda x: jnp.nansum(f(x))), (x,), (x[::-1],)),
        )
        return [[way(lambda x: curve(x, between)) for way in ways] for between in (numerics.fence_blocks, lambda t: t)]  # noqa: B023

    for one, other in zip(*map(jax.tree.leaves, derivatives(x)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5 if dtype == jnp.float32 else 1e-13)


def test_a_branch_around_blocks_is_left_by_xla(monkeypatch):
    monkeypatch.setattr(fences, "barriers_hold", lambda: False)
    compiled = jax.jit(lambda x: numerics.fence_blocks((jnp.sin(x),))).lower(jnp.ones(500)).compile().as_text()
    assert "conditional(" in compiled


@pytest.mark.parametrize("barriers", [True, False])
@pytest.mark.parametrize("size", [(), (1,), (5000,)])
def test_a_firm_fence_holds_every_size_and_changes_no_number(size, barriers, monkeypatch):
    monkeypatch.setattr(fences, "barriers_hold", lambda: barriers)
    law = lambda between: lambda x: jnp.sum(jnp.prod(jnp.stack(between((jnp.sin(x), x * x))), axis=0))
    ours, theirs = law(firm), law(lambda tree: tree)
    x = jnp.asarray(np.full(size, 0.3))
    assert holds(ours, x, barriers)
    # Of a long array the derivatives along some of its numbers, each by itself: the whole matrix is 25 million.
    along = np.eye(x.size)[:: max(1, x.size // 50)].reshape(-1, *size)
    directions = lambda f: lambda x: jax.vmap(lambda one: jax.jvp(f, (x,), (one,))[1])(jnp.asarray(along))
    ways = (lambda f: f, jax.grad, directions, lambda f: lambda x: jax.vmap(f)(jnp.stack([x, 2 * x])))
    found = jax.jit(lambda x: [[way(f)(x) for way in ways] for f in (ours, theirs)])(x)
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13)


def test_a_firm_fence_leaves_alone_what_has_no_arrays(monkeypatch):
    assert firm((None, ())) == (None, ())
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert "jaxveh_fence" not in str(jax.make_jaxpr(lambda x: firm((x,)))(X))


def test_blocks_of_several_types_at_once(monkeypatch):
    monkeypatch.setattr(fences, "barriers_hold", lambda: False)
    given = jnp.ones(200), jnp.ones(200, jnp.float32), jnp.ones(200, jnp.int32)
    for one, other in zip(jax.jit(numerics.fence_blocks)(given), given, strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
