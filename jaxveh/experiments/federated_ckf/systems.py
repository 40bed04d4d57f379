"""Every model, method and figure of paper 002 (Ji, Li, Fan), and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import System

SYSTEMS = (
    System(
        "car of three degrees of freedom on four motors",
        "eqs 1-9",
        ("vehicles.TwoTrack3DOF", "vehicles.FourMotors", "experiments.federated_ckf.model.Planar"),
    ),
    System("four steer angles", "eqs 1-9", ("vehicles.IndependentSteering",)),
    System(
        "longitudinal force of a motor",
        "eq 10",
        ("experiments.federated_ckf.model", "estimators.speed.METHODS[motor_force]"),
    ),
    System("Dugoff's tyre", "eqs 11-14", ("tyres.Dugoff",)),
    System("cubature filter by singular values", "eqs 24-65", ("filters.Cubature", "filters.SingularValues")),
    System("federated filter: shares, reset, fusion", "eqs 15-23, 66-73", ("filters.Federated",)),
    System("three estimators that exchange results", "fig 2", ("filters.interleave", "estimators.Exchange")),
    System(
        "single extended filter, Sage-Husa, interacting models, dual and triple filters",
        "introduction [4-9]",
        ("filters.Extended", "filters.SageHusa", "filters.InteractingModels", "filters.Dual"),
        "not compared on the paper's drive, which has none of the situations that they are for",
    ),
    System("states and parameters over time", "figs 3, 4", ("experiments.federated_ckf.figures",)),
    System("the printed filters", "4", ("experiments.federated_ckf.printed.as_printed",)),
    System("a sensor with a fault", "4", ("experiments.federated_ckf.drives",)),
)
