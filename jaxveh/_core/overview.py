"""The display of a result: a title and a small table, as text for a terminal and as HTML for a notebook."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

MOST_ROWS = 14
"""Rows of the table that are shown at once: the whole display has less than 20 lines."""

WIDTH = 96
LONGEST = 32
"""Largest number of characters of a cell."""

MOST_FOLDED = 400
"""Largest number of rows of a table in HTML, including the folded ones."""

POINTS = 120
"""Number of pieces of a small curve, which is drawn from the smallest to the largest value of each piece."""


class Lazy(Sequence):
    """The results of a function for many things, each computed when it is accessed: those not shown are never computed."""

    def __init__(self, things: Sequence[Any], make: Callable[[Any], Any]):
        self._things, self._make = things, make

    def __len__(self) -> int:
        return len(self._things)

    def __getitem__(self, k: Any) -> Any:
        return [self._make(one) for one in self._things[k]] if isinstance(k, slice) else self._make(self._things[k])


class Overview(NamedTuple):
    """The display of a result.

    `title`: its description in one line; `columns` and `rows`: a table of texts, whose first `words` columns are not numbers;
    `curves`: an array (T,) per row for a small curve, None for no curve; `count`: the full number of rows (default: that of
    `rows`).
    """

    title: str
    columns: tuple[str, ...] = ()
    rows: Sequence[tuple[str, ...]] = ()
    words: int = 1
    curves: Sequence[Any] = ()
    count: int | None = None


def as_text(overview: Overview) -> str:
    """Return the overview as text of at most `WIDTH` columns and 18 lines."""
    lines = _wrapped(overview.title)
    rows = [tuple(_cut(cell, LONGEST) for cell in row) for row in overview.rows[:MOST_ROWS]]
    if rows:
        table = [overview.columns, *rows]
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        for row in table:
            cells = [
                cell.ljust(width) if k < overview.words else cell.rjust(width)
                for k, (cell, width) in enumerate(zip(row, widths, strict=True))
            ]
            lines.append(_cut("  " + "  ".join(cells).rstrip(), WIDTH))
    more = (overview.count or len(overview.rows)) - len(rows)
    return "\n".join([*lines, f"  ... and {more} more"] if more > 0 else lines)


def _wrapped(title: str) -> list[str]:
    title = " ".join(title.split())
    if len(title) <= WIDTH:
        return [title]
    at = title.rfind(" ", 0, WIDTH)
    at = at if at > 0 else WIDTH
    return [title[:at], _cut("  " + title[at:].strip(), WIDTH)]


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."


def as_html(overview: Overview) -> str:
    """Return the overview as an HTML table, with the rows beyond `MOST_ROWS` folded; texts are escaped."""
    rows = overview.rows[:MOST_FOLDED]
    curves = overview.curves[:MOST_FOLDED] or [None] * len(rows)
    pairs = list(zip(rows, curves, strict=True))
    parts = [f"<div><p><b>{html.escape(overview.title)}</b></p>"]
    if pairs:
        parts.append(_table(overview, pairs[:MOST_ROWS]))
    folded = pairs[MOST_ROWS:]
    count = overview.count or len(overview.rows)
    if count > MOST_ROWS:
        left = f", of which {count - MOST_ROWS - len(folded)} are not shown" if count > MOST_ROWS + len(folded) else ""
        parts.append(f"<details><summary>{count - MOST_ROWS} more{left}</summary>{_table(overview, folded)}</details>")
    return "".join([*parts, "</div>"])


def _table(overview: Overview, pairs: Iterable[tuple[tuple[str, ...], Any]]) -> str:
    aligned = lambda k: "left" if k < overview.words else "right"
    cell = lambda tag, k, text: f'<{tag} style="text-align:{aligned(k)}">{html.escape(text)}</{tag}>'
    head = "".join(cell("th", k, name) for k, name in enumerate(overview.columns))
    drawn = bool(overview.curves)
    rows = [
        "<tr>"
        + "".join(cell("td", k, text) for k, text in enumerate(row))
        + (f"<td>{curve_of(curve)}</td>" if drawn else "")
        + "</tr>"
        for row, curve in pairs
    ]
    return f"<table><thead><tr>{head}{'<th></th>' if drawn else ''}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def curve_of(values: Any, width: int = 160, height: int = 24) -> str:
    """Return a small curve of values (T,) as SVG, from the smallest to the largest value of each piece, with gaps at NaN."""
    if values is None or not is_known(values):
        return ""
    array = _plain(values).astype(np.float64)
    if array.ndim != 1 or array.size == 0:
        return ""
    edges = np.unique(np.linspace(0, array.size, min(POINTS, array.size) + 1).astype(int))
    finite = np.isfinite(array)
    low = np.minimum.reduceat(np.where(finite, array, np.inf), edges[:-1])
    high = np.maximum.reduceat(np.where(finite, array, -np.inf), edges[:-1])
    known = high >= low
    if not known.any():
        return ""
    bottom, top = low[known].min(), high[known].max()
    # A flat curve is drawn in the middle; halving before the subtraction avoids an overflow.
    scale = top / 2 - bottom / 2
    at = lambda value: height / 2 if scale == 0 else height - 2 - (value / 2 - bottom / 2) / scale * (height - 4)
    step = width / max(len(low), 1)
    lines = "".join(
        f"{'L' if k and known[k - 1] else 'M'}{(k + 0.5) * step:.1f} {at(low[k]):.1f}V{at(high[k]) - 0.5:.1f}"
        for k in np.flatnonzero(known)
    )
    return (
        f'<svg width="{width}" height="{height}" role="img" aria-label="curve">'
        f'<path d="{lines}" stroke="#1f77b4" stroke-width="1" fill="none"/></svg>'
    )


def is_known(values: Any) -> bool:
    """Whether a value is a concrete number or array, and not a tracer."""
    if isinstance(values, jax.core.Tracer):
        return False
    return isinstance(values, bool | int | float | np.ndarray | np.generic | jax.Array)


def _plain(values: Any) -> np.ndarray:
    """Return the array; types that only JAX has (bfloat16) are converted to single precision."""
    array = np.asarray(values)
    return array.astype(np.float32) if array.dtype.kind == "V" and array.dtype.names is None else array


def number(value: Any) -> str:
    """Format a number in few digits, an array as its shape, smallest and largest value, and a tracer as its type."""
    if isinstance(value, jax.core.Tracer):
        return f"traced {value.dtype}{list(value.shape)}"
    if not is_known(value):
        return type(value).__name__
    array = _plain(value)
    if array.dtype.kind not in "fiub":
        return str(array.dtype)
    if array.ndim == 0:
        plain = array.item()
        return f"{float(plain):.6g}" if isinstance(plain, float) else str(plain)
    low, high = span(array)
    return f"{list(array.shape)} {low} to {high}"


def span(values: Any) -> tuple[str, str]:
    """Return the smallest and the largest finite value of an array as texts; `-` if there are none."""
    if not is_known(values):
        return "-", "-"
    array = _plain(values)
    if array.dtype.kind == "f":
        finite = array[np.isfinite(array)] if not np.isfinite(array).all() else array
    else:
        finite = array
    if finite.size == 0:
        return "-", "-"
    return f"{float(finite.min()):.4g}", f"{float(finite.max()):.4g}"


def missing_share(values: Any) -> str:
    """Return the share of an array that is not finite, in per cent."""
    if not is_known(values):
        return "-"
    array = _plain(values)
    if array.size == 0 or array.dtype.kind != "f":
        return "0 %"
    share = 1 - np.count_nonzero(np.isfinite(array)) / array.size
    return "0 %" if share == 0 else f"{max(100 * share, 0.1):.1f} %"


def stretch(time: Any) -> str:
    """Return the number of rows and the span of time, in words."""
    rows = count_of(time.shape[-1], "row")
    if time.ndim > 1:
        return f"{rows}, {count_of(int(np.prod(time.shape[:-1])), 'run')}"
    if not is_known(time):
        return f"{rows}, traced"
    stamps = np.asarray(time)
    rate = f" ({1 / np.median(np.diff(stamps)):.4g} Hz)" if len(stamps) > 1 else ""
    return f"{rows}, {stamps[0]:.10g} to {stamps[-1]:.10g} s{rate}"


def count_of(count: int, word: str) -> str:
    """Return a count with its noun: `1 row`, `2 rows`."""
    return (
        f"{count} {word}"
        if count == 1
        else f"{count} {word.removesuffix('y') + 'ies' if word.endswith('y') else word + 's'}"
    )
