"""Options of programs whose sweeps can be stored: the folder, and the workers that compute them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from jaxveh._core.errors import InputError
from jaxveh.io import kit

if TYPE_CHECKING:
    from jaxveh.sweeps import Stores

Store = Annotated[
    Path | None,
    typer.Option(
        "--store",
        metavar="FOLDER",
        help="Write the sweeps into Zarr stores in this folder, chunk by chunk. The same call continues an interrupted run; "
        "stored chunks are not computed again.",
    ),
]

Processes = Annotated[int | None, typer.Option("--processes", help="Number of processes on this machine.", min=1)]

Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Compute on the workers of a Dask scheduler (tcp://host:8786). They must see the store under the same path, and "
        "have the same versions and XLA_FLAGS.",
    ),
]


def check_workers(processes: int | None, scheduler: str | None) -> None:
    """Raise `InputError` if both kinds of workers are requested."""
    if processes is not None and scheduler is not None:
        raise InputError("--processes and --scheduler: give one of them, not both.")


def stores_of(folder: Path | None, processes: int | None, scheduler: str | None) -> Stores | None:
    """Return the stores that the options request; None if they request none.

    Raises `InputError`, before any work: for workers without a store, for both kinds of workers, for a folder that is a file,
    and if the extra `sweep` is missing.
    """
    asked = [name for name, value in (("--processes", processes), ("--scheduler", scheduler)) if value is not None]
    if folder is None:
        if asked:
            raise InputError(f"{asked[0]}: applies to stored sweeps; name a folder with --store, or leave it out.")
        return None
    check_workers(processes, scheduler)
    # The nearest existing parent, in which the folder will be created.
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        raise InputError(
            f"--store {folder}: {'is' if there == folder.absolute() else f'{there} is'} a file; name a folder."
        )
    libraries = (
        "zarr",
        "filelock",
        *(("cloudpickle", "loky") if processes else ()),
        *(("distributed",) if scheduler else ()),
    )
    for library in libraries:
        kit.require(library, "storing a sweep", "sweep")
    from jaxveh.sweeps import Stores

    return Stores(folder, processes=processes, client=scheduler)
