"""Logs without `v_x`, as production cars write them: the speed is estimated first, from the wheel speeds."""

from __future__ import annotations

from pathlib import Path

from jaxveh import Recording, estimators
from jaxveh.cli.console import results
from jaxveh.io import CarSpecification


def with_speed(log: Path, recording: Recording, car: CarSpecification) -> Recording:
    """Return the log with the speed of the recommended method as `v_x`, with a note, if it has wheel speeds and no `v_x`."""
    speed = estimators.speed
    if "v_x" in recording or not any(name.startswith("wheel_speed_") for name in recording.names):
        return recording
    words = (
        f"note: {log.name}: there is no v_x: it is estimated from the wheel speeds, as --what speed does ({speed.RECOMMENDED}), "
        "and used like a measurement."
    )
    results().print(words, markup=False, soft_wrap=True)
    found = speed.estimate(car, recording)
    return recording.replace(v_x=found["v_x"], units={"v_x": "m/s"})
