"""Numbers beside arrays."""

import ast
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxveh
from jaxveh import numerics

ROOT = Path(jaxveh.__file__).parent


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(), (3,), (2, 3)])
def test_a_number_has_the_shape_and_precision_of_what_is_beside_it(shape, dtype):
    found = numerics.as_wide_as(-0.7, jnp.full(shape, 5.0, dtype))
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, np.full(shape, -0.7, dtype))


def test_arrays_have_their_common_shape():
    found = numerics.as_wide_as(jnp.arange(3.0), jnp.ones((2, 1)))
    np.testing.assert_array_equal(found, [[0.0, 1.0, 2.0]] * 2)


def test_what_is_not_finite_beside_it_is_told_and_has_no_slope():
    np.testing.assert_array_equal(numerics.as_wide_as(1.0, jnp.asarray([2.0, np.nan, np.inf])), [1.0, np.nan, np.nan])
    assert jax.grad(numerics.as_wide_as, argnums=(0, 1))(2.0, 3.0) == (1.0, 0.0)


def test_several_arrays_have_their_common_shape_and_precision():
    found = numerics.as_wide_as(0.5, jnp.ones(2, np.float32), jnp.ones((3, 1), np.float32))
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, np.full((3, 2), 0.5, np.float32))


def is_product_for_a_shape(node):
    """Whether a node of a syntax tree is `0.0 * x` or `jnp.ones_like(x) * y`, or the other way round."""
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult)):
        return False
    zero = lambda side: isinstance(side, ast.Constant) and side.value == 0
    ones = lambda side: isinstance(side, ast.Call) and ast.unparse(side.func).endswith("ones_like")
    return any(zero(side) or ones(side) for side in (node.left, node.right))


def test_no_other_module_multiplies_by_zero_or_ones_for_a_shape():
    """Such a product says neither what it is for nor that a NaN goes through: `jnp.zeros_like` and `as_wide_as` do."""
    texts = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in ROOT.rglob("*.py")}
    # To parse all of them takes a second.
    suspects = {
        name: ast.parse(text) for name, text in texts.items() if re.search(r"\b0(\.0*)? \*|\* 0\b|ones_like\(", text)
    }
    found = {place for place, tree in suspects.items() if any(map(is_product_for_a_shape, ast.walk(tree)))}
    assert found == {"numerics/widths.py"}
