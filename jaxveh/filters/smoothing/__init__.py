"""Smoothers: what all rows say of each."""

from jaxveh.filters.smoothing.driver import BackwardSampling, Genealogy, smooth
from jaxveh.filters.smoothing.fixed_lag import FixedLag
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate

__all__ = ["BackwardSampling", "FixedLag", "Genealogy", "SmoothedEstimate", "smooth"]
