"""Smoothers: the estimate of each row given all rows."""

from jaxveh.filters.smoothing.backward_sampling import BackwardSampling
from jaxveh.filters.smoothing.driver import smooth
from jaxveh.filters.smoothing.fixed_lag import FixedLag
from jaxveh.filters.smoothing.genealogy import Genealogy
from jaxveh.filters.smoothing.path_smoother import AbstractPathSmoother
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate

__all__ = ["AbstractPathSmoother", "BackwardSampling", "FixedLag", "Genealogy", "SmoothedEstimate", "smooth"]
