"""The files that programs write: `-o FILE` the output, `--out DIR` the figures, `--json FILE` every number shown."""

from __future__ import annotations

import json
import math
import os
import platform
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import jaxveh
from jaxveh import InputError, io


def check_product(
    path: Path | None,
    suffixes: tuple[str, ...],
    force: bool,
    sources: tuple[Path | None, ...] = (),
    option: str = "-o",
) -> None:
    """Raise `InputError`, before any work, if the file of an `option` could not be written in the end.

    Reasons are its suffix, its folder, an existing file without `force`, and a file that is one of the inputs (`sources`).
    """
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{option} {path}: suffix {path.suffix!r}; it must end in one of {', '.join(suffixes)}.")
    for source in sources:
        if source is not None and source.exists() and path.exists() and path.samefile(source):
            raise InputError(f"{option} {path}: is an input of this program; name another file.")
    if path.is_dir():
        raise InputError(f"{option} {path}: is a folder; name a file.")
    if path.exists() and not force:
        raise InputError(f"{option} {path}: exists already; name another file, or pass --force to replace it.")
    _check_folder(path, option)


def check_products(folder: Path, files: list[Path], force: bool, sources: tuple[Path | None, ...] = ()) -> None:
    """Check several files in a folder like `check_product`; the folder is created if it does not exist."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"-o {folder}: is a file; several logs need a folder.")
    names = [file.name for file in files]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"-o {folder}: two logs would be written to {twice[0]}; estimate them one by one.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"-o {folder}: cannot be made ({error.strerror}).") from error
    for file in files:
        check_product(file, io.SUFFIXES, force, sources)


def check_folders(out: Path | None, logs: list[Path]) -> None:
    """Raise `InputError`, before any work, if the figures of two logs would go into one folder of `--out`."""
    stems = [log.stem for log in logs]
    if out is not None and (twice := [stem for stem in stems if stems.count(stem) > 1]):
        raise InputError(f"--out {out}: the figures of two logs would be in {out / twice[0]}; rename one of the logs.")


def check_report(out: Path | None, numbers: Path | None) -> None:
    """Raise `InputError`, before any work, if `--out` or `--json` could not be written, or matplotlib is missing."""
    if out is not None:
        if out.exists() and not out.is_dir():
            raise InputError(f"--out {out}: is a file; name a folder.")
        io.kit.require("matplotlib", "drawing figures", "plot")
    if numbers is not None:
        # The required suffix prevents a typing error from replacing a log or a car file.
        if numbers.suffix.lower() != ".json":
            raise InputError(f"--json {numbers}: suffix {numbers.suffix!r}; it must end in .json.")
        if numbers.is_dir():
            raise InputError(f"--json {numbers}: is a folder; name a file.")
        _check_folder(numbers, "--json")


def _check_folder(path: Path, option: str) -> None:
    folder = path.absolute().parent
    if not folder.is_dir():
        raise InputError(f"{option} {path}: there is no folder {folder}; create it first.")
    if not os.access(folder, os.W_OK):
        raise InputError(f"{option} {path}: the folder {folder} cannot be written to.")


def make_folder(out: Path) -> None:
    """Create the folder of the figures if it does not exist."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be made ({error.strerror}).") from error


def write_numbers(
    path: Path | None, numbers: Mapping[str, Any], configuration: Mapping[str, Any], seed: int | None
) -> None:
    """Write numbers and the manifest as JSON, replacing an existing file; numbers that are not finite become null."""
    if path is None:
        return
    content = {"manifest": manifest(configuration, seed), **numbers}
    text = json.dumps(plain(content), indent=2, allow_nan=False, ensure_ascii=False)
    io.write_text(text + "\n", path, overwrite=True)


def manifest(configuration: Mapping[str, Any], seed: int | None) -> dict[str, Any]:
    """Return the origin of the numbers: versions, platform, seed, configuration, command line."""
    import jax

    return {
        "versions": {
            "jaxveh": jaxveh.__version__,
            "jax": jax.__version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
        "platform": {
            "system": platform.platform(),
            "machine": platform.machine(),
            "device": str(jax.devices()[0]),
            "cpus": os.cpu_count(),
            "float": "float64" if jax.config.jax_enable_x64 else "float32",
            "xla_flags": os.environ.get("XLA_FLAGS", ""),
        },
        "seed": seed,
        "configuration": configuration,
        "command": ["jaxveh", *sys.argv[1:]],
    }


def plain(value: Any) -> Any:
    """Convert nested containers of arrays to Python numbers, strings, lists and dicts; NaN and infinity become None."""
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, bool | str) or value is None:
        return value
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    array = np.asarray(value)
    if array.ndim:
        return [plain(item) for item in array]
    if array.dtype.kind in "iub":
        return array.item()
    number = float(array)
    return number if math.isfinite(number) else None
