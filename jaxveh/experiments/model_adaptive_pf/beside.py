"""Parts of the paper that its own race does not contain: seven degrees of freedom with wheel spins, autoregressions of higher
order with a matrix, process noise with tails; and its figure 4, six states by three methods."""

from __future__ import annotations

from jaxveh import filters
from jaxveh.experiments.model_adaptive_pf.aar import MatrixAutoRegressive
from jaxveh.experiments.model_adaptive_pf.contestants import PLAIN, REDESIGNED, Contestant, Run
from jaxveh.experiments.model_adaptive_pf.drives import spinning_car
from jaxveh.experiments.model_adaptive_pf.models import (
    heavy_dynamics,
    lagging_car,
    matrix_autoregression,
    mixture,
    rows_of,
    spinning_model,
    spinning_rows_of,
)
from jaxveh.experiments.model_adaptive_pf.settings import Study
from jaxveh.experiments.model_adaptive_pf.study import Raced
from jaxveh.experiments.report import interval, spread
from jaxveh.sweeps import Table, compare

SEVEN = "CKF, 7 degrees of freedom"
HEAVY = "PF, heavy process noise"

RIVALS = {
    "AAR, matrix": "AAR",
    "AAR, matrix, order 2": "AAR",
    HEAVY: PLAIN,
    "PF, 7 degrees of freedom": "PF, no relaxation",
    SEVEN: "PF, no relaxation",
}
"""Each entrant's rival in the race, which differs only in what is new. The tyres of the seven degrees of freedom do not
relax."""

FEW = 10
"""Most seeds of all this: its differences are large."""

SLOWLY = ("open loop", PLAIN, "AAR", REDESIGNED)
"""The estimators that run at 30 km/h and on a loose road."""

FOUR = {"strong tracking": "strong tracking", PLAIN: "particle filter", "AAR as printed": "the paper's, as printed",
        "AAR": "the paper's, corrected"}  # fmt: skip
"""The methods of the paper's figure 4, by our names."""

STATES = {"v_x": "m/s", "v_y": "m/s", "a_x": "m/s^2", "a_y": "m/s^2", "yaw_rate": "degrees/s", "sideslip": "degrees"}
"""Its six states, and the units of their errors."""


def entrants(study: Study) -> dict[str, Contestant]:
    """The estimators of `RIVALS`."""
    particles = filters.ParticleFilter(study.particles)
    haar = filters.HaarParticles(particles, window=study.window, forgetting=study.forgetting)
    matrix = lambda order: _matrix_filter(MatrixAutoRegressive(haar, order, study.update))
    return {
        "AAR, matrix": Contestant(matrix(1), "each state from all three of the last row, least squares"),
        "AAR, matrix, order 2": Contestant(matrix(2), "from those of two rows"),
        HEAVY: Contestant(_heavy_filter(particles), "the dynamics, also the process noise an alpha-stable mixture"),
        "PF, 7 degrees of freedom": Contestant(
            _spinning_filter(particles), "wheel spins are states, wheel speeds measured; the paper's car"
        ),
        SEVEN: Contestant(_spinning_filter(filters.Cubature()), "the same, cubature"),
    }


def _matrix_filter(filter_) -> Run:
    def run(study, car, drive, key):
        model = matrix_autoregression(study, car, drive.v_x[0], mixture(study))
        return filters.scan(filter_, model, rows_of(study, drive), key)

    return run


def _heavy_filter(filter_) -> Run:
    def run(study, car, drive, key):
        model = heavy_dynamics(study, lagging_car(study, car), drive.v_x[0])
        return filters.scan(filter_, model, rows_of(study, drive), key)

    return run


def _spinning_filter(filter_) -> Run:
    def run(study, car, drive, key):
        model = spinning_model(study, spinning_car(study, car.front), drive.v_x[0])
        return filters.scan(filter_, model, spinning_rows_of(study, drive), key)

    return run


def beside_table(raced: Raced, beside: Raced) -> Table:
    """Each entrant's sideslip and its ratio to its rival's on the same drives, and its error of the wheels' slip."""
    rows = []
    every, seeds = entrants(beside.study), beside.found.seeds
    for name in ("open loop", *RIVALS):
        rival = RIVALS.get(name, PLAIN)
        where, cells = beside if name in RIVALS else raced, []
        for case in beside.cases:
            own, other = where.of("sideslip", name, case)[:seeds], raced.of("sideslip", rival, case)[:seeds]
            cells += [spread(own), interval(compare(own, other).ratio)]
        slips = [where.of("slip", name, case)[:seeds] for case in beside.cases]
        rows.append((name, rival, *cells, *map(spread, slips), every[name].what if name in every else "does nothing"))
    heads = [head for case in beside.cases for head in (f"'{case}', degrees", "over the rival's")]
    slips = [f"wheels' slip, %, '{case}'" for case in beside.cases]
    return Table(
        f"More of the paper: sideslip RMSE, median [quartiles] over {beside.found.seeds} seeds, and paired ratios [95 %]",
        ("estimator", "rival", *heads, *slips, "what it is"),
        rows,
        2,
    )


def six_table(raced: Raced, case: str = "both") -> Table:
    """The six states of figure 4 by the paper's three methods, doing nothing and the redesigned filter."""
    rows = []
    for name in ("open loop", *FOUR, REDESIGNED):
        cells = [spread(raced.of(state, name, case)) for state in STATES]
        rows.append((name, FOUR.get(name, ""), *cells))
    return Table(
        f"Figure 4, scenario '{case}': RMSE of six states, median [quartiles] over {raced.found.seeds} seeds",
        ("estimator", "in the paper", *[f"{state.replace('_', ' ') if state == 'yaw_rate' else state}, {unit}"
                                        for state, unit in STATES.items()]),
        rows,
        2,
    )  # fmt: skip


def slow_table(raced: Raced, slow: Raced) -> Table:
    """Both ends of the paper's speeds, and a loose road."""
    rows, seeds = [], slow.found.seeds
    there = {"50 km/h": (raced, "both"), **{case: (slow, case) for case in slow.cases}}
    for name in SLOWLY:
        cells = []
        for where, case in there.values():
            own, plain = (where.of("sideslip", one, case)[:seeds] for one in (name, PLAIN))
            cells.append(f"{spread(own)}; {interval(compare(own, plain).ratio)}")
        rows.append((name, *cells))
    return Table(
        f"By speed and road, noise as in 'both': sideslip RMSE in degrees, median [quartiles] over {seeds} seeds; over the "
        f"{PLAIN}'s [95 %]",
        ("estimator", *there),
        rows,
    )
