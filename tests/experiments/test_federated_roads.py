"""The federated-ckf experiment on roads of several frictions and with rear wheels that turn, at small size."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import manoeuvres, sweeps
from jaxveh._core.names import record_type
from jaxveh.experiments import federated_ckf as experiment
from jaxveh.experiments.federated_ckf import drives, model, road_drives, road_filters, road_tables, study
from jaxveh.experiments.federated_ckf.settings import Start

SMALL = experiment.Study(duration=6.0, settled=3.0, jump_at=20.0)
CASES = tuple(road_drives.road_cases(SMALL))


@pytest.fixture(scope="module")
def driven():
    """(5 cases, 2 seeds, T, ...)."""
    return road_drives.drives_on_roads(SMALL, 2, jax.random.key(3))


def one(driven, case, seed=0):
    return drives.Drive(*(leaf[CASES.index(case), seed] for leaf in driven))


def test_the_roads_are_what_they_say(driven):
    later = slice(150, None)
    np.testing.assert_allclose(one(driven, "one friction").true_friction, 0.2, rtol=1e-9)
    sides = np.median(one(driven, "split mu").true_friction[later], axis=0)
    np.testing.assert_allclose(sides, [0.2, 0.3, 0.2, 0.3], rtol=1e-6)
    jump = one(driven, "mu jump")
    np.testing.assert_allclose(jump.true_friction[[0, -1]], [[0.3] * 4, [0.2] * 4], rtol=1e-6)
    # The rear wheels get there a wheelbase later.
    front, rear = (np.argmax(jump.true_friction[:, wheel] < 0.29) for wheel in (0, 2))
    np.testing.assert_allclose((rear - front) * SMALL.dt, 2.6 / jump.true_v_x.mean(), rtol=0.1)


def test_rear_wheels_turn_by_their_ratio_and_filters_are_told_or_not(driven):
    told, untold = one(driven, "rear steer"), one(driven, "rear steer, untold")
    np.testing.assert_allclose(told.steer[:, 2:], SMALL.rear_steer * told.steer[:, :2], atol=1e-12)
    assert np.ptp(told.steer[:, 2]) > np.radians(3.0)
    np.testing.assert_array_equal(untold.steer[:, 2:], 0.0)
    np.testing.assert_allclose(untold.steer[:, :2], told.steer[:, :2], rtol=1e-9)
    np.testing.assert_allclose(untold.true_yaw_rate, told.true_yaw_rate, rtol=1e-9)
    assert np.abs(told.true_yaw_rate - one(driven, "one friction").true_yaw_rate).max() > 0.02


@pytest.fixture(scope="module")
def said():
    @jax.jit
    def said_by(drive):
        car = model.planar(SMALL, Start(*study.truth(SMALL)))
        rows = model.rows_of(SMALL, drive)
        names = (*rows.u._fields, *drives.FRICTIONS)
        u = record_type("Inputs", names)(*rows.u, *drive.true_friction.T)
        x = model.State(drive.true_v_x, drive.true_v_y, drive.true_yaw_rate)
        return rows.y, model.sensor_outputs(car, 0.0, x, u)

    return said_by


@pytest.mark.parametrize("case", ["rear steer", "split mu"])
def test_the_filters_model_with_four_angles_and_frictions_is_the_truth_s(driven, said, case):
    """At the true states it says what was measured, but for noise."""
    for seed in range(2):
        y, expected = said(one(driven, case, seed))
        for name, level in model.noise_levels(SMALL).items():
            rest = np.asarray(getattr(y, name) - getattr(expected, name))[50:]
            assert rest.std() < 1.25 * level and abs(rest.mean()) < 0.3 * level, name


def test_a_filter_that_is_not_told_the_rear_angle_does_not_know_the_car(driven, said):
    y, expected = said(one(driven, "rear steer, untold"))
    assert np.std(y.a_y - expected.a_y) > 3.0 * SMALL.a_y


def test_four_frictions_that_walk_are_found_where_one_is_between(driven):
    raced = road_filters.race_on_roads(SMALL, driven, only=("first guess", "four mu, walking"))
    error = lambda who, value, case="split mu": float(np.median(raced.at(value, who, case)))
    assert error("four mu, walking", "friction_error_left") < 0.3 * error("first guess", "friction_error_left")
    assert error("four mu, walking", "v_y_rmse") < 0.5 * error("first guess", "v_y_rmse")
    front = np.median(raced.at("friction", "four mu, walking", "split mu")[:, -1], axis=0)[:2]
    assert front[0] < 0.25 < front[1]
    tables = road_tables.road_tables(raced)
    assert len(tables) == len(CASES)
    for table in tables:
        assert table.rows[0][0] == "first guess" and "[" in table.rows[0][1]


def test_errors_on_a_road_of_a_known_course():
    rows = round(SMALL.duration / SMALL.dt) + 1
    same = np.ones(rows)
    drive = drives.Drive(*(0.0 * same,) * 11)._replace(
        true_v_x=5.0 * same, true_friction=np.tile([0.2, 0.3, 0.2, 0.3], (rows, 1))
    )
    friction = drive.true_friction * np.exp([0.1, -0.2, 0.1, -0.2])
    found = road_filters.RoadFound(5.1 * same, 0.02 * same, 1.1 * 1230.0 * same, friction, np.full((rows, 4), 0.04))
    seen = road_filters.road_metrics(SMALL, found, drive)
    np.testing.assert_allclose([seen["v_x_rmse"], seen["v_y_rmse"]], [0.1, 0.02], rtol=1e-9)
    np.testing.assert_allclose(seen["sideslip_rmse"], np.degrees(np.arctan2(0.02, 5.1)), rtol=1e-9)
    sides = [seen[f"friction_error{side}"] for side in ("_left", "_right", "")]
    np.testing.assert_allclose(sides, [0.1, 0.2, np.sqrt(0.025)], rtol=1e-9)
    np.testing.assert_allclose(seen["friction_nees"], 0.025 / 0.04, rtol=1e-9)
    np.testing.assert_allclose(seen["mass_error"], 0.1, rtol=1e-9)
    sure = road_filters.road_metrics(SMALL, found._replace(variance=0.0 * friction), drive)
    assert np.isinf(sure["friction_nees"])


def test_every_estimator_on_roads_says_what_it_knows():
    every = road_filters.road_contestants(SMALL)
    assert next(iter(every)) == "first guess"
    assert all(one.what for one in every.values()) and len({one.what for one in every.values()}) == len(every)


def test_the_table_of_the_speeds_has_both_and_what_doing_nothing_gives():
    names = ("first guess", "joint")
    values = {"v_x_rmse": np.full((2, 1, 3), 0.1), "v_y_rmse": np.full((2, 1, 3), 0.02)}
    design = sweeps.Design(estimator=dict.fromkeys(names), case=range(1))
    raced = study.Raced(SMALL, ("nearer start",), None, sweeps.Swept(design, 3, values))
    table = road_tables.speed_table(raced, ("nearer start",))
    assert table.rows[0][:3] == ("first guess", "0.1 [0.1, 0.1]", "0.02 [0.02, 0.02]")


def test_the_driver_in_the_lane_comes_back_to_its_middle():
    """His offset follows y'' + 2 D w y' + w^2 y = 0 of a car that turns as its front wheels say."""
    driver = road_drives.lane_slalom(dataclasses.replace(SMALL, steer=0.0), manoeuvres.SteadySpeed(5.0), 0.0)
    turning = SMALL.speed / 2.6
    np.testing.assert_allclose(float(driver.per_offset) * turning * SMALL.speed, road_drives.LANE_RATE**2, rtol=1e-9)
    middle = 2.0 * road_drives.LANE_DAMPING * road_drives.LANE_RATE
    np.testing.assert_allclose(float(driver.per_yaw) * turning, middle, rtol=1e-9)
    motion = record_type("Motion", ("y", "yaw"))(jnp.asarray(1.0), jnp.asarray(0.1))
    expected = -float(driver.per_offset) - 0.1 * float(driver.per_yaw)
    np.testing.assert_allclose(driver.inputs(0.0, motion, ()).steer_fl, expected, rtol=1e-9)
