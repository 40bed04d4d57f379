"""The printed settings of the paper, and the assumptions of the study where the paper gives none."""

from __future__ import annotations

import dataclasses

CITATION = """@article{massgrade_aukf,
  title   = {Joint estimation of vehicle mass and road grade at small acceleration by an adaptive unscented Kalman filter},
  note    = {Zhejiang University of Technology, Tsinghua University and Changan; published in Chinese, its reference 1 is of 2019}
}"""

TABLE_1 = {3000.0: 5734.0, 3500.0: 5735.0, 4500.0: 5765.0, 5000.0: 5733.0}
"""Truck: first guess of the mass -> the AUKF's estimate, kg, as printed. The printed errors (2.86, 0.41, 1.81, 2.75 %) do
not follow from these masses, whose errors are 0.42, 0.40, 0.12 and 0.43 %."""

COMPARED = {"UKF": 5795.0, "AUKF": 5721.0}
"""Truck from 4000 kg, kg, as printed: both 0.64 % off."""

CAR = {"UKF": 1614.0, "AUKF": 1694.0}
"""Car of 1700 kg from 1300 kg, kg, as printed."""

GRADE_RMSE = {"truck": {"AUKF": 0.38, "UKF": 0.51}, "car": {"AUKF": 0.16, "UKF": 0.29}}
"""Degrees, as printed."""

GATE = 0.6
"""m/s^2 below which reference 8 of the paper stops estimating."""


@dataclasses.dataclass(frozen=True)
class Study:
    """A drive and its sensors. Truth: a car of seven degrees of freedom on a road of random grade.

    `name`: `truck` or `car`; `mass` kg, the truth, and `guesses`, from which filters start; `duration` s, rows every `dt` s,
    `max_step` s of the simulation. `speed` m/s with a standard deviation of `speed_std` over `speed_time` s, after a gentle
    start from `start_speed` (m/s) over `start_time` (s; None: no start). Pedals: coloured noise of `pedals` m/s^2 over
    `pedal_time` s. `grade_std` rad over `grade_length` m, with no wave shorter than `grade_shortest` m. `touches`: how often
    the brake is touched in the first 30 s, with a deceleration of `touch` m/s^2. Sensors: `v_x` m/s, `a_x` m/s^2.
    `grade_rate_walk` (rad/s per sqrt(s)) and `speed_noise` (m/s per sqrt(s)) of the filters: those of the greatest
    likelihood on drives of other keys, within a factor of three, so that the truth is not used.
    """

    name: str = "truck"
    mass: float = 5758.0
    guesses: tuple[float, ...] = (3000.0, 3500.0, 4500.0, 5000.0)
    duration: float = 560.0
    dt: float = 0.05
    max_step: float = 0.005
    speed: float = 62.5 / 3.6
    speed_std: float = 2.5
    speed_time: float = 120.0
    start_speed: float | None = None
    start_time: float = 10.0
    pedals: float = 0.1
    pedal_time: float = 2.0
    grade_std: float = 0.019
    grade_length: float = 600.0
    grade_shortest: float = 300.0
    touches: int = 0
    touch: float = 0.5
    v_x: float = 0.02
    a_x: float = 0.05
    grade_rate_walk: float = 1e-3
    speed_noise: float = 0.002


def truck(**changes) -> Study:
    """The paper's TruckSim drive: 560 s at 40 to 85 km/h, accelerations below 0.4 m/s^2, a grade of 5.5 degrees peak to peak.

    Not printed and chosen here: the driver's pedals, the grade's spectrum, the torque, the sensors' noise.
    """
    return Study(**changes)


def car(**changes) -> Study:
    """The paper's test car: gently to 20 km/h, brake touches in the first 30 s.

    It starts at 1 m/s: towards standstill the wheel spins become ever stiffer, without information about the mass.
    """
    settings = dict(
        name="car", mass=1700.0, guesses=(1300.0,), duration=120.0, max_step=0.0005,
        speed=20.0 / 3.6, speed_std=0.0, start_speed=1.0, pedals=0.05, touches=3,
        grade_std=0.01, grade_length=150.0, grade_shortest=75.0, grade_rate_walk=6e-4,
    )  # fmt: skip
    return Study(**{**settings, **changes})
