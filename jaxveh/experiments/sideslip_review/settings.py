"""The review's statements, and the assumptions of our drives, sensors and filters."""

from __future__ import annotations

import dataclasses
import math

CITATION = """@article{chen2013sideslip,
  title   = {Review on Vehicle Sideslip Angle Estimation},
  author  = {Chen, Hui and Gao, Bolin and Xu, Fan},
  journal = {Journal of Mechanical Engineering},
  volume  = {49},
  number  = {24},
  pages   = {76},
  year    = {2013},
  doi     = {10.3901/JME.2013.24.076},
  note    = {in Chinese}
}"""

DEGREE = math.pi / 180

YAW_RATE, A_Y, V_X = 0.1 * DEGREE, 0.05, 0.05
"""Noise of the sensors, rad/s, m/s^2, m/s: that of `sensors.production_car`, and of a speed from wheels."""

Levels = tuple[tuple[str, float], ...]

MARKS = {
    "normal driving": (True, True),
    "hard cornering": (True, True),
    "robust to sensor bias": (False, True),
    "stable over a long time": (False, True),
    "robust to a change of friction": (True, False),
    "robust to vehicle parameters": (True, False),
    "shows fast transients": (True, False),
}
"""The review's one table, circles (True) and crosses (False): direct integration, nonlinear dynamic estimation."""

MARKED = ("integration", "EKF")
"""Our estimators for the two columns."""


@dataclasses.dataclass(frozen=True)
class Scenario:
    """The settings of a drive.

    `steer` (rad, standard deviation at the road wheels), `pace` (-): frequency of the steering over the ordinary one;
    `friction` (-) of the road's second half over that of its first; `bank` (rad, standard deviation along the way); `offset`
    and `spread` (-): offsets of the inertial sensors and errors of the car's parameters, as multiples of the ordinary ones.
    """

    steer: float = 0.012
    pace: float = 1.0
    friction: float = 1.0
    bank: float = 0.0
    offset: float = 1.0
    spread: float = 1.0


SCENARIOS = {
    "normal": Scenario(),
    "limit": Scenario(steer=0.05),
    "sensor bias": Scenario(offset=20.0),
    "friction": Scenario(friction=0.3),
    "parameters": Scenario(spread=3.0),
    "transient": Scenario(pace=6.0),
    "bank": Scenario(bank=0.03),
}
"""The review's rows, and banked roads, which are only in its text. Each changes one thing of the first. For a long run the
end of the first is compared with its beginning."""


@dataclasses.dataclass(frozen=True)
class Noise:
    """The noise of the filters' models: process noise in unit per root second, measurement noise in the channel's unit.

    The levels are those of the greatest likelihood on mixed drives, ordinary and at the limit, of other keys than the
    study's, so that the truth is not used; no measurement noise is below the sensor's own. `linear`, `nonlinear`: the single
    tracks; `kinematic`: v_x and v_y driven by the accelerometers; `handling`: the library's model with errors as states.
    """

    linear: Levels = (("sideslip", 0.01), ("yaw_rate", 0.09), ("seen_yaw_rate", YAW_RATE), ("seen_a_y", A_Y))
    nonlinear: Levels = (("v_y", 0.18), ("yaw_rate", 0.043), ("seen_yaw_rate", YAW_RATE), ("seen_a_y", 0.27))
    kinematic: Levels = (("v_x", 0.0076), ("v_y", 0.016), ("seen_v_x", V_X))
    handling: Levels = (
        ("v_y", 0.0014), ("yaw_rate", 1e-4), ("front_error", 0.05), ("rear_error", 0.07), ("a_y_error", 0.006),
        ("seen_yaw_rate", YAW_RATE), ("seen_a_y", A_Y),
    )  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Study:
    """Drives, sensors, filters; none of these numbers is printed in the review.

    Drives: `speed` m/s held by the driver, random steering between `lowest` and `highest` Hz (times the scenario's pace),
    `duration` s, rows every `dt` s, `max_step` s of the simulation. Scored are the beginning, from `warm_up` to `span` s, and
    the end, the last `span` s. The road: banks of `bank_length` m; friction changes after half the way.

    The truth is a car of seven degrees of freedom, the library's electric car with a motor in each wheel. Its tyres are
    Magic Formulas of the shape `C` and `E` with the friction `peak_friction`, scaled by load and friction (Pacejka's
    similarity; stiffest at `stiffest` times the load at rest, `slip_stiffness` times as stiff along as across), which relax
    over `relaxation` m. The true parameters differ from the data sheet by draws (standard deviations, relative): `stiffness`
    of each axle, `grip`, `mass`, `yaw_inertia`; `place` (m): of the centre of gravity. The filters have the data sheet's
    car, on axles of its cornering stiffnesses and otherwise ordinary shape (C 1.3, E -0.5, friction 1, force proportional to
    load). Sensors: noises of `yaw_rate` rad/s, `a_x` and `a_y` m/s^2, `v_x` m/s; their remaining offsets after zeroing at
    standstill, drawn with standard deviations `yaw_rate_offset`, `a_offset`; the steering's offset, `steer_offset` rad.

    Observers: `poles` 1/s; `share` of the sliding observer's gain that is linear, and the `boundary` of its switching in
    rad/s and m/s^2; `pseudo_time` s of the pseudo-integration; `switch_at` m/s^2 of lateral
    acceleration, the end of a tyre's linear range; `particles`.

    Verdicts: an error is good if it is at most `share_limit` of sideslip's own root mean square, or if a disturbance increases it
    at most by the factor `growth_limit`. Both were chosen before the numbers were seen. That fast transients are judged by the
    fast part of the error alone was decided after a first look, in which drift hid the transients.

    Integration has an advantage here: a car without roll, whose accelerometer leans only on banks.
    """

    speed: float = 25.0
    lowest: float = 0.1
    highest: float = 0.5
    duration: float = 60.0
    span: float = 20.0
    dt: float = 0.01
    max_step: float = 0.0025
    warm_up: float = 2.0
    bank_length: float = 150.0
    peak_friction: float = 1.0
    C: float = 1.5
    E: float = -0.2
    stiffest: float = 1.5
    slip_stiffness: float = 1.4
    relaxation: float = 0.4
    stiffness: float = 0.1
    grip: float = 0.05
    mass: float = 0.04
    yaw_inertia: float = 0.05
    place: float = 0.03
    yaw_rate: float = YAW_RATE
    a_x: float = 0.05
    a_y: float = A_Y
    v_x: float = V_X
    yaw_rate_offset: float = 0.01 * DEGREE
    a_offset: float = 0.005
    steer_offset: float = 0.03 * DEGREE
    poles: tuple[float, float] = (-10.0, -12.0)
    share: float = 0.3
    boundary: tuple[float, float] = (0.02, 1.0)
    pseudo_time: float = 1.0
    switch_at: float = 4.0
    share_limit: float = 0.3
    growth_limit: float = 2.0
    particles: int = 100
    noise: Noise = dataclasses.field(default_factory=Noise)
