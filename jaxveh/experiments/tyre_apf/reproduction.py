"""What the experiment found, as one value."""

from __future__ import annotations

from typing import NamedTuple

from jaxveh.diagnostics.observability import Observability
from jaxveh.experiments.tyre_apf.printed import Printed, PrintedOutcome
from jaxveh.experiments.tyre_apf.saturated import Saturated
from jaxveh.experiments.tyre_apf.settings import Study
from jaxveh.experiments.tyre_apf.sharpness import Sharpness
from jaxveh.experiments.tyre_apf.study import Outcome


class Reproduction(NamedTuple):
    """Everything the experiment found; leaves over seeds. `peeked`: the honest filters' parameters by the paper's final rule."""

    study: Study
    seeds: int
    outcome: Outcome
    steps: dict
    lane_change: Observability
    sweep: Observability
    printed: PrintedOutcome
    printed_settings: Printed
    saturated: Saturated
    sharpness: Sharpness
    peeked: dict
