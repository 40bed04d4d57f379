"""Monte Carlo: one function over a design of settings and many seeds, in chunks, on every core or on many machines."""

from jaxveh.sweeps.design import Axis, Design
from jaxveh.sweeps.paired import Comparison, ConfidenceInterval, compare
from jaxveh.sweeps.running import sweep
from jaxveh.sweeps.sampling import Samples, latin_hypercube, sobol
from jaxveh.sweeps.stored import read_sweep
from jaxveh.sweeps.study_stores import IN_MEMORY, Stores
from jaxveh.sweeps.swept import Swept
from jaxveh.sweeps.table import Table

__all__ = [
    "IN_MEMORY",
    "Axis",
    "Comparison",
    "ConfidenceInterval",
    "Design",
    "Samples",
    "Stores",
    "Swept",
    "Table",
    "compare",
    "latin_hypercube",
    "read_sweep",
    "sobol",
    "sweep",
]
