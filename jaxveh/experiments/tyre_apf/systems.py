"""Every model, method, table and figure of tyre-apf (Bao, Sabbioni et al. 2015), and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import system

SYSTEMS = (
    system("importance sampling, weights, mean", "1, eqs 1-5, 7", "filters.ParticleFilter"),
    system("multinomial resampling", "eq 6", "numerics.multinomial"),
    system("auxiliary particle filter, two weightings", "2, eqs 8-11", "filters.AuxiliaryParticleFilter"),
    system(
        "single track with longitudinal forces, earth-fixed",
        "3, eq 12",
        "vehicles.SingleTrack3DOF",
        "experiments.tyre_apf.variants",
    ),
    system("Magic Formula", "eq 13", "tyres.MagicFormula"),
    system("longitudinal force from the torque", "eq 14", "vehicles.AxleDrive", "experiments.tyre_apf.variants"),
    system("slip angles", "eq 15", "vehicles.slip_angle"),
    system("particles drawn by an extended filter", "introduction [5]", "filters.Guided"),
    system(
        "extended filter of tyre parameters, adaptive one",
        "introduction [3, 4]",
        "filters.Extended",
        "filters.SageHusa",
        "experiments.tyre_apf.variants",
    ),
    system("double lane change, step steer, swept sine", "4", "manoeuvres"),
    system("low-pass of 20 Hz", "4", "sensors.low_pass", "experiments.tyre_apf.variants"),
    system("the car", "table 1", "vehicles.passenger_car", "vehicles.passenger_car_as_printed"),
    system("parameters by both filters", "tables 2, 3", "experiments.tyre_apf.tables"),
    system("parameters over time, degeneracy", "figs 6-13", "experiments.tyre_apf.tracks"),
    system("states of the lane change with estimated tyres", "figs 14-16", "experiments.tyre_apf.course_figures"),
    system("forces over slip", "figs 17, 18", "experiments.tyre_apf.figures"),
    system(
        "step steer of 5, 10 and 15 degrees",
        "figs 19-23",
        "experiments.tyre_apf.course_figures",
        "experiments.tyre_apf.settings",
    ),
    system("high order by Runge-Kutta", "conclusion 1", "experiments.tyre_apf.order"),
    system("the paper's claims", "5, 6", "experiments.tyre_apf.claims"),
    system("drives of the real car", "4, 5", lacks="the paper gives no data"),
)
