"""A calibration as a file: readable TOML that restores the process that wrote it to the last digit."""

from __future__ import annotations

import importlib
import inspect
import os
from pathlib import Path
from types import ModuleType
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_finite, check_flags, check_has, check_kind, path_of
from jaxveh._core.parameter import Parameter, put, resolve
from jaxveh._core.parameters import Parameters
from jaxveh._core.result import Result, code
from jaxveh._core.version import VERSION
from jaxveh.estimators.contract import Calibration, Span, Told
from jaxveh.fitting import Fit
from jaxveh.io import kit

KEYS = (
    "estimator",
    "version",
    "result",
    "steps",
    "cost",
    "reference",
    "logs",
    "car",
    "options",
    "parameters",
    "covariance",
)

OWN = ("NAME", "model", "chosen_parameters")
"""What a file is read by, of the module of an estimator."""

NONE = "none"
"""The text that stands for an option that is None."""

REFERENCE = ("weight", "validation")
LOG = ("name", "start", "end")
PARAMETER = ("value", "std", "unit", "line")


ROUNDING = 1e-3
"""The share by which a value and its line may differ, in float32 too."""


def write_calibration(calibration: Calibration, path: str | os.PathLike, *, overwrite: bool = False) -> None:
    """Write a calibration as TOML that `read_calibration` reads back to the last digit.

    The file holds the car's file as given, the logs' names and spans, the fitted parameters with their standard errors, and
    their covariance on the real line of their bijectors, which the bands of an estimate need.

    **Raises** `InputError` where the file exists and `overwrite` is False, or the calibration did not start from a car's file.
    """
    check_flags(overwrite=overwrite)
    path = path_of(path)
    check_kind("calibration", calibration, Calibration, "The `calibrate` of an estimator makes one.")
    told, fit = calibration.told, calibration.fit
    if told is None:
        raise InputError(
            f"{path}: this calibration did not start from a car's file (io.CarSpecification) and plain options; only such a "
            "calibration can be written."
        )
    lines = [
        "# A calibration by jaxveh. SI units; [parameters] are the fitted values, [car] is the car as it was given.",
        f"estimator = {kit.toml_string(calibration.estimator)}",
        f"version = {kit.toml_string(VERSION)}",
        f"result = {kit.toml_string(Result(int(fit.result)).name)}",
        f"steps = {int(fit.steps)}",
        f"cost = {_number(fit.cost)}",
    ]
    if calibration.validation:
        tried = ", ".join(f"[{_weight(weight)}, {_number(error)}]" for weight, error in calibration.validation)
        lines += ["", "[reference]  # how closely a reference was followed (0: not at all); tried: [weight, error]"]
        lines += [f"weight = {_weight(calibration.weight)}", f"validation = [{tried}]"]
    for span in calibration.spans:
        lines += ["", "[[logs]]", f"name = {kit.toml_string(span.log)}"]
        lines += [f"start = {_number(span.start)}  # s", f"end = {_number(span.end)}"]
    lines += ["", *kit.car_lines(told.car, "car")]
    if told.options:
        lines += ["", "[options]", *(f"{name} = {_plain(value)}" for name, value in told.options)]
    for p, line in zip(fit.chosen, fit.unconstrained, strict=True):
        lines += [
            "",
            f"[parameters.{kit.toml_string(p.name)}]",
            f"value = {_number(fit.parameters[p.name])}  # {p.unit}",
        ]
        lines += [f"std = {_number(fit.parameters_std[p.name])}", f"line = {_number(line)}"]
    rows = np.asarray(fit.covariance)
    lines += ["", "[covariance]  # of the lines, each row up to the diagonal"]
    lines += [
        f"{kit.toml_string(p.name)} = [{', '.join(_number(value) for value in rows[i, : i + 1])}]"
        for i, p in enumerate(fit.chosen)
    ]
    kit.write_toml(lines, path, overwrite)


def read_calibration(path: str | os.PathLike, *, estimator: ModuleType | None = None) -> Calibration:
    """Read the calibration that `write_calibration` wrote.

    `estimator`: the module of an estimator of one's own; by default the one of this package that the file names.

    **Raises** `InputError` for a file that is no calibration, is cut short, was written by another version, is of another
    estimator, or holds other parameters than the estimator fits.
    """
    if estimator is not None:
        check_has("estimator", estimator, OWN, "Give the module, as it was imported.")
    path = path_of(path)
    content = kit.read_toml(path)
    kit.check_file(path, content, "calibration", KEYS)
    kit.check_keys(str(path), content, KEYS)
    missing = [key for key in KEYS if key not in content and key not in ("reference", "options")]
    if missing:
        raise InputError(f"{path}: no {', '.join(missing)}: this is not a calibration, or it is cut short; fit again.")
    try:
        _check_version(kit.toml_text("version", content["version"]))
        return _calibration(content, path.parent, estimator)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _check_version(version: str) -> None:
    if version.split(".")[:2] != VERSION.split(".")[:2]:
        raise InputError(f"version = {version!r}: the calibration was not written by version {VERSION}; fit again.")


def _module(name: str, own: ModuleType | None) -> Any:
    """The module of the estimator that a file names. The package's own are found in its list, so that none is forgotten."""
    if own is not None:
        if name != own.NAME:
            raise InputError(f"the calibration is of {name}: must be of {own.NAME}, the estimator that was given.")
        return own
    room = importlib.import_module("jaxveh.estimators")
    there = {one: getattr(room, one) for one in room.__all__ if hasattr(getattr(room, one), "calibrate")}
    own_advice = f"If it is your own, give its module: read_calibration(path, estimator={name})."
    kit.check_known("the calibration", "estimator", name, there, own_advice)
    return there[name]


def _calibration(content: dict[str, Any], folder: Path, own: ModuleType | None) -> Calibration:
    name = kit.toml_text("estimator", content["estimator"])
    module = _module(name, own)
    options = {key: None if value == NONE else value for key, value in _table("options", content).items()}
    told = Told(kit.car_of_toml(content["car"], "[car]", folder), tuple(options.items()))
    kit.check_keys("[options]", options, inspect.signature(module.model).parameters)
    start = module.model(told.car, **options)
    fit = _fit(content, start, resolve(start, module.chosen_parameters))
    reference = _table("reference", content, REFERENCE)
    weight = lambda value: _told_number("[reference]", value) or None
    tried = tuple((weight(a), _told_number("[reference]", b)) for a, b in _pairs(reference.get("validation", [])))
    return Calibration(name, fit, _spans(content["logs"]), weight(reference.get("weight", 0.0)), tried, told)


def _fit(content: dict[str, Any], start: Any, chosen: tuple[Parameter, ...]) -> Fit:
    names = [p.name for p in chosen]
    tables, rows = content["parameters"], content["covariance"]
    for where, table in (("[parameters]", tables), ("[covariance]", rows)):
        kit.check_keys(where, table, names)
        missing = [name for name in names if name not in table]
        if missing:
            raise InputError(f"{where}: no {', '.join(missing)}: cut short, or of another version; fit again.")
    dtype = jnp.result_type(float)
    numbers = {
        key: [_told_number(f"[parameters.{name}]: {key}", _table(name, tables, PARAMETER).get(key)) for name in names]
        for key in ("value", "std", "line")
    }
    for p, value, line in zip(chosen, numbers["value"], numbers["line"], strict=True):
        _check_pair(p, value, line)
    half = np.zeros((len(names), len(names)))
    for i, name in enumerate(names):
        if not isinstance(rows[name], list) or len(rows[name]) != i + 1:
            raise InputError(f"[covariance]: {name}: must be a list of {i + 1} numbers.")
        half[i, : i + 1] = [_told_number(f"[covariance]: {name}", value) for value in rows[name]]
    if not _is_positive(half):
        raise InputError("[covariance]: is not positive definite: edited, or lost in rounding (float32); fit again.")
    values = [jnp.asarray(value, dtype) for value in numbers["value"]]
    result = kit.toml_text("result", content["result"])
    kit.check_known("the calibration", "result", result, Result.__members__)
    return Fit(
        parameters=Parameters(dict(zip(names, values, strict=True))),
        parameters_std=Parameters({n: jnp.asarray(v, dtype) for n, v in zip(names, numbers["std"], strict=True)}),
        unconstrained=jnp.asarray(numbers["line"], dtype),
        covariance=jnp.asarray(half + np.tril(half, -1).T, dtype),
        cost=jnp.asarray(_told_number("cost", content["cost"]), dtype),
        steps=jnp.asarray(int(_told_number("steps", content["steps"]))),
        result=code(Result[result]),
        model=put(start, chosen, values),
        chosen=chosen,
    )


def _check_pair(p: Parameter, value: float, line: float) -> None:
    """Raise `InputError` unless a fitted value is in its domain and belongs to its line, on which the bands are: one of both
    was edited otherwise."""
    where = f"[parameters.{kit.toml_string(p.name)}]"
    try:
        check_finite("value", value)
        found = float(p.domain.inverse(value))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    if not abs(found - line) <= ROUNDING * (1 + abs(line)):
        raise InputError(
            f"{where}: value = {value:g}: must be {float(p.domain.forward(line)):g}, which belongs to line = {line:g}. A fitted "
            "value cannot be edited alone: edit the car's file, and fit again."
        )


def _is_positive(half: np.ndarray) -> bool:
    """Whether the matrix of this lower half is a covariance: the bands of an estimate take its root."""
    if not np.isfinite(half).all():
        return False
    try:
        np.linalg.cholesky(half + np.tril(half, -1).T)
    except np.linalg.LinAlgError:
        return False
    return True


def _spans(logs: Any) -> tuple[Span, ...]:
    if not isinstance(logs, list) or not logs:
        raise InputError("[[logs]]: must be a list of tables, one per log.")
    spans = []
    for log in logs:
        kit.check_keys("[[logs]]", log, LOG)
        start, end = (_told_number(f"[[logs]]: {key}", log.get(key)) for key in ("start", "end"))
        spans.append(Span(start, end, kit.toml_text("[[logs]]: name", log.get("name"))))
    return tuple(spans)


def _table(name: str, content: dict[str, Any], keys: tuple[str, ...] | None = None) -> dict[str, Any]:
    table = content.get(name, {})
    kit.check_keys(f"[{name}]", table, table if keys is None and isinstance(table, dict) else keys or ())
    return table


def _pairs(values: Any) -> list[list[Any]]:
    if not isinstance(values, list) or any(not isinstance(one, list) or len(one) != 2 for one in values):
        raise InputError("[reference]: validation: must be a list of [weight, error].")
    return values


def _told_number(where: str, value: Any) -> float:
    """A number of the file; infinite values are allowed, since a fit may return them."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where} = {value!r}: must be a number; the file may be cut short.")
    return float(value)


def _number(value: Any) -> str:
    """A number in TOML, which Python reads back bit for bit."""
    return repr(float(value))


def _weight(weight: float | None) -> str:
    return _number(0.0 if weight is None else weight)


def _plain(value: Any) -> str:
    """An option in TOML, which has no None."""
    if value is None:
        value = NONE
    if isinstance(value, str):
        return kit.toml_string(value)
    return str(value).lower() if isinstance(value, bool) else repr(value)
