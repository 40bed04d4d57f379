"""Every system of a paper, and where this package has it: what a paper's `SYSTEMS` declares, and the page made of it."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple


class System(NamedTuple):
    """`what`: a model, a method, a table or a claim; `where` the paper has it (section, equation, table, its reference). `found`:
    who has it here, names below `jaxveh`, the entries of a mapping in brackets. `lacks`: what is not there, and why."""

    what: str
    where: str
    found: tuple[str, ...] = ()
    lacks: str = ""


def resolve_name(name: str) -> Any:
    """What a name below `jaxveh` stands for: modules, attributes, `mapping[key]`. **Raises** `LookupError` where it stands for
    nothing."""
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
    """A Markdown table a paper."""
    parts = []
    for title, systems in papers.items():
        lines = [f"## {title}", "", "| system | in the paper | here | not here |", "| --- | --- | --- | --- |"]
        for one in systems:
            here = ", ".join(f"`{name}`" for name in one.found)
            lines.append(f"| {one.what} | {one.where} | {here} | {one.lacks} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"
