"""The definition of an estimator of a quantity, and what all estimators share.

An estimator is a module of `jaxveh.estimators`, named after the quantity, with eight names, whose first arguments are:

- `NAME`: the name of the module, which messages and files of calibrations have.
- `needs`: a tuple of `Need`, the channels that it reads and their units.
- `car_of(car)`: the vehicle model of the estimator, built from a car's file without calibration.
- `model(car, ...) -> StateSpace`: the state space that a filter uses. `car`: an `io.CarSpecification`, or the vehicle model of
  the estimator. All other arguments have defaults and are given by name.
- `chosen_parameters(model)`: the parameters and noise levels that a calibration fits.
- `calibrate(car, recording, *, filter=None, progress=silent, ...) -> Calibration`: parameters of the car and of the noises,
  fitted to a span of a log, or to several logs of one car together.
- `estimate(source, recording, *, filter=None, key=None, ...) -> Estimate`: means and standard deviations of the quantity along a
  log; `source` is a `Calibration`, a model, or a car's file without calibration. An estimator that smooths has `smoothed=`,
  which turns it off.
- `live(source, *, filter=None, key=None) -> Live`: the same, one row at a time.

`AbstractCleaning` prepares the log for the filter. It looks back only, so that `live` gives the same results as `estimate`
without smoothing.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from jaxveh._core.errors import InputError, check_kind, is_concrete
from jaxveh._core.labelled import Labelled
from jaxveh._core.overview import Overview
from jaxveh._core.recording import Recording, check_recording, gap_to_fill
from jaxveh._core.shown import Shown, above
from jaxveh.fitting import Fit
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io
from jaxveh.statespace import StateSpace


class Need(NamedTuple):
    """A channel that an estimator reads, in its `unit`. `optional`: needed only where the model measures it; `throughout`:
    needed in every row, as inputs are, while measurements may be missing (NaN)."""

    channel: str
    unit: str
    optional: bool = False
    throughout: bool = False


def join_needs(*several: tuple[Need, ...]) -> tuple[Need, ...]:
    """The needs of all together: optional where each is, and throughout where one is."""
    found: dict[str, Need] = {}
    for need in (need for needs in several for need in needs):
        other = found.get(need.channel, need)
        optional, throughout = need.optional and other.optional, need.throughout or other.throughout
        found[need.channel] = need._replace(optional=optional, throughout=throughout)
    return tuple(found.values())


def check_needs(who: str, needs: tuple[Need, ...], recording: Recording, model: StateSpace | None = None) -> None:
    """Raise `InputError` for a channel that is missing from the recording, is in another unit, or has gaps where none are
    allowed.

    An optional channel is needed where the `model` reads it.
    """
    check_recording(who, recording)
    read = () if model is None else (*model.inputs, *model.channels)
    wanted = [need for need in needs if not need.optional or need.channel in read]
    missing = [f"{need.channel} ({need.unit})" for need in wanted if need.channel not in recording]
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        measured = [name for name in recording.names if not name.startswith("true.")]
        likely = io.likely_words([need.channel for need in wanted if need.channel not in recording], measured)
        raise InputError(
            f"{who}: {', '.join(missing)} {verb} missing from the log; it has: "
            f"{io.in_words(measured, io.MOST_NAMED) if measured else 'no channel'}.{' ' if likely else ''}{likely} "
            "Name the columns in a channel map, or in the recording."
        )
    for need in wanted:
        unit = recording.unit(need.channel)
        if io.is_unit(unit) and not io.same_unit(unit, need.unit):
            raise InputError(f"{who}: channel {need.channel} is in {unit}: must be in {need.unit}. Convert its values.")
        if need.throughout:
            _check_known(who, need.channel, recording)


def _check_known(who: str, name: str, recording: Recording) -> None:
    if not is_concrete(recording[name]):
        return
    gaps = np.isnan(np.asarray(recording[name]))
    if gaps.all():
        raise InputError(f"{who}: input channel {name} has no value in any row. Map another column, or leave it out.")
    if gaps.any():
        needed = gap_to_fill(recording, name)
        raise InputError(
            f"{who}: input channel {name} is NaN in {int(gaps.sum())} rows, first at t = "
            f"{np.asarray(recording.time)[np.argmax(gaps)]:g} s: an input must be known in every row. "
            f'Fill it with: recording.fill("{name}", "linear", max_gap={needed:g}).'
        )


class Span(NamedTuple):
    """The span of a log used by a calibration: from `start` to `end` (s, in the log's own time); `log`: its file's name, or
    ""."""

    start: float
    end: float
    log: str = ""


class Told(NamedTuple):
    """The start of a calibration: a car's file, and the options of its `model` by name, as plain values."""

    car: CarSpecification
    options: tuple[tuple[str, Any], ...] = ()


def start_of(car: Any, options: Mapping[str, Any] | None = None) -> Told | None:
    """The start of a calibration; None if it was not a car's file or an option is not a plain value, which cannot be
    written."""
    options = options or {}
    plain = all(value is None or isinstance(value, str | float | int) for value in options.values())
    return Told(car, tuple(options.items())) if plain and isinstance(car, CarSpecification) else None


class Calibration(Shown, eqx.Module):
    """An estimator's parameters fitted to logs; `write_calibration` and `read_calibration` write and read it as a file.

    `estimator`: its name; `fit`: the `fitting.Fit` (its `model` is the fitted StateSpace); `spans`: the spans used, one per
    log. If a reference was given, `weight` is its weight in the fit, in the reference's unit, or None if validation inside
    the span chose not to use it; `validation`: the validation error of each weight that was tried. `told`: the start of the
    fit, None if it was not a car's file.
    """

    estimator: str = eqx.field(static=True)
    fit: Fit
    spans: tuple[Span, ...] = eqx.field(static=True)
    weight: float | None = eqx.field(static=True, default=None)
    validation: tuple[tuple[float | None, float], ...] = eqx.field(static=True, default=())
    told: Told | None = eqx.field(static=True, default=None)

    def plot(self, *arguments: Any, **options: Any) -> Any:
        """Plot the fitted parameters with their standard errors (`plots.fit`). **Returns** the figure."""
        return self.fit.plot(*arguments, **options)

    def save(self, path: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Write the calibration as TOML; see `write_calibration`."""
        above("estimators", "write_calibration")(self, path, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | os.PathLike, *, estimator: Any = None) -> Calibration:
        """Read the calibration that `save` wrote; see `read_calibration`."""
        return above("estimators", "read_calibration")(path, estimator=estimator)

    def _labelled(self) -> Labelled:
        return self.fit._labelled()

    def _overview(self) -> Overview:
        spans = ", ".join(f"{span.log} {span.start:g} to {span.end:g} s".strip() for span in self.spans)
        of_fit = self.fit._overview()
        return of_fit._replace(title=f"Calibration of {self.estimator} on {spans}; {of_fit.title}")

    @property
    def model(self) -> StateSpace:
        """The fitted state space."""
        return self.fit.model

    def with_log_names(self, *logs: str) -> Calibration:
        """The same calibration with the names of the logs' files."""
        spans = tuple(span._replace(log=log) for span, log in zip(self.spans, logs, strict=True))
        return dataclasses.replace(self, spans=spans)

    def summary(self) -> dict[str, dict[str, Any]]:
        """Fitted values by name: `{"value", "std", "unit"}`."""
        fit = self.fit
        return {
            in_words(p.name): {
                "value": float(fit.parameters[p.name]), "std": float(fit.parameters_std[p.name]), "unit": p.unit
            }
            for p in fit.chosen
        }  # fmt: skip


def in_words(name: str) -> str:
    """The name of a fitted parameter as shown in tables."""
    for path, words in (("process_noise.law.std", "process noise"), ("measurement_noise.std", "measurement noise")):
        name = name.replace(path, words)
    return name


def model_of(who: str, source: Any, model: Callable[[Any], StateSpace], kind: type = object) -> StateSpace:
    """The state space of a `source`: that of a calibration, a model itself, whose system must be of this `kind`, or otherwise
    `model(car)`.

    **Raises** `InputError` for a calibration of another estimator, and a model of another system.
    """
    if isinstance(source, StateSpace):
        check_kind(
            f"{who}: the system of source, a StateSpace,", source.system, kind, f"estimators.{who}.model makes one."
        )
        return source
    if not isinstance(source, Calibration):
        return model(source)
    if source.estimator != who:
        raise InputError(f"{who}: the calibration was made by {source.estimator}: must be made by {who}.calibrate.")
    return source.model


def several_of(recording: Recording | Iterable[Recording]) -> list[Recording]:
    """One recording, or several, as a list; what is no recording stays in it for a check that knows its name."""
    if isinstance(recording, Recording) or not isinstance(recording, Iterable):
        return [recording]
    return list(recording)


def spans_of(
    who: str, recording: Recording | Sequence[Recording], shortest: float, what: str
) -> tuple[list[Recording], tuple[Span, ...]]:
    """The recordings to calibrate on, as a list, and their spans.

    **Raises** `InputError` if there is no recording, or one is shorter than `shortest` (s), too short to contain `what`.
    """
    recordings = several_of(recording)
    if not recordings:
        raise InputError(f"{who}: no log to calibrate on: give a recording, or several of one car.")
    for one in recordings:
        check_recording(who, one)
    spans = tuple(Span(float(one.time[0]), float(one.time[-1])) for one in recordings)
    for i, span in enumerate(spans):
        if span.end - span.start < shortest:
            which = f" {i + 1}" if len(spans) > 1 else ""
            raise InputError(
                f"{who}: calibration span{which} of {span.end - span.start:.3g} s ({span.start:g} to {span.end:g} s): must be at "
                f"least {shortest:g} s, with {what} in it."
            )
    return recordings, spans


PIECE_LENGTH = 8.0
"""s: a calibration runs the filter in parallel on pieces of about this length."""

WARM_UP = 2.0
"""s: the pieces overlap by this; in the overlap each filter finds its state."""


def cut_pieces(log: Recording, length: float = PIECE_LENGTH, overlap: float = WARM_UP) -> tuple[list[Recording], int]:
    """Cut the log into pieces of equal numbers of rows, about `length` seconds plus an `overlap` (s); also the overlap's
    rows."""
    time = np.asarray(log.time)
    step = float(np.median(np.diff(time)))
    warm_up = round(overlap / step)
    count = max(1, round((time[-1] - time[0] - overlap) / length))
    new = (len(log) - warm_up) // count
    return [log.rows(slice(i * new, i * new + new + warm_up)) for i in range(count)], warm_up
