"""The parts for adding a filter or a wrapper: the contract, the base classes of the families, and their tools."""

from jaxveh.filters.choosing import (
    AbstractDraw,
    AbstractResampling,
    Resampled,
    choose_ancestors,
    gather,
    log_chosen,
    log_of,
)
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter, AbstractRuleFilter, check_covariances, with_spread
from jaxveh.filters.gaussian.forms import AbstractForm, Spread
from jaxveh.filters.gaussian.rules import AbstractRule, Image, Points, Slopes
from jaxveh.filters.gaussian.wrapper import AbstractGaussianWrapper, AbstractStateless
from jaxveh.filters.outer_belief import AbstractOuterBelief, AbstractTransparentBelief
from jaxveh.filters.particle import (
    AbstractAhead,
    AbstractParticleFilter,
    AbstractProposalFilter,
    DrawnParticles,
    Expected,
    ParticleBelief,
    add_noise,
    check_particle_settings,
    fate,
    log_prob,
    make_info,
    replace_lost,
    without,
)
from jaxveh.filters.smoothing.rauch_tung_striebel import rauch_tung_striebel, smooth_together
from jaxveh.filters.wrappers.base import (
    AbstractLearnedNoise,
    AbstractRemembering,
    Remembering,
    gaussian_of,
    variances_of,
    with_gaussian,
    with_variances,
)
from jaxveh.filters.wrappers.innovation import Innovation, innovation
from jaxveh.filters.wrappers.robust import AbstractReweighting
from jaxveh.filters.wrappers.wavelet import NORMAL_MEDIAN, Window, first_window, row_values, window_after
from jaxveh.statespace import (
    AbstractBelief,
    AbstractFilter,
    AbstractTwoPartFilter,
    AbstractTwoPartWrapper,
    AbstractWrapper,
    Gradient,
    Info,
    Row,
    Smoothing,
    StateSpace,
)
from jaxveh.statespace import kit as contract

by_channel = contract.by_channel
check_noise_by_row = contract.check_noise_by_row
check_rows_between = contract.check_rows_between
innermost = contract.innermost
input_result = contract.input_result
key_for = contract.key_for
layers = contract.layers
presence = contract.presence
smoothing_of = contract.smoothing_of
who_lacks = contract.who_lacks

__all__ = [
    "NORMAL_MEDIAN",
    "AbstractAhead",
    "AbstractBelief",
    "AbstractDraw",
    "AbstractFilter",
    "AbstractForm",
    "AbstractGaussianFilter",
    "AbstractGaussianWrapper",
    "AbstractLearnedNoise",
    "AbstractOuterBelief",
    "AbstractParticleFilter",
    "AbstractProposalFilter",
    "AbstractRemembering",
    "AbstractResampling",
    "AbstractReweighting",
    "AbstractRule",
    "AbstractRuleFilter",
    "AbstractStateless",
    "AbstractTransparentBelief",
    "AbstractTwoPartFilter",
    "AbstractTwoPartWrapper",
    "AbstractWrapper",
    "DrawnParticles",
    "Expected",
    "GaussianBelief",
    "Gradient",
    "Image",
    "Info",
    "Innovation",
    "ParticleBelief",
    "Points",
    "Remembering",
    "Resampled",
    "Row",
    "Slopes",
    "Smoothing",
    "Spread",
    "StateSpace",
    "Window",
    "add_noise",
    "by_channel",
    "check_covariances",
    "check_noise_by_row",
    "check_particle_settings",
    "check_rows_between",
    "choose_ancestors",
    "fate",
    "first_window",
    "gather",
    "gaussian_of",
    "innermost",
    "innovation",
    "input_result",
    "key_for",
    "layers",
    "log_chosen",
    "log_of",
    "log_prob",
    "make_info",
    "presence",
    "rauch_tung_striebel",
    "replace_lost",
    "row_values",
    "smooth_together",
    "smoothing_of",
    "variances_of",
    "who_lacks",
    "window_after",
    "with_gaussian",
    "with_spread",
    "with_variances",
    "without",
]
