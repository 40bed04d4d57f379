"""`jaxveh cache`: the compiled programs that earlier starts have kept."""

from __future__ import annotations

import shutil
from pathlib import Path

from jaxveh.cli import kept_programs
from jaxveh.cli.console import results

MEGABYTE = 1e6


def show() -> None:
    """Print the folders of the compiled programs, with number and size.

    A later start reads them instead of compiling. In the environment, JAXVEH_CACHE=off keeps none, JAXVEH_CACHE=FOLDER keeps them
    in that folder; if JAX_COMPILATION_CACHE_DIR is set, jax keeps them there by its own rules.
    """
    for one in _folders():
        results().print(f"{one}: {_said(one)}", markup=False, soft_wrap=True)


def clear() -> None:
    """Delete the compiled programs of all versions; the next start compiles again."""
    for one in _folders():
        results().print(f"deleted {one}: {_said(one)}", markup=False, soft_wrap=True)
        shutil.rmtree(one)


def _folders() -> list[Path]:
    above = kept_programs.root()
    found = [] if above is None else kept_programs.folders(above)
    if above is None:
        results().print(f"{kept_programs.VARIABLE} is {kept_programs.OFF}: nothing is kept")
    elif not found:
        results().print(f"{above}: nothing is kept yet", markup=False, soft_wrap=True)
    return found


def _said(folder: Path) -> str:
    files = [file for file in folder.iterdir() if file.is_file()]
    programs = sum(file.name.endswith(kept_programs.PROGRAM) for file in files)
    return f"{programs} programs, {sum(file.stat().st_size for file in files) / MEGABYTE:.0f} MB"
