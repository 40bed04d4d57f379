"""A sweep into a disk of its own, which is full at first: `python full_disk.py FOLDER`, where a small disk is mounted."""

import shutil
import sys
from pathlib import Path

import jax
import stored_study

from jaxveh import InputError

jax.config.update("jax_enable_x64", True)
folder = Path(sys.argv[1])
ballast = folder / "ballast"
stored_study.sweep(folder / "whole.zarr")
for leave in (0, 8, 24, 64):
    path = folder / "s.zarr"
    shutil.rmtree(path, ignore_errors=True)
    stored_study.sweep(path, part=(0, 3))
    free = shutil.disk_usage(folder).free
    ballast.write_bytes(bytes(max(0, free - 4096 * leave)))
    try:
        stored_study.sweep(path, **({"processes": 1} if leave == 24 else {}))
    except (OSError, InputError) as error:
        if "No space left" not in str(error):
            raise
        print("full")
    else:
        print("fits")
    ballast.unlink()
    stored_study.sweep(path)
    whole = {
        p.relative_to(folder / "whole.zarr"): p.read_bytes() for p in (folder / "whole.zarr").rglob("*") if p.is_file()
    }
    again = {p.relative_to(path): p.read_bytes() for p in path.rglob("*") if p.is_file() and p.suffix != ".partial"}
    assert whole == again
