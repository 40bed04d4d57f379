"""jaxveh: estimate what a car cannot measure, in JAX, differentiable end to end."""

from jaxveh import estimators, filters, fitting, manoeuvres, observers, roads, sensors, statespace, tyres, vehicles
from jaxveh._core.errors import FilterError, InputError, JaxvehWarning
from jaxveh._core.recording import Recording
from jaxveh._core.result import Result
from jaxveh.simulation import simulate
from jaxveh.statespace import Estimate, cast, run

__version__ = "0.1.0"

__all__ = [
    "Estimate",
    "FilterError",
    "InputError",
    "JaxvehWarning",
    "Recording",
    "Result",
    "__version__",
    "cast",
    "estimators",
    "filters",
    "fitting",
    "manoeuvres",
    "observers",
    "roads",
    "run",
    "sensors",
    "simulate",
    "statespace",
    "tyres",
    "vehicles",
]
