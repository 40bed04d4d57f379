"""The printed settings of the paper, and the assumptions of the study where the paper gives none."""

from __future__ import annotations

import dataclasses
import math

CITATION = """@article{ji_li_fan_federated_ckf,
  title   = {Joint estimation of states and parameters of a distributed-drive electric car by a federated cubature Kalman filter},
  author  = {Ji, Xiao and Li, Gang and Fan, Dongsheng},
  note    = {Liaoning University of Technology and Jilin University; published in Chinese}
}"""

SPEED, FRICTION, STEP = 20.0 / 3.6, 0.2, 0.02
"""The paper's test: m/s, friction of the road (-), s between rows."""

PARAMETERS = ("friction", "mass", "yaw_inertia", "front_axle_to_cg")
"""The estimated parameters of the car and the road: mu (-), m (kg), I_z (kg m^2), a (m)."""


@dataclasses.dataclass(frozen=True)
class Start:
    """First guesses of mu (-), m (kg), I_z (kg m^2) and a (m)."""

    friction: float
    mass: float
    yaw_inertia: float
    front_axle_to_cg: float


PRINTED_START = Start(1.0, 700.0, 1400.0, 1.0)
"""As printed."""

OTHER_START = Start(0.3, 1050.0, 1500.0, 1.1)
"""Our own: a is off to the other side, all others are nearer to the truth."""

STARTS = {"printed": PRINTED_START, "nearer": OTHER_START}


@dataclasses.dataclass(frozen=True)
class Study:
    """A slalom on a slippery road and its sensors. Truth: a four-motor car of seven degrees of freedom (`vehicles.sets.ev`).

    `duration` s, rows every `dt` s, `max_step` s of the simulation: the wheel spins have a pole of 860 1/s at 20 km/h, and
    explicit steps above 3 ms would ring. `speed` m/s, varied with the standard deviation `speed_std` over `speed_time` s, no
    faster than one swing in `speed_fastest` s. Steer: a sine of amplitude `steer` (rad at the road wheels) and
    `steer_frequency` (Hz), faded in over the first second. `friction`: that of the road; `fading` (s/m): the paper's speed
    influence eps.

    Sensors: white noise of `a_x`, `a_y` (m/s^2) and `yaw_rate` (rad/s), as large as in production units
    (`sensors.production_car`), and `wheel_speed` (rad/s; 6 mm/s at the tread). Steer and motor torques are known. The
    wheels' accelerations (for eq 10) are differences over `rate_time` s; loads follow the measured accelerations with the
    lag of roll and pitch, `load_time` s.

    Fault: the yaw rate is off by `bias` (rad/s) from `fault_at` (s) for `fault_time` (s). Errors count from `settled` (s) on.

    Other roads: `other_friction`, on the right side or before `jump_at` (m), where it becomes `friction`; the slalom in a
    lane has `lane_frequency` (Hz), high enough for the wheels to keep to their sides; `rear_steer`: the rear wheels' angle
    over that of the front ones, where they turn; `friction_walk` (relative, per sqrt(s)): of filters that are told that the
    friction changes.

    Filters: standard deviations of the prior's logarithms, `friction_spread` to `cg_spread`: two of them reach from a dry
    road to an icy one, from an empty car to twice its load, and over a fifth of the position of the centre of gravity. (With
    1.0 for the friction the joint filter loses one drive in 40 before the first turn: points then lie a factor of 14 apart.)
    `speed_noise` (m/s per sqrt(s)), `yaw_noise` (rad/s per sqrt(s)) and `walk` (relative, per sqrt(s); of every parameter):
    those of the greatest likelihood on drives of other keys, within a factor of three, so that the truth is not used.
    `isolate`: largest ratio of the fading mean of a sensor group's NIS to its expected value; `gate`: largest innovation in
    standard deviations.
    """

    duration: float = 30.0
    dt: float = STEP
    max_step: float = 0.002
    speed: float = SPEED
    speed_std: float = 0.3
    speed_time: float = 10.0
    speed_fastest: float = 4.0
    steer: float = math.radians(8.0)
    steer_frequency: float = 0.25
    friction: float = FRICTION
    fading: float = 0.015
    a_x: float = 0.05
    a_y: float = 0.05
    yaw_rate: float = math.radians(0.1)
    wheel_speed: float = 0.02
    rate_time: float = 0.2
    load_time: float = 0.1
    bias: float = 0.05
    fault_at: float = 18.0
    fault_time: float = 6.0
    settled: float = 10.0
    friction_spread: float = 0.8
    mass_spread: float = 0.4
    inertia_spread: float = 0.3
    cg_spread: float = 0.1
    speed_noise: float = 0.001
    yaw_noise: float = 0.001
    walk: float = 3e-4
    isolate: float = 5.0
    gate: float = 5.0
    other_friction: float = 0.3
    jump_at: float = 80.0
    lane_frequency: float = 0.35
    rear_steer: float = -0.3
    friction_walk: float = 0.1
