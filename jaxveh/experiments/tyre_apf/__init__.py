"""Bao, Sabbioni et al. (2015): an auxiliary particle filter for Magic Formula parameters and vehicle states."""

from jaxveh._core.lazy import submodules
from jaxveh.experiments.report import Check
from jaxveh.experiments.tyre_apf.criteria import CRITERIA
from jaxveh.experiments.tyre_apf.printed import Printed, run_printed
from jaxveh.experiments.tyre_apf.report import as_printed, check, run, settings
from jaxveh.experiments.tyre_apf.reproduction import Reproduction
from jaxveh.experiments.tyre_apf.settings import CITATION, STEP_OUTPUTS, Study, tyres
from jaxveh.experiments.tyre_apf.staged import Staged, run_staged
from jaxveh.experiments.tyre_apf.study import ESTIMATORS, FIELDS
from jaxveh.experiments.tyre_apf.tables import tables
from jaxveh.sweeps import Table

__all__ = [
    "CITATION",
    "CRITERIA",
    "ESTIMATORS",
    "FIELDS",
    "STEP_OUTPUTS",
    "Check",
    "Printed",
    "Reproduction",
    "Staged",
    "Study",
    "Table",
    "as_printed",
    "check",
    "figures",
    "run",
    "run_printed",
    "run_staged",
    "settings",
    "tables",
    "tyres",
]

# The figures need matplotlib, which is an extra.
__getattr__ = submodules(__name__, ("figures",))
