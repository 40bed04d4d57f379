"""Fits on optimistix: rig data of tyres, residuals of recordings by multiple shooting, likelihoods of filters."""

from jaxveh.fitting.likelihood import maximise, maximum_likelihood
from jaxveh.fitting.multiple_shooting import multiple_shooting, shoot
from jaxveh.fitting.prediction_error import Target, prediction_error
from jaxveh.fitting.result import Fit
from jaxveh.fitting.rig import RigFit, StageReport, fit_rig
from jaxveh.fitting.rig_canonical import canonical
from jaxveh.fitting.rig_robust import Tails, heavy_tails
from jaxveh.fitting.rig_signs import WrongSign, wrong_signs
from jaxveh.fitting.rig_start import starting_tyre
from jaxveh.fitting.segments import Segments, cut

__all__ = [
    "Fit",
    "RigFit",
    "Segments",
    "StageReport",
    "Tails",
    "Target",
    "WrongSign",
    "canonical",
    "cut",
    "fit_rig",
    "heavy_tails",
    "maximise",
    "maximum_likelihood",
    "multiple_shooting",
    "prediction_error",
    "shoot",
    "starting_tyre",
    "wrong_signs",
]
