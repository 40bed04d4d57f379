"""Diagnostics: the quality of a log, the observability of parameters from a recording, the consistency of an estimate with its
standard deviations, and the numbers that standards take from a drive."""

from jaxveh.diagnostics import drive_channels, kit
from jaxveh.diagnostics.braking_test import BrakingTest, braking_test
from jaxveh.diagnostics.chi_squared import chi_squared_band, chi_squared_quantile, chi_squared_tails
from jaxveh.diagnostics.consistency import Consistency, nees, nis, nis_by_channel
from jaxveh.diagnostics.delays import delay, delay_of_rows
from jaxveh.diagnostics.drive_numbers import Peaks, drive_numbers, peaks
from jaxveh.diagnostics.frequency_response import FrequencyResponse, frequency_response
from jaxveh.diagnostics.log_check import check_log
from jaxveh.diagnostics.log_findings import SEVERITIES, LogFinding
from jaxveh.diagnostics.log_plausibility import check_car
from jaxveh.diagnostics.observability import Observability, from_sensitivities, observability_at
from jaxveh.diagnostics.particles import Ancestry, ParticleHealth, ancestry, particle_health
from jaxveh.diagnostics.scores import Score, score_band
from jaxveh.diagnostics.sine_with_dwell import SineWithDwellTest, sine_with_dwell
from jaxveh.diagnostics.steady_state import SteadyTurns, Understeer, steady_turns, understeer
from jaxveh.diagnostics.step_response import StepResponse, step_response
from jaxveh.diagnostics.whiteness import Whiteness, whiteness

__all__ = [
    "SEVERITIES",
    "Ancestry",
    "BrakingTest",
    "Consistency",
    "FrequencyResponse",
    "LogFinding",
    "Observability",
    "ParticleHealth",
    "Peaks",
    "Score",
    "SineWithDwellTest",
    "SteadyTurns",
    "StepResponse",
    "Understeer",
    "Whiteness",
    "ancestry",
    "braking_test",
    "check_car",
    "check_log",
    "chi_squared_band",
    "chi_squared_quantile",
    "chi_squared_tails",
    "delay",
    "delay_of_rows",
    "drive_channels",
    "drive_numbers",
    "frequency_response",
    "from_sensitivities",
    "kit",
    "nees",
    "nis",
    "nis_by_channel",
    "observability_at",
    "particle_health",
    "peaks",
    "score_band",
    "sine_with_dwell",
    "steady_turns",
    "step_response",
    "understeer",
    "whiteness",
]
