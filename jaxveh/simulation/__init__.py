"""Drives: vehicle, road, driver and sensors through diffrax, into a Recording."""

from jaxveh.simulation import kit
from jaxveh.simulation.driven import Driven, DrivenState
from jaxveh.simulation.events import Event, standstill, wheel_lift
from jaxveh.simulation.fixed_steps import fixed_steps
from jaxveh.simulation.simulate import driven_car, simulate
from jaxveh.simulation.solve import Grid, Solution, even_grid, grid_through, solve
from jaxveh.simulation.stiffness import SolverChoice, fastest_pole

__all__ = [
    "Driven",
    "DrivenState",
    "Event",
    "Grid",
    "Solution",
    "SolverChoice",
    "driven_car",
    "even_grid",
    "fastest_pole",
    "fixed_steps",
    "grid_through",
    "kit",
    "simulate",
    "solve",
    "standstill",
    "wheel_lift",
]
