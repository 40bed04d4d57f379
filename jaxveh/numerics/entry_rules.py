"""Rules of JAX's primitives for arrays that are written out entry by entry (`written_out`)."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxveh.numerics.entries import Entries, entries, is_known, of_list, scalar_of

ELEMENTWISE = frozenset((
    "abs", "acos", "add", "add_any", "and", "asin", "atan", "atan2", "bitcast_convert_type", "cbrt", "ceil", "clamp",
    "convert_element_type", "copy", "cos", "cosh", "div", "eq", "erf", "erf_inv", "erfc", "exp", "exp2", "expm1", "floor", "ge",
    "gt", "integer_pow", "is_finite", "jaxveh_derivative_alone", "le", "lgamma", "log", "log1p", "logistic", "lt", "max", "min",
    "mul", "name", "ne", "neg", "nextafter", "not", "or", "pow", "real", "rem", "round", "rsqrt", "select_n", "shift_left",
    "shift_right_arithmetic", "shift_right_logical", "sign", "sin", "sinh", "sqrt", "square", "stop_gradient", "sub", "tan",
    "tanh", "xor",
))  # fmt: skip
"""Primitives with one result, each entry of which depends only on the operands' entries at the same place."""

REDUCTIONS = {
    "reduce_sum": ("add", lax.add), "reduce_max": ("max", lax.max), "reduce_min": ("min", lax.min),
    "reduce_prod": ("mul", lax.mul), "reduce_and": ("and", lax.bitwise_and), "reduce_or": ("or", lax.bitwise_or),
}  # fmt: skip
"""By name, the primitive that combines two entries, and its function."""

_ON_NUMBERS: dict[str, Callable] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "neg": np.negative, "max": np.maximum, "min": np.minimum,
    "eq": np.equal, "ne": np.not_equal, "lt": np.less, "le": np.less_equal, "gt": np.greater, "ge": np.greater_equal,
    "and": np.bitwise_and, "or": np.bitwise_or, "not": np.invert, "sqrt": np.sqrt, "square": np.square, "abs": np.abs,
    "is_finite": np.isfinite, "sign": np.sign,
}  # fmt: skip


def elementwise(primitive: Any, params: dict[str, Any], operands: list[Entries], out: Any) -> Entries:
    """An elementwise primitive, entry by entry."""
    wide = [np.broadcast_to(one, out.shape) for one in operands]
    bind = functools.partial(primitive.bind, **params)
    found = [
        one_entry(primitive.name, bind, [one[index] for one in wide], out.dtype) for index in np.ndindex(out.shape)
    ]
    return of_list(found, out.shape)


def one_entry(name: str, bind: Callable, operands: list[Any], dtype: Any) -> Any:
    """One entry of the result. Known numbers are computed here; sums with zero and products with one or zero are simplified.

    Thus a triangular matrix costs no more than its lower half. A product of zero and NaN is zero here.
    """
    simple = _simplified(name, operands, dtype)
    if simple is not None:
        return simple
    like = next((one.dtype for one in operands if not is_known(one)), None)
    wanted = [getattr(one, "dtype", like) for one in operands]
    return bind(*(scalar_of(one, kind) for one, kind in zip(operands, wanted, strict=True)))


def _simplified(name: str, operands: list[Any], dtype: Any) -> Any:
    known = [is_known(one) for one in operands]
    if name in _ON_NUMBERS and all(known):
        with np.errstate(all="ignore"):
            return np.asarray(_ON_NUMBERS[name](*operands), dtype)[()]
    if name == "mul":
        for number, is_number, other in zip(operands, known, operands[::-1], strict=True):
            if is_number and number == 1:
                return other
            if is_number and number == 0:
                return np.zeros((), dtype)[()]
    if name in ("add", "add_any", "sub"):
        if known[1] and operands[1] == 0:
            return operands[0]
        if known[0] and operands[0] == 0:
            return operands[1] if name != "sub" else -operands[1]
    if name == "select_n" and known[0]:
        return operands[1 + int(operands[0])]
    return None


def reduction(name: str, axes: tuple[int, ...], operand: Entries, out: Any) -> Entries:
    """A reduction, from the first entry to the last."""
    if not axes:
        return operand
    combined, combine = REDUCTIONS[name]
    first = np.moveaxis(operand, axes, range(len(axes)))
    columns = first.reshape(math.prod(operand.shape[axis] for axis in axes), *out.shape)
    found = []
    for index in np.ndindex(out.shape):
        total, *rest = (columns[(k, *index)] for k in range(len(columns)))
        for entry in rest:
            total = one_entry(combined, combine, [total, entry], out.dtype)
        found.append(total)
    return of_list(found, out.shape)


def inner_products(params: dict[str, Any], operands: list[Entries], out: Any) -> Entries:
    """A `dot_general`, term by term."""
    (contracted_a, contracted_b), (batch_a, batch_b) = params["dimension_numbers"]
    a, b = _ordered(operands[0], batch_a, contracted_a), _ordered(operands[1], batch_b, contracted_b)
    found = []
    for batch in range(a.shape[0]):
        for i in range(a.shape[1]):
            for j in range(b.shape[1]):
                terms = [
                    one_entry("mul", lax.mul, [x, y], out.dtype) for x, y in zip(a[batch, i], b[batch, j], strict=True)
                ]
                total, *rest = terms
                for term in rest:
                    total = one_entry("add", lax.add, [total, term], out.dtype)
                found.append(total)
    return of_list(found, out.shape)


def _ordered(one: Entries, batch: tuple[int, ...], last: tuple[int, ...]) -> Entries:
    """The array with three axes: those of the batch, the others, and those that are summed over, each group flattened."""
    others = [axis for axis in range(one.ndim) if axis not in batch and axis not in last]
    size = lambda axes: math.prod(one.shape[axis] for axis in axes)
    return one.transpose(*batch, *others, *last).reshape(size(batch), size(others), size(last))


def _broadcast(params, operands, out):
    (one, *_) = operands
    shape = [1] * len(out.shape)
    for axis, size in zip(params["broadcast_dimensions"], one.shape, strict=True):
        shape[axis] = size
    return np.broadcast_to(one.reshape(shape), out.shape)


def _slice(params, operands, out):
    steps = params["strides"] or (1,) * operands[0].ndim
    bounds = zip(params["start_indices"], params["limit_indices"], steps, strict=True)
    return operands[0][tuple(slice(*three) for three in bounds)]


def _iota(params, operands, out):
    shape = [-1 if axis == params["dimension"] else 1 for axis in range(len(out.shape))]
    return entries(
        np.broadcast_to(np.arange(out.shape[params["dimension"]], dtype=out.dtype).reshape(shape), out.shape)
    )


def _pad(params, operands, out):
    one, value = operands
    found = np.full(out.shape, None, object)
    for index in np.ndindex(out.shape):
        found[index] = value[()]
    places = []
    for (low, _, between), size in zip(params["padding_config"], one.shape, strict=True):
        places.append(low + (between + 1) * np.arange(size))
    inside = [(place >= 0) & (place < size) for place, size in zip(places, out.shape, strict=True)]
    kept = np.ix_(*[np.flatnonzero(which) for which in inside])
    found[np.ix_(*[place[which] for place, which in zip(places, inside, strict=True)])] = one[kept]
    return found


def _split(params, operands, out):
    return np.split(operands[0], np.cumsum(params["sizes"])[:-1], axis=params["axis"])


def _unstack(params, operands, out):
    # Parts of length one: a single entry is not an array.
    return [
        part.reshape(out.shape) for part in np.split(operands[0], operands[0].shape[params["axis"]], params["axis"])
    ]


def _gather(params, operands, out):
    """A gather with known indices, whose entries are therefore known, too; None if the indices are not known."""
    places, indices = np.arange(operands[0].size).reshape(operands[0].shape), operands[1]
    if not all(is_known(index) for index in indices.reshape(-1)):
        return None
    numbers = np.asarray(indices.tolist(), np.int32).reshape(indices.shape)
    with jax.ensure_compile_time_eval():
        found = np.asarray(lax.gather_p.bind(jnp.asarray(places), jnp.asarray(numbers), **params))
    if found.min(initial=0) < 0:
        return None
    entry = operands[0].reshape(-1)
    return of_list([entry[place] for place in found.reshape(-1)], found.shape)


MOVES: dict[str, Callable] = {
    "broadcast_in_dim": _broadcast,
    "concatenate": lambda params, operands, out: np.concatenate(operands, axis=params["dimension"]),
    "expand_dims": lambda params, operands, out: operands[0].reshape(out.shape),
    "gather": _gather,
    "iota": _iota,
    "pad": _pad,
    "reshape": lambda params, operands, out: operands[0].reshape(out.shape),
    "rev": lambda params, operands, out: np.flip(operands[0], params["dimensions"]),
    "slice": _slice,
    "split": _split,
    "squeeze": lambda params, operands, out: operands[0].reshape(out.shape),
    "stack": lambda params, operands, out: np.stack(operands, axis=params["axis"]),
    "transpose": lambda params, operands, out: operands[0].transpose(params["permutation"]),
    "unstack": _unstack,
}
"""Primitives that move entries without computing; `gather` gives None if its indices are not known."""
