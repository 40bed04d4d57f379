"""Drives whose simulation is a quarter of the program: the same method, its stages in a loop."""

import functools

from jaxveh.simulation import simulate
from jaxveh.statespace import RolledRK4

rolled_simulate = functools.partial(simulate, solver=RolledRK4())
