"""The learner of what changes slowly: closed forms, flags, and its file."""

import dataclasses

import equinox as eqx
import numpy as np
import pytest
from banked_drives import BOUNDS, RATIO, file_of, follow_all
from method_logs import CAR
from steady_logs import LENGTH, UNDERSTEER, G, log
from winding_roads import SCORED, heard_of

from jaxveh import InputError
from jaxveh.estimators import geometry
from jaxveh.estimators.geometry.learner import RATES, UNITS


def told(car):
    """The learner with a filter of roll and bank that has no offsets to find."""
    method = geometry.METHODS["learner"].make(car)
    exact = lambda m: (m.leaning.a_y_offset_spread, m.leaning.gyro_offset_spread, m.leaning.scale_spread)
    return eqx.tree_at(exact, method, [np.asarray(1e-5), np.asarray(1e-6), np.asarray(1e-4)])


def drive(needs, *, ratio=16.0, offset=0.0, swing=0.06, speed=12.0, rows=6000):
    """A car that weaves slowly at speeds from a crawl to a road's, exactly as the single track does; the yaw rate in rad/s."""
    time = 0.01 * np.arange(rows)
    speed = speed * (1.0 + 0.58 * np.sin(0.12 * time))
    turn = swing * np.sin(0.5 * time)
    f_y = speed * turn
    rate = np.gradient(turn, time)
    lag = CAR.yaw_inertia * rate * (1.0 / CAR.front_cornering_stiffness + 1.0 / CAR.rear_cornering_stiffness) / LENGTH
    steer = LENGTH * turn / speed + UNDERSTEER * f_y + lag + offset
    wheels = dict.fromkeys((f"wheel_speed_{at}" for at in ("fl", "fr", "rl", "rr")), speed)
    body_roll = CAR.roll_gradient * f_y
    made = {"a_y": f_y + G * body_roll, "yaw_rate": turn, "a_x": 0.0, "steering_wheel": ratio * steer, **wheels}
    return log(needs, made, rows)


def test_a_ratio_and_an_offset_are_learned():
    method = told(dataclasses.replace(CAR, steering_ratio=15.5))
    found = geometry.estimate(method, drive(method.needs, ratio=16.0, offset=0.001))
    np.testing.assert_allclose(found["steering_ratio"][-1], 16.0, atol=2.5 * float(found.std.steering_ratio[-1]))
    assert abs(found["steering_ratio"][-1] - 16.0) < 0.35
    np.testing.assert_allclose(found["steer_offset"][-1], 0.001, atol=2e-4)
    assert found.known.steer_offset[-1]


def test_a_town_s_turns_make_the_ratio_known_and_a_weaving_that_play_swallows_does_not():
    method = told(dataclasses.replace(CAR, steering_ratio=15.5))
    town = geometry.estimate(method, drive(method.needs, speed=6.5, swing=0.3))
    assert town.known.steering_ratio[-1] and abs(town["steering_ratio"][-1] - 16.0) < 0.25
    weaving = geometry.estimate(method, drive(method.needs, speed=12.0, swing=0.03))
    assert not weaving.known.steering_ratio.any()


@pytest.mark.parametrize(("turned", "passed"), [(0.2, 0.01), (-0.2, 0.01), (0.2, -0.01), (-0.2, -0.01)])
def test_on_a_circle_the_ratio_s_band_has_the_errors_of_gyroscope_and_wheels(turned, passed):
    # The gyroscope's offset (degrees/s) and the wheels' radius are errors of one sign throughout: no number of rows helps.
    method, rows = geometry.METHODS["learner"].make(CAR), 4000
    speed = 5.0 + 4.0 * np.arange(rows) / rows
    turn, radius = speed / 40.0, 40.0
    f_y = speed**2 / radius
    wheels = dict.fromkeys((f"wheel_speed_{at}" for at in ("fl", "fr", "rl", "rr")), speed * (1.0 + passed))
    made = {
        "a_y": f_y * (1.0 + G * CAR.roll_gradient), "yaw_rate": turn + np.radians(turned), "a_x": 0.0,
        "steering_wheel": RATIO * (LENGTH / radius + UNDERSTEER * f_y), **wheels,
    }  # fmt: skip
    found = geometry.estimate(method, log(method.needs, made, rows))
    assert (np.abs(found["steering_ratio"] - RATIO) < 1.5 * np.asarray(found.std.steering_ratio)).all()


def test_straight_running_tells_the_offset_and_nothing_else():
    method = told(CAR)
    found = geometry.estimate(method, drive(method.needs, offset=0.001, swing=0.0))
    np.testing.assert_allclose(found["steer_offset"][-1], 0.001, atol=1.5e-4)
    for name in ("steering_ratio", "yaw_inertia", "front_axle_to_cg"):
        assert not getattr(found.known, name).any(), name
        np.testing.assert_allclose(found[name][-1], getattr(CAR, name), rtol=0.01, err_msg=name)


def test_a_car_that_stands_learns_nothing():
    method = geometry.METHODS["learner"].make(CAR)
    standing = drive(method.needs, offset=0.004)
    standing = standing.replace(**{name: np.zeros(6000) for name in standing.names if name.startswith("wheel")})
    found = geometry.estimate(method, standing)
    for name in UNITS:
        np.testing.assert_array_equal(found[name], found[name][0], err_msg=name)
        assert not getattr(found.known, name).any(), name


def test_what_is_reported_moves_no_faster_than_it_may():
    method = told(dataclasses.replace(CAR, steering_ratio=14.0, yaw_inertia=1800.0))
    found = geometry.estimate(method, drive(method.needs, offset=0.004, swing=0.1))
    for name, most in RATES.items():
        assert np.abs(np.diff(found[name])).max() <= 0.01 * most * (1.0 + 1e-9), name
    assert np.abs(np.diff(found["steer_offset"])).max() > 0.005 * RATES["steer_offset"]


def test_the_place_follows_the_understeer_as_equation_17_corrected_says():
    # l_f / l = (1 + C_f / (m a_y) (l r / v - delta)) / (C_f / C_r + 1), with the understeer delta - l r / v = u a_y.
    method = geometry.METHODS["learner"].make(CAR)
    front, rear = CAR.front_cornering_stiffness, CAR.rear_cornering_stiffness
    slope = float(method._place_slope())
    place = lambda understeer: LENGTH * (1.0 - front / CAR.mass * understeer) / (front / rear + 1.0)
    np.testing.assert_allclose(place(UNDERSTEER), CAR.front_axle_to_cg, rtol=1e-9)
    np.testing.assert_allclose(float(method._understeer()), UNDERSTEER, rtol=1e-12)
    np.testing.assert_allclose((place(UNDERSTEER + 1e-4) - place(UNDERSTEER)) / 1e-4, 1.0 / slope, rtol=1e-6)


def test_what_was_learned_is_a_file_that_the_next_drive_starts_from(tmp_path):
    method = told(CAR)
    one = geometry.numbers_learned(geometry.estimate(method, drive(method.needs, offset=0.001)))
    assert one.entries["steer_offset"].valid and not one.entries["yaw_inertia"].valid
    path = tmp_path / "car.toml"
    geometry.write_learned(one, path)
    assert geometry.read_learned(path) == one
    with pytest.raises(InputError, match="exists"):
        geometry.write_learned(one, path)
    geometry.write_learned(one, path, overwrite=True)
    again = geometry.start_from(method, geometry.read_learned(path))
    assert float(again.steer_offset) == one.entries["steer_offset"].value
    assert float(again.yaw_inertia) == CAR.yaw_inertia
    # A unit elsewhere in the car stays there.
    elsewhere = geometry.METHODS["learner"].make(dataclasses.replace(CAR, sensor_position=(0.5, 0.0, 0.0)))
    other = geometry.start_from(elsewhere, geometry.read_learned(path))
    assert float(other.inner.steer_offset) == float(again.steer_offset) and float(other.preparation.unit_x) == 0.5
    start = geometry.estimate(again, drive(again.needs, offset=0.001).rows(slice(0, 50)))
    assert start.known.steer_offset[0]
    assert geometry.numbers_learned(geometry.live(again).init(0.0, {})[1]).entries["steer_offset"].value == float(
        again.steer_offset
    )


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('unit = "m"', 'unit = "mm"', r"\[front_axle_to_cg\]: unit = 'mm': must be 'm'"),
        ("valid = false", "valid = 0", "valid = 0: must be true or false"),
        ("[yaw_inertia]", "[yaw]", "yaw"),
        ("value = 1", "value = -1", "must be positive|must be|positive"),
        ("[steer_offset]\n", "[steer_offset]\nmore = 1\n", "more"),
    ],
)
def test_a_file_that_is_none_is_refused_by_name(tmp_path, before, after, message):
    entry = geometry.learned.Entry(1.2, 0.1, False)
    geometry.write_learned(geometry.Learned(dict.fromkeys(UNITS, entry)), tmp_path / "good.toml")
    text = (tmp_path / "good.toml").read_text()
    assert before in text
    bad = tmp_path / "bad.toml"
    bad.write_text(text.replace(before, after))
    with pytest.raises(InputError, match=message) as error:
        geometry.read_learned(bad)
    assert "bad.toml" in str(error.value)
    bad.write_text(text[: text.index("[steer_offset]")])
    with pytest.raises(InputError, match="no steer_offset, steering_ratio"):
        geometry.read_learned(bad)


@pytest.mark.full
def test_flags_are_honest_on_unseen_cars():
    cases, _, offsets, time = heard_of(SCORED, range(4), 120.0)
    said = follow_all(lambda car: geometry.METHODS["learner"].make(file_of(car)), cases, time)
    true = {
        "steering_ratio": np.full(len(cases), RATIO), "steer_offset": np.array([o["steering_wheel"] for o in offsets]) / RATIO,
        "yaw_inertia": np.array([file_of(car).yaw_inertia for car, _ in cases]),
        "front_axle_to_cg": np.array([file_of(car).front_axle_to_cg for car, _ in cases]),
    }  # fmt: skip
    for name, expected in true.items():
        error = (getattr(said.mean, name)[:, -1] - expected) / getattr(said.std, name)[:, -1]
        assert np.mean(error**2) < 2.5, name
        known = getattr(said.known, name)[:, -1]
        assert np.abs(error[known]).max(initial=0.0) < 4.0, name
    assert said.known.steer_offset[:, -1].all()
    off = said.mean.steer_offset[:, -1] - true["steer_offset"]
    assert np.sqrt(np.mean(off**2)) < BOUNDS["steering_wheel"] / RATIO
