"""A study: what is simulated, estimated and measured, and which settings vary."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import jax
import numpy as np

from jaxveh._core.errors import check
from jaxveh.io import kit
from jaxveh.studies.axes import SAMPLES, Varied, design_of
from jaxveh.studies.drives import Drive, drive_of
from jaxveh.studies.estimating import model_of, told_car
from jaxveh.studies.metrics import asked_metrics, unit_of_metric
from jaxveh.studies.named_filters import filter_of
from jaxveh.studies.numbers import flat, unit_of
from jaxveh.studies.one_run import run_of
from jaxveh.studies.settings import check_kinds, put_at
from jaxveh.sweeps import Axis, Design

UNITS = {"drive.speed": "m/s", "drive.steer_deg": "°", "drive.duration": "s", "drive.rate": "Hz"}
"""Units of settings that are not numbers of an object."""


@dataclasses.dataclass(frozen=True, eq=False)
class Study:
    """`settings`: nested tables as in a study's file, with cars' files read; `axes`: the varied settings; `sampled`: the
    paths of the samples' numbers by their names; `seeds` runs at every point, drawn from `seed`. When called, it is the
    `run` of a sweep."""

    settings: Mapping[str, Any]
    axes: tuple[Varied, ...]
    sampled: Mapping[str, str]
    seeds: int
    seed: int

    @property
    def design(self) -> Design:
        """Every combination of the varied settings."""
        return design_of(self.axes)

    @property
    def key(self) -> jax.Array:
        """The key from which every run's key is split."""
        return jax.random.key(self.seed)

    @property
    def size(self) -> int:
        """The number of runs."""
        return self.seeds * math.prod(self.design.shape)

    def words(self) -> str:
        """What is simulated and estimated, and what the estimator is told, in a few sentences."""
        s, paths = self.settings, [*(axis.path for axis in self.axes if axis.path is not None), *self.sampled.values()]
        of = lambda table: ", ".join(
            sorted({f"{table}.{name}" for name in flat(s[table])} | {p for p in paths if p.startswith(f"{table}.")})
        )
        drive = s["drive"]
        car = drive["vehicle"] if isinstance(drive["vehicle"], str) else drive["vehicle"].name or "the car's file"
        own = f", with its own {of('told')}" if of("told") else ""
        noise = "from measurement_noise" if s["measurement_noise"] else "as it is"
        varied = ", ".join(paths) or "nothing"
        return (
            f"{car} as {drive['fidelity']}, {drive['manoeuvre']} on {drive['road']}, measured by {s['sensors']['devices']}, "
            f"estimated by {s['estimator']['name']} and {s['filter']['name']}. Varied: {varied}. "
            f"The estimator is told the car's numbers{' except ' + of('car') if of('car') else ''}"
            f"{own}, the sensors' noise {noise}, the speed at the start, and, exactly, inputs (steer) that no sensor measures."
        )

    def __call__(self, point: Any, key: jax.Array) -> dict[str, Any]:
        """One run: the metrics by name."""
        return run_of(self.at(point), key, self._duration(point))

    def at(self, point: Any) -> dict[str, Any]:
        """The settings at a point of the design."""
        settings = dict(self.settings)
        for axis in self.axes:
            value = getattr(point, axis.name)
            paths = (
                {axis.path: value} if axis.path is not None else {p: getattr(value, n) for n, p in self.sampled.items()}
            )
            for path, number in paths.items():
                settings = put_at(settings, path, number)
        return settings

    def check(self) -> None:
        """Build, without running it, every combination of choices, at both ends of every varied setting.

        **Raises** `InputError` for an unknown name or a value out of range.
        """
        check_kinds(self.settings)
        for _, _, objects in self.design.combinations():
            for point in self._ends(objects, lambda path: False):
                check_kinds(self.at(point))
            duration = self._duration(next(self._ends(objects, lambda path: False)))
            for point in self._ends(objects, lambda path: True):
                settings = self.at(point)
                drive = drive_of(settings, self.key, duration)
                _check_after(settings["metrics"]["after"], drive.driver.duration)
                filter_of(settings["filter"]).check(model_of(settings, drive))
                asked_metrics(settings["metrics"]["names"])

    def units(self) -> dict[str, str]:
        """The unit of every axis of numbers and of every metric, by name."""
        _, _, objects = next(self.design.combinations())
        settings = self.at(next(self._ends(objects, lambda path: False)))
        drive = drive_of(settings, self.key)
        found = {axis.name: _unit_at(axis.path, settings, drive) for axis in self.axes if axis.path is not None}
        found |= {f"{SAMPLES}.{name}": _unit_at(path, settings, drive) for name, path in self.sampled.items()}
        for one in asked_metrics(settings["metrics"]["names"]):
            found[one.name] = unit_of_metric(one, drive.car.units.get(one.quantity, unit_of(drive.car, one.quantity)))
        return found

    def _duration(self, point: Any) -> float | None:
        """Duration of the drives at a point's choices, s; None if the file gives it. It is the longest of those in one
        program, whose runs all have the same number of rows."""
        if "duration" in self.at(point)["drive"]:
            return None
        objects = {axis.name: getattr(point, axis.name) for axis in self.design.choices}
        with jax.ensure_compile_time_eval():
            ends = self._ends(objects, lambda path: path.startswith("drive."))
            return max(float(drive_of(self.at(one), jax.random.key(0)).driver.duration) for one in ends)

    def _ends(self, objects: Mapping[str, Any], moves: Callable[[str], bool]) -> Iterator[Any]:
        """Points of these choices: every number at its first value, and each number that `moves` accepts (by its path) at
        its least and its largest."""
        design, paths = self.design, {axis.name: axis.path for axis in self.axes}
        first = {axis.name: axis.at(np.asarray(0)) for axis in design.numbers}
        yield design.point(first, objects)
        for axis in design.numbers:
            for end in (min, max):
                for part in (None,) if axis.columns is None else axis.columns:
                    if moves(self.sampled[part] if part is not None else paths[axis.name] or ""):
                        yield design.point({**first, axis.name: _end(axis, part, end)}, objects)


def _check_after(after: Any, duration: float) -> None:
    """Raise `InputError` unless rows are left to count: without any, errors would be those of no row."""
    after = kit.toml_number("metrics.after", after)
    check("metrics.after", after, lambda v: (v >= 0) & (v < duration), f"from 0 to below the duration, {duration:g} s")


def _end(axis: Axis, part: str | None, end: Callable[[Any], Any]) -> Any:
    """An end of an axis of numbers; for samples that of one `part`, with the others as in the first sample."""
    columns = axis.columns or {}
    return end(axis.values) if part is None else {**axis.at(np.asarray(0)), part: end(columns[part])}


def _unit_at(path: str, settings: Mapping[str, Any], drive: Drive) -> str:
    """The unit of a varied number."""
    table, _, name = path.partition(".")
    if table == "car":
        return unit_of(drive.car, name)
    if table == "told":
        return unit_of(told_car(settings), name)
    if table in ("measurement_noise", "sensors"):
        return drive.car.units.get(name, unit_of(drive.sensors, name))
    if table == "process_noise":
        return f"{drive.car.units.get(name, '-')}/sqrt(s)"
    return UNITS.get(path, "-")
