"""What programs over `simulate` ask for."""

from jaxveh.simulation.simulate import SOLVERS

__all__ = [
    "SOLVERS",
]
