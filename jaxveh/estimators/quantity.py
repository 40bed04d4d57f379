"""The functions that the modules of the quantities have in common: `estimate` and `live` of their methods, and `do_nothing`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from jaxveh._core.recording import Recording, check_recording
from jaxveh.estimators.following import follow
from jaxveh.estimators.method import Answers, LiveMethod
from jaxveh.estimators.method_of_car import MethodOfCar, method_of
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io


class Estimate(Protocol):
    """The type of `estimate` of a quantity."""

    def __call__(self, source: Any, recording: Recording, *, method: str = ...) -> Answers:
        """The quantity along a log. `source`: a car's file, or a method; `method`: a name of `METHODS`, by default the
        recommended one. **Raises** as `follow`."""
        ...


class SmoothableEstimate(Protocol):
    """The type of `estimate` of a quantity of which a method can be smoothed."""

    def __call__(self, source: Any, recording: Recording, *, method: str = ..., smoothed: bool = False) -> Answers:
        """The same as `Estimate`. `smoothed`: each row is estimated from all rows."""
        ...


class LiveOfSource(Protocol):
    """The type of `live` of a quantity."""

    def __call__(self, source: Any, *, method: str = ...) -> LiveMethod:
        """The quantity, one row at a time; `source` and `method` as in `Estimate`."""
        ...


class DoNothing(Protocol):
    """The type of `do_nothing` of a quantity."""

    def __call__(self, car: CarSpecification, recording: Recording) -> dict[str, np.ndarray]:
        """What a car's file says of the quantity without any method, (T,) by the names of `SHOWN`."""
        ...


ARGUMENTS = "`source`: a car's file, or a method; `method`: a name of `METHODS`."


def estimate_of(name: str, shown: Mapping[str, str], methods: Mapping[str, MethodOfCar], recommended: str) -> Estimate:
    """The function `estimate` of the module of a quantity, whose `NAME`, `SHOWN`, `METHODS` and `RECOMMENDED` are given. Its
    text names what all methods show, with units."""

    def estimate(source: Any, recording: Recording, *, method: str = recommended) -> Answers:
        return follow(name, method_of(name, methods, source, method), recording)

    _describe(estimate, name, f"{_in_words(shown)} along a log.\n\n{ARGUMENTS}\n\n**Raises** as `follow`.")
    return estimate


def smoothable_estimate_of(
    name: str, shown: Mapping[str, str], methods: Mapping[str, MethodOfCar], recommended: str
) -> SmoothableEstimate:
    """The same for a quantity of which a method is an `AbstractSmoothable`."""

    def estimate(source: Any, recording: Recording, *, method: str = recommended, smoothed: bool = False) -> Answers:
        return follow(name, method_of(name, methods, source, method), recording, smoothed=smoothed)

    text = f"{_in_words(shown)} along a log.\n\n{ARGUMENTS}\n`smoothed`: each row is estimated from all rows."
    _describe(estimate, name, f"{text}\n\n**Raises** as `follow`.")
    return estimate


def live_of(name: str, shown: Mapping[str, str], methods: Mapping[str, MethodOfCar], recommended: str) -> LiveOfSource:
    """The function `live` of the module of a quantity, with the arguments of `estimate_of`."""

    def live(source: Any, *, method: str = recommended) -> LiveMethod:
        return LiveMethod(method_of(name, methods, source, method))

    _describe(live, name, f"{_in_words(shown)}, one row at a time: the same answers as `estimate`.\n\n{ARGUMENTS}")
    return live


def check_drive(who: str, car: Any, recording: Any) -> None:
    """Raise `InputError` unless these are a car's file and a recording."""
    io.check_car_file(who, car)
    check_recording(who, recording)


def constant_of(name: str, values: Callable[[CarSpecification], Mapping[str, float | None]], text: str) -> DoNothing:
    """The function `do_nothing` of the module of a quantity: the same `values` of a car's file, by name, in every row; None is
    NaN. `text` says what they are."""

    def do_nothing(car: CarSpecification, recording: Recording) -> dict[str, np.ndarray]:
        check_drive(f"{name}: do_nothing", car, recording)
        told = {field: np.nan if value is None else value for field, value in values(car).items()}
        return {field: np.full(len(recording), value) for field, value in told.items()}

    _describe(do_nothing, name, text)
    return do_nothing


def _in_words(shown: Mapping[str, str]) -> str:
    """The names and units: "`roll` (rad), `roll_rate` (rad/s)"."""
    return ", ".join(f"`{field}` ({unit})" for field, unit in shown.items())


def _describe(function: Callable, quantity: str, text: str) -> None:
    """Give a function its text, and the place where `help`, pickles and tracebacks find it."""
    function.__doc__ = text
    function.__module__ = f"{__package__}.{quantity}"
    function.__qualname__ = function.__name__
