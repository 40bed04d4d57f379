"""Tests of a filter on a model: many runs on draws of the model, ranks of the truth, scatter of the log-likelihood."""

from jaxveh.filters.calibration.accuracy import Accuracy, rmse_beside_bound
from jaxveh.filters.calibration.kept import run_and_keep
from jaxveh.filters.calibration.log_likelihood import LogLikelihoodSpread, log_likelihood_spread
from jaxveh.filters.calibration.monte_carlo import Runs, monte_carlo
from jaxveh.filters.calibration.simulation_based import CalibrationRanks, simulation_based_calibration

__all__ = [
    "Accuracy",
    "CalibrationRanks",
    "LogLikelihoodSpread",
    "Runs",
    "log_likelihood_spread",
    "monte_carlo",
    "rmse_beside_bound",
    "run_and_keep",
    "simulation_based_calibration",
]
