"""The kind of the processor: a program compiled for one kind may not run on another, or rounds differently."""

from __future__ import annotations

import hashlib
import os
import platform
import sys
from pathlib import Path

SAID = ("vendor_id", "model name", "flags", "Features", "CPU implementer", "CPU part")
"""Lines of Linux's description that identify the kind; other lines change, such as the current speed."""


def processor() -> str:
    """Return the machine's name and a hash of the processor's model and features, such as `x86_64-9dbd76df0de6`."""
    said = [sys.platform, platform.machine(), platform.processor(), os.environ.get("PROCESSOR_IDENTIFIER", "")]
    described = Path("/proc/cpuinfo")
    if described.exists():
        first = described.read_text(errors="replace").split("\n\n")[0].splitlines()
        said += [line for line in first if line.startswith(SAID)]
    hashed = hashlib.sha256("\n".join(said).encode()).hexdigest()
    return f"{platform.machine()}-{hashed[:12]}"
