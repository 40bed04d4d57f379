"""Files: clear errors when reading, all or nothing when writing. Only this module opens files for writing."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import socket
import tempfile
import threading
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from jaxveh._core.errors import InputError, check_flags, did_you_mean, path_of


def check_readable(path: Path) -> None:
    """Raise `InputError` unless `path` is an existing file that can be opened, is not empty, and is what its name says: not the
    pointer of a file that was not fetched, nor a web page that was saved in its place."""
    try:
        with path.open("rb") as file:
            begin = file.read(64)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}). Check the name and the folder.") from error
    if not begin:
        raise InputError(f"{path}: the file is empty.")
    if begin.startswith(b"version https://git-lfs"):
        raise InputError(f"{path}: is a pointer of Git LFS, not the file itself: fetch that with `git lfs pull`.")
    if begin.lstrip().lower().startswith((b"<!doctype html", b"<html")):
        raise InputError(f"{path}: is a web page: download the file itself (on GitHub: Raw).")


def check_suffix(path: Path, allowed: Iterable[str], kind: str = "file") -> str:
    """Return the suffix in lower case; raise `InputError` unless it is one of `allowed`."""
    suffix = path.suffix.lower()
    if suffix not in tuple(allowed):
        allowed = tuple(allowed)
        raise InputError(
            f"{path}: suffix {path.suffix!r}; a {kind} must end in one of {', '.join(allowed)}.{did_you_mean([suffix], allowed)}"
        )
    return suffix


@contextlib.contextmanager
def replacing_file(path: str | os.PathLike, overwrite: bool = False) -> Iterator[Path]:
    """Yield a path to write to; that file replaces `path` in one step when the block ends without an error.

    A failure, an interrupt included, leaves the previous file: never half a file, and no other file beside it. Leftovers of a
    killed program beside `path` are deleted at the next writing of `path`. If `path` is a link, its target is replaced. An
    interrupt that a library has swallowed is raised at the end.

    **Raises** `InputError` if `path` exists and `overwrite` is False, or the system refuses to write.
    """
    check_flags(overwrite=overwrite)
    path = path_of(path)
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file.")
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; pass overwrite=True, or name another file.")
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    with _refusals_in_words(path), _beside(target) as part:
        with _interrupts_heard():
            yield part
        _settle(part)
        if target.exists():
            shutil.copymode(target, part)
        os.replace(part, target)


@contextlib.contextmanager
def making_folder(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a new folder to write into; it becomes `path`, with its contents, when the block ends without an error.

    **Raises** `InputError` if `path` exists, or the system refuses to write.
    """
    path = path_of(path)
    if path.exists():
        raise InputError(f"{path}: exists already; name a new folder.")
    with _refusals_in_words(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with _beside(path) as part:
            part.mkdir()
            with _interrupts_heard():
                yield part
            for file in part.iterdir():
                _settle(file)
            os.rename(part, path)


def write_text(text: str, path: str | os.PathLike, overwrite: bool = False) -> None:
    """Write a text file in UTF-8, completely or not at all."""
    check_flags(overwrite=overwrite)
    with replacing_file(path, overwrite) as part:
        part.write_text(text, encoding="utf-8", newline="\n")


@contextlib.contextmanager
def _refusals_in_words(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}). Check folder and space.") from error


@contextlib.contextmanager
def _beside(path: Path) -> Iterator[Path]:
    """Yield a path of the same name in a hidden folder beside `path`, on the same disk; the folder is deleted in the end.

    It is a folder rather than a file because writers may add further files, and because the result then has the usual
    permissions. Its name contains the target, the computer and the process, so that a leftover of an ended process is recognised.
    """
    mark = f".writing-{zlib.crc32(os.fsencode(path.name)):08x}-{_host()}-"
    for leftover in path.parent.glob(f"{mark}*"):
        if not _lives(leftover.name.removeprefix(mark)):
            shutil.rmtree(leftover, ignore_errors=True)
    folder = Path(tempfile.mkdtemp(prefix=f"{mark}{os.getpid()}-", dir=path.parent))
    try:
        yield folder / path.name
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _host() -> str:
    """Return this computer's name in letters and digits; several computers may share a folder."""
    return re.sub(r"\W", "", socket.gethostname())[:32]


def _lives(rest: str) -> bool:
    """Whether the process whose number begins the rest of a hidden folder's name still runs; Windows has no safe way to ask."""
    number = rest.partition("-")[0]
    if os.name == "nt" or not number.isdigit():
        return True
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


@contextlib.contextmanager
def _interrupts_heard() -> Iterator[None]:
    """Raise `KeyboardInterrupt` at the end of a block that lost an interrupt, as pandas' CSV writer (written in C) does."""
    usual = signal.getsignal(signal.SIGINT)
    if usual is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield  # another handler receives the interrupts
        return
    heard = []

    def hear(number, frame):
        heard.append(number)
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGINT, hear)
    try:
        yield
        if heard:
            raise KeyboardInterrupt
    except Exception as error:
        if heard:
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, usual)


def _settle(path: Path) -> None:
    """Have the system write a file's content to the disk before its name points to it."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())
