"""Figures of recordings, estimates, tyre forces and parameters, in one restrained style; matplotlib is the extra `plot`.

Every function returns a matplotlib `Figure` made without pyplot: no window, no global state, shown by notebooks as it
is. Give `figure=` (a `Figure` or a `SubFigure`) to draw into one of your own. Angles are shown in degrees.
"""

from jaxveh.plots.estimates import estimate
from jaxveh.plots.force_curves import force_curves
from jaxveh.plots.friction_ellipse import friction_ellipse
from jaxveh.plots.gradient_map import gradient_map
from jaxveh.plots.parameters import parameters
from jaxveh.plots.recordings import recording
from jaxveh.plots.style import COLOURS, save, style
from jaxveh.plots.tyres import tyre

__all__ = [
    "COLOURS",
    "estimate",
    "force_curves",
    "friction_ellipse",
    "gradient_map",
    "parameters",
    "recording",
    "save",
    "style",
    "tyre",
]
