"""Every model, method, table and figure of paper 001 (Qin et al. 2014), and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import System

SYSTEMS = (
    System(
        "car of seven degrees of freedom", "1.1, eqs 1-4", ("vehicles.SevenDOF", "experiments.model_adaptive_pf.beside")
    ),
    System("slips, wheel speeds", "eqs 5-8", ("vehicles.kit", "sensors.WheelSpeeds")),
    System(
        "Fiala's tyre in three forms", "1.2, eqs 9-11", ("tyres.FialaPolynomial", "tyres.FialaADAMS", "tyres.Fiala")
    ),
    System("mixture of Cauchy and Gauss", "1.3, eqs 12-14", ("statespace.CauchyGaussianMixture",)),
    System("noise levels by wavelets", "1.4, eqs 15, 16", ("filters.HaarNoise", "filters.HaarParticles")),
    System("particle filter", "2.1, eqs 17-19", ("filters.ParticleFilter",)),
    System(
        "autoregression instead of dynamics",
        "2.2, eqs 20-25",
        ("experiments.model_adaptive_pf.aar.AutoRegressive", "experiments.model_adaptive_pf.aar.MatrixAutoRegressive"),
    ),
    System("strong tracking filter", "3.1 [11]", ("filters.StrongTracking",)),
    System(
        "filters of several rates",
        "introduction [5, 6]",
        ("statespace.StateSpace",),
        "no contestant of its own: with every filter, a channel that is NaN in a row was not measured there",
    ),
    System(
        "dual extended filter, unscented particle filter", "introduction [8, 13]", ("filters.Dual", "filters.Guided")
    ),
    System("the numbers", "table 1", ("experiments.model_adaptive_pf.Study",)),
    System("the course and six states", "figs 3, 4", ("experiments.model_adaptive_pf.figures",)),
    System(
        "a sandy slope",
        "fig 7",
        ("experiments.model_adaptive_pf.drives",),
        "the paper gives no data; the road is simulated",
    ),
)
