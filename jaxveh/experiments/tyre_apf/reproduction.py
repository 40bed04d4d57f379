"""The results of the experiment, as one value."""

from __future__ import annotations

from typing import NamedTuple

from jaxveh.diagnostics import Observability
from jaxveh.experiments.tyre_apf.printed import Printed, PrintedOutcome
from jaxveh.experiments.tyre_apf.saturated import Saturated
from jaxveh.experiments.tyre_apf.settings import Study
from jaxveh.experiments.tyre_apf.sharpness import Sharpness
from jaxveh.experiments.tyre_apf.study import Outcome
from jaxveh.experiments.tyre_apf.tracks import Tracks
from jaxveh.sweeps import Swept


class Reproduction(NamedTuple):
    """All results of the experiment; leaves over seeds.

    `outcome` of the honest lane change, `steps`: errors of step steers by degrees; `lane_change`: its information about the
    eight parameters; `saturated`, `sharpness`: the further drives and sweeps; `ahead`: the sweep with a filter that looks
    ahead with the process noise. `printed`: results of the printed settings. `peeked`: the honest filters' parameters,
    (seeds, 8), by the paper's final rule, which uses the truth. `first_step`: the step of 5 degrees with each estimator's
    tyres, (seeds, outputs, T); `open_loop`: the lane change with them; `tracks`: parameters over time; `variants`: the lane
    change in other ways; `order`: the effects of order and integrator on the particle filter.
    """

    study: Study
    seeds: int
    outcome: Outcome
    steps: dict
    lane_change: Observability
    saturated: Saturated
    sharpness: Sharpness
    ahead: Sharpness
    printed: PrintedOutcome
    printed_settings: Printed
    peeked: dict
    first_step: dict
    open_loop: dict
    tracks: Tracks
    variants: dict[str, Swept]
    order: Swept
