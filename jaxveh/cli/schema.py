"""`jaxveh schema`: commented examples of the files that the programs read."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from jaxveh.io import CANONICAL, kit


class File(StrEnum):
    """The file to explain."""

    car = "car"
    channels = "channels"
    study = "study"


def schema(
    file: Annotated[File, typer.Argument(help="The car, the channel map, or the study of a sweep.")] = File.car,
) -> None:
    """Print a commented example of the file that describes a car, of a channel map, or of a study (jaxveh sweep).

    Every example is a valid file: [bold]jaxveh schema car > car.toml[/] is a good start.
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
