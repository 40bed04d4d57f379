"""Bao, Sabbioni et al. (2015): an auxiliary particle filter for Magic Formula parameters and vehicle states."""

from jaxveh.experiments.tyre_apf.printed import Printed, run_printed_seeds
from jaxveh.experiments.tyre_apf.report import Check, Reproduction, Table, as_printed, check, run, settings, tables
from jaxveh.experiments.tyre_apf.settings import CITATION, Study, tyres
from jaxveh.experiments.tyre_apf.staged import Staged, run_staged

__all__ = [
    "CITATION",
    "Check",
    "Printed",
    "Reproduction",
    "Staged",
    "Study",
    "Table",
    "as_printed",
    "check",
    "run",
    "run_printed_seeds",
    "run_staged",
    "settings",
    "tables",
    "tyres",
]
