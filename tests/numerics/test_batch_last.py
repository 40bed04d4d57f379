"""A batch of scans with its axis last is that batch under `jax.vmap`: values and derivatives, whatever the body does."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from test_written_out import BODIES as FOR_THREE
from test_written_out import ROWS as ROWS_OF_THREE
from test_written_out import START as START_OF_THREE
from test_written_out import close

from jaxveh import numerics
from jaxveh.numerics.batch_last import evaluate
from jaxveh.numerics.last_axis import MOST_TERMS, Last

N, RUNS = 9, 3
ROWS = {"a": jnp.linspace(0.1, 0.9, 3), "n": jnp.arange(3, dtype=jnp.int32)}
P = jnp.eye(N) + 0.02 * jnp.cos(jnp.arange(81.0)).reshape(N, N)
START = {"P": P, "x": jnp.linspace(-0.5, 0.7, N), "k": jnp.int32(0)}


def factors(c, r):
    """Cholesky factors and triangular solutions of more rows than are written out."""
    factor = numerics.cholesky(c["P"] @ c["P"].T + jnp.eye(N))
    right = lax.linalg.triangular_solve(factor, c["P"][:2], lower=True)
    upper = lax.linalg.triangular_solve(factor.T, c["P"][:, :2], left_side=True, transpose_a=True, unit_diagonal=True)
    several = numerics.cholesky(jnp.stack([2.0, c["x"][0] + 3.0])[:, None, None] * jnp.eye(N))
    x = numerics.solve_lower(factor, c["x"])
    return c | {"x": x, "P": 0.5 * factor + 0.5 * jnp.eye(N)}, (right, upper, several)


def sums(c, r):
    """Of products, of few and of many terms, along several axes, and those that something else reads, too."""
    times = c["P"][:, None, :] * c["P"].T[None]
    square = c["P"] * c["P"]
    many = jnp.ones((MOST_TERMS + 1, 1)) * c["x"]
    x = jnp.sum(times, axis=(0, 2)) + jnp.sum(many * many, axis=0) / 65 + jnp.sum(many, axis=0)
    return c | {"x": jnp.tanh(x + jnp.prod(1 + 0.1 * square, axis=1)), "P": jnp.sum(times, 2) / 9}, (
        square, jnp.sum(square), jnp.max(c["P"], axis=1), jnp.any(c["P"] > 1, axis=0), jnp.sum(c["P"], axis=()),
    )  # fmt: skip


def contractions(c, r):
    three = c["P"].reshape(3, 3, 9)
    x = (
        jnp.einsum("iak,ka->i", three, c["P"][:, :3]) @ jnp.ones((3, N))
        + jnp.tensordot(c["P"], three, ((0,), (2,)))[:, 0, 1]
    )
    with_batch = jnp.einsum("ijk,ijl->ikl", three, three)
    wide = jnp.broadcast_to(c["x"], (8, N)).reshape(-1)
    return c | {"x": jnp.sin(x), "P": jnp.tanh(with_batch[0] + r["a"])}, (wide @ (wide + 1), jnp.outer(c["x"], c["x"]))


def moves(c, r):
    first, rest = jnp.split(c["x"], [4])
    padded = lax.pad(c["P"], 0.5, ((1, 0, 1), (-1, 2, 0)))
    own = lax.pad(c["P"], c["x"][0], ((0, 1, 0), (0, 0, 0)))
    gathered = c["P"][jnp.asarray([3, 1, 3]), :2] + c["x"][jnp.asarray([0, 8, 2])][:, None]
    x = jnp.concatenate([rest, jnp.ones(2), first[::-1][:2]])
    put = c["P"].at[2, 1:3].set(0.3).at[jnp.asarray([0, 0, 1])].add(0.1)
    return c | {"x": jnp.roll(x, 2), "P": put.T[::-1] + jnp.diag(c["x"])}, (
        padded, own[-1], gathered, c["P"][1::3, ::-2], jnp.stack([c["x"], x], axis=1), jnp.clip(c["x"], -0.1, c["x"][3]),
    )  # fmt: skip


def choices(c, r):
    """Branches that all runs take, and those that each takes for itself."""
    pair = lax.switch(r["n"] % 2, [lambda x: (2 * x, r["a"]), lambda x: (jnp.cos(x), x[0])], c["x"])
    x = lax.cond(c["x"][0] > 0, lambda x: x[::-1], lambda x: -x, pair[0])
    slow = lax.while_loop(lambda y: y[1] < 3, lambda y: (0.5 * y[0], y[1] + 1), (lax.stop_gradient(x), 0))[0]
    return c | {"x": 0.3 * x + 0.1 * slow, "k": c["k"] + r["n"]}, (
        pair[1],
        jnp.argmax(x),
        jnp.cumsum(x),
        c["x"][c["k"]],
    )


def rules(c, r):
    """Functions with derivatives of their own, and what stays the same for the whole batch."""
    x = numerics.sqrt(1 + c["x"] ** 2) + numerics.lower_factor(c["P"][:3])[2, 0] + numerics.hypot(c["x"], r["a"])
    fenced = numerics.fence_blocks(numerics.fence((numerics.sin(x), numerics.arctan2(x, c["x"] + 2))))
    known = jnp.linalg.inv(jnp.eye(3) + jnp.diag(jnp.asarray([r["a"], 1.0, 2.0])))
    return c | {"x": fenced[0] + known[0, 0], "k": c["k"] + 1}, (fenced[1], known, c["k"])


BODIES = {f.__name__: (f, START, ROWS) for f in (factors, sums, contractions, moves, choices, rules)}
SMALL = ("products", "moves", "own_derivatives", "of_the_unknown", "of_nothing", "of_scalars")
BODIES |= {f"{name}, three": (FOR_THREE[name], START_OF_THREE, ROWS_OF_THREE) for name in SMALL}


def is_float(leaf):
    return jnp.issubdtype(leaf.dtype, jnp.floating)


def batch(tree):
    return jax.tree.map(
        lambda leaf: jnp.stack([leaf * (1 - 0.1 * k) if is_float(leaf) else leaf for k in range(RUNS)]), tree
    )


@pytest.mark.parametrize("name", BODIES)
def test_it_is_the_scan(name):
    body, start, rows = BODIES[name]
    whole, last = (lambda c, r, scan=scan: scan(body, c, r) for scan in (lax.scan, numerics.scan_batch_last))
    moving = {"x": 0, "P": None, "k": None}
    many = batch(start)
    partly = {key: many[key] if moving[key] == 0 else start[key] for key in start}

    def every(scan):
        return (
            scan(start, rows),
            jax.vmap(scan)(many, batch(rows)),
            jax.vmap(scan, in_axes=(moving, None))(partly, rows),
        )

    close(jax.jit(lambda: every(last))(), jax.jit(lambda: every(whole))())


@pytest.mark.parametrize("name", BODIES)
def test_its_derivatives_are_those_of_the_scan(name):
    body, start, rows = BODIES[name]

    def value(scan, x, P, a):
        """Of runs that begin otherwise, beside what is the same for all."""
        run = lambda x, a: scan(body, start | {"x": x, "P": P + 0.0 * jnp.sum(x)}, rows | {"a": a})
        leaves = [leaf for leaf in jax.tree.leaves(jax.vmap(run, in_axes=(0, None))(x, a)) if is_float(leaf)]
        return sum(jnp.sum(leaf * jnp.cos(jnp.arange(leaf.size, dtype=float).reshape(leaf.shape))) for leaf in leaves)

    at = batch(start["x"]), start["P"], rows["a"]
    of = lambda scan: lambda *p: value(scan, *p)
    both = lambda f: (jax.grad(f, (0, 1, 2))(*at), jax.jvp(f, at, tuple(jnp.ones_like(p) for p in at))[1])
    whole, last = (jax.jit(lambda scan=scan: both(of(scan)))() for scan in (lax.scan, numerics.scan_batch_last))
    close(last, whole, 1e-9)


def twice(c, r):
    return jnp.sin(c * r) + jnp.sum(c * c) / 9, jnp.prod(c)


def test_batches_of_batches_and_second_derivatives():
    """A step that is the primitive already is batched and differentiated once more."""
    c, r = jnp.linspace(0.2, 1.0, 12).reshape(2, 3, 2), jnp.linspace(0.5, 1.5, 6).reshape(2, 3)

    def value(scan, c, r):
        inner = jax.vmap(lambda c, r: jnp.sum(scan(twice, c, r)[0]) + jnp.sum(scan(twice, c, r)[1]), in_axes=(0, None))
        outer = (
            jax.vmap(inner)(c, r)
            + jax.vmap(inner, in_axes=(None, 0))(c[0], r)
            + jax.vmap(inner, in_axes=(0, None))(c, r[0])
        )
        return jnp.sum(outer * jnp.asarray([1.0, 2.0, 3.0]))

    every = lambda f: (f(c, r), jax.grad(f, (0, 1))(c, r), jax.hessian(f)(c, r), jax.jacfwd(jax.grad(f, 1), 0)(c, r))
    whole, last = (
        jax.jit(lambda scan=scan: every(lambda c, r: value(scan, c, r)))()
        for scan in (lax.scan, numerics.scan_batch_last)
    )
    close(last, whole, 1e-10)


SCANS = {"batch last": numerics.scan_batch_last, "written out": numerics.scan_written_out}


def of_shared_numbers(scan, numbers, x, apart):
    """The sum over runs of a scan whose body reads numbers that all runs share; unless all is `apart`, a part of the carry
    depends on nothing else."""
    a, b = numbers

    def body(c, r):
        alone = b[0] * c[1] + (0.1 * c[0][0] if apart else 0.0)
        return (jnp.sin(a * c[0] + r) + b * c[0][::-1] * alone, alone), jnp.sum(c[0]) * alone + a

    def run(x):
        (end, alone), shown = scan(body, (x, jnp.asarray(0.7)), jnp.linspace(0.1, 0.9, 4))
        return jnp.sum(end) * alone + jnp.sum(shown**2)

    return jnp.sum(jax.vmap(run)(x))


@pytest.mark.parametrize("apart", [True, False], ids=["all of the batch", "a part shared"])
@pytest.mark.parametrize("name", SCANS)
def test_derivatives_by_what_all_runs_share(name, apart):
    numbers, x = (jnp.asarray(0.8), jnp.asarray([0.3, -0.6])), jnp.linspace(-1.0, 1.0, 2 * RUNS).reshape(RUNS, 2)
    every = lambda f: (
        jax.value_and_grad(f, (0, 1))(numbers, x),
        jax.jvp(f, (numbers, x), jax.tree.map(jnp.ones_like, (numbers, x))),
        jax.hessian(f, (0, 1))(numbers, x),
        jax.vmap(jax.grad(lambda a: f((a, numbers[1]), x)))(jnp.linspace(0.1, 0.9, 3)),
    )
    whole, last = (
        jax.jit(lambda scan=scan: every(lambda numbers, x: of_shared_numbers(scan, numbers, x, apart)))()
        for scan in (lax.scan, SCANS[name])
    )
    close(last, whole, 1e-10)


@pytest.mark.parametrize("name", SCANS)
def test_the_sum_over_the_runs_is_taken_once_and_not_in_every_step(name):
    def sums_of_steps(apart):
        numbers, x = (jnp.asarray(0.8), jnp.asarray([0.3, -0.6])), jnp.ones((RUNS, 2))
        program = jax.make_jaxpr(jax.grad(lambda n: of_shared_numbers(SCANS[name], n, x, apart)))(numbers)
        bodies = [one.params["jaxpr"].jaxpr for one in program.jaxpr.eqns if one.primitive.name == "scan"]
        assert bodies and any(one.primitive.name == "jaxveh_steps" for body in bodies for one in body.eqns)
        return sum(one.primitive.name == "reduce_sum" for body in bodies for one in body.eqns)

    assert sums_of_steps(apart=True) == 0
    assert sums_of_steps(apart=False) > 0


def test_a_factor_of_an_indefinite_matrix_is_not_a_number():
    factor = numerics.cholesky
    matrices = jnp.stack([jnp.eye(N), jnp.eye(N).at[4, 4].set(-1.0)])
    scan = lambda P: numerics.scan_batch_last(lambda c, _: (factor(c), ()), P, jnp.zeros(1))[0]
    good, bad = jax.vmap(scan)(matrices)
    np.testing.assert_array_equal(good, np.eye(N))
    assert np.isnan(bad[-1, -1])


def test_what_is_the_same_for_all_is_reckoned_once():
    def body(c, r):
        return {"x": c["x"] * c["P"][0], "P": jnp.sin(c["P"])}, jnp.sum(c["P"])

    scan = lambda x: numerics.scan_batch_last(body, {"x": x, "P": P}, jnp.zeros(4))
    end, shown = jax.vmap(scan, out_axes=({"x": 0, "P": None}, None))(jnp.ones((RUNS, N)))
    assert end["x"].shape == (RUNS, N) and end["P"].shape == (N, N) and shown.shape == (4,)


def test_sums_of_few_terms_are_written_out_and_products_that_one_sum_reads_are_not_stored():
    def shapes(f):
        given = Last(jnp.ones((4, 5, 6)))
        program = jax.make_jaxpr(lambda x: f(x))(given.array[..., 0])
        traced = jax.make_jaxpr(lambda x: evaluate(program, [Last(x)], 6)[0].array)(given.array)
        return [
            one.aval.shape
            for equation in traced.jaxpr.eqns
            for one in equation.outvars
            if equation.primitive.name == "mul"
        ]

    assert set(shapes(lambda x: jnp.sum(x[:, None] * x[None], axis=2))) == {(4, 4, 6)}
    assert set(shapes(lambda x: (x * x)[0] + jnp.sum(x * x, axis=0))) == {(4, 5, 6), (5, 6)}
