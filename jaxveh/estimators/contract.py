"""What an estimator of a quantity is, and what all of them share.

An estimator is a module of `jaxveh.estimators`, named after what it estimates, with seven names and these arguments first:

- `needs`: a tuple of `Need`, the channels that it reads and their units.
- `car_of(car)`: the vehicle that the estimator is about, of a car's file taken at its word.
- `model(car, ...) -> StateSpace`: the state space that a filter sees. `car`: an `io.CarSpecification`, or the vehicle that the
  estimator is about. All other arguments have defaults and are given by name.
- `chosen_parameters(model)`: the parameters and noise levels that a calibration fits.
- `calibrate(car, recording, *, filter=None, progress=silent, ...) -> Calibration`: what of the car and of the noises a span of a
  log tells, or several logs of one car together.
- `estimate(source, recording, *, filter=None, key=None, ...) -> Estimate`: means and standard deviations of the quantity along a
  log; `source` is a `Calibration`, a model, or a car taken at its word. One that smooths has `smoothed=`, which turns it off.
- `live(source, *, filter=None, key=None) -> Live`: the same a row at a time.

`AbstractCleaning` is what stands between the log and the filter. It looks back only, so that `live` says what `estimate` says
without smoothing.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from jaxveh._core.errors import InputError, is_concrete
from jaxveh._core.labelled import Labelled
from jaxveh._core.overview import Overview
from jaxveh._core.recording import Recording
from jaxveh._core.shown import Shown, above
from jaxveh.fitting import Fit
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io
from jaxveh.statespace import StateSpace


class Need(NamedTuple):
    """A channel that an estimator reads, in its `unit`. `optional`: only where the model measures it; `throughout`: known in
    every row, as inputs must be, while measurements may be missing (NaN)."""

    channel: str
    unit: str
    optional: bool = False
    throughout: bool = False


def check_needs(who: str, needs: tuple[Need, ...], recording: Recording, model: StateSpace | None = None) -> None:
    """Raise `InputError` for a channel that the recording lacks, or has in another unit, or with gaps where there may be none.

    An optional one is needed where the `model` reads it.
    """
    read = () if model is None else (*model.inputs, *model.channels)
    wanted = [need for need in needs if not need.optional or need.channel in read]
    missing = [f"{need.channel} ({need.unit})" for need in wanted if need.channel not in recording]
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        raise InputError(
            f"{who}: {', '.join(missing)} {verb} missing from the log; it has: {', '.join(recording.names) or 'no channel'}. "
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
    if gaps.any():
        raise InputError(
            f"{who}: input channel {name} is NaN in {int(gaps.sum())} rows, first at t = "
            f"{np.asarray(recording.time)[np.argmax(gaps)]:g} s: an input must be known. "
            f'Fill it on request: recording.fill("{name}", "linear", max_gap=0.1).'
        )


class Span(NamedTuple):
    """What a calibration saw of a log: from `start` to `end` (s, in the log's own time); `log`: its file's name, "" for none."""

    start: float
    end: float
    log: str = ""


class Told(NamedTuple):
    """What a calibration started from: a car's file, and the options of its `model` by name, plain values."""

    car: CarSpecification
    options: tuple[tuple[str, Any], ...] = ()


def start_of(car: Any, options: Mapping[str, Any] | None = None) -> Told | None:
    """What a calibration started from; None where that was no file, or an option is no plain value: it cannot be written then."""
    options = options or {}
    plain = all(value is None or isinstance(value, str | float | int) for value in options.values())
    return Told(car, tuple(options.items())) if plain and isinstance(car, CarSpecification) else None


class Calibration(Shown, eqx.Module):
    """What logs told an estimator of a car; a file of it is written and read by `write_calibration` and `read_calibration`.

    `estimator`: its name; `fit`: the `fitting.Fit` (its `model` is the fitted StateSpace); `spans`: what was seen, one a log.
    Where a reference was offered, `weight` is the one that it got in the fit, in the reference's unit, None for none, by
    choice or because validation inside the span said so; `validation`: the error that each weight tried left there. `told`: what
    the fit started from, None where that was no car's file.
    """

    estimator: str = eqx.field(static=True)
    fit: Fit
    spans: tuple[Span, ...] = eqx.field(static=True)
    weight: float | None = eqx.field(static=True, default=None)
    validation: tuple[tuple[float | None, float], ...] = eqx.field(static=True, default=())
    told: Told | None = eqx.field(static=True, default=None)

    def plot(self, *arguments: Any, **options: Any) -> Any:
        """The fitted parameters with their standard errors (`plots.fit`). **Returns** the figure."""
        return self.fit.plot(*arguments, **options)

    def save(self, path: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Write it as TOML; see `write_calibration`."""
        above("estimators", "write_calibration")(self, path, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | os.PathLike) -> Calibration:
        """What `save` wrote; see `read_calibration`."""
        return above("estimators", "read_calibration")(path)

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
        """The same with the names of the logs' files."""
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
    """The name of a fitted parameter as tables show it."""
    for path, words in (("process_noise.law.std", "process noise"), ("measurement_noise.std", "measurement noise")):
        name = name.replace(path, words)
    return name


def model_of(who: str, source: Any, model: Callable[[Any], StateSpace]) -> StateSpace:
    """The state space of a `source`: that of a calibration or a model as it is, else `model(car)`.

    **Raises** `InputError` for a calibration of another estimator.
    """
    if isinstance(source, StateSpace):
        return source
    if not isinstance(source, Calibration):
        return model(source)
    if source.estimator != who:
        raise InputError(f"{who}: the calibration is one of {source.estimator}: must be made by {who}.calibrate.")
    return source.model


def spans_of(
    who: str, recording: Recording | Sequence[Recording], shortest: float, what: str
) -> tuple[list[Recording], tuple[Span, ...]]:
    """The recordings to calibrate on, as a list, and their spans.

    **Raises** `InputError` for one that is shorter than `shortest` (s), and cannot hold `what` is needed, or for none at all.
    """
    recordings = [recording] if isinstance(recording, Recording) else list(recording)
    if not recordings:
        raise InputError(f"{who}: no log to calibrate on: give a recording, or several of one car.")
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
"""s: calibration runs the filter on pieces of about this length side by side,"""

WARM_UP = 2.0
"""s: which overlap by this, in which each filter finds its state."""


def cut_pieces(log: Recording, length: float = PIECE_LENGTH, overlap: float = WARM_UP) -> tuple[list[Recording], int]:
    """The log in pieces of one number of rows, about `length` seconds beside an `overlap` (s), and the overlap's rows."""
    time = np.asarray(log.time)
    step = float(np.median(np.diff(time)))
    warm_up = round(overlap / step)
    count = max(1, round((time[-1] - time[0] - overlap) / length))
    new = (len(log) - warm_up) // count
    return [log.rows(slice(i * new, i * new + new + warm_up)) for i in range(count)], warm_up
