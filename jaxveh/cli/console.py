"""Output for the terminal: tables on stdout, progress and messages on stderr."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from jaxveh._core.progress import Progress as Report


def messages() -> Console:
    """Return a console on stderr; it is made anew each time, so that a redirected stream is used."""
    return Console(stderr=True, emoji=False, highlight=False)


WIDE = 160
"""Width, in characters, of a file or a pipe: wide enough to keep the numbers of a table row on one line."""


def results() -> Console:
    """Return a console on stdout."""
    console = Console(emoji=False, highlight=False)
    return console if console.is_terminal else Console(emoji=False, highlight=False, width=WIDE)


@contextlib.contextmanager
def progress(title: str) -> Iterator[Report]:
    """Yield a callable `(done, total, stage)` that moves a bar on a terminal, and elsewhere prints each new stage as a line."""
    console = messages()
    if not console.is_terminal:
        yield _lines(console, title)
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.fields[title]}"),
        BarColumn(bar_width=24),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=1.0, title=title)
        yield lambda done, total, stage: bar.update(task, completed=done, total=total, description=stage)


def _lines(console: Console, title: str) -> Report:
    seen: list[str] = []

    def report(done: float, total: float, stage: str) -> None:
        # Stages that differ only in a count would fill a log file.
        kind = re.sub(r"[\d.]+", "#", stage)
        if stage and kind not in seen:
            seen.append(kind)
            console.print(f"{title}: {stage}", markup=False, soft_wrap=True)

    return report


def printable(text: str) -> str:
    """Return the text with a question mark for each byte that could not be decoded, which a terminal would refuse."""
    return text.encode("utf-8", "replace").decode("utf-8")


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], note: str = "", left: int = 1) -> None:
    """Print a table: the first `left` columns aligned to the left, the others to the right.

    A cell that is not a string is formatted by `number`.
    """
    shown = Table(box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    for i, column in enumerate(columns):
        shown.add_column(Text(column), justify="left" if i < left else "right")
    for row in rows:
        shown.add_row(*[Text(printable(cell) if isinstance(cell, str) else number(cell)) for cell in row])
    console = results()
    console.print(Text(title, "bold"))
    console.print(shown)
    if note:
        console.print(Text(note, "dim"))
    console.print()


def number(value: object, digits: int = 4) -> str:
    """Format a number with `digits` significant digits; a dash for None and NaN."""
    if value is None:
        return "-"
    value = float(value)  # type: ignore[arg-type]
    if value != value:
        return "-"
    return f"{value:.{digits}g}" if value == 0 or 1e-3 <= abs(value) < 1e5 else f"{value:.{digits - 1}e}"


def spread(mean: object, std: object, between: str = " ") -> str:
    """Format `mean ± std` with the number of decimals that the standard deviation justifies."""
    mean, std = float(mean), float(std)  # type: ignore[arg-type]
    if not 0 < std < float("inf"):
        return number(mean)
    if std < 1e-4 * abs(mean):
        # All particles have collapsed into one: decimals that fit the standard deviation would fill the line.
        return f"{number(mean)}{between}± {std:.0e}"
    decimals = max(0, 1 - int(f"{std:e}".partition("e")[2]))
    return f"{mean:.{decimals}f}{between}± {std:.{decimals}f}"
