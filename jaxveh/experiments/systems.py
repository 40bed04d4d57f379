"""Every system of a paper and its place in this package: the entries of a paper's `SYSTEMS`, and the page made of them."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple


class System(NamedTuple):
    """`what`: a model, a method, a table or a claim; `where` it is in the paper (section, equation, table, its reference).
    `found`: its names below `jaxveh`, with entries of a mapping in brackets. `lacks`: what is not here, and why."""

    what: str
    where: str
    found: tuple[str, ...] = ()
    lacks: str = ""


def system(what: str, where: str, *found: str, lacks: str = "") -> System:
    """An entry of a paper's `SYSTEMS`: the fields of `System`, with as many names as there are."""
    return System(what, where, found, lacks)


def ways(quantity: str, *methods: str) -> tuple[str, ...]:
    """The names of a quantity's methods below `jaxveh`."""
    return tuple(f"estimators.{quantity}.METHODS[{name}]" for name in methods)


def resolve_name(name: str) -> Any:
    """The object of a name below `jaxveh`: modules, attributes, `mapping[key]`. **Raises** `LookupError` if there is none."""
    plain, _, key = name.partition("[")
    found: Any = importlib.import_module("jaxveh")
    path = "jaxveh"
    for part in plain.split("."):
        path += f".{part}"
        try:
            found = getattr(found, part)
        except AttributeError:
            try:
                found = importlib.import_module(path)
            except ImportError as error:
                raise LookupError(f"jaxveh.{name}: there is no {path}.") from error
    if not key:
        return found
    if key.rstrip("]") not in found:
        raise LookupError(f"jaxveh.{name}: {path} has no {key.rstrip(']')}.")
    return found[key.rstrip("]")]


def systems_page(papers: Mapping[str, Sequence[System]]) -> str:
    """One Markdown table per paper."""
    parts = []
    for title, systems in papers.items():
        lines = [f"## {title}", "", "| system | in the paper | here | not here |", "| --- | --- | --- | --- |"]
        for one in systems:
            here = ", ".join(f"`{name}`" for name in one.found)
            lines.append(f"| {one.what} | {one.where} | {here} | {one.lacks} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"
