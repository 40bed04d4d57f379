"""Files: clear errors on reading, all or nothing on writing."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from jaxveh._core.errors import InputError


def check_readable(path: Path) -> None:
    """Raise `InputError` unless `path` is an existing file that can be opened and is not empty."""
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}). Check the name and the folder.") from error
    if empty:
        raise InputError(f"{path}: the file is empty.")


def check_suffix(path: Path, allowed: Iterable[str], kind: str = "file") -> str:
    """The suffix in small letters; raises `InputError` unless it is one of `allowed`."""
    suffix = path.suffix.lower()
    if suffix not in tuple(allowed):
        raise InputError(f"{path}: suffix {path.suffix!r}; a {kind} must end in one of {', '.join(allowed)}.")
    return suffix


@contextlib.contextmanager
def replacing(path: str | os.PathLike, overwrite: bool = False) -> Iterator[Path]:
    """Yield a path to write to; it takes the place of `path` in one step when the block ends without an error.

    A failure, an interrupt included, leaves what was there before: never half a file.

    **Raises** `InputError` where `path` exists and `overwrite` is False, or the system refuses to write.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file.")
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; pass overwrite=True, or name another file.")
    try:
        # A folder rather than a file: writers may add files of their own, and the result has the usual permissions.
        with tempfile.TemporaryDirectory(prefix=".writing-", dir=path.parent) as folder:
            part = Path(folder) / path.name
            yield part
            os.replace(part, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}). Check folder and space.") from error


def write_text(text: str, path: str | os.PathLike, overwrite: bool = False) -> None:
    """Write a text file in UTF-8, all or nothing."""
    with replacing(path, overwrite) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
