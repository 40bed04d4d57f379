"""Every method, equation, table and claim of the review (Chen, Gao & Xu 2013), and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import System


def _ways(quantity: str, *methods: str) -> tuple[str, ...]:
    return tuple(f"estimators.{quantity}.METHODS[{name}]" for name in methods)


LATERAL = (
    System("optical sensor", "1 [4]", ("sensors.OpticalSideslip",)),
    System("direct integration", "1.1 [5-7]", _ways("sideslip", "integration")),
    System("kinematic Kalman filter", "1.1 [8]", _ways("sideslip", "kinematic_kalman")),
    System("roll estimated, then integration", "1.1.1 [10]", _ways("sideslip", "roll_compensated")),
    System("inertial unit of six axes with the wheels' speed", "1.1.2 [9]", _ways("sideslip", "six_axis")),
    System(
        "tyres and hubs that measure forces",
        "1.2 [11-13]",
        (),
        "no device: an axle's or a wheel's force is an output of every car (`F_yf`, `F_y_fl`), and a channel of that name can be "
        "observed; the errors of such a hub are in none of the five papers",
    ),
    System("single track", "1.2.1 [16-18]", ("vehicles.SingleTrack", *_ways("sideslip", "linear_kalman", "ekf"))),
    System(
        "two tracks, two degrees of freedom", "1.2.1 [19]", ("vehicles.TwoTrack2DOF", *_ways("sideslip", "two_track"))
    ),
    System(
        "three degrees of freedom with the speed",
        "1.2.1 [20, 21]",
        ("vehicles.TwoTrack3DOF", "experiments.model_adaptive_pf"),
    ),
    System("three degrees of freedom with roll", "1.2.1 [22]", ("vehicles.Roll3DOF", *_ways("sideslip", "roll_3dof"))),
    System("four degrees of freedom", "1.2.1 [23]", ("vehicles.Roll4DOF", *_ways("sideslip", "roll_4dof"))),
    System("linear tyre", "1.2.2", ("tyres.Linear", *_ways("sideslip", "linear_kalman"))),
    System("Magic Formula", "eq 3", ("tyres.MagicFormula", *_ways("sideslip", "ukf"))),
    System("HSRI", "eq 4", ("tyres.HSRI", *_ways("sideslip", "ukf_hsri"))),
    System("parabolic", "eq 5", ("tyres.Parabolic", *_ways("sideslip", "ukf_parabolic"))),
    System("exponential", "eq 6", ("tyres.Exponential", *_ways("sideslip", "ukf_exponential"))),
    System("arctangent", "eq 7", ("tyres.Arctangent", *_ways("sideslip", "ukf_arctangent"))),
    System("UniTire", "1.2.2 [26]", ("tyres.UniTire", *_ways("sideslip", "ukf_unitire"))),
    System("linear tyre with adapted stiffness", "1.2.2 [7, 29]", _ways("sideslip", "adapted_stiffness", "adaptive")),
    System("steady turn, from steer", "eq 1", _ways("sideslip", "steady_steer")),
    System("steady turn, from yaw rate and a_y", "eq 2", _ways("sideslip", "steady_turn")),
    System(
        "tyre forces as states that walk",
        "1.2.2 [30]",
        ("experiments.sideslip_review.handling.Handling",),
        "friction is not estimated with them; `estimators.friction` does that with a tyre curve",
    ),
    System("aligning torque to front force to slip angle", "1.2.3 [37, 38]", _ways("sideslip", "steering_torque")),
    System("switch", "1.3.1 [40]", _ways("sideslip", "switched")),
    System("weighted by covariances", "1.3.1 [41]", _ways("sideslip", "weighted")),
    System("pseudo-integration", "1.3.1 [40, 42, 43]", _ways("sideslip", "pseudo_integration")),
    System(
        "satellites and inertial unit, with biases",
        "1.3.2 [44, 45, 48-50]",
        _ways("navigation", "kinematic", "six_axes", "two_antennas"),
    ),
    System("satellites and a car's dynamics", "1.3.2 [46, 47]", _ways("navigation", "adapted_stiffness", "rear_axle")),
    System("satellites' course, at several rates", "1.3.2 [51]", _ways("navigation", "multi_rate")),
    System(
        "satellites with a reference station",
        "1.3.2 [52, 53]",
        ("sensors.GNSS",),
        "no carrier phases: `sensors.GNSS` with a noise of a centimetre replaces their solution",
    ),
    System(
        "camera and dynamics, at several rates",
        "1.3.3 [54, 55]",
        ("sensors.LaneCamera", *_ways("navigation", "camera")),
    ),
    System("motors' yaw moment on a single track", "1.5, eq 10 [34, 83]", _ways("sideslip", "motor_moment")),
)

OBSERVERS = (
    System(
        "Kalman filter",
        "1.4.1 [17, 57]",
        ("filters.Kalman", *_ways("sideslip", "linear_kalman")),
        "the tyre pressure of [57]: no pressure enters a single track",
    ),
    System("Luenberger observer", "1.4.2", ("observers.Luenberger", *_ways("sideslip", "luenberger"))),
    System(
        "extended Luenberger observer, gain from the state", "1.4.2 [58]", _ways("sideslip", "state_dependent_gain")
    ),
    System("observer with a linear error", "1.4.2 [59]", _ways("sideslip", "error_linearising")),
    System(
        "sliding mode, smooth as in eq 9",
        "1.4.3, eq 9 [60-62]",
        ("observers.SlidingMode", *_ways("sideslip", "sliding_mode")),
    ),
    System("gain that is insensitive to a disturbance", "1.4.4 [21, 65]", _ways("sideslip", "decoupled")),
    System("H-infinity", "1.4.4 [66, 67]", ("filters.HInfinity", *_ways("sideslip", "h_infinity"))),
    System("unscented filter", "1.4.5 [68-71]", ("filters.Unscented", *_ways("sideslip", "ukf"))),
    System(
        "particle filters, plain and unscented",
        "1.4.6 [72-76]",
        ("filters.ParticleFilter", "filters.Guided", *_ways("sideslip", "pf", "upf")),
    ),
    System("gains by Lyapunov's function", "1.4.7 [77-79]", ("observers.Adaptive", *_ways("sideslip", "adaptive"))),
    System("fuzzy rules", "1.4.7 [80]", _ways("sideslip", "fuzzy")),
    System(
        "neural network",
        "1.4.7 [56, 81]",
        (*_ways("sideslip", "neural_network"), "experiments.sideslip_review.network_training"),
    ),
    System(
        "disturbance observer, extended state",
        "1.4",
        ("observers.extended_state", *_ways("bank", "disturbance_observer")),
    ),
)

SPEED = (
    System(
        "fastest and slowest wheel, slope, both",
        "2.1 [86]",
        _ways("speed", "fastest_wheel", "slowest_wheel", "slope_limited", "combined"),
    ),
    System("adaptive nonlinear filter under ABS", "2.1 [19, 87]", _ways("speed", "adaptive_nonlinear")),
    System("integral of a_x, its offset from the wheels", "2.1 [88, 89]", _ways("speed", "accelerometer")),
    System("wheels and accelerometer, weighted", "2.1 [90-92]", _ways("speed", "weighted")),
    System("fuzzy rules", "2.1 [93]", _ways("speed", "fuzzy")),
    System("force from the brakes' pressure", "2.2, eq 11 [2, 94, 95]", _ways("speed", "brake_force")),
    System("force from the motors' torque", "2.3, eq 12 [34, 83, 96]", _ways("speed", "motor_force")),
    System("speed among the states of a car", "2.2", ("vehicles.TwoTrack3DOF", *_ways("sideslip", "roll_4dof"))),
)

PARAMETERS = (
    System(
        "recursive least squares, one and several factors",
        "3.1.1 [33, 120, 121, 127]",
        ("observers.RecursiveLeastSquares",),
    ),
    System("states and parameters in one filter", "3.1.1.1 [79, 97-100]", ("statespace.with_parameters",)),
    System(
        "dual filter",
        "3.1.1.2 [102-104]",
        ("filters.Dual",),
        "the list of 103 states is not formed: it is in none of the texts",
    ),
    System(
        "parameters of a tyre by a filter", "3.1.1 [129-132]", ("statespace.with_parameters", "experiments.tyre_apf")
    ),
    System("filters that exchange results", "3.1.1.2", ("filters.interleave", "estimators.Exchange")),
    System(
        "road ahead of the wheel; sound and strain of the tread",
        "3.1.2.1.1 [107-111]",
        (),
        "sensors on the road or in the tyre, whose signals no vehicle model has",
    ),
    System("friction by slip slope", "3.1.2.1 [112-116]", _ways("friction", "slip_slope")),
    System("friction by a lateral tyre curve", "3.1.2.1", _ways("friction", "lateral_curve", "bank")),
    System("friction by the aligning torque", "3.1.2.1", _ways("friction", "aligning_torque")),
    System(
        "friction by an adaptive observer of the wheels", "3.1.2.1.3, eq 14 [118]", _ways("friction", "wheel_observer")
    ),
    System("LuGre observer", "3.1.2.1.3 [119]", ("tyres.LuGre", *_ways("friction", "lugre"))),
    System("friction as a constant state", "3.1.2.1.4 [79, 99, 100, 103]", _ways("friction", "augmented")),
    System("observer and nonlinear least squares", "3.1.1.1, fig 3 [101]", _ways("friction", "hybrid")),
    System(
        "used friction over slip, its slope",
        "3.2, eqs 18, 19, fig 6 [3, 136-138]",
        _ways("friction", "reconstruction", "sides_apart"),
    ),
    System("cornering stiffness by least squares", "3.1.2.2, eq 15 [120]", _ways("stiffness", "axle_forces")),
    System("cornering stiffness by derivatives", "3.1.2.2, eq 16 [122]", _ways("stiffness", "derivatives")),
    System("cornering stiffness with satellites", "3.1.2.2 [46, 47]", _ways("stiffness", "walking")),
    System("bank by a disturbance observer", "3.1.2.3 [125]", _ways("bank", "disturbance_observer")),
    System("bank as an unknown input", "3.1.2.3 [126]", _ways("bank", "unknown_input")),
    System("bank by Tseng's rule", "3.1.2.3 [123]", _ways("bank", "tseng")),
    System("grade by a filter", "3.1.2.3 [124, 127]", _ways("grade", "kinematic", "filter", "joint")),
    System("grade from satellites", "3.1.2.3 [128]", _ways("grade", "satellite", "climb")),
    System("roll", "1.1", _ways("roll", "gyro", "steady", "springs", "six_axis", "filter")),
    System("position of the centre of gravity", "3.1.2.4, eq 17 [133]", _ways("geometry", "learner")),
    System("mass", "3.1.2.4 [129-135]", _ways("mass", "gated", "forgetting", "filter")),
    System("yaw inertia, steering", "3.1.2.4", _ways("geometry", "learner")),
)

CLAIMS = (
    System("the table of seven rows", "table 1", ("experiments.sideslip_review.verdicts.ROWS",)),
    System(
        "equations 1, 2, 4, 5, 15, 17 as printed and corrected",
        "1 to 3",
        ("experiments.sideslip_review.printed.equations",),
    ),
    System("figures 1, 2, 4, 5", "1 to 3", (), "drawings of terms, with nothing to compute"),
    System("every method in every setting", "1 to 3", ("experiments.sideslip_review.chapters.race_methods",)),
    System("the four conclusions", "4", ("experiments.sideslip_review.chapters.CONCLUSIONS",)),
    System(
        "networks inside a filter, which the review does not have",
        "",
        ("estimators.learned.ResidualTyre", "experiments.sideslip_review.hybrid"),
    ),
)

SYSTEMS = (*LATERAL, *OBSERVERS, *SPEED, *PARAMETERS, *CLAIMS)
