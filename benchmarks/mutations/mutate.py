"""Changes of one expression within one line of Python, like those of a typing error."""

from __future__ import annotations

import ast
import difflib
from collections.abc import Collection, Iterator
from typing import NamedTuple

OPERATORS = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"), ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&"), ast.MatMult: ("@", "*"),
}  # fmt: skip
COMPARISONS = {
    ast.Lt: ("<", ">="), ast.LtE: ("<=", "<"), ast.Gt: (">", "<="), ast.GtE: (">=", ">"), ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
}  # fmt: skip
NAMES = {
    "minimum": "maximum", "maximum": "minimum", "sin": "cos", "cos": "sin", "tan": "sin", "exp": "expm1", "log": "log1p",
    "sqrt": "square", "square": "abs", "argmax": "argmin", "floor": "ceil", "any": "all", "all": "any", "abs": "square",
}  # fmt: skip
DECLARATIONS = {"parameter", "positive", "field", "_levels", "warn", "Info", "code", "check_names"}
"""Calls whose arguments are metadata or words."""

NOT_SWAPPED = {
    "getattr",
    "hasattr",
    "isinstance",
    "issubclass",
    "record",
    "record_type",
    "zip",
    "map",
    "broadcast_to",
    "apart",
}
"""Calls that would only raise."""

SWAPS = "swapped arguments"


class Mutation(NamedTuple):
    """A mutation: `before` in columns `start` to `end` of `line` (from 1) of a file becomes `after`; `kind` in words."""

    file: str
    line: int
    start: int
    end: int
    before: str
    after: str
    kind: str

    @property
    def name(self) -> str:
        """A unique name of the change."""
        return f"{self.file}:{self.line}:{self.start}-{self.end}:{self.kind}:{self.after}"

    def applied(self, source: str) -> str:
        """Return the file's text with the change."""
        lines = source.split("\n")
        # Columns of the syntax tree count bytes.
        text = lines[self.line - 1].encode()
        lines[self.line - 1] = (text[: self.start] + self.after.encode() + text[self.end :]).decode()
        return "\n".join(lines)

    def diff(self, source: str) -> str:
        """Return the change as a unified diff without context."""
        found = difflib.unified_diff(
            source.splitlines(), self.applied(source).splitlines(), self.file, self.file, lineterm="", n=0
        )
        return "\n".join(found)


def mutations(file: str, source: str) -> list[Mutation]:
    """Return all mutations of a file in the order of its text, except those of texts, checks, annotations and declarations."""
    found = []
    for node in _computing(ast.parse(source)):
        if node.lineno == node.end_lineno:
            found.extend(_of(file, source, node))
    return sorted(set(found), key=lambda m: (m.line, m.start, m.kind, m.after))


def _computing(node: ast.AST) -> Iterator[ast.expr]:
    """Yield the expressions that compute something."""
    if isinstance(node, ast.Raise | ast.Assert | ast.Import | ast.ImportFrom | ast.JoinedStr):
        return
    if isinstance(node, ast.FunctionDef) and _only_checks(node.name):
        return
    if isinstance(node, ast.If) and all(isinstance(statement, ast.Raise) for statement in node.body):
        for statement in node.orelse:
            yield from _computing(statement)
        return
    if isinstance(node, ast.Call) and _only_checks(_called(node), DECLARATIONS):
        return
    if isinstance(node, ast.expr):
        yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases", "keywords") and not isinstance(node, ast.Call):
            continue
        if name == "slice" or (name == "value" and isinstance(node, ast.AnnAssign) and node.simple == 0):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _computing(child)


def _only_checks(name: str, more: Collection[str] = ()) -> bool:
    return name.lstrip("_").startswith("check") or name in {"units", "__repr__", *more}


def _called(node: ast.Call) -> str:
    function = node.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _of(file: str, source: str, node: ast.expr) -> Iterator[Mutation]:
    line = source.split("\n")[node.lineno - 1].encode()
    text = lambda part: line[part.col_offset : part.end_col_offset].decode()

    def change(start: int, end: int, after: str, kind: str) -> Mutation:
        return Mutation(file, node.lineno, start, end, line[start:end].decode(), after, kind)

    whole = lambda after, kind: change(node.col_offset, _end(node), after, kind)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS and not _words(node):
        sign, other = OPERATORS[type(node.op)]
        yield _between(change, line, node.left, node.right, sign, other, "operator")
        if isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div):
            yield whole(text(node.left), "dropped term")
    elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in COMPARISONS:
        sign, other = COMPARISONS[type(node.ops[0])]
        yield _between(change, line, node.left, node.comparators[0], sign, other, "comparison")
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Invert | ast.Not):
        yield whole(text(node.operand), "sign")
    elif isinstance(node, ast.BoolOp):
        sign, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        yield _between(change, line, node.values[0], node.values[1], sign, other, "operator")
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        yield whole(_other_number(node.value), "constant")
    elif isinstance(node, ast.Call):
        if len(node.args) > 1 and not any(isinstance(a, ast.Starred) for a in node.args[:2]):
            first, second = node.args[:2]
            numbers = all(isinstance(a, ast.Name | ast.Attribute | ast.BinOp | ast.Subscript) for a in (first, second))
            named = text(first) in ("self", "model") or _called(node) in NOT_SWAPPED
            if numbers and not named and text(first) != text(second):
                between = line[_end(first) : second.col_offset].decode()
                yield change(first.col_offset, _end(second), text(second) + between + text(first), SWAPS)
        if isinstance(node.func, ast.Attribute) and node.func.attr in NAMES:
            end = _end(node.func)
            yield change(end - len(node.func.attr), end, NAMES[node.func.attr], "function")


def _end(node: ast.expr) -> int:
    """Return the column after the expression, which is within one line."""
    assert node.end_col_offset is not None
    return node.end_col_offset


def _between(change, line: bytes, left: ast.expr, right: ast.expr, sign: str, other: str, kind: str) -> Mutation:
    """Return the mutation of the operator's sign, which is between its operands, with parentheses beside it."""
    start = line.find(sign.encode(), left.end_col_offset, right.col_offset)
    return change(start, start + len(sign), other, kind)


def _words(node: ast.BinOp) -> bool:
    """Whether texts or types are joined, which is not arithmetic."""
    parts = [part for side in (node.left, node.right) for part in ast.walk(side)]
    text = any(
        isinstance(p, ast.JoinedStr) or (isinstance(p, ast.Constant) and isinstance(p.value, str)) for p in parts
    )
    names = [side.id for side in (node.left, node.right) if isinstance(side, ast.Name)]
    return text or (isinstance(node.op, ast.BitOr) and any(name[:1].isupper() for name in names))


def _other_number(value: float) -> str:
    if isinstance(value, int):
        return str(value + 1)
    return "1.0" if value == 0 else repr(1.5 * value)
