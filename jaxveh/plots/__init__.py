"""Figures of recordings, drives, cars, estimates, innovations, tyre forces, parameters and fits, in one restrained style;
matplotlib is the extra `plot`. `log_report` makes a page with zoomable charts; it uses Bokeh, the extra `report`.

Every function returns a matplotlib `Figure` made without pyplot: there is no window and no global state, and notebooks show
it directly. Give `figure=` (a `Figure` or a `SubFigure`) to draw into your own. Angles are shown in degrees. Figures of drives
show a simulation's truth if the recording has it, otherwise the measurements.
"""

from jaxveh.plots import kit
from jaxveh.plots.braking_drives import braking
from jaxveh.plots.cars import car
from jaxveh.plots.closeup import closeup
from jaxveh.plots.drives import drive
from jaxveh.plots.dwell import sine_with_dwell
from jaxveh.plots.estimates import estimate
from jaxveh.plots.fits import fit
from jaxveh.plots.force_curves import force_curves
from jaxveh.plots.frequency_responses import frequency_response
from jaxveh.plots.friction_ellipse import friction_ellipse
from jaxveh.plots.gradient_map import gradient_map
from jaxveh.plots.handling import handling_diagram
from jaxveh.plots.innovations import InnovationPoints, innovation_points, innovations
from jaxveh.plots.log_report import ReportedLog, log_report
from jaxveh.plots.panels import overview
from jaxveh.plots.parameters import parameters
from jaxveh.plots.rear_axles import AxlePoints, rear_axle, rear_axle_points
from jaxveh.plots.recordings import recording
from jaxveh.plots.report_page import ReportTable
from jaxveh.plots.rig_fit import rig_fit
from jaxveh.plots.rigs import rig
from jaxveh.plots.step_responses import step_response
from jaxveh.plots.style import COLOURS, save, style
from jaxveh.plots.top_views import top_view
from jaxveh.plots.tyres import tyre
from jaxveh.plots.wheel_loads import loads

__all__ = [
    "COLOURS",
    "AxlePoints",
    "InnovationPoints",
    "ReportTable",
    "ReportedLog",
    "braking",
    "car",
    "closeup",
    "drive",
    "estimate",
    "fit",
    "force_curves",
    "frequency_response",
    "friction_ellipse",
    "gradient_map",
    "handling_diagram",
    "innovation_points",
    "innovations",
    "kit",
    "loads",
    "log_report",
    "overview",
    "parameters",
    "rear_axle",
    "rear_axle_points",
    "recording",
    "rig",
    "rig_fit",
    "save",
    "sine_with_dwell",
    "step_response",
    "style",
    "top_view",
    "tyre",
]
