"""Every model, method, table and figure of paper 004, and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import System


def _ways(quantity: str, *methods: str) -> tuple[str, ...]:
    return tuple(f"estimators.{quantity}.METHODS[{name}]" for name in methods)


SYSTEMS = (
    System(
        "longitudinal model",
        "1.2, eqs 1-3",
        ("vehicles.Longitudinal",),
        "gears and engine enter as the torque at the wheels",
    ),
    System("state space", "1.3, eqs 4-7", ("estimators.mass_and_grade.model",)),
    System("unscented filter", "2, eqs 8-21", ("filters.Unscented",)),
    System(
        "adaptive unscented filter, frozen",
        "2, eqs 22-25",
        ("filters.MatchedProcess", "experiments.mass_grade_aukf.contestants.Frozen"),
    ),
    System("pause while braking", "3.2", ("filters.Paused",)),
    System("first guesses", "table 1, figs 5, 6", ("experiments.mass_grade_aukf.report",)),
    System("speed, force, acceleration, errors", "figs 3, 4, 7-10", ("experiments.mass_grade_aukf.figures",)),
    System("the car: brake signal, the filter's state", "figs 12-19", ("experiments.mass_grade_aukf.figures",)),
    System("least squares behind a gate", "introduction [8]", _ways("mass", "gated")),
    System("extended filters", "introduction [9, 10]", _ways("mass", "filter", "joint")),
    System("least squares of the fast components", "introduction [11]", _ways("mass", "high_pass")),
    System(
        "grade from accelerometer and speed, then least squares", "introduction [12]", _ways("mass", "kinematic_grade")
    ),
    System("accelerometer and two forgetting factors", "introduction [13]", _ways("mass", "forgetting")),
    System("satellites", "introduction", _ways("grade", "satellite")),
    System("the paper's claims", "3, 4", ("experiments.mass_grade_aukf.claims",)),
    System("lidar", "introduction", (), "a sensor of the road ahead, which no vehicle model includes"),
    System("mass and grade of a log, without code", "", _ways("mass", "filter")[:1] + _ways("grade", "filter")),
)
