"""The reference: one page per module, generated from docstrings, declarations and the code of pages that use the module.

The head of a page is written by hand in `notebooks/reference/`: the purpose of the module, and an example that runs. Below it
each public name has its signature and text (mkdocstrings), its arguments, and the lines of pages that use it.
"""

from __future__ import annotations

import ast
import dataclasses
import enum
import functools
import html
import importlib
import inspect
import itertools
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jaxveh
from notebooks.site.executed import blocks_of
from notebooks.site.words import SHARED, SHARED_VALUES

PLACE = "reference"
PROGRAMS = ("jaxveh.cli",)
"""Documented by their own `--help`."""


class Entry(NamedTuple):
    """A public name: the module that lists it first, its name, and its value."""

    module: str
    name: str
    value: Any

    @property
    def path(self) -> str:
        return f"{self.module}.{self.name}"

    @property
    def short(self) -> str:
        """As written after `from jaxveh import ...`."""
        return self.path.removeprefix("jaxveh.")


class Argument(NamedTuple):
    """An argument of a public name: its name, type, default and description; each empty if absent."""

    name: str
    type: str
    default: str
    words: str


def public_modules() -> list[str]:
    """Every module that lists public names, the least nested first."""
    found = ["jaxveh"]
    for module in pkgutil.walk_packages(jaxveh.__path__, "jaxveh."):
        private = any(part.startswith("_") for part in module.name.split("."))
        if not private and module.name not in PROGRAMS and hasattr(importlib.import_module(module.name), "__all__"):
            found.append(module.name)
    return sorted(found, key=lambda name: (name.count("."), name.endswith(".kit"), name))


def public_entries() -> dict[str, list[Entry]]:
    """The entries of each module; a name that several modules list is an entry of the first only."""
    seen: set[int] = set()
    pages: dict[str, list[Entry]] = {}
    for name in public_modules():
        module = importlib.import_module(name)
        pages[name] = []
        for one in module.__all__:
            value = getattr(module, one)
            shared = callable(value) and id(value) in seen
            if not inspect.ismodule(value) and not one.startswith("__") and not shared:
                seen.add(id(value))
                pages[name].append(Entry(name, one, value))
    return {name: entries for name, entries in pages.items() if entries}


def arguments_of(entry: Entry) -> list[Argument]:
    """The arguments of a function or class, each with its description."""
    if not callable(entry.value) or not entry.value.__module__.startswith("jaxveh") or _is_made_elsewhere(entry.value):
        return []
    try:
        parameters = inspect.signature(entry.value).parameters.values()
    except (ValueError, TypeError):
        return []
    return [
        Argument(p.name, _type(p.annotation), _default(p), _words(entry, p.name))
        for p in parameters
        if p.name != "self" and not p.name.startswith("_")
    ]


def _is_made_elsewhere(value: Any) -> bool:
    """Whether another library defines how a class is made: an enumeration, a figure."""
    bases = value.__mro__ if inspect.isclass(value) else ()
    return any(base is enum.Enum or base.__module__.startswith("matplotlib") for base in bases)


def _type(annotation: Any) -> str:
    if annotation is inspect.Parameter.empty:
        return ""
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))


def _default(p: inspect.Parameter) -> str:
    if p.default is inspect.Parameter.empty:
        return ""
    if callable(p.default):
        return getattr(p.default, "__name__", type(p.default).__name__)
    text = " ".join(repr(p.default).split())
    return text if len(text) < 40 and " at 0x" not in text else f"{type(p.default).__name__}(...)"


def _words(entry: Entry, name: str) -> str:
    """The description of an argument: its unit and range, then the words of its owner's text or the shared words of its name."""
    declared, text = _declared(entry.value, name), " ".join(text_of(entry.value).split())
    said = (
        _explained(text, name)
        or _sentence(text, rf"`{re.escape(name)}[`(. ]")
        or SHARED.get(f"{entry.name}.{name}", SHARED.get(name))
        or _sentence(text, rf"\b{re.escape(name)}\b")
        or ""
    )
    said = said.removeprefix("-; ")
    unit, _, positive = declared.partition(", ")
    if said == "-":
        return declared or "no unit"
    if said.startswith(unit):
        return f"{said}, {positive}" if positive else said
    return "; ".join(part for part in (declared, said) if part)


def _declared(value: Any, name: str) -> str:
    if not (inspect.isclass(value) and dataclasses.is_dataclass(value)):
        return ""
    for field in dataclasses.fields(value):
        if field.name == name and (unit := field.metadata.get("unit")):
            positive = type(field.metadata.get("domain")).__name__ == "Positive"
            return f"{'no unit' if unit == '-' else unit}{', positive' if positive else ''}"
    return ""


def text_of(value: Any) -> str:
    """The docstring of a function; for a class also those of its base classes."""
    if not inspect.isclass(value):
        return inspect.getdoc(value) or ""
    own = [base.__dict__.get("__doc__") or "" for base in value.__mro__ if base.__module__.startswith("jaxveh")]
    return inspect.cleandoc(own[0]) + "\n\n" + "\n\n".join(inspect.cleandoc(text) for text in own[1:])


def _explained(text: str, name: str) -> str:
    """The words behind an argument's name in a text, in brackets or after a colon."""
    if found := re.search(rf"`{re.escape(name)}`(?:, `\w+`)*(?: and `\w+`)? \(([^()]+)\)", text):
        return found[1]
    if found := re.search(rf"`{re.escape(name)}`: ([^.;`(]+(?:`[^`]+`[^.;`(]*)*)", text):
        return found[1].strip(" ,")
    return ""


def _sentence(text: str, pattern: str) -> str:
    """The first sentence of a text that has the pattern, without its full stop; if it is long, a pointer to the text."""
    sentences = re.split(r"(?<=[a-z)`\]0-9])[.;](?= [A-Z`*a-z])| - (?=`)", text)
    told = (one.strip(" .") for one in sentences if "**Raises" not in one)
    found = next((one for one in told if re.search(pattern, one)), "")
    return found if len(found) < 160 else "see the text above"


def signature_of(entry: Entry) -> str:
    """The call that makes a class, on several lines if it is long."""
    given = []
    for p in inspect.signature(entry.value).parameters.values():
        if p.name == "self":
            continue
        default = _default(p)
        given.append(f"{p.name}={default}" if default else f"*{p.name}" if p.kind == p.VAR_POSITIONAL else p.name)
    line = f"{entry.short}({', '.join(given)})"
    return line if len(line) < 90 else f"{entry.short}(\n    " + ",\n    ".join(given) + ",\n)"


def usages(pages: dict[str, str]) -> dict[str, list[tuple[str, str]]]:
    """The statements that use each name (such as `filters.run`): (page, code), shortest first."""
    found: dict[str, list[tuple[str, str]]] = {}
    for page, text in pages.items():
        for block in blocks_of(text):
            if block.language == "python":
                for name, code in _names_used(block.code):
                    found.setdefault(name, []).append((page, code))
    return {name: sorted(uses, key=lambda use: len(use[1])) for name, uses in found.items()}


def _names_used(code: str) -> Iterator[tuple[str, str]]:
    """The names of the package that each statement of a block uses: `filters.run`, `Recording` as `Recording`."""
    for statement in ast.parse(code).body:
        text = ast.get_source_segment(code, statement) or ""
        if isinstance(statement, ast.Import | ast.ImportFrom):
            continue
        used = set()
        for node in ast.walk(statement):
            if isinstance(node, ast.Attribute):
                used.add(ast.unparse(node).removeprefix("jaxveh."))
            elif isinstance(node, ast.Name):
                used.add(node.id)
        yield from ((name, text) for name in used)


def write_reference(heads: Path, folder: Path, pages: dict[str, str]) -> None:
    """Write the pages of all modules into a folder; `heads` has the texts above them, `pages` the site's pages by path."""
    uses = usages(pages)
    folder.mkdir(parents=True, exist_ok=True)
    for module, entries in public_entries().items():
        name = page_of(module)
        head = heads / name
        opening = head.read_text() if head.exists() else _opening(module)
        body = "\n\n".join(_entry(entry, uses, f"{PLACE}/{name}") for entry in entries)
        (folder / name).write_text(f"{opening.rstrip()}\n\n{_overview(module, entries)}\n\n{body}\n")


def page_of(module: str) -> str:
    """The file of a module's page."""
    return f"{module.removeprefix('jaxveh.').replace('.', '-')}.md"


def _opening(module: str) -> str:
    return f"# {module}\n\n{inspect.getdoc(importlib.import_module(module))}"


def _overview(module: str, entries: list[Entry]) -> str:
    """A table of the names that the module lists, with links to those on other pages."""
    rows = [f"| [`{entry.name}`](#{entry.path}) | {_first_sentence(entry)} |" for entry in entries]
    there = {id(entry.value): entry for entry in _every_entry() if callable(entry.value)}
    own = {entry.name for entry in entries}
    for name in importlib.import_module(module).__all__:
        value = getattr(importlib.import_module(module), name)
        if name not in own and (entry := there.get(id(value))):
            anchor = f'<a id="{module}.{name}"></a>'
            rows.append(f"| {anchor}[`{name}`]({page_of(entry.module)}#{entry.path}) | {_first_sentence(entry)} |")
    return "\n".join(["## What it lists", "", "| name | |", "| --- | --- |", *rows])


def _first_sentence(entry: Entry) -> str:
    said = inspect.getdoc(entry.value) if callable(entry.value) else text_of_value(entry)
    text = " ".join((said or "").split("\n\n")[0].split())
    return re.split(r"(?<=[a-z)`\]])[.:;] ", text)[0].rstrip(".").replace("|", "\\|")


def _entry(entry: Entry, uses: dict[str, list[tuple[str, str]]], page: str) -> str:
    is_class = inspect.isclass(entry.value)
    parts = [_heading(entry)]
    if is_class and (arguments := arguments_of(entry)):
        parts.append(f"```python\n{signature_of(entry)}\n```")
    if arguments := arguments_of(entry):
        rows = [
            f"| `{a.name}` | {_cell(a.type)} | {_cell(a.default)} | {a.words.replace('|', '/')} |" for a in arguments
        ]
        parts.append("\n".join(["| argument | type | default | what it is |", "| --- | --- | --- | --- |", *rows]))
    if links := _related(entry):
        parts.append(links)
    if used := uses.get(entry.short):
        where, code = used[0]
        link = "" if where == page else f" ([{Path(where).stem.replace('_', ' ')}]({_from_reference(where)}))"
        parts.append(f"Example{link}:\n\n```python\n{code}\n```")
    return "\n\n".join(parts)


def _related(entry: Entry) -> str:
    """For a class: the functions that return it, and its public subclasses."""
    if not inspect.isclass(entry.value):
        return ""
    returned, kinds = [], []
    for other in _every_entry():
        if inspect.isclass(other.value):
            kinds += [other] if entry.value in other.value.__mro__[1:] else []
        elif callable(other.value) and re.search(rf"\b{entry.name}\b", _returns(other.value)):
            returned.append(other)
    links = [("Returned by", returned), ("Kinds of it", kinds)]
    return "\n\n".join(
        f"{title}: " + ", ".join(f"[`{one.short}`]({page_of(one.module)}#{one.path})" for one in found) + "."
        for title, found in links
        if found
    )


@functools.cache
def _every_entry() -> list[Entry]:
    return [entry for entries in public_entries().values() for entry in entries]


def _returns(function: Any) -> str:
    try:
        annotation = inspect.signature(function).return_annotation
    except (ValueError, TypeError):
        return ""
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", "")


def has_example(entry: Entry, uses: dict[str, list[tuple[str, str]]]) -> bool:
    """Whether a page shows how it is used, or names the functions that return it or its subclasses."""
    return entry.short in uses or bool(_related(entry)) or not callable(entry.value)


def _heading(entry: Entry) -> str:
    """Name and text: by mkdocstrings for names that this package defines, here for functions made by others; the value and its
    text; a note for names of other libraries."""
    anchor = f"## {entry.name} {{ #{entry.path} }}"
    if not callable(entry.value):
        return f"{anchor}\n\n{_shown_value(entry.value)}\n\n{text_of_value(entry)}"
    if not (entry.value.__module__ or "").startswith("jaxveh"):
        return f"{anchor}\n\n`{entry.value.__module__}.{entry.name}`, as it is."
    if _is_made_by_function(entry.value):
        # mkdocstrings reads the source, where it has neither a signature nor a text.
        return f"{anchor}\n\n```python\n{signature_of(entry)}\n```\n\n{inspect.getdoc(entry.value)}"
    home = f"{entry.value.__module__}.{entry.name}"
    if not entry.value.__module__.endswith(f".{entry.name}") or entry.module == entry.value.__module__:
        return f"::: {entry.path}"
    # By the path in the room, mkdocstrings would find the module of the same name.
    options = f'    options:\n      heading: "{entry.path}"\n      toc_label: "{entry.name}"'
    return f'<a id="{entry.path}"></a>\n\n::: {home}\n{options}'


def _is_made_by_function(value: Any) -> bool:
    """Whether a function is made by another one, and not as the wrapper of a definition."""
    code = getattr(value, "__code__", None)
    return code is not None and "<locals>" in code.co_qualname and not hasattr(value, "__wrapped__")


def _shown_value(value: Any) -> str:
    if isinstance(value, dict):
        return "By name: " + ", ".join(f"`{key}`" for key in value) + "."
    text = " ".join(repr(value).split())
    return f"`{text}`" if len(text) < 100 else f"A `{type(value).__name__}`."


@functools.cache
def _texts_of_values() -> dict[str, list[tuple[str, str]]]:
    """The text below each constant of the package: (module, text) by its name."""
    found: dict[str, list[tuple[str, str]]] = {}
    root = Path(jaxveh.__file__).parent
    for path in sorted(root.rglob("*.py")):
        module = ".".join(("jaxveh", *path.relative_to(root).with_suffix("").parts))
        body = ast.parse(path.read_text()).body
        for one, after in itertools.pairwise(body):
            if (
                isinstance(one, ast.Assign | ast.AnnAssign)
                and isinstance(after, ast.Expr)
                and isinstance(after.value, ast.Constant)
            ):
                target = one.targets[0] if isinstance(one, ast.Assign) else one.target
                for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                    found.setdefault(ast.unparse(name), []).append((module, inspect.cleandoc(str(after.value.value))))
    return found


def text_of_value(entry: Entry) -> str:
    """The text below a constant; that of its own room is preferred."""
    room = entry.module.removesuffix(".kit")
    texts = _texts_of_values().get(entry.name, [])
    here = [text for module, text in texts if module.startswith(room)]
    return here[0] if here else SHARED_VALUES.get(entry.name) or (texts[0][1] if texts else "")


def _cell(text: str) -> str:
    # In a table a bar begins the next cell, even in code.
    return f"<code>{html.escape(text).replace('|', '&#124;')}</code>" if text else ""


def _from_reference(page: str) -> str:
    return page.removeprefix(f"{PLACE}/") if page.startswith(f"{PLACE}/") else f"../{page}"
