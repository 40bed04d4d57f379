"""jaxveh: estimate what a car cannot measure, in JAX, differentiable end to end."""

from jaxveh import (
    diagnostics,
    estimators,
    filters,
    fitting,
    io,
    kit,
    manoeuvres,
    numerics,
    observers,
    roads,
    sensors,
    simulation,
    statespace,
    tyres,
    vehicles,
)
from jaxveh._core.errors import FilterError, InputError, JaxvehWarning
from jaxveh._core.lazy import submodules
from jaxveh._core.parameters import Parameters
from jaxveh._core.recording import Recording
from jaxveh._core.result import Result
from jaxveh._core.version import VERSION
from jaxveh.simulation import simulate
from jaxveh.statespace import Estimate, cast, run

__version__ = VERSION

__all__ = [
    "Estimate",
    "FilterError",
    "InputError",
    "JaxvehWarning",
    "Parameters",
    "Recording",
    "Result",
    "__version__",
    "cast",
    "diagnostics",
    "estimators",
    "experiments",
    "filters",
    "fitting",
    "io",
    "kit",
    "manoeuvres",
    "numerics",
    "observers",
    "plots",
    "roads",
    "run",
    "sensors",
    "simulate",
    "simulation",
    "statespace",
    "sweeps",
    "tyres",
    "vehicles",
]

# Imported when first asked for: they take longer, or need an extra.
__getattr__ = submodules(__name__, ("experiments", "plots", "sweeps"))
