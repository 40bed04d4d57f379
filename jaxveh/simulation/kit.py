"""Names for programs that call `simulate`."""

from jaxveh.simulation.simulate import SOLVERS

__all__ = [
    "SOLVERS",
]
