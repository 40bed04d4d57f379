"""Delays of a_y are found where the drive shows them, and nowhere else."""

import warnings

import numpy as np
import pytest
import test_sideslip

from jaxveh import Recording
from jaxveh.diagnostics import kit
from jaxveh.estimators import alignment

CAR, SPEED, STEP = test_sideslip.CAR, 22.0, 0.01


def log_of(turning, rng, late=0.0):
    """A log with this v_x yaw_rate and an a_y that is `late` s late, with the gain of a car that leans, less than proportional
    to the force, on a road whose bank changes slowly."""
    time = STEP * np.arange(len(turning))
    smooth = np.convolve(np.pad(turning, 50, mode="edge"), np.ones(101) / 101, "valid")
    felt = np.interp(time - late, time, smooth)
    bank = rng.normal(scale=0.15) * np.sin(2 * np.pi * (time / rng.uniform(20.0, 60.0) + rng.uniform()))
    a_y = felt * (1.1 - rng.uniform(0.0, 0.02) * np.abs(felt)) + bank + 0.1 * rng.normal(size=len(time))
    yaw_rate = smooth / SPEED + 0.002 * rng.normal(size=len(time))
    return Recording(time, {"v_x": np.full(len(time), SPEED), "a_x": 0.0 * time, "yaw_rate": yaw_rate, "a_y": a_y})


def ramp(rng):
    return 6.0 * np.clip((STEP * np.arange(2500) - 3.0) / rng.uniform(15.0, 20.0), 0.0, 1.0)


def circle(rng):
    return 6.0 * (np.arange(6000) / 6000) ** rng.uniform(1.0, 2.0)


def slalom(rng):
    return rng.uniform(2.0, 5.0) * np.sin(2 * np.pi * rng.uniform(0.3, 0.5) * STEP * np.arange(2500))


def motorway(rng):
    time = STEP * np.arange(6000)
    return sum(0.5 * np.sin(2 * np.pi * (rng.uniform(0.03, 0.2) * time + rng.uniform())) for _ in range(10))


def test_slow_errors_are_no_delays_of_a_ramp_or_a_circle():
    logs = [log_of(drive(rng), rng) for drive in (ramp, circle) for rng in map(np.random.default_rng, range(12))]
    timed = [kit.a_y_delay(log, CAR) for log in logs]
    assert any(one.correlation > alignment.ALIKE and abs(one.seconds) > 0.12 + 3 * one.error for one in timed)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [alignment.a_y_delay(CAR, CAR, [log]) for log in logs] == [0.0] * len(logs)


@pytest.mark.parametrize("late", [0.3, -0.3])
@pytest.mark.parametrize("drive", [slalom, motorway])
def test_delays_of_drives_that_show_them_are_found(drive, late):
    for rng in map(np.random.default_rng, range(6)):
        with pytest.warns(UserWarning, match="a_y comes"):
            assert alignment.a_y_delay(CAR, CAR, [log_of(drive(rng), rng, late)]) == pytest.approx(late, abs=0.1)
