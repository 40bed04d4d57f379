"""Names for programs built on the fits."""

from jaxveh.fitting.problem import in_units, on_line, scalar_parameters
from jaxveh.fitting.rig_data import LEAST_NOISE
from jaxveh.fitting.rig_ranges import measured_ranges, widened_ranges
from jaxveh.fitting.rig_robust import FAR_RESIDUAL
from jaxveh.fitting.rig_stages import HELD_COEFFICIENTS, varying_inputs
from jaxveh.fitting.rig_start import RIG_STARTS, RigFacts
from jaxveh.fitting.segments import cut_rows

__all__ = [
    "FAR_RESIDUAL",
    "HELD_COEFFICIENTS",
    "LEAST_NOISE",
    "RIG_STARTS",
    "RigFacts",
    "cut_rows",
    "in_units",
    "measured_ranges",
    "on_line",
    "scalar_parameters",
    "varying_inputs",
    "widened_ranges",
]
