"""jaxveh: estimate what a car cannot measure, in JAX, differentiable end to end."""

from typing import TYPE_CHECKING

from jaxveh._core.errors import FilterError, InputError, JaxvehWarning
from jaxveh._core.lazy import submodules
from jaxveh._core.parameters import Parameters
from jaxveh._core.recording import Recording
from jaxveh._core.result import Result
from jaxveh._core.version import VERSION

if TYPE_CHECKING:
    from jaxveh import (
        diagnostics,
        estimators,
        experiments,
        filters,
        fitting,
        io,
        kit,
        manoeuvres,
        numerics,
        observers,
        plots,
        roads,
        sensors,
        simulation,
        statespace,
        studies,
        sweeps,
        tyres,
        vehicles,
    )
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
    "studies",
    "sweeps",
    "tyres",
    "vehicles",
]

# Subpackages are imported when they are first used: importing all of them takes as long as importing jax.
_INSIDE = {"Estimate": "statespace", "cast": "statespace", "run": "statespace", "simulate": "simulation"}
_ROOMS = tuple(name for name in __all__ if name not in _INSIDE and name not in globals())

__getattr__ = submodules(__name__, _ROOMS, _INSIDE)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
