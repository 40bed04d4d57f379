"""Drives whose answer is known: a car on a linear rear axle that is steered by its yaw rate, and what its sensors would say.

The motion is integrated finely by NumPy, so that a measurement of any instant, and of any point of the car, is exact.
"""

import numpy as np

from jaxveh import Recording, io

G = 9.80665
CAR = io.CarSpecification(
    mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.5, front_cornering_stiffness=1.1e5,
    rear_cornering_stiffness=1.3e5, cg_height=0.55, wheel_radius=0.32, low_pass=1000.0, inertial_delay=0.0, satellite_delay=0.15,
    camera_delay=0.08, antenna_position=(-0.9, 0.3, 0.0),
)  # fmt: skip
"""Its inertial unit is not late, so that what is late is seen."""

STEP, FINE, EARLY = 0.02, 20, 1.0
"""s: of the rows; how many steps of the integration are in one; and how long the drive goes on before the first."""

UNITS = {
    "a_x": "m/s^2", "a_y": "m/s^2", "yaw_rate": "rad/s", "speed": "m/s", "course": "rad", "heading": "rad", "steer": "rad",
    "wheel_speed_rl": "m/s", "wheel_speed_rr": "m/s", "lane_offset": "m", "lane_heading": "rad",
}  # fmt: skip


class Drive:
    """The motion, finely: `t`, `v_x`, `v_y`, `yaw_rate`, `yaw`, `a_x`, `a_y`, `x`, `y`, each an array. `grip`: largest force of
    the rear axle over its load."""

    def __init__(
        self, duration, speed=20.0, stiffness=CAR.rear_cornering_stiffness, turn=0.2, phase=0.0, grip=np.inf, shape=2.5
    ):
        dt = STEP / FINE
        self.t = t = np.arange(-EARLY, duration, dt)
        self.v_x = speed + 2.0 * np.sin(0.4 * t + phase)
        self.yaw_rate = turn * (np.sin(0.5 * t + phase) + 0.6 * np.sin(1.3 * t) + 0.4 * np.cos(0.11 * t))
        turning = np.gradient(self.yaw_rate, t)
        a, b, length = CAR.front_axle_to_cg, CAR.rear_axle_to_cg, CAR.wheelbase
        # The rear axle's force over its mass, less what turns the car: a_y = slope (b r - v_y) / v + swing.
        slope = stiffness * length / (a * CAR.mass)
        swing = CAR.yaw_inertia * turning / (a * CAR.mass)
        # Load moves with a_x, and the stiffness with the load.
        gains = 1.0 + CAR.cg_height * np.gradient(self.v_x, t) / (G * a)
        v_y = np.empty_like(t)
        v_y[0] = b * self.yaw_rate[0]
        for k in range(len(t) - 1):
            linear = slope * (b * self.yaw_rate[k] - v_y[k]) / self.v_x[k]
            bent = linear / (1.0 + abs(linear / (G * grip)) ** shape) ** (1.0 / shape)
            a_y = gains[k] * bent + swing[k]
            v_y[k + 1] = v_y[k] + dt * (a_y - self.v_x[k] * self.yaw_rate[k])
        self.v_y = v_y
        self.a_y = np.gradient(v_y, t) + self.v_x * self.yaw_rate
        self.a_x = np.gradient(self.v_x, t) - v_y * self.yaw_rate
        along = lambda rate: np.concatenate([[0.0], np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]))])
        self.yaw = along(self.yaw_rate) + 0.5
        self.yaw -= np.interp(0.0, t, self.yaw) - 0.5
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        self.x, self.y = along(self.v_x * c - v_y * s), along(self.v_x * s + v_y * c)

    def at(self, name, times):
        """A quantity at any instants."""
        return np.interp(times, self.t, getattr(self, name))

    def rows(self):
        """The instants of the rows."""
        return np.arange(0.0, self.t[-1] - 0.5 * STEP, STEP)

    def channels(self, car=CAR, seed=None, every=10, biases=(0.0, 0.0, 0.0), lean=0.008):
        """What sensors say by name. `every`: rows from fix to fix; `biases` of a_x, a_y (m/s^2) and yaw rate (rad/s); `lean`:
        roll for each m/s^2 (rad s^2/m); with a seed there is the noise that the methods take for usual."""
        t, rng = self.rows(), np.random.default_rng(seed)
        noise = lambda std: 0.0 if seed is None else std * rng.normal(size=t.size)
        then, (ahead, aside, _) = t - car.satellite_delay, car.antenna_position or (0.0, 0.0, 0.0)
        v_x = self.at("v_x", then) - self.at("yaw_rate", then) * aside
        v_y = self.at("v_y", then) + self.at("yaw_rate", then) * ahead
        along, across = np.hypot(v_x, v_y) + noise(0.05), noise(0.05)
        course = self.at("yaw", then) + np.arctan2(v_y, v_x) + np.arctan2(across, along)
        fresh = np.arange(t.size) % every == 0
        fix = lambda values: np.where(fresh, values, np.nan)
        wrapped = lambda angle: (angle + np.pi) % (2.0 * np.pi) - np.pi
        wheels = self.at("v_x", t) + noise(0.02)
        return {
            "a_x": self.at("a_x", t) * (1.0 + G * 0.004) + biases[0] + noise(0.05),
            "a_y": self.at("a_y", t) * (1.0 + G * lean) + biases[1] + noise(0.05),
            "yaw_rate": self.at("yaw_rate", t) + biases[2] + noise(0.0017),
            "speed": fix(np.hypot(along, across)), "course": fix(wrapped(course)),
            "heading": fix(wrapped(self.at("yaw", then) + noise(0.004))),
            "wheel_speed_rl": wheels - 0.75 * self.at("yaw_rate", t), "wheel_speed_rr": wheels + 0.75 * self.at("yaw_rate", t),
        }  # fmt: skip

    def log(self, *left_out, **changed):
        """The channels as a recording."""
        made = {name: value for name, value in self.channels(**changed).items() if name not in left_out}
        return Recording(self.rows(), made, {name: UNITS[name] for name in made})


def silent(log, start, end, *names):
    """The log without these channels between two times (s)."""
    within = (log.time >= start) & (log.time < end)
    return log.replace(**{name: np.where(within, np.nan, np.asarray(log[name])) for name in names})


def rmse(found, expected, rows=slice(None)):
    """Root mean square, angles to a turn's nearest."""
    error = np.asarray(found) - np.asarray(expected)
    return float(np.sqrt(np.mean(np.square(np.atleast_1d((error + np.pi) % (2.0 * np.pi) - np.pi)[rows]))))
