"""Which kind of processor this is: what is compiled for one does not run on another, and does not round as there."""

from __future__ import annotations

import hashlib
import os
import platform
import sys
from pathlib import Path

SAID = ("vendor_id", "model name", "flags", "Features", "CPU implementer", "CPU part")
"""Lines of Linux's description that tell kinds apart; others tell how fast it is at the moment."""


def processor() -> str:
    """The machine's name and a hash of the processor's model and features, `x86_64-9dbd76df0de6`."""
    said = [sys.platform, platform.machine(), platform.processor(), os.environ.get("PROCESSOR_IDENTIFIER", "")]
    described = Path("/proc/cpuinfo")
    if described.exists():
        first = described.read_text(errors="replace").split("\n\n")[0].splitlines()
        said += [line for line in first if line.startswith(SAID)]
    hashed = hashlib.sha256("\n".join(said).encode()).hexdigest()
    return f"{platform.machine()}-{hashed[:12]}"
