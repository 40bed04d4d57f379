"""`jaxveh schema`: the files that programs read, as commented examples."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from jaxveh.io import CANONICAL, kit


class File(StrEnum):
    """Which file to explain."""

    car = "car"
    channels = "channels"


def schema(file: Annotated[File, typer.Argument(help="The car, or the channel map.")] = File.car) -> None:
    """Print a commented example of the file that describes a car, or of a channel map.

    Both examples can be read as they are: [bold]jaxveh schema car > car.toml[/] is a start.
    """
    if file is File.car:
        typer.echo(kit.CAR_SCHEMA, nl=False)
        return
    typer.echo(kit.CHANNEL_MAP_SCHEMA)
    typer.echo("# Channels that jaxveh knows by name, and their units:")
    for name, channel in CANONICAL.items():
        typer.echo(f"#   {name:<26}{channel.unit:<9}{channel.meaning}")
