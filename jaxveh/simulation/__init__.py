"""A vehicle, a manoeuvre and sensors make a Recording."""

from jaxveh.simulation.fixed_steps import fixed_steps
from jaxveh.simulation.simulate import simulate

__all__ = ["fixed_steps", "simulate"]
