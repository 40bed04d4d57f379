"""Sideslip from logs: cleaning, a car with known parameters, the real log."""

import dataclasses
import functools

import numpy as np
import pytest
from shared_data import shared

from jaxveh import InputError, Recording, estimators, io, vehicles

CAR = io.CarSpecification(
    mass=1420.0, yaw_inertia=2124.0, front_axle_to_cg=0.96, rear_axle_to_cg=1.59,
    front_cornering_stiffness=88000.0, rear_cornering_stiffness=127000.0, cg_height=0.5,
)  # fmt: skip


ROWS = 3000


def log(rows=ROWS):
    """The first rows of a drive on a winding road."""
    return drive().rows(slice(0, rows))


@functools.cache
def drive():
    """A car on a winding road that follows the linear single track at modest lateral acceleration, 100 Hz."""
    rows, rng = ROWS, np.random.default_rng(0)
    time = np.arange(rows) * 0.01
    steer = 0.02 * np.sin(2 * np.pi * 0.4 * time) + 0.01 * np.sin(2 * np.pi * 0.17 * time + 1.0)
    v_x = np.full(rows, 20.0)
    recording = Recording(time, {"steer": steer, "v_x": v_x})
    truth = estimators.open_loop(vehicles.from_specification(CAR), recording)
    yaw_rate, v_y = truth["yaw_rate"], truth["v_y"]
    a_y = np.gradient(v_y, time) + v_x * yaw_rate
    return recording.replace(
        a_x=np.zeros(rows), v_y=v_y,
        yaw_rate=yaw_rate + 0.002 * rng.standard_normal(rows), a_y=a_y + 0.1 * rng.standard_normal(rows),
    )  # fmt: skip


def test_clean_holds_spikes_and_drops_repeats_and_looks_back_only():
    recording = log(500)
    steer, yaw_rate, a_y = (np.array(recording[name]) for name in ("steer", "yaw_rate", "a_y"))
    steer[200] += 0.5
    yaw_rate[301], a_y[301] = yaw_rate[300], a_y[300]
    a_y[401] = a_y[400]
    cleaned = estimators.clean(recording.replace(steer=steer, yaw_rate=yaw_rate, a_y=a_y))
    assert float(cleaned["steer"][200]) == steer[199]
    assert float(cleaned["steer"][201]) == steer[201]
    assert np.flatnonzero(np.isnan(np.asarray(cleaned["yaw_rate"]))).tolist() == [301]
    assert np.isfinite(float(cleaned["a_y"][401]))
    longer = estimators.clean(recording)
    shorter = estimators.clean(recording.rows(slice(0, 100)))
    for name in ("steer", "a_x", "yaw_rate", "a_y"):
        np.testing.assert_array_equal(np.asarray(longer[name])[:100], np.asarray(shorter[name]))


def test_a_step_of_steer_is_not_held_for_ever():
    recording = log(100)
    steer = np.where(np.arange(100) < 50, 0.0, 0.2)
    cleaned = np.asarray(estimators.clean(recording.replace(steer=steer))["steer"])
    assert cleaned[50] == 0.0
    assert cleaned[-1] == 0.2


def test_missing_channels_and_gaps_are_named():
    with pytest.raises(InputError, match="a_y"):
        estimators.clean(log(100).without("a_y"))
    with pytest.raises(InputError, match=r"steer is NaN in 1 rows.*fill"):
        estimators.clean(log(100).replace(steer=np.append(np.zeros(99), np.nan)))


def test_a_short_span_and_an_unknown_reference_are_refused():
    with pytest.raises(InputError, match="at least 20 s"):
        estimators.sideslip.calibrate(CAR, log(1000))
    with pytest.raises(InputError, match="uses"):
        estimators.sideslip.calibrate(CAR, log(), uses=("course",))


def test_estimates_the_sideslip_of_a_car_as_told_and_scores_it():
    recording = log()
    found = estimators.sideslip.estimate(CAR, recording.without("v_y"))
    numbers = estimators.sideslip.score(CAR, found, recording)
    assert numbers["rows"] == 3000
    assert numbers["open_loop_sideslip_rmse_deg"] < 1e-6
    assert numbers["sideslip_rmse_deg"] < 0.15
    assert 0.5 < numbers["sideslip_coverage_95"] <= 1.0
    # The score counts what it is told: shifting the reference by one degree is one degree of error.
    off = recording.replace(v_y=np.asarray(recording["v_y"]) - np.radians(1.0) * 20.0)
    assert estimators.sideslip.score(CAR, found, off)["sideslip_rmse_deg"] == pytest.approx(1.0, abs=0.15)


def test_slow_rows_are_not_scored():
    recording = log(1500)
    v_x = np.where(np.arange(1500) < 600, 2.0, 20.0)
    slow = recording.replace(v_x=v_x, v_y=np.where(v_x < 3.0, 1.0, np.asarray(recording["v_y"])))
    found = estimators.sideslip.estimate(CAR, slow.without("v_y"))
    score = lambda **more: estimators.sideslip.score(CAR, found, slow, **more)
    numbers = score()
    assert (numbers["rows"], numbers["least_speed"]) == (900, 3.0)
    assert score(least_speed=1.0)["rows"] == 1500
    small = dataclasses.replace(CAR, front_axle_to_cg=0.15, rear_axle_to_cg=0.18)
    assert estimators.sideslip.least_speed_of(small) == 0.5
    with pytest.raises(InputError, match="speed of at least 30 m/s"):
        score(least_speed=30.0)


def test_the_reference_cannot_reach_a_blind_estimate():
    recording = log()
    found = estimators.sideslip.estimate(CAR, recording)
    blind = estimators.sideslip.estimate(CAR, recording.without("v_y"))
    np.testing.assert_array_equal(np.asarray(found.mean.sideslip), np.asarray(blind.mean.sideslip))


def real_log():
    recording = io.read_recording(shared("ferrari_250lm_100hz.csv"))
    return (
        recording.rows(slice(0, 13750)),
        recording.rows(slice(13750, None)),
        io.read_car(shared("ferrari_250lm.toml")),
    )


@pytest.mark.parametrize(("log", "begin", "measured", "open_loop"), [
    ("ferrari_250lm", 13750, 0.1816, 0.3047), ("ferrari_250lm", 16750, 0.2364, 0.6899),
    ("genesis", 16129, 0.4819, 0.4752),
])  # fmt: skip
def test_real_logs_as_near_as_they_were_measured(log, begin, measured, open_loop):
    """Half a minute of each, the car taken at its file's word: sideslip RMSE, degrees, as measured, and 3 % for another rounding.

    On the Ferrari's log the estimate is better than the open loop; on the Genesis', whose accelerometer is 0.65 m/s^2 off and
    whose v_y is of another point than the file's, it is not. A bound far above what was measured would hide either.
    """
    recording, car = io.read_recording(shared(f"{log}_100hz.csv")), io.read_car(shared(f"{log}.toml"))
    span = recording.rows(slice(begin, begin + 3000))
    found = estimators.sideslip.estimate(car, span.select(["steer", "v_x", "a_x", "a_y", "yaw_rate"]))
    numbers = estimators.sideslip.score(car, found, span)
    assert numbers["open_loop_sideslip_rmse_deg"] == pytest.approx(open_loop, rel=0.03)
    assert numbers["sideslip_rmse_deg"] <= 1.03 * measured


@pytest.mark.full
def test_real_log_taken_at_its_word():
    _, rest, car = real_log()
    numbers = estimators.sideslip.score(
        car, estimators.sideslip.estimate(car, rest.select(["steer", "v_x", "a_x", "a_y", "yaw_rate"])), rest
    )
    assert numbers["open_loop_sideslip_rmse_deg"] == pytest.approx(0.605, abs=0.005)
    assert numbers["sideslip_rmse_deg"] <= 0.305  # 0.296 measured


@pytest.mark.full
def test_real_log_calibrated_blind():
    first, rest, car = real_log()
    blind = ["steer", "v_x", "a_x", "a_y", "yaw_rate"]
    calibration = estimators.sideslip.calibrate(car, first.select(blind))
    numbers = estimators.sideslip.score(car, estimators.sideslip.estimate(calibration, rest.select(blind)), rest)
    assert numbers["sideslip_rmse_deg"] <= 0.24  # 0.2312 measured
    assert set(calibration.summary()) >= {
        "front.B",
        "rear.D",
        "steer_gain",
        "process noise.v_y",
        "measurement noise.a_y",
    }
    fitted = estimators.sideslip.fitted_car(calibration, car)
    assert fitted.front.nominal_load == pytest.approx(982 * 9.80665 * 1.07 / 2.40, rel=1e-6)


@pytest.mark.full
def test_real_log_calibrated_with_the_reference():
    first, rest, car = real_log()
    calibration = estimators.sideslip.calibrate(car, first, uses=("v_y",))
    blind = rest.select(["steer", "v_x", "a_x", "a_y", "yaw_rate"])
    numbers = estimators.sideslip.score(car, estimators.sideslip.estimate(calibration, blind), rest)
    assert numbers["sideslip_rmse_deg"] <= 0.26
    assert [weight for weight, _ in calibration.validation] == [None, 0.05, 0.02]
