"""The sideslip methods of the review (Chen, Gao & Xu 2013), each an `AbstractMethod` that is made from a car's file."""

from __future__ import annotations

from jaxveh import filters
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.estimators.sideslip_methods.four_wheels import roll_3dof, roll_4dof, two_track
from jaxveh.estimators.sideslip_methods.fusion import by_fuzzy_rules, by_switch, pseudo_integration, weighted_mean
from jaxveh.estimators.sideslip_methods.integration import direct_integration, roll_compensated
from jaxveh.estimators.sideslip_methods.kinematic import kinematic_kalman, six_axis
from jaxveh.estimators.sideslip_methods.motors import motor_moment
from jaxveh.estimators.sideslip_methods.network import neural_network
from jaxveh.estimators.sideslip_methods.observers import (
    blind_to_front,
    error_linearising,
    luenberger,
    sliding_mode,
    state_dependent,
)
from jaxveh.estimators.sideslip_methods.recommended import rear_axle
from jaxveh.estimators.sideslip_methods.single_track import linear_kalman, open_loop, single_track_filter
from jaxveh.estimators.sideslip_methods.steady_state import steady_steer, steady_turn
from jaxveh.estimators.sideslip_methods.steering_torque import steering_torque
from jaxveh.estimators.sideslip_methods.stiffness import adapted_stiffness, adaptive
from jaxveh.estimators.sideslip_methods.worst_case import h_infinity

PARTICLES = 100
"""Number of particles of the particle filters: two states need no more."""


def _in_tyres(tyre: str, equation: str) -> MethodOfCar:
    return MethodOfCar(
        single_track_filter(filters.Unscented(), tyre), f"single track on {tyre} axles, unscented filter", equation
    )


METHODS = {
    "rear_axle": MethodOfCar(
        rear_axle,
        "integration corrected by the rear axle's force, as in `live`",
        "sections 1.1, 1.2 and 1.3.1; ours",
        any_steering=True,
    ),
    "open_loop": MethodOfCar(
        open_loop, "linear single track driven by the steer, without correction", "section 1.2.2, [14]"
    ),
    "integration": MethodOfCar(direct_integration, "a_y - v_x r, integrated", "section 1.1, [5]"),
    "kinematic_kalman": MethodOfCar(
        kinematic_kalman, "Kalman filter of v_x and v_y, driven by accelerometers and gyroscope", "section 1.1, [8]"
    ),
    "roll_compensated": MethodOfCar(
        roll_compensated, "integration with the estimated roll angle taken out", "section 1.1.1, [10]"
    ),
    "six_axis": MethodOfCar(
        six_axis, "inertial unit of six axes, corrected by the wheels' speed", "section 1.1.2, [9]"
    ),
    "steady_steer": MethodOfCar(steady_steer, "steady turn of the linear single track, from the steer", "eq 1, [20]"),
    "steady_turn": MethodOfCar(steady_turn, "steady turn, from the yaw rate and a_y", "eq 2, [28]"),
    "linear_kalman": MethodOfCar(linear_kalman, "linear single track, Kalman filter", "section 1.2.2, [17]"),
    "adapted_stiffness": MethodOfCar(
        adapted_stiffness, "linear tyres, both stiffnesses among the filter's states", "section 1.2.2, [7, 29]"
    ),
    "ekf": MethodOfCar(
        single_track_filter(filters.Extended()), "single track on Magic Formulas, extended filter", "eq 3, [31, 67]"
    ),
    "ukf": MethodOfCar(
        single_track_filter(filters.Unscented()), "the same, unscented filter", "section 1.4.5, [68-71]"
    ),
    "pf": MethodOfCar(
        single_track_filter(filters.ParticleFilter(PARTICLES), random=True),
        "the same, particle filter",
        "section 1.4.6, [72-75]",
    ),
    "upf": MethodOfCar(
        single_track_filter(filters.Guided(PARTICLES, rule="unscented"), random=True),
        "the same, with particles drawn given the measurement",
        "section 1.4.6, [76]",
    ),
    "ukf_hsri": _in_tyres("hsri", "eq 4, [2, 25]"),
    "ukf_parabolic": _in_tyres("parabolic", "eq 5, [20]"),
    "ukf_exponential": _in_tyres("exponential", "eq 6, [32]"),
    "ukf_arctangent": _in_tyres("arctangent", "eq 7, [33, 34]"),
    "ukf_unitire": _in_tyres("unitire", "section 1.2.2, [26]"),
    "two_track": MethodOfCar(
        two_track, "four wheels with lateral load transfer, unscented filter", "section 1.2.1, [19]"
    ),
    "roll_3dof": MethodOfCar(roll_3dof, "four wheels and a rolling body, unscented filter", "section 1.2.1, [22]"),
    "roll_4dof": MethodOfCar(
        roll_4dof, "the same, driven by torques, with the speed as a state", "section 1.2.1, [23]"
    ),
    "motor_moment": MethodOfCar(
        motor_moment, "single track with the yaw moment of motors, unscented filter", "eq 10 with its erratum, [34, 83]"
    ),
    "steering_torque": MethodOfCar(
        steering_torque,
        "from the steering torque to aligning moment, front force and slip angle",
        "section 1.2.3, [37, 38]",
    ),
    "switched": MethodOfCar(
        by_switch,
        "integration where the tyre model is not trusted, otherwise the extended filter",
        "section 1.3.1, [40]",
    ),
    "weighted": MethodOfCar(
        weighted_mean,
        "mean of the kinematic and the extended filter, weighted by their variances",
        "section 1.3.1, [41]",
    ),
    "pseudo_integration": MethodOfCar(
        pseudo_integration,
        "slow part of the extended filter's estimate, fast part of the integral",
        "section 1.3.1, [40, 42, 43]",
    ),
    "luenberger": MethodOfCar(luenberger, "observer with the gain of straight running", "section 1.4.2"),
    "state_dependent_gain": MethodOfCar(
        state_dependent, "observer of the yaw rate alone, poles placed at the estimate", "section 1.4.2, [58]"
    ),
    "error_linearising": MethodOfCar(
        error_linearising, "observer whose gains at the estimate make the error linear", "section 1.4.2, [59]"
    ),
    "sliding_mode": MethodOfCar(
        sliding_mode, "observer with most of its gain in a smooth switch", "section 1.4.3, eq 9, [60-62]"
    ),
    "decoupled": MethodOfCar(
        blind_to_front, "observer that no disturbance of the front axle affects", "section 1.4.4, [21, 65]"
    ),
    "h_infinity": MethodOfCar(h_infinity, "single track, filter that bounds the worst case", "section 1.4.4, [66, 67]"),
    "adaptive": MethodOfCar(
        adaptive, "linear tyres, both stiffnesses adapted by a Lyapunov law", "section 1.4.7, [77-79]"
    ),
    "fuzzy": MethodOfCar(
        by_fuzzy_rules, "integration, drawn to the extended filter by fuzzy rules", "section 1.4.7, [80]"
    ),
    "neural_network": MethodOfCar(
        neural_network,
        "a network of present and past measurements, trained on simulated drives of five other cars",
        "section 1.4.7, [56, 81]",
    ),
}

__all__ = ["METHODS"]
