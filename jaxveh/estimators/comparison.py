"""Compares the methods of one quantity on one log, and scores them where there is a truth."""

from __future__ import annotations

import time as clock
from collections.abc import Iterable
from types import ModuleType
from typing import NamedTuple

import jax
import numpy as np

from jaxveh._core.errors import InputError, check_flags, check_has, check_kind, check_numbers, check_one_of
from jaxveh._core.names import as_names
from jaxveh._core.recording import Recording, check_recording
from jaxveh.diagnostics import Score, delay, score_band
from jaxveh.estimators.method import AbstractSmoothable, Answers
from jaxveh.estimators.method_of_car import method_of
from jaxveh.io import CarSpecification


class Compared(NamedTuple):
    """`answers` by method; `refused`: the reason by method, for those that could not run; `microseconds` per step by method,
    already compiled, in one scan over the log; `smoothed`: the methods whose answers use all rows."""

    answers: dict[str, Answers]
    refused: dict[str, str]
    microseconds: dict[str, float]
    smoothed: tuple[str, ...] = ()


class MethodScore(NamedTuple):
    """The score of one method for one of its outputs: `score`, a `diagnostics.Score` over all rows of the truth; `known`: the
    share of those rows that the method marks as known; `rmse_known`: the RMSE over them (NaN if there are none); `delay`
    (s)."""

    score: Score
    known: float
    rmse_known: float
    delay: float


def compare(
    car: CarSpecification,
    recording: Recording,
    quantity: ModuleType,
    methods: Iterable[str] | None = None,
    *,
    smoothed: bool = False,
) -> Compared:
    """Run the methods of a quantity along a log: all of them, or those named in `methods`. With `smoothed`, each row is estimated
    from all rows by those methods that can be smoothed, from the rows up to it by the others.

    A method that needs a key missing from the car's file or a channel missing from the log is `refused` with the reason. If
    it was named in `methods`, it **raises** `InputError` instead, as does an unknown name.
    """
    check_flags(smoothed=smoothed)
    asked = ("NAME", "METHODS", "estimate")
    check_has("compare: quantity", quantity, asked, "A module of a quantity has them: estimators.sideslip.")
    check_kind("car", car, CarSpecification, "io.read_car reads one from a file.")
    check_recording("compare", recording)
    names = as_names(quantity.METHODS if methods is None else methods, "methods")
    compared = Compared({}, {}, {})
    for name in names:
        check_one_of(f"{quantity.NAME}: method", name, quantity.METHODS)
        try:
            method = method_of(quantity.NAME, quantity.METHODS, car, name)
            looks = {"smoothed": True} if smoothed and isinstance(method, AbstractSmoothable) else {}
            compared.answers[name] = quantity.estimate(method, recording, **looks)
        except InputError as error:
            if methods is not None:
                raise
            compared.refused[name] = str(error)
            continue
        start = clock.perf_counter()
        jax.block_until_ready(quantity.estimate(method, recording, **looks).mean)
        compared.microseconds[name] = 1e6 * (clock.perf_counter() - start) / len(recording)
        compared = compared._replace(smoothed=compared.smoothed + ((name,) if looks else ()))
    return compared


def score_answers(found: Answers, name: str, truth: np.ndarray, which: np.ndarray | None = None) -> MethodScore:
    """Score the answers against a `truth` (T,) of the output `name`, in the rows where it is finite and `which` (T,) is True.
    **Raises** `InputError` where no row is left."""
    check_kind("found", found, Answers, "compare(...).answers has one by each method's name.")
    check_one_of("name", name, found.mean._fields)
    mean, std, known = (np.asarray(getattr(part, name)) for part in (found.mean, found.std, found.known))
    which = np.ones(mean.shape, bool) if which is None else which
    for what, array in (("truth", truth), ("which", which)):
        check_numbers(what, array)
        if np.shape(array) != mean.shape:
            raise InputError(f"{what} has shape {np.shape(array)}: must be {mean.shape}, one for each row.")
    truth = np.asarray(truth, float)
    rows = np.isfinite(truth) & np.isfinite(mean) & np.asarray(which, bool)
    claimed = None if np.isnan(std[rows]).all() else np.where(np.isnan(std), 0.0, std)
    score = score_band(truth, mean, claimed, rows)
    sure = rows & known
    rmse_known = float(np.sqrt(np.mean((mean - truth)[sure] ** 2))) if sure.any() else float("nan")
    late = delay(np.asarray(found.time), np.where(rows, mean, np.nan), truth)
    return MethodScore(score, float(sure.sum() / rows.sum()), rmse_known, late)
