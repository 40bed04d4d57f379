"""What is written out in scalars gives what whole arrays give: values, batches and derivatives, whatever the body does."""

import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxveh import numerics
from jaxveh.numerics.entries import entries, is_known

batches = sys.modules[numerics.by_batch.__module__]

ROWS = {"a": jnp.linspace(0.1, 0.9, 7), "b": jnp.arange(21.0).reshape(7, 3) / 20, "n": jnp.arange(7, dtype=jnp.int32)}
START = {"x": jnp.asarray([0.3, -0.2, 0.5]), "P": jnp.eye(3) + 0.05 * jnp.arange(9.0).reshape(3, 3), "k": jnp.int32(0)}


def products(c, r):
    P = 0.5 * (c["P"] + c["P"].T) @ jnp.diag(jnp.exp(-r["b"])) + r["a"] * jnp.outer(c["x"], c["x"])
    x = jnp.tanh(jnp.einsum("ij,j->i", P, c["x"]) + r["b"])
    return {"x": x, "P": 0.9 * jnp.tril(P) + 0.1, "k": c["k"] + 1}, (jnp.diagonal(P), jnp.trace(P), P[::-1, 1:])


def moves(c, r):
    stacked = jnp.stack([c["x"], r["b"]], axis=1).reshape(-1)
    wide = jnp.concatenate([jnp.pad(stacked, (1, 2), constant_values=0.5), c["P"].ravel()])
    x = jnp.roll(wide, 1)[jnp.asarray([0, 5, 2])] + jnp.flip(c["x"])
    P = jnp.where(jnp.arange(3)[:, None] > jnp.arange(3), 0.0, c["P"] + jnp.squeeze(x[None, :, None], 0))
    return {"x": x / (1.0 + jnp.max(jnp.abs(x))), "P": P / 3, "k": c["k"] + r["n"]}, (wide[2:-2:3], P.T, c["k"] % 2)


def own_derivatives(c, r):
    x = numerics.sin(c["x"]) + numerics.arctan(r["a"] * c["P"]).sum(axis=1) + numerics.sqrt(1 + c["x"] ** 2)
    factor = numerics.cholesky(c["P"] @ c["P"].T + jnp.eye(3))
    P = numerics.solve_psd(factor, jnp.eye(3) * numerics.log(2 + r["a"]))
    return {"x": 0.3 * x, "P": P, "k": c["k"]}, (numerics.log_det(factor), numerics.wrap_angle(4 * x))


def branches(c, r):
    which = r["n"] % 3
    x = lax.switch(which, [lambda x: 2 * x, lambda x: x[::-1], lambda x: jnp.sin(x)], c["x"])
    P = lax.cond(c["x"][0] > 0, lambda P: P.T, lambda P: -P, c["P"])
    return {"x": 0.5 * x, "P": 0.9 * P, "k": jnp.where(which == 1, c["k"] + 1, c["k"])}, (x, jnp.any(x > 0), jnp.min(P))


def of_the_unknown(c, r):
    """Primitives that are not written out."""
    x = (
        jnp.cumsum(c["x"]) / 3
        + jnp.sort(r["b"])
        + lax.fori_loop(0, 3, lambda i, y: y + r["a"] * jnp.cos(y), c["x"]) / 9
    )
    P = jnp.linalg.inv(jnp.eye(3) + 0.1 * c["P"] @ c["P"].T) + x[jnp.argmax(x)]
    return {"x": jnp.tanh(x), "P": 0.3 * P, "k": c["k"]}, (P, c["x"][c["k"]])


def of_nothing(c, r):
    """Arrays without entries."""
    none = jnp.zeros((0, 3)) + c["x"]
    P = c["P"] + none.T @ none + jnp.sum(none, axis=0)
    return {"x": c["x"] + none.sum(axis=0), "P": jnp.concatenate([P, none]), "k": c["k"]}, (none.sum(axis=1), none)


def of_scalars(c, r):
    """Nothing of a row, and a number that is known."""
    return {"x": jnp.zeros(3) - c["x"] * jnp.asarray([1.0, 0.0, 2.0]), "P": jnp.zeros((3, 3)), "k": c["k"]}, ()


def as_a_whole(c, r):
    many = lambda x: sum(jnp.sin(0.01 * k * x + c["P"]) for k in range(200))
    P = numerics.as_whole(many)(c["x"]) / 200
    return {"x": jnp.tanh(P.sum(axis=0)), "P": P, "k": c["k"]}, (P[0],)


BODIES = {
    f.__name__: f
    for f in (products, moves, own_derivatives, branches, of_the_unknown, of_nothing, of_scalars, as_a_whole)
}


def close(a, b, rtol=1e-11):
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert x.shape == y.shape and x.dtype == y.dtype
        np.testing.assert_allclose(x, y, rtol, 1e-12)


@pytest.mark.parametrize("name", BODIES)
def test_it_is_the_scan(name):
    body = BODIES[name]
    whole, out = (jax.jit(lambda c, r, scan=scan: scan(body, c, r)) for scan in (lax.scan, numerics.scan_written_out))
    close(out(START, ROWS), whole(START, ROWS))
    batch = lambda tree: jax.tree.map(
        lambda leaf: jnp.stack([leaf, leaf if jnp.issubdtype(leaf.dtype, jnp.integer) else 0.9 * leaf]), tree
    )
    close(jax.vmap(out)(batch(START), batch(ROWS)), jax.vmap(whole)(batch(START), batch(ROWS)))
    close(jax.vmap(out, in_axes=(0, None))(batch(START), ROWS), jax.vmap(whole, in_axes=(0, None))(batch(START), ROWS))


@pytest.mark.parametrize("name", BODIES)
def test_its_derivatives_are_those_of_the_scan(name):
    def value(scan, x, P, a):
        carry, shown = scan(BODIES[name], START | {"x": x, "P": P}, ROWS | {"a": a})
        leaves = [leaf for leaf in jax.tree.leaves((carry, shown)) if jnp.issubdtype(leaf.dtype, jnp.floating)]
        return sum(jnp.sum(leaf * jnp.cos(jnp.arange(leaf.size, dtype=float).reshape(leaf.shape))) for leaf in leaves)

    at = START["x"], START["P"], ROWS["a"]
    of = lambda scan: lambda *p: value(scan, *p)
    both = lambda f: (jax.grad(f, (0, 1, 2))(*at), jax.jvp(f, at, tuple(jnp.ones_like(p) for p in at))[1])
    whole, out = (jax.jit(lambda scan=scan: both(of(scan)))() for scan in (lax.scan, numerics.scan_written_out))
    close(out, whole, 1e-9)


def test_what_is_known_is_reckoned_when_it_is_traced():
    known = entries(np.asarray([[1.0, 2.0], [0.0, 4.0]]))
    assert all(is_known(one) for one in known.reshape(-1)) and known.shape == (2, 2)
    assert not is_known(entries(jnp.asarray(1.0))[()])

    def body(c, _):
        return c @ jnp.tril(jnp.ones((3, 3))) * jnp.asarray([1.0, 1.0, 0.0]), ()

    jaxpr = str(jax.make_jaxpr(lambda c: numerics.scan_written_out(body, c, jnp.zeros(4)))(jnp.ones((3, 3))))
    # Sums over a lower triangle of ones, of which the last column counts for nothing: in 3 rows 2 and 1.
    assert jaxpr.count(" add ") == 9 and " mul " not in jaxpr


def test_a_long_function_as_a_whole_is_left_as_it_is_and_a_short_one_is_not():
    def products(terms):
        many = lambda x: sum(jnp.sin(k * x) * x for k in range(terms))
        body = lambda c, _: (numerics.as_whole(many)(c), ())
        program = str(jax.make_jaxpr(lambda c: numerics.scan_written_out(body, c, jnp.zeros(4))[0])(START["P"]))
        return program.count("f64[3,3] = mul"), program.count("f64[] = mul")

    (whole, _), (_, scalars) = products(900), products(3)
    assert whole > 900 and products(3)[0] == 0 and scalars > 3 * 9


def test_float32_stays_float32(float32):
    body = BODIES["own_derivatives"]
    start, rows = jax.tree.map(jnp.asarray, (START, ROWS))
    narrow = jax.tree.map(lambda x: x.astype(jnp.float32) if x.dtype == jnp.float64 else x, (start, rows))
    found = jax.jit(lambda c, r: numerics.scan_written_out(body, c, r))(*narrow)
    close(found, jax.jit(lambda c, r: lax.scan(body, c, r))(*narrow), 1e-5)


def pair(x, label):
    one = lambda x, label: (jnp.sin(x) + 1.0, label)
    many = lambda x, label: (jnp.sin(x) + 2.0, label)
    return numerics.by_batch(one, many, x, label)


def test_a_batch_takes_the_form_for_many_and_a_call_the_other():
    x = jnp.linspace(0.0, 1.0, 5)
    value = lambda x: pair(x, "kept")[0]
    assert pair(x[0], "kept")[1] == "kept"
    np.testing.assert_allclose(jax.jit(value)(x[1]), np.sin(x[1]) + 1, rtol=1e-15)
    np.testing.assert_allclose(value(x[1]), np.sin(x[1]) + 1, rtol=1e-15)
    np.testing.assert_allclose(jax.vmap(value)(x), np.sin(x) + 2, rtol=1e-15)
    np.testing.assert_allclose(jax.vmap(jax.vmap(value))(x[None]), np.sin(x[None]) + 2, rtol=1e-15)
    np.testing.assert_allclose(jax.jit(jax.vmap(lambda k: value(x * k)))(x), np.sin(np.outer(x, x)) + 2, rtol=1e-15)
    together = lambda x: jnp.sum(jax.vmap(value)(x))
    np.testing.assert_allclose(together(x), np.sum(np.sin(x) + 2), rtol=1e-15)
    for derivative in (jax.grad(together), jax.vmap(jax.grad(value)), jax.vmap(jax.jacfwd(value))):
        np.testing.assert_allclose(derivative(x), np.cos(x), rtol=1e-15)
    np.testing.assert_allclose(jax.vmap(jax.hessian(value))(x), -np.sin(x), rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize(("least", "many"), [(15, True), (16, False)])
def test_few_calls_take_the_form_for_one(least, many):
    one, other = lambda x: jnp.sin(x) + 1.0, lambda x: jnp.sin(x) + 2.0
    value = lambda x: numerics.by_batch(one, other, x, least=least)
    x = jnp.linspace(0.0, 1.0, 15).reshape(3, 5)
    np.testing.assert_allclose(jax.vmap(value)(x[0]), np.sin(x[0]) + 1, rtol=1e-15)
    wanted = np.sin(x) + (2 if many else 1)
    np.testing.assert_allclose(jax.jit(jax.vmap(jax.vmap(value)))(x), wanted, rtol=1e-15)
    np.testing.assert_allclose(jax.vmap(jax.vmap(value), in_axes=1, out_axes=1)(x), wanted, rtol=1e-15)
    np.testing.assert_allclose(jax.grad(lambda x: jnp.sum(jax.vmap(jax.vmap(value))(x)))(x), np.cos(x), rtol=1e-15)


def test_integers_have_no_slope():
    both = lambda x, k: numerics.by_batch(*2 * (lambda x, k: (x * k.astype(float), k + 1),), x, k)
    value, slope = jax.jvp(lambda x: both(x, jnp.int32(3)), (2.0,), (1.0,))
    assert value == (6.0, 4) and slope[0] == 3.0 and slope[1].dtype == jax.dtypes.float0
    assert jax.grad(lambda x: both(x, jnp.int32(3))[0])(2.0) == 3.0


@pytest.mark.parametrize("size", [1, 2, 63, 200, 256, 257, 260, 1000, 1001])
def test_blocks_are_of_no_consequence(size):
    blocks, width = batches.blocks_of(size)
    assert blocks * width >= size > (blocks - 1) * width and width <= batches.BLOCK
    x = jnp.linspace(0.0, 1.0, size)
    found, shared = jax.vmap(lambda x: (pair(x, "")[0], pair(x, "")[0] + jnp.arange(3.0)), out_axes=(0, 1))(x)
    np.testing.assert_allclose(found, np.sin(x) + 2, rtol=1e-15)
    assert shared.shape == (3, size)
