"""Every model, method, table and figure of mass-grade-aukf, and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import system, ways

SYSTEMS = (
    system(
        "longitudinal model",
        "1.2, eqs 1-3",
        "vehicles.Longitudinal",
        lacks="gears and engine enter as the torque at the wheels",
    ),
    system("state space", "1.3, eqs 4-7", "estimators.mass_and_grade.model"),
    system("unscented filter", "2, eqs 8-21", "filters.Unscented"),
    system(
        "adaptive unscented filter, frozen",
        "2, eqs 22-25",
        "filters.MatchedProcess",
        "experiments.mass_grade_aukf.contestants.Frozen",
    ),
    system("pause while braking", "3.2", "filters.Paused"),
    system("first guesses", "table 1, figs 5, 6", "experiments.mass_grade_aukf.report"),
    system("speed, force, acceleration, errors", "figs 3, 4, 7-10", "experiments.mass_grade_aukf.figures"),
    system("the car: brake signal, the filter's state", "figs 12-19", "experiments.mass_grade_aukf.figures"),
    system("least squares behind a gate", "introduction [8]", *ways("mass", "gated")),
    system("extended filters", "introduction [9, 10]", *ways("mass", "filter", "joint")),
    system("least squares of the fast components", "introduction [11]", *ways("mass", "high_pass")),
    system(
        "grade from accelerometer and speed, then least squares", "introduction [12]", *ways("mass", "kinematic_grade")
    ),
    system("accelerometer and two forgetting factors", "introduction [13]", *ways("mass", "forgetting")),
    system("satellites", "introduction", *ways("grade", "satellite")),
    system("the paper's claims", "3, 4", "experiments.mass_grade_aukf.claims"),
    system("lidar", "introduction", lacks="a sensor of the road ahead, which no vehicle model includes"),
    system("mass and grade of a log, without code", "", *(ways("mass", "filter")[:1] + ways("grade", "filter"))),
)
