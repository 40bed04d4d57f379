"""A filter's run that keeps part of the belief of every row."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx

from jaxveh._core.errors import check_flags
from jaxveh._core.fresh_functions import note_function
from jaxveh._core.parameter import strong
from jaxveh._core.recording import Recording
from jaxveh.statespace import AbstractFilter, Estimate, StateSpace, kit

_scan_and_keep = eqx.filter_jit(kit.scan_and_keep)


def run_and_keep(
    filter: AbstractFilter, model: StateSpace, recording: Recording, keep: Callable, *, key=None, throw: bool = True
) -> tuple[Estimate, Any]:
    """The estimate of `run`, and `keep(belief)` of every row, with leaves (T, ...).

    For example `lambda belief: belief.covariance`, or the belief's `ancestors`. Each new lambda compiles anew.
    **Raises** as `run`.
    """
    check_flags(throw=throw)
    model = strong(model)
    kit.check_told(filter, model)
    filter.check(model)
    note_function("run_and_keep: keep", keep)
    estimate, kept = _scan_and_keep(filter, model, model.rows(recording), key, keep)
    estimate = dataclasses.replace(estimate, time=recording.time)
    if throw:
        kit.raise_failure(estimate, filter, model, recording)
    return estimate, kept
