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
    study = "study"


def schema(
    file: Annotated[File, typer.Argument(help="The car, the channel map, or the study of a sweep.")] = File.car,
) -> None:
    """Print a commented example of the file that describes a car, of a channel map, or of a study (jaxveh sweep).

    All examples can be read as they are: [bold]jaxveh schema car > car.toml[/] is a start.
    """
    if file is File.car:
        typer.echo(kit.CAR_SCHEMA, nl=False)
        return
    if file is File.study:
        from jaxveh.studies import STUDY_SCHEMA

        typer.echo(STUDY_SCHEMA, nl=False)
        return
    typer.echo(kit.CHANNEL_MAP_SCHEMA)
    typer.echo("# Channels that jaxveh knows by name, and their units:")
    for name, channel in CANONICAL.items():
        typer.echo(f"#   {name:<26}{channel.unit:<9}{channel.meaning}")
