"""Build and load of the C++ limit, with one ``g++`` command and a cache folder."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from . import coefficients

__all__ = ["FLAGS", "LimitUnavailable", "build", "library", "unavailable"]

SOURCES = Path(__file__).parent

# Signed zeros and infinities never matter here, so x + 0 may be dropped; reassociation (-ffast-math) must stay off, see
# vector.hpp. The straight-line vectoriser is off because it packs the scalar algebra of the unscented filter's single
# run into vectors, whose shuffles lengthen its chain of dependent operations by a tenth.
FLAGS = (
    "-std=c++20",
    "-O3",
    "-march=native",
    "-ffp-contract=fast",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-ffinite-math-only",
    "-fno-tree-slp-vectorize",
    "-Wall",
    "-Wno-maybe-uninitialized",  # GCC 12 warns about its own intrinsics
    "-Wno-psabi",
    "-fPIC",
    "-shared",
)


class LimitUnavailable(RuntimeError):
    """The limit cannot be built here; the message says why and what to do."""


def unavailable() -> str | None:
    """Return why the limit cannot be built on this machine; None if it can."""
    if shutil.which("g++") is None:
        return "g++ is not on the PATH; install it (Debian: apt install g++) to compare with the C++ limit"
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return f"the C++ limit is written for x86-64 vector units, not for {platform.machine()}"
    return None


def build(extra_flags: tuple[str, ...] = ()) -> Path:
    """Return the path of the shared library, compiled unless it is in the cache already.

    The cache key covers the sources, the flags, the compiler and the processor (``-march=native`` code may not run
    elsewhere). Set ``XDG_CACHE_HOME`` to move the cache.

    Raises
    ------
    LimitUnavailable
        Without g++, on another processor family, or when the compiler fails.
    """
    reason = unavailable()
    if reason:
        raise LimitUnavailable(reason)
    header = coefficients.header()
    flags = [*FLAGS, *extra_flags]
    target = _cache() / f"limit-{_key(header, flags)}.so"
    if target.exists():
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        Path(folder, "coefficients.hpp").write_text(header)
        output = Path(folder, target.name)
        sources = [
            str(SOURCES / name) for name in ("particle_filters.cpp", "unscented.cpp", "mf_tyre.cpp", "seven_dof.cpp")
        ]
        command = ["g++", *flags, f"-I{folder}", f"-I{SOURCES}", *sources, "-o", str(output)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise LimitUnavailable(f"g++ failed on the C++ limit (GCC 12 or newer is needed):\n{done.stderr[-2000:]}")
        os.replace(output, target)  # in one step: another process may be building the same file
    return target


@functools.cache
def library(extra_flags: tuple[str, ...] = ()) -> ctypes.CDLL:
    """Return the loaded library; it is built when it is first used."""
    return ctypes.CDLL(str(build(extra_flags)))


def _cache() -> Path:
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "jaxveh-benchmarks"


def _key(header: str, flags: list[str]) -> str:
    digest = hashlib.sha256(header.encode())
    for source in sorted(SOURCES.glob("*.[ch]pp")):
        digest.update(source.read_bytes())
    digest.update(" ".join(flags).encode())
    digest.update(subprocess.run(["g++", "--version"], capture_output=True, check=True).stdout)
    digest.update(_processor().encode())
    return digest.hexdigest()[:16]


def _processor() -> str:
    if sys.platform == "linux":
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return "".join(line for line in lines[:64] if line.startswith(("model name", "flags")))
    return platform.processor()
