"""Tables of the speeds, and of one friction and four on roads with several frictions."""

from __future__ import annotations

from jaxveh.experiments.federated_ckf.contestants import contestants
from jaxveh.experiments.federated_ckf.road_drives import road_cases
from jaxveh.experiments.federated_ckf.road_filters import ROAD_START, road_contestants
from jaxveh.experiments.federated_ckf.study import Raced
from jaxveh.experiments.report import spread
from jaxveh.sweeps import Table


def speed_table(raced: Raced, cases: tuple[str, ...]) -> Table:
    """RMSE of both speeds by every estimator in these cases."""
    names = raced.found.design.axis("estimator").labels
    whats = contestants(raced.study)
    rows = []
    for name in names:
        cells = [spread(raced.at(value, name, case)) for case in cases for value in ("v_x_rmse", "v_y_rmse")]
        rows.append((name, *cells, whats[name].what))
    heads = [f"{speed}, {case}" for case in cases for speed in ("v_x", "v_y")]
    return Table(
        f"RMSE of the speeds in m/s (the paper's Fig 4): median [quartiles] over {raced.found.seeds} seeds",
        ("estimator", *heads, "what it is"),
        rows,
    )


def road_tables(raced: Raced) -> list[Table]:
    """One table per road: errors of speeds, friction on both sides and mass, and the consistency of the friction's
    variance."""
    whats, begun = road_contestants(raced.study), f"from mu {ROAD_START.friction:g}"
    found = []
    for case, about in road_cases(raced.study).items():
        rows = []
        for name in raced.found.design.axis("estimator").labels:
            at = lambda value, name=name, case=case, **options: spread(raced.at(value, name, case), **options)
            sides = [at(f"friction_error_{side}", scale=100.0) for side in ("left", "right")]
            nees = at("friction_nees", lost="certain")
            speeds = [at(value) for value in ("v_x_rmse", "v_y_rmse", "sideslip_rmse")]
            rows.append((name, *speeds, *sides, nees, at("mass_error", scale=100.0), whats[name].what))
        found.append(
            Table(
                f"{case.capitalize()} ({about.what}), {begun}: median [quartiles] over {raced.found.seeds} seeds",
                (
                    "estimator", "v_x RMSE, m/s", "v_y RMSE, m/s", "sideslip RMSE, degrees", "ln mu left, %", "ln mu right, %",
                    "NEES of mu", "m, %", "what it is told",
                ),
                rows,
            )
        )  # fmt: skip
    return found
