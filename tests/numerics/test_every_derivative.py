"""Derivatives up to the third of every public function, where jax before 0.12 drops derivative rules: in a scan.

References come of values alone: derivatives of the polynomial through 17 values of the same steps outside of a scan. What is in
`numerics.__all__` has a case here or a reason in `NONE`.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from numpy.polynomial import Chebyshev

from jaxveh import numerics
from jaxveh.numerics import elementary, triangular

NONE = {
    "RUNS": "a name",
    "derivative_alone": "a derivative without a value, which differences do not see: test_every_hessian, of particle filters",
    "polynomials": "a module: of the elementary functions, which are here",
    "sigma_points": "a module: of constant points and weights",
    "barriers_hold": "a fact of the platform",
    "Piece": "a record of rows",
    "pieces_of": "a count",
    "on_cpu": "a fact of the platform",
    "pays_alone": "a fact of the platform",
    "cauchy": "numbers of a key, which has no derivative",
    "exponential": "numbers of a key, which has no derivative",
    "normal": "numbers of a key, which has no derivative",
    "normals": "numbers of a key, which has no derivative",
    "uniform": "numbers of a key, which has no derivative",
    "multinomial": "ancestors are whole numbers; see the test of those below",
    "residual": "ancestors are whole numbers; see the test of those below",
    "stratified": "ancestors are whole numbers; see the test of those below",
    "systematic": "ancestors are whole numbers; see the test of those below",
}

KEY = jax.random.key(3)
POINTS = (0.0, 0.4)
REACH = 0.1
"""Within this distance of the points the cases are analytic, and so are the steps made of them."""


def count(like, *numbers):
    return jnp.asarray(numbers, like.dtype)


def matrix(x):
    """Symmetric, positive definite (3, 3)."""
    one = jnp.ones_like(x)
    return jnp.stack([jnp.stack(row) for row in ([2 + x, x, one], [x, 2 * one, x * x], [one, x * x, 3 - x])])


def factor(x):
    one, none = jnp.ones_like(x), jnp.zeros_like(x)
    rows = ([1 + x * x, none, none], [x, 2 - x, none], [one, x * x, 2 * one])
    return jnp.stack([jnp.stack(row) for row in rows])


def sides(x):
    return jnp.stack([1 + x, x * x, 2 - x])


def mixed(values):
    """One number of an array, to which every entry contributes in its own measure."""
    flat = jnp.ravel(values)
    return jnp.sum(flat * jnp.cos(jnp.arange(flat.size, dtype=flat.dtype)))


def joined(tree):
    """The same of all arrays of a tree."""
    return mixed(jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(tree)]))


def fenced(between):
    def case(x):
        first, second = between((x * x, jnp.sin(x) * jnp.ones(40, x.dtype)))
        return first + jnp.mean(second) * first

    return case


def table(interpolate):
    points = lambda x: count(x, -1.0, -0.5, 1.0, 2.0)
    return lambda x: interpolate(x + 0.1, points(x), jnp.stack([-1 + x * x, jnp.sin(x), 1 + x, 2 + x * x * x]))


CASES: dict[str, Callable] = {
    "apart": lambda x: numerics.apart(lambda y: y * jnp.sin(2 * y) + y**3, x, x),
    "arctan": lambda x: numerics.arctan(2 * x),
    "arctan2": lambda x: numerics.arctan2(x, x + 0.7) + numerics.arctan2(1 + x, x - 0.2),
    "band_harmonics": lambda x: mixed(jnp.stack(numerics.band_harmonics(KEY, 1 + x * x, 3 + x, 4, x.dtype))) / 9,
    "as_whole": lambda x: numerics.as_whole(lambda y: y * jnp.sin(y))(x),
    "by_batch": lambda x: numerics.by_batch(*2 * (lambda y: y * jnp.sin(y),), x),
    "scan_batch_last": lambda x: mixed(
        numerics.scan_batch_last(lambda c, r: (jnp.sin(c.T * r) / 2, ()), factor(x), count(x, 0, 1, 2) * x / 2)[0]
    ),
    "as_entries": lambda x: joined(numerics.as_entries((factor(x), x))),
    "from_entries": lambda x: joined(numerics.from_entries(numerics.as_entries((factor(x), x)), (factor(x), x))),
    "scan_written_out": lambda x: mixed(
        numerics.scan_written_out(lambda c, r: (jnp.sin(c.T * r) / 2, ()), factor(x), count(x, 0, 1, 2) * x / 2)[0]
    ),
    "cholesky": lambda x: mixed(numerics.cholesky(matrix(x))),
    "cos": lambda x: numerics.cos(3 * x),
    "ess": lambda x: numerics.ess(jnp.exp(x * count(x, 0, 1, -1, 0.5))),
    "fence": fenced(numerics.fence),
    "fence, firm": fenced(functools.partial(numerics.fence, firm=True)),
    "fence_blocks": fenced(numerics.fence_blocks),
    "fence_results": fenced(numerics.fence_results(lambda pair: pair)),
    "gauss_markov_harmonics": lambda x: mixed(numerics.gauss_markov_harmonics(KEY, 1 + x, 2.0, 4, x.dtype)[0]),
    "hypot": lambda x: numerics.hypot(x, 1 - x),
    "interpolate_linear": table(numerics.interpolate_linear),
    "interpolate_smooth": table(numerics.interpolate_smooth),
    "inverse_psd": lambda x: mixed(numerics.inverse_psd(factor(x))),
    "largest": lambda x: numerics.largest(jnp.sin(x + count(x, 0, 1, -1, 0.5))),
    "log": lambda x: numerics.log(1.5 + x),
    "log_det": lambda x: numerics.log_det(factor(x)),
    "lower_factor": lambda x: mixed(numerics.lower_factor(jnp.concatenate([factor(x), matrix(x)], axis=1))),
    "mahalanobis": lambda x: numerics.mahalanobis(factor(x), sides(x)),
    "normalise": lambda x: sum(mixed(part) for part in numerics.normalise(jnp.sin(x * count(x, 0, 1, -1, 0.5)))[:2]),
    "as_wide_as": lambda x: joined((numerics.as_wide_as(x * x, sides(x)), numerics.as_wide_as(sides(x), x))),
    "or_one": lambda x: x / numerics.or_one(1 + x, x > 0.2) + x * jnp.sqrt(numerics.or_one(2 - x, x < 0.2)),
    "secant": lambda x: numerics.secant(
        lambda y, a: a[0] * y**3 + y - a[1], (1 + x * x, 2 + x), jnp.ones_like(x) / 2, jnp.ones_like(x), 1e-13
    ),
    "sin": lambda x: numerics.sin(3 * x),
    "smallest": lambda x: numerics.smallest(jnp.sin(x + count(x, 0, 1, -1, 0.5))),
    "smooth_bump": lambda x: numerics.smooth_bump(0.4 + 0.5 * x),
    "smooth_clip": lambda x: numerics.smooth_clip(x, -1.5, jnp.cos(x) - 0.8, 0.6),
    "smooth_ramp": lambda x: numerics.smooth_ramp(x, 2.0 + x),
    "smooth_step": lambda x: numerics.smooth_step(0.4 + 0.5 * x),
    "solve_lower": lambda x: mixed(numerics.solve_lower(factor(x), sides(x))),
    "solve_lower_transposed": lambda x: mixed(numerics.solve_lower_transposed(factor(x), matrix(x))),
    "solve_psd": lambda x: mixed(numerics.solve_psd(factor(x), sides(x))),
    "solve_scalars": lambda x: mixed(
        jnp.stack(numerics.solve_scalars([[2 + x], [x, 2 + x * x], [1 - x, x, 3 + x]], sides(x)))
    ),
    "sqrt": lambda x: numerics.sqrt(1.5 + x),
    "student_t": lambda x: mixed(numerics.student_t(KEY, 4 + x, (3,), x.dtype)),
    "sum_in_blocks": lambda x: numerics.sum_in_blocks(
        lambda p, row: numerics.sin(p * row), x, jnp.arange(7, dtype=x.dtype) / 7, block=3
    ),
    "sum_of_harmonics": lambda x: mixed(numerics.sum_of_harmonics(sides(x), count(x, 0.3, 0.5), sides(x)[:2])) / 2,
    "symmetric": lambda x: mixed(numerics.symmetric(factor(x))),
    "tan": lambda x: numerics.tan(x),
    "write_out": lambda x: mixed(numerics.write_out(lambda c: jnp.sin(c @ c.T), factor(x))),
    "wrap_angle": lambda x: numerics.wrap_angle(3 * x + 7.0) * x,
    "there_and_back": lambda x: mixed(forward_and_back(x)) / 3,
    "total": lambda x: numerics.total(jnp.sin(x * jnp.arange(90, dtype=x.dtype) / 50)) / 20,
}


def forward_and_back(x):
    """A sum forward, and back what it was with the one of what comes later."""
    rows = jnp.arange(6, dtype=x.dtype) / 5
    ahead = lambda carry, piece: carry + jnp.sum(jnp.where(piece.there, numerics.sin(x * piece.rows), 0.0))
    back = lambda later, carry, piece: (later + carry, carry * piece.rows + later)
    last, shown = numerics.there_and_back(ahead, back, x, lambda carry: carry * carry, rows, rows)
    return shown + last


def test_every_public_name_has_a_case_or_a_reason():
    assert sorted([*{name.partition(",")[0] for name in CASES}, *NONE]) == sorted(numerics.__all__)


def stepped(case, x, value):
    """One step towards a fixed point that depends on x."""
    return x + 0.1 * case(value)


def in_scan(case, wrapped=lambda step: step):
    step = wrapped(lambda value, x: (stepped(case, x, value), None))

    def three_steps(x):
        return jax.lax.scan(lambda value, _: step(value, x), x, None, length=3)[0]

    return three_steps


def in_solver(case):
    """The fixed point by a loop of unknown length, differentiated by the implicit function theorem."""

    def solved(x):
        missing = lambda value, x: value - stepped(case, x, value)
        small = 1e-13 if x.dtype == jnp.float64 else 1e-5
        return optx.root_find(missing, optx.Newton(small, small), x, args=x, max_steps=20).value

    return solved


def one_by_one(case, steps):
    def found(x):
        value = x
        for _ in range(steps):
            value = stepped(case, x, value)
        return value

    return found


class Place(NamedTuple):
    of: Callable
    steps: int


PLACES = {
    "scan": Place(in_scan, 3),
    "checkpoint": Place(functools.partial(in_scan, wrapped=jax.checkpoint), 3),
    "solver": Place(in_solver, 60),
}


def forward(function):
    """Of `x -> (highest, lower)`: the same with one derivative more, forward."""

    def more(x):
        highest, change, lower = jax.jvp(function, (x,), (jnp.ones_like(x),), has_aux=True)
        return change, (*lower, highest)

    return more


def reverse(function):
    def more(x):
        (highest, lower), change = jax.value_and_grad(function, has_aux=True)(x)
        return change, (*lower, highest)

    return more


MODES = {"forward": (forward,) * 3, "reverse": (reverse,) * 3, "mixed": (reverse, forward, reverse)}


BATCHED = ("apart", "fence", "fence, firm", "fence_blocks", "fence_results", "sum_in_blocks", "total")
"""What has a rule of its own for batches, or looks at their size: all points at once. Others compile faster one by one."""


def derivatives(function, mode, batched=True):
    """Of points (n,): value and three derivatives, (n, 4)."""
    found = lambda x: (function(x), ())
    for one_more in MODES[mode]:
        found = one_more(found)

    def stacked(x):
        highest, lower = found(x)
        return jnp.stack((*lower, highest))

    if batched:
        return jax.jit(jax.vmap(stacked))
    program = jax.jit(stacked)
    return lambda points: np.stack([program(point) for point in points])


def polynomial_of(case, steps):
    """(points, 4): value and derivatives of the polynomial through 17 values around each point."""
    nodes = np.cos(np.pi * (np.arange(17) + 0.5) / 17)
    around = np.add.outer(POINTS, REACH * nodes)
    values = np.asarray(jax.jit(jax.vmap(jax.vmap(one_by_one(case, steps))))(around))
    found = []
    for point, some in zip(POINTS, values, strict=True):
        through = Chebyshev.fit(point + REACH * nodes, some, 16, domain=(point - REACH, point + REACH))
        found.append([through.deriv(order)(point) if order else through(point) for order in range(4)])
    return np.array(found)


@functools.cache
def reference(name, steps):
    return polynomial_of(CASES[name], steps)


RULED = (
    "arctan", "arctan2", "cos", "fence, firm", "fence_blocks", "log", "lower_factor", "secant", "sin", "sum_in_blocks", "tan"
)  # fmt: skip
"""Made of a rule, a primitive or a value without derivative: they go backward by default, where jax 0.10 drops rules."""


def turn(i, name, mode):
    """By default all that is `RULED`, and of the others one in three, each in a mode of its turn."""
    mine = mode == "reverse" if name in RULED else i % 3 == 0 and mode == list(MODES)[i // 3 % 3]
    return pytest.param(name, mode, marks=[] if mine else pytest.mark.full)


@pytest.mark.parametrize(("name", "mode"), [turn(i, name, mode) for i, name in enumerate(CASES) for mode in MODES])
def test_in_a_scan(name, mode):
    found = derivatives(in_scan(CASES[name]), mode, name in BATCHED)(np.asarray(POINTS))
    expected = reference(name, 3)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=2e-7)


@pytest.mark.full
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("place", ["checkpoint", "solver"])
@pytest.mark.parametrize("name", CASES)
def test_in_other_places(name, mode, place):
    if name == "secant" and place == "solver":
        pytest.skip("a root in a root: each derivative is one of the inner function, of twice the order")
    of, steps = PLACES[place]
    found = derivatives(of(CASES[name]), mode)(jnp.asarray(POINTS))
    np.testing.assert_allclose(found, reference(name, steps), rtol=1e-7, atol=2e-7)


DRAWN = ("band_harmonics", "gauss_markov_harmonics", "student_t")
"""Made of random numbers: those of float32 are others than those of float64."""


@pytest.mark.full
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", CASES)
def test_in_float32(name, mode):
    points = jnp.asarray(POINTS, jnp.float32)
    found = derivatives(in_scan(CASES[name]), mode)(points)
    assert found.dtype == jnp.float32
    expected = derivatives(one_by_one(CASES[name], 3), "forward")(points) if name in DRAWN else reference(name, 3)
    np.testing.assert_allclose(found[:, :3], expected[:, :3], rtol=2e-3, atol=2e-3)
    np.testing.assert_allclose(found[:, 3], expected[:, 3], rtol=2e-2, atol=2e-2)


BITS = ("arctan", "log", "sqrt")
"""Of each way to be without a derivative by itself one: signs, exponents, infinite slopes."""


@pytest.mark.parametrize(
    ("place", "dtype"),
    [
        ("scan", jnp.float32),
        ("checkpoint", jnp.float64),
        pytest.param("solver", jnp.float64, marks=pytest.mark.full),
        pytest.param("checkpoint", jnp.float32, marks=pytest.mark.full),
        pytest.param("solver", jnp.float32, marks=pytest.mark.full),
    ],
)
def test_functions_of_bits_elsewhere(place, dtype):
    """What the full run asks of each by itself, in one program a place, in the mode that jax 0.10 gets wrong."""
    of, steps = PLACES[place]
    case = lambda x: sum(CASES[name](x) for name in BITS) / len(BITS)
    found = derivatives(of(case), "reverse", batched=False)(np.asarray(POINTS, dtype))
    assert found.dtype == dtype
    close = 2e-7 if dtype == jnp.float64 else 2e-2
    np.testing.assert_allclose(found, polynomial_of(case, steps), rtol=close, atol=close)


def test_zeros_with_infinite_slopes_are_flat_in_a_scan():
    case = lambda x: numerics.sqrt(x) + numerics.hypot(x, 2 * x) + numerics.arctan2(x, 3 * x)
    found = derivatives(lambda x: jax.lax.scan(lambda c, _: (c * case(x), None), x, None, length=2)[0], "reverse")
    np.testing.assert_array_equal(found(np.zeros(1)), 0.0)


RULES = {
    f"{module.__name__}.{name}": value
    for module in (elementary, triangular)
    for name, value in vars(module).items()
    if isinstance(value, jax.custom_jvp)
}
SQUARE = np.random.default_rng(0).normal(size=(3, 5))
ANGLES = np.array([-2.5, -0.4, -0.0, 0.0, 0.3, 1.1, 2.5])
PAIRS = np.array([0.0, -0.0, 1.0, -1.0, 0.0, 0.4, -0.7, 2.0]), np.array([0.0, 0.0, 0.0, -0.0, 2.0, -0.3, -2.0, 0.5])
ARGUMENTS = {"_log": (np.array([1e-300, 0.2, 1.0, 3.0, 1e300]),), "_arctan2": PAIRS, "lower_factor": (SQUARE,)}


@pytest.mark.parametrize("name", RULES)
def test_without_its_rule_a_function_has_the_same_derivative(name):
    """What jax 0.10 does in a scan, asked of every rule by itself."""
    rule = RULES[name]
    arguments = ARGUMENTS.get(name.rpartition(".")[2], (ANGLES,))
    tangents = tuple(np.cos(x + i) for i, x in enumerate(arguments))
    ours, bare = jax.jit(lambda *both: [jax.jvp(f, *both) for f in (rule, rule.__wrapped__)])(arguments, tangents)
    np.testing.assert_array_equal(ours[0], bare[0])
    np.testing.assert_allclose(ours[1], bare[1], rtol=1e-11, atol=1e-12)
