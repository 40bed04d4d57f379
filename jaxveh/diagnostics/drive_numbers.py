"""The numbers of standard tests for a drive, by the manoeuvre's name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import check_kind
from jaxveh._core.host import on_host
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.braking_test import braking_test
from jaxveh.diagnostics.drive_channels import channel, has, sideslip
from jaxveh.diagnostics.frequency_response import frequency_response
from jaxveh.diagnostics.sine_with_dwell import sine_with_dwell
from jaxveh.diagnostics.steady_state import steady_turns, understeer
from jaxveh.diagnostics.step_response import step_response

OUTPUTS = ("yaw_rate", "a_y")


class Peaks(NamedTuple):
    """Largest absolute values in a drive: `a_y` (m/s^2), `yaw_rate` (rad/s) and `sideslip` (rad).

    `least_load`: N, the smallest load of a wheel, NaN if the recording has no loads.
    """

    a_y: float
    yaw_rate: float
    sideslip: float
    least_load: float


class LowestFrequency(NamedTuple):
    """The `gain` (SI) of a frequency response at its lowest `frequency` (Hz), which is close to the steady-state gain.

    `at_45_deg` (Hz): the frequency above which the response lags by more than 45 degrees (NaN: nowhere).
    """

    frequency: float
    gain: float
    at_45_deg: float


@on_host
def peaks(recording: Recording) -> Peaks:
    """Return the largest absolute values in a drive, over all samples; NaN for channels missing from the recording."""
    loads = [f"load_{wheel}" for wheel in ("fl", "fr", "rl", "rr") if has(recording, f"load_{wheel}")]
    size = lambda values: float(np.max(np.abs(values)))
    of = lambda name: size(channel(recording, name)) if has(recording, name) else float("nan")
    slides = has(recording, "sideslip") or has(recording, "v_x", "v_y")
    return Peaks(
        of("a_y"),
        of("yaw_rate"),
        size(sideslip(recording)) if slides else float("nan"),
        min((float(np.min(channel(recording, name))) for name in loads), default=float("nan")),
    )


class _Car(NamedTuple):
    """The numbers of the car that are needed: `wheelbase` (m) and `steer_at_03g` (rad); None if unknown."""

    wheelbase: float | None = None
    steer_at_03g: float | None = None


@on_host
def drive_numbers(
    recording: Recording,
    manoeuvre: str | None = None,
    wheelbase: float | None = None,
    *,
    steer_at_03g: float | None = None,
) -> dict[str, Any]:
    """Return the numbers that a `manoeuvre` (its name in `jaxveh.manoeuvres.MANOEUVRES`) is made for, as named tuples by title.

    `wheelbase` (m) is used for the understeer gradient, `steer_at_03g` (rad at the road wheels) for the `sine_with_dwell`. For
    other manoeuvres, and without a name, there are only the peaks.

    **Raises** `InputError` if the drive does not allow the numbers: it is too short, or a channel is missing.
    """
    if manoeuvre is not None:
        check_kind("drive_numbers: manoeuvre", manoeuvre, str, 'It is the manoeuvre\'s name: "step-steer".')
    return {"peaks": peaks(recording), **_NUMBERS.get(manoeuvre or "", _none)(recording, _Car(wheelbase, steer_at_03g))}


def _none(recording: Recording, car: _Car) -> dict[str, Any]:
    return {}


def _step(recording: Recording, car: _Car) -> dict[str, Any]:
    return {f"step response of {name} (ISO 7401)": step_response(recording, name) for name in OUTPUTS}


def _sweep(recording: Recording, car: _Car) -> dict[str, Any]:
    return {f"frequency response of {name} (ISO 7401)": _lowest(recording, name) for name in OUTPUTS}


def _lowest(recording: Recording, name: str) -> LowestFrequency:
    found = frequency_response(recording, name)
    lags = np.flatnonzero(np.degrees(np.unwrap(np.angle(found.response))) < -45.0)
    at = float(found.frequency[lags[0]]) if lags.size else float("nan")
    return LowestFrequency(float(found.frequency[0]), float(np.abs(found.response[0])), at)


def _turns(recording: Recording, car: _Car) -> dict[str, Any]:
    if car.wheelbase is None:
        return {}
    return {"steady turns (ISO 4138)": understeer(steady_turns(recording, car.wheelbase))}


def _dwell(recording: Recording, car: _Car) -> dict[str, Any]:
    return {"sine with dwell (FMVSS 126)": sine_with_dwell(recording, steer_at_03g=car.steer_at_03g)}


def _braking(recording: Recording, car: _Car) -> dict[str, Any]:
    return {"braking (UN R13-H)": braking_test(recording)}


_NUMBERS: dict[str, Callable[[Recording, _Car], dict[str, Any]]] = {
    "step-steer": _step,
    "swept-sine": _sweep,
    "random-steering": _sweep,
    "ramp-steer": _turns,
    "steady-circle": _turns,
    "sine-with-dwell": _dwell,
    "braking-in-a-turn": _braking,
    "mu-jump-braking": _braking,
}
