"""One core, one thread, known flags: settings before NumPy and JAX are imported, and the description of the machine."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
import sys
from pathlib import Path

__all__ = ["describe", "prepare"]

VECTOR_WIDTH_FLAG = "--xla_cpu_prefer_vector_width=512"
# Compiles in less than half of the time, programs that run slower: for runs without measurements.
QUICKLY_COMPILED = " ".join(
    (
        "--xla_cpu_use_fusion_emitters=false",
        "--xla_llvm_disable_expensive_passes=true",
        "--xla_backend_optimization_level=0",
        "--xla_cpu_parallel_codegen_split_count=1",
    )
)
PACKAGES = (
    "jaxveh",
    "jax",
    "jaxlib",
    "numpy",
    "scipy",
    "equinox",
    "diffrax",
    "dynamax",
    "smcx",
    "cuthbert",
    "filterpy",
    "particles",
)


def prepare(core: int | None, smoke: bool = False) -> int | None:
    """Pin this process to one core (by default the last it may use) and set flags; return the core, None if impossible.

    A `smoke` run compiles quickly if this version of XLA is known to have the flags: an unknown flag ends the process.

    It must run before NumPy or JAX are imported, because they read thread counts and flags only once.
    """
    for module in ("numpy", "jax"):
        if module in sys.modules:
            raise RuntimeError(f"{module} is imported already; start the benchmarks with python -m benchmarks")
    flags = os.environ.get("XLA_FLAGS", "")
    if "xla_cpu_prefer_vector_width" not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {VECTOR_WIDTH_FLAG}".strip()
    if smoke and importlib.metadata.version("jaxlib").startswith("0.10."):
        os.environ["XLA_FLAGS"] += f" {QUICKLY_COMPILED}"
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    if not hasattr(os, "sched_setaffinity"):
        return None
    allowed = sorted(os.sched_getaffinity(0))
    if core is None:
        core = allowed[-1]
    if core not in allowed:
        raise ValueError(f"core is {core}; this process may use {allowed}")
    os.sched_setaffinity(0, {core})
    return core


def describe(core: int | None) -> dict[str, object]:
    """Return versions, processor and settings for the report."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    if "jaxveh" not in versions:  # run from a checkout
        import jaxveh

        versions["jaxveh"] = jaxveh.__version__
    return {
        "processor": _processor(),
        "core": core,
        "clock": "CPU time of the process" if core is not None else "wall",
        "python": platform.python_version(),
        "versions": versions,
        "xla_flags": os.environ.get("XLA_FLAGS", ""),
        "compiler": _compiler(),
        "load": list(os.getloadavg()) if hasattr(os, "getloadavg") else None,
    }


def _processor() -> str:
    if sys.platform == "linux":
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                widest = "AVX-512" if "avx512f" in Path("/proc/cpuinfo").read_text() else "no AVX-512"
                return f"{line.split(':', 1)[1].strip()} ({widest})"
    return platform.processor() or platform.machine()


def _compiler() -> str | None:
    try:
        done = subprocess.run(["g++", "--version"], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.splitlines()[0]
