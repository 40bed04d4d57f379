"""The printed numbers of the paper, and the assumptions of the honest study of it."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

CITATION = """@article{bao2015tyre,
  author  = {Bao, Ruixin and Sabbioni, Edoardo and Yu, Huilong and Zhang, Tao},
  title   = {Vehicle Tire Parameter and State Estimation under Driving Situation Based on Auxiliary Particle Filter Method},
  journal = {Transactions of the Chinese Society for Agricultural Machinery},
  volume  = {46}, number = {4}, pages = {282--288}, year = {2015},
  doi     = {10.6041/j.issn.1000-1298.2015.04.042}
}"""

TABLE_2 = {  # truth -> estimate, as printed
    "rear_D": (5609.0, 5608.0),
    "rear_C": (1.6, 1.596),
    "rear_B": (14.16, 14.13),
    "rear_E": (1.0073, 1.0126),
    "front_D": (7872.0, 7871.0),
    "front_C": (1.6, 1.605),
    "front_B": (6.9986, 6.9851),
    "front_E": (-0.054, -0.052),
}

TABLE_3 = {  # RMSE of the particle filter -> of the auxiliary particle filter, as printed
    "front_D": (40.6, 28.2),
    "front_C": (1.11, 0.41),
    "front_B": (2.41, 1.32),
    "front_E": (0.21, 0.03),
    "rear_D": (20.12, 10.23),
    "rear_C": (0.70, 0.29),
    "rear_B": (1.41, 1.21),
    "rear_E": (0.17, 0.05),
}

STEP_STEER = {10: (0.031, 0.015), 15: (0.052, 0.026)}
"""Degrees of step steer: RMSE of yaw (rad) and yaw rate (rad/s), as printed."""

STEPS = (5, *STEP_STEER)
"""Degrees of step steer; first that of the paper's figures 19 to 23, for which no number is printed."""

STEP_OUTPUTS = {"yaw": "rad", "yaw_rate": "rad/s", "v_y": "m/s", "F_yf": "N", "F_yr": "N"}
"""The outputs of a step steer that are shown, with units."""


def tyres(car):
    """The eight parameters of the paper: B, C, D and E of both axles."""
    return (car.front.B, car.front.C, car.front.D, car.front.E, car.rear.B, car.rear.C, car.rear.D, car.rear.E)


@dataclasses.dataclass(frozen=True)
class StudyNoise:
    """The process noise that a filter's model adds to a drive without any: `v_y` m/s, `yaw_rate` rad/s, `walk` of the
    parameters (relative).

    All per root second. They allow for the filter's approximations: its sigma points, or its finite number of particles.
    """

    v_y: float
    yaw_rate: float
    walk: float


class NoiseLevel(NamedTuple):
    """The sensors' noise, `yaw_rate` (rad/s) and `a_y` (m/s^2), and the process `noise` of both particle filters at this
    level: the one with the largest mean of their log-likelihoods on drives of other seeds (`noise.choose_level`)."""

    yaw_rate: float
    a_y: float
    noise: StudyNoise


LEVELS = (
    NoiseLevel(0.001, 0.02, StudyNoise(v_y=0.05, yaw_rate=0.001, walk=0.1)),
    NoiseLevel(0.005, 0.1, StudyNoise(v_y=0.01, yaw_rate=0.005, walk=0.1)),
    NoiseLevel(0.02, 0.4, StudyNoise(v_y=0.01, yaw_rate=0.002, walk=0.1)),
)
"""From sharp sensors to coarse ones; the middle one is the study's."""

LOOKING_AHEAD = (
    NoiseLevel(0.001, 0.02, StudyNoise(v_y=0.05, yaw_rate=0.001, walk=0.1)),
    NoiseLevel(0.005, 0.1, StudyNoise(v_y=0.02, yaw_rate=0.002, walk=0.1)),
    NoiseLevel(0.02, 0.4, StudyNoise(v_y=0.01, yaw_rate=0.002, walk=0.1)),
)
"""The same levels, with noise chosen for an auxiliary filter that looks ahead with the process noise (`predictive`)."""


@dataclasses.dataclass(frozen=True)
class Study:
    """The honest study: a double lane change, a prior whose mean is not the truth, four estimators side by side.

    `speed` m/s; `steer` rad at the road wheels; `duration` s; `rate` Hz; `yaw_rate_std` rad/s and `a_y_std` m/s^2 the
    sensors' noise; `prior` the relative standard deviation of the parameters (E: times 2, so 0.2); `particles`; `window` s
    of the multiple shooting; `low_pass` Hz of the sensors in the variants that have one. `gaussian`: the noise of UKF and
    MAP, `particle`: that of PF and APF, both chosen by the filters' own likelihood on drives of other seeds
    (`noise.choose`), so that the truth is not used. `saturated`: that of the UKF if both axles pass their peak: almost zero,
    because inputs are linear between rows there and the model is the truth's.
    """

    speed: float = 25.0
    steer: float = math.radians(7.0)
    duration: float = 7.0
    rate: float = 100.0
    yaw_rate_std: float = 0.005
    a_y_std: float = 0.1
    prior: float = 0.1
    particles: int = 1000
    gaussian: StudyNoise = StudyNoise(v_y=0.02, yaw_rate=0.01, walk=0.0)
    particle: StudyNoise = StudyNoise(v_y=0.02, yaw_rate=0.005, walk=0.05)
    saturated: StudyNoise = StudyNoise(v_y=0.0005, yaw_rate=0.0002, walk=0.0)
    window: float = 0.5
    low_pass: float = 20.0
