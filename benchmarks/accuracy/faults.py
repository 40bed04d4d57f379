"""Nine faults of a log, each added to a sound log."""

from __future__ import annotations

import numpy as np

from jaxveh import Recording

BEGIN = 0.4
"""The share of the log after which the fault begins."""


def _at(log: Recording) -> int:
    return int(BEGIN * len(log))


def _rows(log: Recording, seconds: float) -> int:
    return max(1, round(seconds / float(np.median(np.diff(np.asarray(log.time))))))


def _changed(log: Recording, name: str, change) -> Recording:
    if name not in log:
        return log
    values = np.array(log[name], float)
    change(values)
    return log.replace(**{name: values})


def spike(log: Recording) -> Recording:
    """The accelerometer and the gyroscope each have an absurd value for one row, once every 7 s."""

    def a_y(values):
        values[_at(log) :: _rows(log, 7.0)] = 90.0

    def yaw_rate(values):
        values[_at(log) + 3 :: _rows(log, 7.0)] = -9.0

    return _changed(_changed(log, "a_y", a_y), "yaw_rate", yaw_rate)


def stuck(log: Recording) -> Recording:
    """The accelerometer repeats one value for 6 s."""

    def hold(values):
        first = _at(log)
        values[first : first + _rows(log, 6.0)] = values[first]

    return _changed(log, "a_y" if "a_y" in log else "yaw_rate", hold)


def jump(log: Recording) -> Recording:
    """The clock jumps by 120 s."""
    time = np.array(log.time, float)
    time[_at(log) :] += 120.0
    return Recording(time, {name: np.asarray(log[name]) for name in log.names})


def gap(log: Recording) -> Recording:
    """Yaw rate and accelerations are missing for 3 s."""

    def lose(values):
        values[_at(log) : _at(log) + _rows(log, 3.0)] = np.nan

    for name in ("yaw_rate", "a_y", "a_x"):
        log = _changed(log, name, lose)
    return log


def kilometres(log: Recording) -> Recording:
    """The speed is in km/h, without a unit."""
    return log.replace(v_x=3.6 * np.asarray(log["v_x"]))


def degrees(log: Recording) -> Recording:
    """The yaw rate is in deg/s, without a unit."""
    return log.replace(yaw_rate=np.degrees(np.asarray(log["yaw_rate"])))


def steer_sign(log: Recording) -> Recording:
    """Steer is positive to the right."""
    return log.replace(steer=-np.asarray(log["steer"]))


def a_y_sign(log: Recording) -> Recording:
    """The lateral acceleration is positive to the right."""
    return log.replace(a_y=-np.asarray(log["a_y"])) if "a_y" in log else log


def delay(log: Recording) -> Recording:
    """The lateral acceleration is 200 ms late."""

    def late(values):
        count = _rows(log, 0.2)
        values[:] = np.concatenate([np.full(count, values[0]), values[:-count]])

    return _changed(log, "a_y", late)


FAULTS = {
    "spike": spike, "stuck": stuck, "jump": jump, "gap": gap, "km/h": kilometres, "degrees": degrees, "sign of steer": steer_sign,
    "sign of a_y": a_y_sign, "delay": delay,
}  # fmt: skip
"""The faults by name."""
