"""The car with fourteen degrees of freedom: a body, four wheels on suspensions, and their spins."""

from jaxveh.vehicles.fourteen_dof.car import FourteenDOF

__all__ = ["FourteenDOF"]
