"""A self-contained page of HTML: headings, tables, charts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.45 system-ui, "DejaVu Sans", sans-serif; color: #222; background: #fff; margin: 2rem auto; padding: 0 1.5rem;
  max-width: 1280px; }
h1 { font-size: 1.6rem; margin: 0 0 1rem; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .6rem; border-bottom: 1px solid #ccc; padding-bottom: .2rem; }
h3 { font-size: 1.05rem; margin: 1.4rem 0 .4rem; }
nav a { margin-right: 1.2rem; }
table { border-collapse: collapse; margin: .3rem 0; }
th, td { text-align: left; padding: .16rem 1.4rem .16rem 0; vertical-align: top; }
th { font-weight: 600; border-bottom: 1px solid #999; }
td { border-bottom: 1px solid #eee; }
td:first-child { white-space: nowrap; }
td:last-child { overflow-wrap: anywhere; }
summary { cursor: pointer; color: #0072b2; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.note { color: #555; margin: .2rem 0 .8rem; }
.error { color: #b00020; font-weight: 600; } .warning { color: #9a6700; font-weight: 600; }
"""

MARKED = ("error", "warning")
"""Cells with these words are coloured."""


class ReportTable(NamedTuple):
    """A table of a page.

    `title`: its title; `columns`: their names (none: a list of facts); `rows`: of text; `note`: a line below the table;
    `numbers`: the indices of columns with numbers, which are aligned to the right; `folded`: whether it is folded until a click
    on its title.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    numbers: Sequence[int] = ()
    folded: bool = False


def page(title: str, head: str, parts: Iterable[str]) -> str:
    """Return a whole page: `head` is inserted into its head unchanged, `parts` into its body."""
    return "\n".join(
        (
            "<!DOCTYPE html>",
            '<html lang="en">',
            f'<head><meta charset="utf-8"><title>{escape(title)}</title>',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<style>{STYLE}</style>",
            head,
            "</head>",
            "<body>",
            f"<h1>{escape(title)}</h1>",
            *parts,
            "</body>",
            "</html>",
            "",
        )
    )


def heading(words: str, name: str = "") -> str:
    """Return a heading, with a `name` as target for links within the page."""
    mark = f' id="{escape(name)}"' if name else ""
    return f"<h2{mark}>{escape(words)}</h2>"


def links(names: Sequence[tuple[str, str]]) -> str:
    """Return links within the page: (name of a heading, words)."""
    return "<nav>" + "".join(f'<a href="#{escape(name)}">{escape(words)}</a>' for name, words in names) + "</nav>"


def note(words: str) -> str:
    """Return a line of small print."""
    return f'<p class="note">{escape(words)}</p>' if words else ""


def table(one: ReportTable) -> str:
    """Return a table with its title and note; a table without rows has only the note."""
    title = f"<h3>{escape(one.title)}</h3>" if one.title else ""
    if not one.rows:
        return title + note(one.note or "None.")
    cells = lambda row, tag: "".join(
        f"<{tag}{_class(cell, i in one.numbers)}>{escape(cell)}</{tag}>" for i, cell in enumerate(row)
    )
    head = f"<thead><tr>{cells(one.columns, 'th')}</tr></thead>" if one.columns else ""
    body = "\n".join(f"<tr>{cells(row, 'td')}</tr>" for row in one.rows)
    whole = f"<table>{head}<tbody>\n{body}\n</tbody></table>{note(one.note)}"
    return f"<details><summary>{escape(one.title)}</summary>{whole}</details>" if one.folded else title + whole


def _class(cell: str, number: bool) -> str:
    words = [*(["number"] if number else []), *([cell] if cell in MARKED else [])]
    return f' class="{" ".join(words)}"' if words else ""
