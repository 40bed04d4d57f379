"""The road along the way: friction, grade and bank."""

from jaxveh.roads.ground import LEVEL, Ground

__all__ = ["LEVEL", "Ground"]
