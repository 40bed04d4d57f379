"""A vehicle, a manoeuvre and sensors make a Recording."""

from jaxveh.simulation.simulate import simulate

__all__ = ["simulate"]
