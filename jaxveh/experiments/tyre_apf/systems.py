"""Every model, method, table and figure of paper 000 (Bao, Sabbioni et al. 2015), and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import System

SYSTEMS = (
    System("importance sampling, weights, mean", "1, eqs 1-5, 7", ("filters.ParticleFilter",)),
    System("multinomial resampling", "eq 6", ("numerics.multinomial",)),
    System("auxiliary particle filter, two weightings", "2, eqs 8-11", ("filters.AuxiliaryParticleFilter",)),
    System(
        "single track with longitudinal forces, earth-fixed",
        "3, eq 12",
        ("vehicles.SingleTrack3DOF", "experiments.tyre_apf.variants"),
    ),
    System("Magic Formula", "eq 13", ("tyres.MagicFormula",)),
    System("longitudinal force from the torque", "eq 14", ("vehicles.AxleDrive", "experiments.tyre_apf.variants")),
    System("slip angles", "eq 15", ("vehicles.slip_angle",)),
    System("particles drawn by an extended filter", "introduction [5]", ("filters.Guided",)),
    System(
        "extended filter of tyre parameters, adaptive one",
        "introduction [3, 4]",
        ("filters.Extended", "filters.SageHusa", "experiments.tyre_apf.variants"),
    ),
    System("double lane change, step steer, swept sine", "4", ("manoeuvres",)),
    System("low-pass of 20 Hz", "4", ("sensors.low_pass", "experiments.tyre_apf.variants")),
    System("the car", "table 1", ("vehicles.passenger_car", "vehicles.passenger_car_as_printed")),
    System("parameters by both filters", "tables 2, 3", ("experiments.tyre_apf.tables",)),
    System("parameters over time, degeneracy", "figs 6-13", ("experiments.tyre_apf.tracks",)),
    System("states of the lane change with estimated tyres", "figs 14-16", ("experiments.tyre_apf.course_figures",)),
    System("forces over slip", "figs 17, 18", ("experiments.tyre_apf.figures",)),
    System(
        "step steer of 5, 10 and 15 degrees",
        "figs 19-23",
        ("experiments.tyre_apf.course_figures", "experiments.tyre_apf.settings"),
    ),
    System("high order by Runge-Kutta", "conclusion 1", ("experiments.tyre_apf.order",)),
    System("the paper's claims", "5, 6", ("experiments.tyre_apf.claims",)),
    System("drives of the real car", "4, 5", (), "the paper gives no data"),
)
