"""Grade: each method where the right answer is known, and the filter on simulated cars."""

import dataclasses

import jax
import numpy as np
import pytest
from banked_drives import DEGREE, file_of, follow_all
from method_logs import CAR
from steady_logs import WHEELS, G, log, pushed
from winding_roads import SCORED, heard_of

from jaxveh import Recording
from jaxveh.estimators import grade
from jaxveh.experiments.sideslip_review.chapters import fleet, fleet_drives, scenarios


@pytest.mark.parametrize("name", list(grade.METHODS))
@pytest.mark.parametrize("slope", [-0.05, 0.03])
def test_a_steady_climb_has_its_grade(name, slope):
    method = grade.METHODS[name].make(CAR)
    found = grade.estimate(method, pushed(method.needs, grade=slope))
    late = slice(1500, None)
    assert found.known.grade[late].all()
    # Who holds an offset and an air that may be wrong for possible leaves a little of a long climb to them.
    most = 0.15 if name in ("filter", "joint") else 0.1
    assert abs(np.mean(found["grade"][late]) - slope) < most * DEGREE
    assert np.std(found["grade"][late]) < 0.5 * DEGREE


@pytest.mark.parametrize("name", ["kinematic", "satellite"])
def test_an_accelerometer_s_offset_is_a_grade_to_kinematics_alone(name):
    method = grade.METHODS[name].make(CAR)
    two = [grade.estimate(method, pushed(method.needs, offset=offset))["grade"][1500:] for offset in (0.0, 0.1)]
    expected = 0.1 / (1.0 + G * CAR.pitch_gradient) / G
    np.testing.assert_allclose(np.mean(two[1]) - np.mean(two[0]), expected, rtol=0.01)


@pytest.mark.parametrize("name", ["joint", "filter"])
def test_torques_tell_the_offset_from_the_grade(name):
    method = grade.METHODS[name].make(CAR)
    found = grade.estimate(method, pushed(method.needs, offset=0.1))
    # What rolling resistance may be wrong by is what the filter leaves of it.
    assert abs(np.mean(found["grade"][3000:]) - 0.03) < 0.25 * 0.1 / G
    assert abs(np.mean(found["grade"][3000:]) - 0.03) < 2.0 * found.std.grade[-1]


def test_without_torques_and_climb_the_filter_cannot_tell_them_apart_and_says_so():
    method = grade.METHODS["filter"].make(CAR)
    whole = pushed(method.needs, offset=0.1)
    climbs = grade.estimate(method, whole.without("drive_torque", "brake_torque"))
    log = whole.without("climb_rate")
    with_torques = grade.estimate(method, log)
    found = grade.estimate(method, log.without("drive_torque", "brake_torque"))
    assert found.std.a_x_bias[-1] > 1.3 * with_torques.std.a_x_bias[-1]
    assert abs(found["grade"][-1] - 0.03) < 3.0 * found.std.grade[-1]
    # Satellites that say how fast it climbs tell them apart, too.
    assert climbs.std.a_x_bias[-1] < found.std.a_x_bias[-1] / 1.3
    assert abs(np.mean(climbs["grade"][3000:]) - 0.03) < 0.25 * 0.1 / G


def test_driven_wheels_slip_and_the_grade_does_not_take_it_for_its_own():
    """Speeds of wheels that are all driven are high by a share of what they push."""
    drives = dataclasses.replace(CAR, front_drive=0.5)
    method = grade.METHODS["filter"].make(drives)
    log = pushed(method.needs, brakes=False)
    force = np.asarray(log["drive_torque"]) / CAR.wheel_radius
    wheels = {name: np.asarray(log[name]) * (1.0 + 0.004 * force / CAR.mass) for name in WHEELS}
    error = lambda one: np.std(np.asarray(grade.estimate(method, one)["grade"])[1500:])
    assert error(log.replace(**wheels)) < 1.3 * error(log)
    # Those of a car whose front wheels alone are driven are not: its rear wheels roll.
    front = grade.METHODS["filter"].make(dataclasses.replace(CAR, front_drive=1.0))
    slipped = np.std(np.asarray(grade.estimate(front, log.replace(**wheels))["grade"])[1500:])
    assert slipped > 1.3 * error(log)


def slippery(needs, what, seed=0, rows=5000):
    """A car on a winding, hilly road that now and then slides across by up to 6 m/s, of which one wheel then spins or locks; and
    the grade."""
    rng, time = np.random.default_rng(seed), 0.01 * np.arange(rows)
    noise = lambda std: std * rng.normal(size=rows)
    true = 0.015 * np.sin(0.25 * time) + 0.008 * np.sin(0.6 * time + 1.0)
    now = 4.0 * np.clip(np.sin(time) - 0.5, 0.0, None) ** 2 * (time > 8.0)
    v_x, turn = 20.0 + 2.0 * np.sin(0.3 * time), 0.1 * np.sin(0.4 * time) + 0.3 * now * (what == "slides")
    v_y, rate = 6.0 * now * (what == "slides"), np.gradient(v_x, time)
    force = (CAR.mass + 4.0 * CAR.wheel_inertia / CAR.wheel_radius**2) * rate + CAR.drag * v_x**2
    force += CAR.mass * G * (CAR.rolling_resistance + np.sin(true))
    beside = np.array([-0.75, 0.75, -0.75, 0.75])[:, None] * turn
    slip = {"spins": 12.0, "locks": -15.0}.get(what, 0.0) * now
    # A wheel that spins or locks has a torque that does not push.
    torque = force * CAR.wheel_radius + 900.0 * now * np.sign(slip)
    heard = np.arange(rows) % 20 == 0
    late = lambda value: np.where(heard, np.interp(time - 0.14, time, value), np.nan)
    channels = {
        "a_x": (rate - v_y * turn + G * np.sin(true)) * (1.0 + G * CAR.pitch_gradient) + 0.05 + noise(0.05),
        "a_y": np.gradient(v_y, time) + v_x * turn + noise(0.05), "yaw_rate": turn + noise(0.002),
        **{name: v_x + beside[k] + slip * (k == 0) + noise(0.02) for k, name in enumerate(WHEELS)},
        "speed": late(np.hypot(v_x, v_y)) + noise(0.05), "climb_rate": late(v_x * np.sin(true)) + noise(0.1),
        "drive_torque": np.maximum(torque, 0.0), "brake_torque": np.maximum(-torque, 0.0),
    }  # fmt: skip
    return log(needs, channels, rows), true


@pytest.mark.parametrize(("without", "share", "most"), [((), 0.4, 2.0), (("speed", "climb_rate"), 0.9, 3.0)])
def test_where_the_car_slides_the_grade_is_not_worse_than_a_level_road_and_the_spread_says_how_good(
    without, share, most
):
    """With satellites, and without; slides of two seconds."""
    method = grade.METHODS[grade.RECOMMENDED].make(CAR)
    late = slice(500, None)
    for what in ("slides", "spins", "locks"):
        drive, true = slippery(method.needs, what)
        found = grade.estimate(method, drive.without(*without) if without else drive)
        error, std = (np.asarray(found["grade"]) - true)[late], np.asarray(found.std.grade)[late]
        known = np.asarray(found.known.grade)[late]
        assert np.sqrt(np.mean(error**2)) < share * np.sqrt(np.mean(true[late] ** 2)), what
        assert known.mean() > 0.5 and np.mean((error / std)[known] ** 2) < most, what


def test_the_filter_hears_the_wheels_where_a_log_has_an_estimated_speed_too():
    """Such a speed is late on hills. It is heard where the wheels are silent, and in reverse, where wheels may count forwards."""
    method = grade.METHODS[grade.RECOMMENDED].make(CAR)
    drive, _ = slippery(method.needs, "nothing")
    late = np.interp(np.asarray(drive.time) - 0.5, np.asarray(drive.time), np.asarray(drive[WHEELS[0]]))
    with_wheels = drive.without(*[name for name in ("v_x",) if name in drive])
    told = drive.replace(v_x=late)
    expected = grade.estimate(method, with_wheels)["grade"]
    np.testing.assert_array_equal(grade.estimate(method, told)["grade"], expected)
    alone = grade.estimate(method, told.without(*WHEELS))
    assert np.isfinite(alone["grade"]).all() and np.abs(np.asarray(alone["grade"]) - expected).max() > 1e-4
    row = {n.channel: jax.numpy.asarray(np.nan) for n in method.needs} | {
        name: jax.numpy.asarray(2.0) for name in WHEELS
    }
    _, backwards = method.motion.first(jax.numpy.asarray(0.0), row | {"v_x": jax.numpy.asarray(-2.0)})
    _, forwards = method.motion.first(jax.numpy.asarray(0.0), row | {"v_x": jax.numpy.asarray(2.5)})
    assert (float(backwards["v_x"]), float(forwards["v_x"])) == (-2.0, 2.0)


@pytest.mark.full
def test_on_slippery_roads_no_unseen_car_is_worse_than_a_level_road():
    """Cars and seeds with which nothing was chosen; until a car has spun."""
    names, seeds = ["low mu", "mu jump", "split mu", "ABS", "wheelspin"], (9100, 9101, 9102)
    places = [list(scenarios.SCENARIOS).index(name) for name in names]
    cases, truths = [], []
    for car in ("compact_car", "suv"):
        built = jax.tree.map(lambda leaf: leaf[0], fleet.built_cars((car,)))
        run = lambda scenario, seed, built=built: fleet_drives.drive_once(
            built, scenarios.scenario_at(scenario), jax.random.key(seed), duration=30.0
        )
        which = np.array([(place, seed) for place in places for seed in seeds])
        made = jax.tree.map(np.asarray, jax.jit(jax.vmap(run))(which[:, 0], which[:, 1]))
        drives = [{name: value[k] for name, value in made.items()} for k in range(len(which))]
        cases += [(car, drive) for drive in drives]
        truths += drives
    rows = len(truths[0]["true.grade"])
    said = follow_all(
        lambda car: grade.METHODS["filter"].make(fleet.told_cars((car,))[0]), cases, 0.01 * np.arange(rows)
    )
    true = np.stack([truth["true.grade"] for truth in truths])
    held = np.cumprod(np.abs([truth["true.sideslip"] for truth in truths]) < 20.0 * DEGREE, axis=1).astype(bool)
    held[:, :500] = False
    error, std = said.mean.grade - true, said.std.grade
    for k, name in enumerate(names):
        chosen = held & (np.arange(len(cases)) // len(seeds) % len(names) == k)[:, None]
        assert np.sqrt(np.mean(error[chosen] ** 2)) < 0.35 * DEGREE < np.sqrt(np.mean(true[chosen] ** 2)), name
        assert np.mean((error / std)[chosen] ** 2) < 2.0, name


@pytest.mark.full
def test_on_unseen_cars_the_grade_is_known():
    cases, truths, offsets, time = heard_of(SCORED, range(4), 120.0)
    said = follow_all(lambda car: grade.METHODS["filter"].make(file_of(car, 1.12)), cases, time)
    error = np.stack([said.mean.grade[k] - truth["grade"] for k, truth in enumerate(truths)])[:, 1000:]
    # A filter that looks back only is late where the grade changes within 40 m.
    assert np.sqrt(np.mean(error**2)) < 0.25 * DEGREE
    assert np.mean((error / said.std.grade[:, 1000:]) ** 2) < 2.0
    off = said.mean.a_x_bias[:, -1000:].mean(1) - [one["a_x"] for one in offsets]
    assert np.sqrt(np.mean(off**2)) < 0.03


def test_a_car_that_climbs_says_the_grade_whatever_its_accelerometer_says():
    t = np.arange(0.0, 20.0, 0.02)
    true = 0.05 * np.sin(0.3 * t)
    fresh = np.arange(t.size) % 10 == 0
    says = {"speed": np.where(fresh, 20.0, np.nan), "climb_rate": np.where(fresh, 20.0 * np.sin(true), np.nan)}
    found = grade.estimate(CAR, Recording(t, says, {"speed": "m/s", "climb_rate": "m/s"}), method="climb")
    known = np.asarray(found.known.grade)
    assert known[5:].all()
    # Late by the low-pass and half a satellite's step.
    late = 0.05 * np.sin(0.3 * (t - 0.6))
    np.testing.assert_allclose(np.asarray(found["grade"])[200:], late[200:], atol=2e-3)
    silent = {name: np.where(t > 10.0, np.nan, values) for name, values in says.items()}
    found = grade.estimate(CAR, Recording(t, silent, {"speed": "m/s", "climb_rate": "m/s"}), method="climb")
    assert not np.asarray(found.known.grade)[t > 11.5].any()
