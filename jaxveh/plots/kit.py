"""What those who draw further figures build with."""

from jaxveh.plots.figure import Figure
from jaxveh.plots.style import CYCLE, PAGE_WIDTH, SHADE

__all__ = [
    "CYCLE",
    "PAGE_WIDTH",
    "SHADE",
    "Figure",
]
