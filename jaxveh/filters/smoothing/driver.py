"""Smoothing of a recording: one function for all filters."""

from __future__ import annotations

from typing import Any

import equinox as eqx

from jaxveh._core.errors import InputError, check_flags, word_for
from jaxveh._core.parameter import strong
from jaxveh._core.recording import Recording
from jaxveh.filters.particle import AbstractParticleFilter
from jaxveh.filters.smoothing.backward_sampling import BackwardSampling
from jaxveh.filters.smoothing.fixed_lag import check_lag, smooth_with_lag
from jaxveh.filters.smoothing.genealogy import Genealogy
from jaxveh.filters.smoothing.path_smoother import AbstractPathSmoother
from jaxveh.filters.smoothing.rauch_tung_striebel import rauch_tung_striebel
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate
from jaxveh.statespace import AbstractFilter, Smoothing, StateSpace, kit


def smooth(
    filter: AbstractFilter,
    model: StateSpace,
    recording: Recording,
    *,
    key=None,
    method: AbstractPathSmoother | None = None,
    lag: int | None = None,
    throw: bool = True,
) -> SmoothedEstimate:
    """Estimate each row's state given the whole recording, or given the rows up to `lag` rows later.

    The filter runs forwards, then its smoother backwards. **Arguments**: as `run`. A Gaussian filter has the
    Rauch-Tung-Striebel smoother of its own rule and form. A particle filter has `method`, by default
    `BackwardSampling()` if every state has process noise, otherwise `Genealogy()`.

    Gaussian smoothers are differentiable with respect to array leaves of `model`. Outside of transformations, recordings of
    similar length share one compiled program.

    **Raises** as `run`, and `InputError` if the method does not suit the filter or the model, or if the filter's class
    does not declare that it can be smoothed (`AbstractFilter.smooths`).
    """
    check_flags(throw=throw)
    model = strong(model)
    kit.check_told(filter, model)
    filter.check(model)
    kind = kit.check_smooths("smooth", filter)
    rows = model.rows(recording)
    if lag is not None:
        check_lag(filter, lag)
        if method is not None:
            raise InputError("smooth: a lag has a method of its own; give either lag or method.")
        found = smooth_with_lag(filter, model, rows, key, lag)
    elif kind is Smoothing.particles:
        found = _particles(filter, model, rows, kit.key_for(filter, key), method)
    elif method is not None:
        raise InputError(
            f"method = {word_for(method)}: is for particle filters; {type(filter).__name__} has a smoother of its own."
        )
    else:
        found = kit.of_common_length(rauch_tung_striebel, rows, filter, model)
    found = eqx.tree_at(lambda e: (e.time, e.filtered.time), found, (recording.time, recording.time))
    if throw:
        kit.raise_failure(found.filtered, filter, model, recording)
    return found


def _particles(filter: AbstractParticleFilter, model: StateSpace, rows: Any, key, method) -> SmoothedEstimate:
    if method is None:
        noisy = () if model.process_noise is None else model.process_noise.law.names
        method = BackwardSampling() if set(noisy) == set(model.states) else Genealogy()
    if not isinstance(method, AbstractPathSmoother):
        raise InputError(f"method = {method!r}: must be BackwardSampling(), Genealogy() or None.")
    method.check(filter, model)
    return method.smooth(filter, model, rows, key)
