"""Methods of one quantity side by side on one log, and what each is worth where there is a truth."""

from __future__ import annotations

import time as clock
from collections.abc import Iterable
from types import ModuleType
from typing import NamedTuple

import jax
import numpy as np

from jaxveh._core.errors import InputError, check_one_of
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import Score, delay, score_band
from jaxveh.estimators.method import Answers
from jaxveh.io import CarSpecification


class Compared(NamedTuple):
    """`answers` by method; `refused`: why a method could not be taken, by its name; `microseconds` a step by method, compiled
    already, in one scan over the log."""

    answers: dict[str, Answers]
    refused: dict[str, str]
    microseconds: dict[str, float]


class MethodScore(NamedTuple):
    """Of one method and one of the names that it shows: a `diagnostics.Score` over all rows of the truth, `known`: the share of
    those rows in which it says that it knows, `rmse_known` over them (NaN without one), `delay` (s)."""

    score: Score
    known: float
    rmse_known: float
    delay: float


def compare(
    car: CarSpecification, recording: Recording, quantity: ModuleType, methods: Iterable[str] | None = None
) -> Compared:
    """Run methods of a quantity, all of them unless `methods` names some, along a log.

    One that lacks a key of the car's file or a channel of the log is `refused` with the reason, unless it was named: then it
    **raises** `InputError`, as does a name that is not there.
    """
    names = list(quantity.METHODS) if methods is None else list(methods)
    compared = Compared({}, {}, {})
    for name in names:
        check_one_of(f"{quantity.NAME}: method", name, quantity.METHODS)
        try:
            compared.answers[name] = quantity.estimate(car, recording, method=name)
        except InputError as error:
            if methods is not None:
                raise
            compared.refused[name] = str(error)
            continue
        start = clock.perf_counter()
        jax.block_until_ready(quantity.estimate(car, recording, method=name).mean)
        compared.microseconds[name] = 1e6 * (clock.perf_counter() - start) / len(recording)
    return compared


def score_answers(found: Answers, name: str, truth: np.ndarray, which: np.ndarray | None = None) -> MethodScore:
    """What the answers are worth against a `truth` (T,) of the shown `name`, in the rows where it is finite, of those `which`
    (T,) says. **Raises** `InputError` where no row is left."""
    mean, std, known = (np.asarray(getattr(part, name)) for part in (found.mean, found.std, found.known))
    truth = np.asarray(truth, float)
    rows = np.isfinite(truth) & np.isfinite(mean) & (True if which is None else which)
    claimed = None if np.isnan(std[rows]).all() else np.where(np.isnan(std), 0.0, std)
    score = score_band(truth, mean, claimed, rows)
    sure = rows & known
    rmse_known = float(np.sqrt(np.mean((mean - truth)[sure] ** 2))) if sure.any() else float("nan")
    late = delay(np.asarray(found.time), np.where(rows, mean, np.nan), truth)
    return MethodScore(score, float(sure.sum() / rows.sum()), rmse_known, late)
