"""Data that is not part of the project: real logs and reference values, in the folder that JAXVEH_SHARED names."""

import os
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]


def _folder() -> Path:
    return Path(os.environ.get("JAXVEH_SHARED", _ROOT / ".." / "shared")) / "data"


def shared_names(folder: str, pattern: str) -> list[str]:
    """Names of the shared files in a folder, for `parametrize`; none where the data is absent."""
    return sorted(path.name for path in (_folder() / folder).glob(pattern))


def shared(name: str) -> Path:
    """The path of a shared data file; skips the test where it is absent, and says where it was looked for."""
    folder = _folder()
    path = folder / name
    if not path.exists():
        pytest.skip(f"{name} is not in {folder}: shared data is not part of the project (set JAXVEH_SHARED)")
    return path
