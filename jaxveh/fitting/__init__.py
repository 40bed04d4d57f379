"""Fits with optimistix: rig data of tyres, residuals of recordings by multiple shooting, likelihoods of filters.

A fit is a problem (`pose_rig`, `pose_shooting`, `pose_likelihood`, `pose_prediction_error`) and its solution by `solve`, a
pure function under `jit`, `vmap` and `grad`. A solver of optimistix finds the optimum: its Levenberg-Marquardt or BFGS, or
one of this package in the same form (`LevenbergMarquardt` on normal equations, `FisherScoring`). The implicit function
theorem gives the derivatives with respect to data, noise levels and priors. `fit_rig`, `multiple_shooting`,
`maximum_likelihood` and `prediction_error` are programs built on these; they check their input, report progress, and raise.
All return one kind of result, `AbstractFit`.
"""

from jaxveh.fitting import kit
from jaxveh.fitting.bootstrap import Bootstrap, bootstrap
from jaxveh.fitting.levenberg_marquardt import LevenbergMarquardt, Quadratic
from jaxveh.fitting.likelihood import LikelihoodProblem, maximum_likelihood, pose_likelihood
from jaxveh.fitting.multiple_shooting import ShootingProblem, multiple_shooting, pose_shooting
from jaxveh.fitting.prediction_error import (
    PredictionErrorProblem,
    Target,
    pose_prediction_error,
    prediction_error,
)
from jaxveh.fitting.problem import AbstractProblem
from jaxveh.fitting.result import AbstractFit, Fit
from jaxveh.fitting.rig import RigFit, StageReport, fit_rig, pose_rig
from jaxveh.fitting.rig_canonical import canonical
from jaxveh.fitting.rig_problem import RigProblem
from jaxveh.fitting.rig_robust import Tails, heavy_tails
from jaxveh.fitting.rig_signs import WrongSign, wrong_signs
from jaxveh.fitting.rig_start import starting_tyre
from jaxveh.fitting.scoring import FisherScoring
from jaxveh.fitting.segments import Segments, cut
from jaxveh.fitting.solve import solve

__all__ = [
    "AbstractFit",
    "AbstractProblem",
    "Bootstrap",
    "FisherScoring",
    "Fit",
    "LevenbergMarquardt",
    "LikelihoodProblem",
    "PredictionErrorProblem",
    "Quadratic",
    "RigFit",
    "RigProblem",
    "Segments",
    "ShootingProblem",
    "StageReport",
    "Tails",
    "Target",
    "WrongSign",
    "bootstrap",
    "canonical",
    "cut",
    "fit_rig",
    "heavy_tails",
    "kit",
    "maximum_likelihood",
    "multiple_shooting",
    "pose_likelihood",
    "pose_prediction_error",
    "pose_rig",
    "pose_shooting",
    "prediction_error",
    "solve",
    "starting_tyre",
    "wrong_signs",
]
