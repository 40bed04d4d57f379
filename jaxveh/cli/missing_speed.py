"""Logs without `v_x`: those of production cars have wheel speeds, those of satellite receivers the speed over ground."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from jaxveh import InputError, Recording, estimators
from jaxveh.cli.console import results
from jaxveh.io import CarSpecification


def with_speed(log: Path, recording: Recording, car: CarSpecification) -> Recording:
    """Return the log with `v_x`, and a note, if it has none: the speed that the recommended method finds from the wheel speeds,
    without them the speed over ground, of which `v_x` is the part along the car, and which has no sign."""
    speed = estimators.speed
    if "v_x" in recording:
        return recording
    if has_wheels(recording):
        how = f"as --what speed does ({speed.RECOMMENDED}), and used like a measurement"
        _tell(log, f"it is estimated from the wheel speeds, {how}")
        return recording.replace(v_x=speed.estimate(car, recording)["v_x"], units={"v_x": "m/s"})
    if "speed" in recording:
        _tell(
            log, "the speed over ground is used. It is 0.4 % larger at 5 degrees of sideslip, and positive in reverse"
        )
        return recording.replace(v_x=recording["speed"], units={"v_x": "m/s"})
    return recording


def sources_of_speed(recording: Recording, car: CarSpecification) -> set[str]:
    """Return the channels of a log from which `with_speed` finds its `v_x`; none if it is measured."""
    speed = estimators.speed
    if "v_x" in recording:
        return set()
    if has_wheels(recording):
        needs = speed.METHODS[speed.RECOMMENDED].make(car).needs
        return {need.channel for need in needs if need.channel in recording}
    return {"speed"} & set(recording.names)


def has_wheels(recording: Recording) -> bool:
    """Whether a log has wheel speeds."""
    return any(name.startswith("wheel_speed_") for name in recording.names)


def wants_v_x(quantity: ModuleType, methods: Sequence[str], car: CarSpecification) -> bool:
    """Whether one of these methods of a quantity uses `v_x`, and not the speed over ground itself."""
    for name in methods:
        with contextlib.suppress(InputError):
            used = {need.channel for need in quantity.METHODS[name].of_centre(car).needs}
            if "v_x" in used and "speed" not in used:
                return True
    return False


def _tell(log: Path, what: str) -> None:
    results().print(f"note: {log.name}: there is no v_x: {what}.", markup=False, soft_wrap=True)
