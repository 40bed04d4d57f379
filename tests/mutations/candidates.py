"""What can be broken in a line: mutations of expressions, found in the syntax tree and written back as text."""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable, Iterator
from typing import NamedTuple

SWAPPED_NAMES = {
    "sin": "cos", "front": "rear", "left": "right", "front_left": "front_right", "rear_left": "rear_right", "F_x": "F_y",
    "minimum": "maximum", "slip_angle": "slip_ratio", "process_noise": "measurement_noise", "mean": "sum",
}  # fmt: skip
SWAPPED_NAMES |= {other: name for name, other in SWAPPED_NAMES.items()}

SWAPPED_OPERATORS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd, ast.MatMult: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Lt: ast.Gt, ast.Gt: ast.Lt, ast.LtE: ast.Gt, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip

UNSEEN_CALLS = (
    "coefficient",
    "InputError",
    "FilterError",
    "warn",
    "warn_once",
    "field",
    "parameter",
    "positive",
    "progress",
    "doc",
)
"""Calls whose arguments are messages, declarations of fields, or progress; and all whose name begins with `check`."""

CHECKS = ("__check_init__", "check")
"""Methods that look at input: what they refuse has tests of its own."""


ALIKE = (ast.Name, ast.Attribute, ast.BinOp, ast.UnaryOp, ast.Call)
"""Arguments that may change places: where one is a list or a text, the exchange is no subtle mistake."""

NOTICED_AT_ONCE = {"arguments": 0.25}
"""How often a kind of change is taken, where others are once: most exchanged arguments end in a traceback."""


class Mutant(NamedTuple):
    """`path` below the package's root, `line` (from 1) with the text `before` and `after`, and what `kind` of change it is."""

    path: str
    line: int
    before: str
    after: str
    kind: str


def mutants(path: str, source: str) -> list[Mutant]:
    """Every mutation of every line of a module."""
    lines = source.splitlines()
    found = []
    for node, changes in _places(ast.parse(source)):
        if node.lineno != node.end_lineno:
            continue
        before = lines[node.lineno - 1]
        raw = before.encode()
        head, tail = raw[: node.col_offset].decode(), raw[node.end_col_offset :].decode()
        for kind, text in changes:
            after = f"{head}{text}{tail}"
            if after != before:
                found.append(Mutant(path, node.lineno, before, after, kind))
    return found


def _places(tree: ast.Module) -> Iterator[tuple[ast.expr, list[tuple[str, str]]]]:
    for node in _seen(tree):
        if isinstance(node, ast.expr):
            changes = [change for of in _CHANGES for change in of(node)]
            if changes:
                yield node, changes


def _seen(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes that compute something: no annotation, message, decorator, import, or check of input."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom | ast.Assert):
        return
    if isinstance(node, ast.Call) and _is_unseen(node.func):
        return
    if isinstance(node, ast.FunctionDef) and (node.name in CHECKS or node.name.startswith("_check")):
        return
    yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _seen(child)


def _is_unseen(function: ast.expr) -> bool:
    name = ast.unparse(function).rpartition(".")[2]
    return name in UNSEEN_CALLS or name.lstrip("_").startswith("check")


# Changes: each takes an expression and gives (kind, text) of what may stand in its place.


def _operators(node: ast.expr) -> Iterator[tuple[str, str]]:
    if isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in SWAPPED_OPERATORS:
        yield "operator", _changed(node, lambda new: setattr(new, "op", SWAPPED_OPERATORS[type(node.op)]()))
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in SWAPPED_OPERATORS:
        yield "comparison", _changed(node, lambda new: setattr(new, "ops", [SWAPPED_OPERATORS[type(node.ops[0])]()]))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not | ast.Invert):
        yield "sign", f"({ast.unparse(node.operand)})"


def _dropped_terms(node: ast.expr) -> Iterator[tuple[str, str]]:
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub | ast.Mult):
        yield "dropped", f"({ast.unparse(node.left)})"
        if not isinstance(node.op, ast.Sub):
            yield "dropped", f"({ast.unparse(node.right)})"


def _constants(node: ast.expr) -> Iterator[tuple[str, str]]:
    if not isinstance(node, ast.Constant):
        return
    if isinstance(node.value, bool):
        yield "constant", str(not node.value)
    elif isinstance(node.value, int):
        yield "constant", str(node.value + 1)
    elif isinstance(node.value, float):
        yield "constant", repr(node.value * 1.1 if node.value else 0.1)


def _arguments(node: ast.expr) -> Iterator[tuple[str, str]]:
    """Two neighbours of a call's arguments change places."""
    if isinstance(node, ast.Call):
        for i in range(len(node.args) - 1):
            first, second = node.args[i : i + 2]
            if not isinstance(first, ALIKE) or not isinstance(second, ALIKE) or ast.dump(first) == ast.dump(second):
                continue

            def swap(new: ast.Call, i=i) -> None:
                new.args[i], new.args[i + 1] = new.args[i + 1], new.args[i]

            yield "arguments", _changed(node, swap)


def _names(node: ast.expr) -> Iterator[tuple[str, str]]:
    if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load) and node.attr in SWAPPED_NAMES:
        yield "name", f"{ast.unparse(node.value)}.{SWAPPED_NAMES[node.attr]}"


_CHANGES: tuple[Callable[[ast.expr], Iterator[tuple[str, str]]], ...] = (
    _operators, _dropped_terms, _constants, _arguments, _names,
)  # fmt: skip


def _changed(node: ast.expr, change: Callable) -> str:
    new = copy.deepcopy(node)
    change(new)
    return f"({ast.unparse(new)})"
