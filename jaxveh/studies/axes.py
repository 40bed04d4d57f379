"""The varied settings of a study: lists of numbers or names, ranges, samples; as the axes of a sweep's design."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_one_of, check_seed, check_whole
from jaxveh.io import kit
from jaxveh.studies.numbers import flat
from jaxveh.sweeps import Design, Samples, latin_hypercube, sobol

SAMPLES = "samples"
"""The axis of points that are drawn together."""

RANGE = ("from", "to", "count", "scale")
METHODS = {"latin-hypercube": latin_hypercube, "sobol": sobol}
SCALES = ("linear", "log")

MOST = 10**7
"""The most points of a range, and the most seeds: what is more would not fit into the memory, and is a slip of the pen."""

TRACED = ("car.", "told.", "sensors.", "process_noise.", "measurement_noise.", "drive.speed", "drive.steer_deg")
"""Settings that vary within one program; for all others each value is a program of its own."""

STILL = "sensors.devices"
"""The exception: it begins like a traced path, but its values are programs of their own."""


class Varied(NamedTuple):
    """One axis: its name in results, the `path` of the varied setting in the study (None: the samples), its values."""

    name: str
    path: str | None
    values: Any


def field_of(path: str) -> str:
    """The name of a path in results: dots become underscores."""
    return path.replace(".", "_").replace("-", "_")


def is_traced(path: str) -> bool:
    """Whether the setting at a path varies within one program."""
    return path.startswith(TRACED) and path != STILL


def axes_of(vary: Mapping[str, Any]) -> tuple[Varied, ...]:
    """The axes of a study's table `vary`.

    **Raises** `InputError` for anything but a list, a range, a table of labels or samples.
    """
    found = []
    for path, told in _paths(vary):
        if path == SAMPLES:
            found.append(Varied(SAMPLES, None, _samples(told)))
        else:
            found.append(Varied(field_of(path), path, _values(path, told, is_traced(path))))
    names = [one.name for one in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"vary: {name} is there twice: give each setting once.")
    return tuple(found)


def design_of(axes: tuple[Varied, ...]) -> Design:
    """The design of these axes."""
    return Design(**{axis.name: axis.values for axis in axes})


def _paths(vary: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    """The varied paths: nested tables or dotted keys down to lists, ranges and tables of labels."""
    found = []
    for key, told in vary.items():
        path = f"{before}{key}"
        if path == SAMPLES or not isinstance(told, Mapping) or _is_range(told) or path in ("filter", "estimator"):
            found.append((path, told))
        else:
            found.extend(_paths(told, f"{path}."))
    return found


def _is_range(told: Mapping[str, Any]) -> bool:
    return {"from", "to"} <= set(told)


def _values(path: str, told: Any, traced: bool) -> Any:
    """Numbers, or a mapping from labels to values."""
    where = f"vary.{path}"
    if isinstance(told, Mapping) and _is_range(told):
        told = _range(where, told)
    if path in ("filter", "estimator"):
        return _labelled(where, told)
    if not isinstance(told, list) or not told:
        raise InputError(
            f"{where} = {told!r}: must be a list, such as [1.0, 2.0], or a range, such as {{from = 1.0, to = 2.0, count = 5}}."
        )
    found = [kit.toml_number(where, value) for value in told] if traced else [str(value) for value in told]
    if len(set(found)) < len(found):
        raise InputError(f"{where} = {told!r}: has a value twice; give each value once.")
    return found if traced else dict(zip(found, told, strict=True))


def _labelled(where: str, told: Any) -> dict[str, Any]:
    """Filters or estimators by label: a list of names, or a table of names and tables."""
    if isinstance(told, list) and told and all(isinstance(one, str) for one in told):
        return {one: {"name": one} for one in told}
    if isinstance(told, Mapping) and told and all(isinstance(one, str | Mapping) for one in told.values()):
        return {label: {"name": one} if isinstance(one, str) else dict(one) for label, one in told.items()}
    raise InputError(
        f'{where} = {told!r}: must be a list of names, or a table of labels: [{where}] EKF = "extended", '
        'PF = {name = "particle-filter", particles = 300}.'
    )


def _range(where: str, told: Mapping[str, Any]) -> list[float]:
    for key in told:
        kit.check_known(where, "key", key, RANGE)
    low, high = (kit.toml_number(f"{where}.{key}", told[key]) for key in ("from", "to"))
    count, scale = told.get("count", 5), told.get("scale", "linear")
    check_whole(f"{where}.count", count, 2, most=MOST)
    check_one_of(f"{where}.scale", scale, SCALES)
    if scale == "log" and not (low > 0 and high > 0):
        raise InputError(f"{where}: from {low:g} to {high:g}: a logarithmic range must be positive.")
    return [float(one) for one in (np.geomspace if scale == "log" else np.linspace)(low, high, count)]


def _samples(told: Any) -> Samples:
    where = f"vary.{SAMPLES}"
    if not isinstance(told, Mapping):
        raise InputError(f"{where} = {told!r}: must be a table with method, count and ranges.")
    for key in told:
        kit.check_known(where, "key", key, ("method", "count", "seed", "ranges"))
    method, seed = told.get("method", "sobol"), told.get("seed", 0)
    check_one_of(f"{where}.method", method, METHODS)
    check_seed(f"{where}.seed", seed)
    count, ranges = told.get("count", 64), told.get("ranges", {})
    check_whole(f"{where}.count", count, most=MOST)
    if not isinstance(ranges, Mapping):
        raise InputError(f"{where}.ranges = {kit.shorten(ranges)}: must be a table of names and [low, high].")
    ranges = flat(ranges)
    for path, ends in ranges.items():
        if not isinstance(ends, list | tuple) or len(ends) != 2:
            raise InputError(f"{where}.ranges: {path} = {kit.shorten(ends)}: must be [low, high].")
        if not is_traced(path):
            raise InputError(f"{where}.ranges: {path} cannot vary within one program; give it its own list in [vary].")
    return METHODS[method](count, seed=seed, **{field_of(path): tuple(ends) for path, ends in ranges.items()})


def sampled_paths(vary: Mapping[str, Any]) -> dict[str, str]:
    """The paths of the samples' numbers, by their names in results."""
    told = vary.get(SAMPLES, {})
    return {field_of(path): path for path in flat(told.get("ranges", {}))} if isinstance(told, Mapping) else {}
