"""Tools for further figures."""

from jaxveh.plots.figure import Figure
from jaxveh.plots.quantities import quantity
from jaxveh.plots.style import CYCLE, PAGE_WIDTH, SHADE

__all__ = [
    "CYCLE",
    "PAGE_WIDTH",
    "SHADE",
    "Figure",
    "quantity",
]
