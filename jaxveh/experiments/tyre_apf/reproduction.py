"""What the experiment found, as one value."""

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
    """Everything the experiment found; leaves over seeds.

    `outcome` of the honest lane change, `steps`: errors of step steers by degrees; `lane_change`: what it can tell of eight
    parameters; `saturated`, `sharpness`: the further drives and sweeps, `ahead` the last
    with a filter that looks ahead with the process noise. `printed`: what the printed settings do. `peeked`: the honest filters'
    parameters, (seeds, 8), by the paper's final rule, which looks at the truth. `first_step`: the step of 5 degrees with each
    estimator's tyres, (seeds, outputs, T); `open_loop`: the lane change with them; `tracks`: parameters over time; `variants`:
    the lane change in other ways; `order`: what order and integrator do to the particle filter.
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
