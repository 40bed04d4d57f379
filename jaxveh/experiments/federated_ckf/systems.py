"""Every model, method and figure of federated-ckf (Ji, Li, Fan), and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import system

SYSTEMS = (
    system(
        "car of three degrees of freedom on four motors",
        "eqs 1-9",
        "vehicles.TwoTrack3DOF",
        "vehicles.FourMotors",
        "experiments.federated_ckf.model.Planar",
    ),
    system("four steer angles", "eqs 1-9", "vehicles.IndependentSteering"),
    system(
        "longitudinal force of a motor",
        "eq 10",
        "experiments.federated_ckf.model",
        "estimators.speed.METHODS[motor_force]",
    ),
    system("Dugoff's tyre", "eqs 11-14", "tyres.Dugoff"),
    system("cubature filter by singular values", "eqs 24-65", "filters.Cubature", "filters.SingularValues"),
    system("federated filter: shares, reset, fusion", "eqs 15-23, 66-73", "filters.Federated"),
    system("three estimators that exchange results", "fig 2", "filters.interleave", "estimators.Exchange"),
    system(
        "single extended filter, Sage-Husa, interacting models, dual and triple filters",
        "introduction [4-9]",
        "filters.Extended",
        "filters.SageHusa",
        "filters.InteractingModels",
        "filters.Dual",
        lacks="not compared on the paper's drive, which has none of the situations that they are for",
    ),
    system("states and parameters over time", "figs 3, 4", "experiments.federated_ckf.figures"),
    system("the printed filters", "4", "experiments.federated_ckf.printed.as_printed"),
    system("a sensor with a fault", "4", "experiments.federated_ckf.drives"),
)
