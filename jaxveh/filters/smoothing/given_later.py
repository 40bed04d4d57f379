"""One step back of the Rauch-Tung-Striebel smoother."""

from __future__ import annotations

from typing import Any

from jaxveh.filters.gaussian import AbstractGaussianFilter
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.filter import transition_image, with_spread
from jaxveh.filters.gaussian.forms import Later, Spread
from jaxveh.filters.wrappers.base import gaussian_of
from jaxveh.statespace import StateSpace, kit


def given_later(
    filter: AbstractGaussianFilter, model: StateSpace, belief: Any, t: Any, u: Any, later: GaussianBelief
) -> GaussianBelief:
    """The Gaussian of a belief, given the smoothed Gaussian `later` at the next row's time `t` with the inputs `u`.

    For a wrapped filter, the process noise is the one that it had estimated at that row.
    """
    own, gaussian = filter.adapted_model(model, belief), gaussian_of(belief)
    image = transition_image(own, gaussian, t, u)
    law = None if own.process_noise is None else own.process_noise.over(t - gaussian.t)
    known = Later(later.vector - image.mean, Spread(later.factor, later.matrix))
    before = Spread(gaussian.factor, gaussian.matrix)
    found = kit.innermost(filter).form.smooth(image, law, model.states, before, known)
    return with_spread(gaussian, gaussian.vector + found.shift, found.spread)
