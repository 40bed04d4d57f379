"""Every model, method, table and figure of model-adaptive-pf (Qin et al. 2014), and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import system

SYSTEMS = (
    system(
        "car of seven degrees of freedom", "1.1, eqs 1-4", "vehicles.SevenDOF", "experiments.model_adaptive_pf.beside"
    ),
    system("slips, wheel speeds", "eqs 5-8", "vehicles.kit", "sensors.WheelSpeeds"),
    system("Fiala's tyre in three forms", "1.2, eqs 9-11", "tyres.FialaPolynomial", "tyres.FialaADAMS", "tyres.Fiala"),
    system("mixture of Cauchy and Gauss", "1.3, eqs 12-14", "statespace.CauchyGaussianMixture"),
    system("noise levels by wavelets", "1.4, eqs 15, 16", "filters.HaarNoise", "filters.HaarParticles"),
    system("particle filter", "2.1, eqs 17-19", "filters.ParticleFilter"),
    system(
        "autoregression instead of dynamics",
        "2.2, eqs 20-25",
        "experiments.model_adaptive_pf.aar.AutoRegressive",
        "experiments.model_adaptive_pf.aar.MatrixAutoRegressive",
    ),
    system("strong tracking filter", "3.1 [11]", "filters.StrongTracking"),
    system(
        "filters of several rates",
        "introduction [5, 6]",
        "statespace.StateSpace",
        lacks="no contestant of its own: with every filter, a channel that is NaN in a row was not measured there",
    ),
    system("dual extended filter, unscented particle filter", "introduction [8, 13]", "filters.Dual", "filters.Guided"),
    system("the numbers", "table 1", "experiments.model_adaptive_pf.Study"),
    system("the course and six states", "figs 3, 4", "experiments.model_adaptive_pf.figures"),
    system(
        "a sandy slope",
        "fig 7",
        "experiments.model_adaptive_pf.drives",
        lacks="the paper gives no data; the road is simulated",
    ),
)
