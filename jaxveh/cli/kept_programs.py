"""The cache of compiled programs for later starts: its folder, its largest size, and what is deleted."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import time
from pathlib import Path

VARIABLE = "JAXVEH_CACHE"
"""The environment variable of the cache: `off`, or another folder."""

JAX_VARIABLE = "JAX_COMPILATION_CACHE_DIR"
"""The environment variable of jax's own cache: if it is set, that cache is used unchanged."""

OFF = "off"

CANNOT_READ = "Error reading persistent compilation cache entry"
"""How jax's warning of a damaged program begins (a start was killed while writing it); jax would repeat it at every start."""

CANNOT_WRITE = ("Error writing persistent compilation cache entry", "FileNotFoundError")
"""The beginning of jax's warning that the file with another program's last use is missing, and its reason.

A start was killed between writing the two files. jax would repeat the warning for every program of every start, and keep none.
"""

DAMAGED = "damaged"
"""A file that marks a folder of programs as damaged: the next start replaces the folder by a new one."""

PROGRAM = "-cache"
"""The ending that jax gives to the name of a program's file."""

MOST = 1_000_000_000
"""Largest size of the programs of one version and processor, bytes; those unused for longest are deleted first."""

MOST_PROGRAMS, LEFT = 1000, 500
"""If a start finds more programs than the first number, it deletes those unused for longest until the second is left. Before jax
writes a program, it reads when each kept one was last used: 37 ms for 1000 of them, 0.7 s for 30,000 (a slow machine), which are
fewer than `MOST` bytes. The first start of `estimate` writes some fifty."""

LAST_USE, LOCK = "-atime", ".lockfile"
"""What jax puts in the place of `PROGRAM` in the name of the file with a program's last use, and the file by which it keeps
others away."""

FORGOTTEN_AFTER = 90 * 86400.0
"""Time after which the unused folder of another version or processor is deleted, s."""

WORTH_KEEPING = 0.0
"""Least compile time of a program that is kept, s: all are kept, because reading one back takes a few milliseconds."""


def root() -> Path | None:
    """Return the folder that has a folder for each version and processor; None if `JAXVEH_CACHE` is `off`."""
    told = os.environ.get(VARIABLE, "")
    if told.lower() == OFF:
        return None
    if told:
        return Path(told).expanduser()
    from platformdirs import user_cache_path

    return user_cache_path("jaxveh", appauthor=False) / "programs"


def folder() -> Path | None:
    """Return the folder for the programs that this version compiles on this processor.

    Code compiled for the vectors of another processor ends the process, or is refused (jax, issue 38445).
    """
    above = root()
    if above is None:
        return None
    from importlib.metadata import version

    from jaxveh._core.processor import processor
    from jaxveh._core.version import VERSION

    return above / f"jaxveh-{VERSION}-jaxlib-{version('jaxlib')}-{processor()}"


def keep_programs() -> None:
    """Let jax keep compiled programs in `folder()`, unless jax has a cache of its own, or `JAXVEH_CACHE` is `off`."""
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
        drop_unused(place)
    except OSError as error:
        print(
            f"note: compiled programs are not kept ({error}); every start compiles again. Set {VARIABLE} to a folder that can be "
            f"written, or to {OFF}.",
            file=sys.stderr,
        )
        return
    import jax

    jax.config.update("jax_compilation_cache_dir", str(place))
    jax.config.update("jax_compilation_cache_max_size", MOST)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", WORTH_KEEPING)


def folders(above: Path) -> list[Path]:
    """Return the folders of all versions and processors; anything else beside them does not belong to jaxveh."""
    return sorted(one for one in above.glob("jaxveh-*-jaxlib-*") if one.is_dir())


def is_of_damage(message: str) -> bool:
    """Return whether a warning of jax means that kept programs are damaged; if so, mark them for deletion at the next start."""
    begin, reason = CANNOT_WRITE
    damaged = message.startswith(CANNOT_READ) or (message.startswith(begin) and reason in message)
    place = folder() if JAX_VARIABLE not in os.environ and damaged else None
    if place is None or not place.is_dir():
        return False
    (place / DAMAGED).touch()
    return True


def drop_old(above: Path) -> None:
    """Delete folders of versions and processors that have not been used for `FORGOTTEN_AFTER`."""
    for one in folders(above):
        if time.time() - one.stat().st_mtime > FORGOTTEN_AFTER:
            shutil.rmtree(one, ignore_errors=True)


def drop_unused(place: Path) -> None:
    """Delete the programs of a folder that have been unused for longest, if they are too many; see `MOST_PROGRAMS`."""
    if sum(1 for _ in place.glob(f"*{PROGRAM}")) <= MOST_PROGRAMS:
        return
    import filelock

    # While another start has the lock, it is left to the next one.
    with contextlib.suppress(filelock.Timeout), filelock.FileLock(place / LOCK, timeout=1.0):
        programs = sorted(place.glob(f"*{PROGRAM}"), key=_last_use, reverse=True)
        for program in programs[LEFT:]:
            # A file that another program holds stays.
            with contextlib.suppress(OSError):
                program.unlink(missing_ok=True)
                _of_last_use(program).unlink(missing_ok=True)


def _of_last_use(program: Path) -> Path:
    return program.with_name(program.name.removesuffix(PROGRAM) + LAST_USE)


def _last_use(program: Path) -> int:
    """When a program was last used (ns); 0 if nobody wrote it."""
    try:
        return int.from_bytes(_of_last_use(program).read_bytes(), "little")
    except OSError:
        return 0
