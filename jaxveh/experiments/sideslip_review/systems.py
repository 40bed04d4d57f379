"""Every method, equation, table and claim of the review (Chen, Gao & Xu 2013), and its place in this package."""

from __future__ import annotations

from jaxveh.experiments.systems import system, ways

LATERAL = (
    system("optical sensor", "1 [4]", "sensors.OpticalSideslip"),
    system("direct integration", "1.1 [5-7]", *ways("sideslip", "integration")),
    system("kinematic Kalman filter", "1.1 [8]", *ways("sideslip", "kinematic_kalman")),
    system("roll estimated, then integration", "1.1.1 [10]", *ways("sideslip", "roll_compensated")),
    system("inertial unit of six axes with the wheels' speed", "1.1.2 [9]", *ways("sideslip", "six_axis")),
    system(
        "tyres and hubs that measure forces",
        "1.2 [11-13]",
        lacks="no device: an axle's or a wheel's force is an output of every car (`F_yf`, `F_y_fl`), and a channel of that name "
        "can be observed; the errors of such a hub are in none of the five papers",
    ),
    system("single track", "1.2.1 [16-18]", "vehicles.SingleTrack", *ways("sideslip", "linear_kalman", "ekf")),
    system("two tracks, two degrees of freedom", "1.2.1 [19]", "vehicles.TwoTrack2DOF", *ways("sideslip", "two_track")),
    system(
        "three degrees of freedom with the speed",
        "1.2.1 [20, 21]",
        "vehicles.TwoTrack3DOF",
        "experiments.model_adaptive_pf",
    ),
    system("three degrees of freedom with roll", "1.2.1 [22]", "vehicles.Roll3DOF", *ways("sideslip", "roll_3dof")),
    system("four degrees of freedom", "1.2.1 [23]", "vehicles.Roll4DOF", *ways("sideslip", "roll_4dof")),
    system("linear tyre", "1.2.2", "tyres.Linear", *ways("sideslip", "linear_kalman")),
    system("Magic Formula", "eq 3", "tyres.MagicFormula", *ways("sideslip", "ukf")),
    system("HSRI", "eq 4", "tyres.HSRI", *ways("sideslip", "ukf_hsri")),
    system("parabolic", "eq 5", "tyres.Parabolic", *ways("sideslip", "ukf_parabolic")),
    system("exponential", "eq 6", "tyres.Exponential", *ways("sideslip", "ukf_exponential")),
    system("arctangent", "eq 7", "tyres.Arctangent", *ways("sideslip", "ukf_arctangent")),
    system("UniTire", "1.2.2 [26]", "tyres.UniTire", *ways("sideslip", "ukf_unitire")),
    system("linear tyre with adapted stiffness", "1.2.2 [7, 29]", *ways("sideslip", "adapted_stiffness", "adaptive")),
    system("steady turn, from steer", "eq 1", *ways("sideslip", "steady_steer")),
    system("steady turn, from yaw rate and a_y", "eq 2", *ways("sideslip", "steady_turn")),
    system(
        "tyre forces as states that walk",
        "1.2.2 [30]",
        "experiments.sideslip_review.handling.Handling",
        lacks="friction is not estimated with them; `estimators.friction` does that with a tyre curve",
    ),
    system("aligning torque to front force to slip angle", "1.2.3 [37, 38]", *ways("sideslip", "steering_torque")),
    system("switch", "1.3.1 [40]", *ways("sideslip", "switched")),
    system("weighted by covariances", "1.3.1 [41]", *ways("sideslip", "weighted")),
    system("pseudo-integration", "1.3.1 [40, 42, 43]", *ways("sideslip", "pseudo_integration")),
    system(
        "satellites and inertial unit, with biases",
        "1.3.2 [44, 45, 48-50]",
        *ways("navigation", "kinematic", "six_axes", "two_antennas"),
    ),
    system("satellites and a car's dynamics", "1.3.2 [46, 47]", *ways("navigation", "adapted_stiffness", "rear_axle")),
    system("satellites' course, at several rates", "1.3.2 [51]", *ways("navigation", "multi_rate")),
    system(
        "satellites with a reference station",
        "1.3.2 [52, 53]",
        "sensors.GNSS",
        lacks="no carrier phases: `sensors.GNSS` with a noise of a centimetre replaces their solution",
    ),
    system(
        "camera and dynamics, at several rates", "1.3.3 [54, 55]", "sensors.LaneCamera", *ways("navigation", "camera")
    ),
    system("motors' yaw moment on a single track", "1.5, eq 10 [34, 83]", *ways("sideslip", "motor_moment")),
)

OBSERVERS = (
    system(
        "Kalman filter",
        "1.4.1 [17, 57]",
        "filters.Kalman",
        *ways("sideslip", "linear_kalman"),
        lacks="the tyre pressure of [57]: no pressure enters a single track",
    ),
    system("Luenberger observer", "1.4.2", "observers.Luenberger", *ways("sideslip", "luenberger")),
    system(
        "extended Luenberger observer, gain from the state", "1.4.2 [58]", *ways("sideslip", "state_dependent_gain")
    ),
    system("observer with a linear error", "1.4.2 [59]", *ways("sideslip", "error_linearising")),
    system(
        "sliding mode, smooth as in eq 9",
        "1.4.3, eq 9 [60-62]",
        "observers.SlidingMode",
        *ways("sideslip", "sliding_mode"),
    ),
    system("gain that is insensitive to a disturbance", "1.4.4 [21, 65]", *ways("sideslip", "decoupled")),
    system("H-infinity", "1.4.4 [66, 67]", "filters.HInfinity", *ways("sideslip", "h_infinity")),
    system("unscented filter", "1.4.5 [68-71]", "filters.Unscented", *ways("sideslip", "ukf")),
    system(
        "particle filters, plain and unscented",
        "1.4.6 [72-76]",
        "filters.ParticleFilter",
        "filters.Guided",
        *ways("sideslip", "pf", "upf"),
    ),
    system("gains by Lyapunov's function", "1.4.7 [77-79]", "observers.Adaptive", *ways("sideslip", "adaptive")),
    system("fuzzy rules", "1.4.7 [80]", *ways("sideslip", "fuzzy")),
    system(
        "neural network",
        "1.4.7 [56, 81]",
        *ways("sideslip", "neural_network"),
        "experiments.sideslip_review.network_training",
    ),
    system(
        "disturbance observer, extended state", "1.4", "observers.extended_state", *ways("bank", "disturbance_observer")
    ),
)

SPEED = (
    system(
        "fastest and slowest wheel, slope, both",
        "2.1 [86]",
        *ways("speed", "fastest_wheel", "slowest_wheel", "slope_limited", "combined"),
    ),
    system("adaptive nonlinear filter under ABS", "2.1 [19, 87]", *ways("speed", "adaptive_nonlinear")),
    system("integral of a_x, its offset from the wheels", "2.1 [88, 89]", *ways("speed", "accelerometer")),
    system("wheels and accelerometer, weighted", "2.1 [90-92]", *ways("speed", "weighted")),
    system("fuzzy rules", "2.1 [93]", *ways("speed", "fuzzy")),
    system("force from the brakes' pressure", "2.2, eq 11 [2, 94, 95]", *ways("speed", "brake_force")),
    system("force from the motors' torque", "2.3, eq 12 [34, 83, 96]", *ways("speed", "motor_force")),
    system("speed among the states of a car", "2.2", "vehicles.TwoTrack3DOF", *ways("sideslip", "roll_4dof")),
)

PARAMETERS = (
    system(
        "recursive least squares, one and several factors",
        "3.1.1 [33, 120, 121, 127]",
        "observers.RecursiveLeastSquares",
    ),
    system("states and parameters in one filter", "3.1.1.1 [79, 97-100]", "statespace.with_parameters"),
    system(
        "dual filter",
        "3.1.1.2 [102-104]",
        "filters.Dual",
        lacks="the list of 103 states is not formed: it is in none of the texts",
    ),
    system("parameters of a tyre by a filter", "3.1.1 [129-132]", "statespace.with_parameters", "experiments.tyre_apf"),
    system("filters that exchange results", "3.1.1.2", "filters.interleave", "estimators.Exchange"),
    system(
        "road ahead of the wheel; sound and strain of the tread",
        "3.1.2.1.1 [107-111]",
        lacks="sensors on the road or in the tyre, whose signals no vehicle model has",
    ),
    system("friction by slip slope", "3.1.2.1 [112-116]", *ways("friction", "slip_slope")),
    system("friction by a lateral tyre curve", "3.1.2.1", *ways("friction", "lateral_curve", "bank")),
    system("friction by the aligning torque", "3.1.2.1", *ways("friction", "aligning_torque")),
    system(
        "friction by an adaptive observer of the wheels", "3.1.2.1.3, eq 14 [118]", *ways("friction", "wheel_observer")
    ),
    system("LuGre observer", "3.1.2.1.3 [119]", "tyres.LuGre", *ways("friction", "lugre")),
    system("friction as a constant state", "3.1.2.1.4 [79, 99, 100, 103]", *ways("friction", "augmented")),
    system("observer and nonlinear least squares", "3.1.1.1, fig 3 [101]", *ways("friction", "hybrid")),
    system(
        "used friction over slip, its slope",
        "3.2, eqs 18, 19, fig 6 [3, 136-138]",
        *ways("friction", "reconstruction", "sides_apart"),
    ),
    system("cornering stiffness by least squares", "3.1.2.2, eq 15 [120]", *ways("stiffness", "axle_forces")),
    system("cornering stiffness by derivatives", "3.1.2.2, eq 16 [122]", *ways("stiffness", "derivatives")),
    system("cornering stiffness with satellites", "3.1.2.2 [46, 47]", *ways("stiffness", "weighed", "walking")),
    system("bank by a disturbance observer", "3.1.2.3 [125]", *ways("bank", "disturbance_observer")),
    system("bank as an unknown input", "3.1.2.3 [126]", *ways("bank", "unknown_input")),
    system("bank by Tseng's rule", "3.1.2.3 [123]", *ways("bank", "tseng")),
    system("grade by a filter", "3.1.2.3 [124, 127]", *ways("grade", "kinematic", "filter", "joint")),
    system("grade from satellites", "3.1.2.3 [128]", *ways("grade", "satellite", "climb")),
    system("roll", "1.1", *ways("roll", "gyro", "steady", "springs", "six_axis", "filter")),
    system("position of the centre of gravity", "3.1.2.4, eq 17 [133]", *ways("geometry", "learner")),
    system("mass", "3.1.2.4 [129-135]", *ways("mass", "gated", "forgetting", "filter")),
    system("yaw inertia, steering", "3.1.2.4", *ways("geometry", "learner")),
)

CLAIMS = (
    system("the table of seven rows", "table 1", "experiments.sideslip_review.verdicts.ROWS"),
    system(
        "equations 1, 2, 4, 5, 15, 17 as printed and corrected",
        "1 to 3",
        "experiments.sideslip_review.printed.equations",
    ),
    system("figures 1, 2, 4, 5", "1 to 3", lacks="drawings of terms, with nothing to compute"),
    system("every method in every setting", "1 to 3", "experiments.sideslip_review.chapters.race_methods"),
    system("the four conclusions", "4", "experiments.sideslip_review.chapters.CONCLUSIONS"),
    system(
        "networks inside a filter, which the review does not have",
        "",
        "estimators.learned.ResidualTyre",
        "experiments.sideslip_review.hybrid",
    ),
)

SYSTEMS = (*LATERAL, *OBSERVERS, *SPEED, *PARAMETERS, *CLAIMS)
