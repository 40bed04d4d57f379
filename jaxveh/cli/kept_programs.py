"""Programs that were compiled once, kept for the next start: where that is, how large it gets, and what is forgotten."""

from __future__ import annotations

import os
import shutil
import sys
import time
from pathlib import Path

VARIABLE = "JAXVEH_CACHE"
"""Of the environment: `off`, or another folder."""

JAX_VARIABLE = "JAX_COMPILATION_CACHE_DIR"
"""Of the environment: who has set it has a cache for jax, which stays."""

OFF = "off"

CANNOT_READ = "Error reading persistent compilation cache entry"
"""How jax begins to say that a kept program is damaged (a start was killed while it wrote); it would say so at every start."""

CANNOT_WRITE = ("Error writing persistent compilation cache entry", "FileNotFoundError")
"""How it begins to say that it misses the file in which another program's last use should stand (a start was killed between both
files), and what then comes; it would say so for every program of every start, and keep none."""

DAMAGED = "damaged"
"""A file in a folder of programs that says so: the next start begins a new one."""

PROGRAM = "-cache"
"""How jax ends the name of a program's file."""

MOST = 1_000_000_000
"""Bytes that the programs of one version and processor may take; those not used for longest go first."""

FORGOTTEN_AFTER = 90 * 86400.0
"""Seconds after which the folder of another version or processor is dropped."""

WORTH_KEEPING = 0.0
"""Seconds of compiling from which on a program is kept: all are, for reading one back takes a few milliseconds."""


def root() -> Path | None:
    """The folder with a folder for each version and processor; None where `JAXVEH_CACHE` is `off`."""
    told = os.environ.get(VARIABLE, "")
    if told.lower() == OFF:
        return None
    if told:
        return Path(told).expanduser()
    from platformdirs import user_cache_path

    return user_cache_path("jaxveh", appauthor=False) / "programs"


def folder() -> Path | None:
    """Where this version keeps what it compiles on this processor.

    Code that was compiled for another processor's vectors ends the process, or is refused (jax, issue 38445).
    """
    above = root()
    if above is None:
        return None
    from importlib.metadata import version

    from jaxveh._core.processor import processor
    from jaxveh._core.version import VERSION

    return above / f"jaxveh-{VERSION}-jaxlib-{version('jaxlib')}-{processor()}"


def keep_programs() -> None:
    """Let jax keep what it compiles in `folder()`, unless somebody has told jax where to keep it, or `JAXVEH_CACHE` is `off`."""
    if JAX_VARIABLE in os.environ:
        return
    try:
        place = folder()
        if place is None:
            return
        if (place / DAMAGED).exists():
            shutil.rmtree(place)
        if not place.exists():
            place.mkdir(parents=True, mode=0o700, exist_ok=True)
            drop_old(place.parent)
        os.utime(place)
    except OSError as error:
        print(
            f"note: compiled programs are not kept ({error}); every start compiles anew. Set {VARIABLE} to a folder that can be "
            f"written, or to {OFF}.",
            file=sys.stderr,
        )
        return
    import jax

    jax.config.update("jax_compilation_cache_dir", str(place))
    jax.config.update("jax_compilation_cache_max_size", MOST)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", WORTH_KEEPING)


def folders(above: Path) -> list[Path]:
    """Those of all versions and processors; whatever else lies beside them is not ours."""
    return sorted(one for one in above.glob("jaxveh-*-jaxlib-*") if one.is_dir())


def is_of_damage(message: str) -> bool:
    """Whether a warning is jax's that it cannot read a kept program, or none beside it; then the next start forgets them all."""
    begin, reason = CANNOT_WRITE
    damaged = message.startswith(CANNOT_READ) or (message.startswith(begin) and reason in message)
    place = folder() if JAX_VARIABLE not in os.environ and damaged else None
    if place is None or not place.is_dir():
        return False
    (place / DAMAGED).touch()
    return True


def drop_old(above: Path) -> None:
    """Remove folders of versions and processors that have not been used for long."""
    for one in folders(above):
        if time.time() - one.stat().st_mtime > FORGOTTEN_AFTER:
            shutil.rmtree(one, ignore_errors=True)
