"""The review's ways to sideslip that need no filter, on signals made by their own assumptions: answers are exact."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from method_logs import CAR
from scipy.linalg import expm

from jaxveh import InputError, Recording, estimators, vehicles
from jaxveh.estimators import kit, sideslip, two_axles
from jaxveh.estimators.sideslip_methods import common, fusion, steady_state
from jaxveh.estimators.sideslip_methods.single_track import LateralState
from jaxveh.estimators.sideslip_methods.stiff_step import StiffStep, solve
from jaxveh.vehicles import GRAVITY, LinearSingleTrack

V = 20.0


def linear_car():
    return LinearSingleTrack(
        mass=CAR.mass, yaw_inertia=CAR.yaw_inertia, front_axle_to_cg=CAR.front_axle_to_cg,
        rear_axle_to_cg=CAR.rear_axle_to_cg, front_stiffness=CAR.front_cornering_stiffness,
        rear_stiffness=CAR.rear_cornering_stiffness,
    )  # fmt: skip


def log(time, method, **channels):
    """A recording of these channels, each a number or (T,)."""
    names = {need.channel: need.unit for need in method.needs}
    return Recording(time, {n: channels[n] + np.zeros_like(time) for n in names}, names)


def say(name, time, **channels):
    method = sideslip.METHODS[name].make(CAR)
    return sideslip.estimate(CAR, log(time, method, **channels), method=name)


def test_integration_is_exact_where_the_rate_runs_straight_between_rows_and_known_until_it_has_drifted():
    time = np.linspace(0.0, 8.0, 801)
    rate = np.interp(time, [0.0, 2.0, 5.0, 8.0], [0.0, 0.4, -0.5, 0.1])
    yaw_rate = 0.2 * np.sin(time)
    found = say("integration", time, v_x=V, yaw_rate=yaw_rate, a_y=rate + V * yaw_rate)
    exact = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])
    np.testing.assert_allclose(found["v_y"], exact, atol=1e-12)
    np.testing.assert_allclose(found["sideslip"], np.arctan2(exact, V), atol=1e-12)
    # From 0.5 m/s at 0.1 m/s^2 to 0.05 rad of 20 m/s: five seconds.
    known = np.asarray(found.known.v_y)
    assert known[time < 4.99].all() and not known[time > 5.01].any()
    assert np.isnan(found.std.v_y).all()


def test_integration_takes_an_offset_as_a_drift_and_begins_anew_after_a_silence_and_where_the_car_crawls():
    time = np.linspace(0.0, 4.0, 401)
    found = say("integration", time, v_x=V, yaw_rate=0.0, a_y=0.2)
    np.testing.assert_allclose(found["v_y"], 0.2 * time, atol=1e-12)
    silent = np.where((time > 1.0) & (time < 2.0), np.nan, 0.2)
    found = say("integration", time, v_x=V, yaw_rate=0.0, a_y=silent)
    np.testing.assert_allclose(found["v_y"][time >= 2.0], 0.2 * (time[time >= 2.0] - 2.0), atol=1e-9)
    known = np.asarray(found.known.v_y)
    assert known[time < 1.29].all() and not known[(time > 1.31) & (time < 2.0)].any() and known[time >= 2.0].all()
    crawls = np.where((time > 1.0) & (time < 2.0), 1.0, V)
    found = say("integration", time, v_x=crawls, yaw_rate=0.1, a_y=0.2 + 0.1 * crawls)
    slow = crawls < 2.0
    np.testing.assert_allclose(found["v_y"][slow], 0.1 * CAR.rear_axle_to_cg)
    assert not np.asarray(found.known.v_y)[slow].any() and np.asarray(found.known.v_y)[~slow].all()


def test_the_roll_that_a_gyroscope_and_a_steady_turn_tell_is_taken_out():
    time = np.linspace(0.0, 6.0, 601)
    yaw_rate = 0.1 * np.sin(2.0 * time)
    leaning = GRAVITY * np.sin(0.03)
    found = say("roll_compensated", time, v_x=V, yaw_rate=yaw_rate, a_y=V * yaw_rate + leaning, roll_rate=0.0)
    np.testing.assert_allclose(found["v_y"], 0.0, atol=1e-12)
    # A roll that grows evenly is followed without lag.
    rolls = 0.01 * time
    gravity = GRAVITY * np.sin(rolls)
    found = say("roll_compensated", time, v_x=V, yaw_rate=yaw_rate, a_y=V * yaw_rate + gravity, roll_rate=0.01)
    np.testing.assert_allclose(found["v_y"], 0.0, atol=1e-5)
    drifting = say("integration", time, v_x=V, yaw_rate=yaw_rate, a_y=V * yaw_rate + gravity)
    assert drifting["v_y"][-1] > 1.5
    # A short swerve is kept: v_y of a tenth of the filter's time.
    rate = np.where(time < 0.1, 1.0, 0.0)
    found = say("roll_compensated", time, v_x=V, yaw_rate=0.0, a_y=np.where(time > 0.0, rate, 0.0), roll_rate=0.0)
    assert found["v_y"][10] == pytest.approx(0.1, rel=0.15)


def test_steady_formulas_are_the_gains_of_the_linear_single_track():
    car, steer, time = linear_car(), 0.02, np.linspace(0.0, 0.1, 11)
    for speed in (8.0, 20.0, 40.0):
        sideslip_of = float(car.sideslip_gain(speed)) * steer
        yaw_rate = float(car.yaw_rate_gain(speed)) * steer
        a_y = float(car.lateral_acceleration_gain(speed)) * steer
        by_steer = say("steady_steer", time, v_x=speed, steer=steer)
        np.testing.assert_allclose(by_steer["sideslip"], sideslip_of, rtol=1e-6)
        by_turn = say("steady_turn", time, v_x=speed, yaw_rate=yaw_rate, a_y=a_y)
        np.testing.assert_allclose(by_turn["v_y"], speed * sideslip_of, rtol=1e-6)
        linear = a_y <= 0.4 * GRAVITY
        assert (np.asarray(by_steer.known.v_y) == linear).all() and (np.asarray(by_turn.known.v_y) == linear).all()
    assert not linear


def test_a_car_near_its_critical_speed_has_no_steady_turn():
    numbers = two_axles.linear_axles_of(CAR) | {"front_cornering_stiffness": 2.5e5, "rear_cornering_stiffness": 1.0e5}
    oversteers = common.guard(CAR, steady_state.SteadySteer(**numbers))
    time = np.linspace(0.0, 0.1, 11)
    found = [sideslip.estimate(oversteers, log(time, oversteers, v_x=v, steer=1e-4)) for v in (10.0, 40.0)]
    assert np.asarray(found[0].known.v_y).all() and not np.asarray(found[1].known.v_y).any()
    assert np.isfinite(found[1]["sideslip"]).all()


def test_open_loop_is_the_linear_baseline():
    time = np.linspace(0.0, 4.0, 401)
    steer, v_x = 0.02 * np.sin(2.0 * time), 15.0 + time
    baseline = estimators.open_loop(vehicles.from_specification(CAR), Recording(time, {"steer": steer, "v_x": v_x}))
    found = say("open_loop", time, steer=steer, v_x=v_x)
    np.testing.assert_allclose(found["v_y"], baseline["v_y"], atol=2e-4)


def test_the_aligning_torque_chain_is_exact_in_a_steady_linear_turn():
    car, steer, speed, time = linear_car(), 0.015, 20.0, np.linspace(0.0, 0.1, 11)
    sideslip_of, yaw_rate = (float(gain(speed)) * steer for gain in (car.sideslip_gain, car.yaw_rate_gain))
    slip = steer - sideslip_of - CAR.front_axle_to_cg * yaw_rate / speed
    method = sideslip.METHODS["steering_torque"].make(CAR)
    moment = CAR.front_cornering_stiffness * slip * float(method.inner.trail)
    found = say("steering_torque", time, v_x=speed, steer=steer, yaw_rate=yaw_rate, steering_torque=moment / 16.0)
    # The formula adds angles where the car's velocity adds tangents.
    np.testing.assert_allclose(found["sideslip"], sideslip_of, atol=2e-6)
    assert np.asarray(found.known.v_y).all()
    hard = say("steering_torque", time, v_x=speed, steer=steer, yaw_rate=yaw_rate, steering_torque=9.0 * moment / 16.0)
    assert not np.asarray(hard.known.v_y).any()


class Says(estimators.AbstractMethod):
    """A method that says one lateral velocity, of one spread."""

    v_y: Any
    std: Any

    @property
    def needs(self):
        return (common.V_X, common.YAW_RATE, common.A_Y)

    def first(self, t, values):
        return self.next((), t, values)

    def next(self, memory, t, values):
        return memory, common.sideslip_answer(self.v_y + 0.0 * t, values["v_x"], True, self.std + 0.0 * t)


def saying(v_y, std=0.1):
    return Says(jnp.asarray(v_y), jnp.asarray(std))


def test_pseudo_integration_is_a_first_order_filter_and_its_complement():
    time = np.linspace(0.0, 5.0, 501)
    rate = lambda value: log(time, saying(0.0), v_x=V, yaw_rate=0.05, a_y=V * 0.05 + value)
    method = fusion.PseudoIntegration(saying(0.3), 0.7)
    np.testing.assert_allclose(kit.follow("x", method, rate(0.0))["v_y"], 0.3, atol=1e-12)
    # An offset leaves itself times T; the way there is the filter's.
    found = kit.follow("x", method, rate(0.2))["v_y"]
    np.testing.assert_allclose(found, 0.3 + 0.2 * 0.7 * (1.0 - np.exp(-time / 0.7)), atol=1e-12)


def test_the_switch_integrates_where_tyres_are_not_to_be_trusted_and_not_on_a_bank():
    time = np.linspace(0.0, 2.0, 201)
    steady = steady_state.SteadySteer(**two_axles.linear_axles_of(CAR))
    method = fusion.Switched(saying(0.3), steady)
    a_y = np.where(time < 1.0, 3.0, 5.0)
    asked = 3.0 / float(linear_car().lateral_acceleration_gain(V))
    drive = lambda a_y, rate, steer: Recording(
        time, {"v_x": V + 0 * time, "steer": steer + 0 * time, "yaw_rate": (a_y - rate) / V, "a_y": a_y}
    )
    follow = lambda *one: np.asarray(kit.follow("x", method, drive(*one))["v_y"])
    found = follow(a_y, 0.2, asked)
    np.testing.assert_allclose(found[time < 1.0], 0.3, atol=1e-12)
    late = time >= 1.0
    np.testing.assert_allclose(found[late], 0.3 + 0.2 * (time[late] - 0.99), atol=1e-9)
    # Far more steer than is answered: a slippery road.
    found = follow(0.0 * time + 1.0, 0.2, 3.0 * asked)
    np.testing.assert_allclose(found[1:], 0.3 + 0.2 * time[1:], atol=1e-9)
    # What a bank does to a_y - v_x r is not integrated.
    found = follow(a_y, 2.0, asked)
    np.testing.assert_allclose(found[time > 1.0], 0.3, atol=1e-12)


def test_fuzzy_rules_pull_to_the_model_in_gentle_driving_and_integrate_in_hard_and_not_on_a_bank():
    time = np.linspace(0.0, 3.0, 301)
    method = fusion.Fuzzy(saying(0.3), 0.2, 1.0)
    drive = lambda a_y, rate: Recording(
        time, {"v_x": V + 0 * time, "yaw_rate": (a_y - rate) / V + 0 * time, "a_y": a_y + 0 * time}
    )
    follow = lambda *one: np.asarray(kit.follow("x", method, drive(*one))["v_y"])
    # Gentle: pulled with the time constant, so that an even rate leaves itself times it, less half a row.
    np.testing.assert_allclose(follow(1.0, 0.1)[-1], 0.3 + 0.1 * 0.01 / np.expm1(0.01 / 0.2), rtol=1e-6)
    # Beyond the upper bound: the integral, while the slow part is below its lower one.
    np.testing.assert_allclose(follow(5.5, 0.25), 0.3 + 0.25 * time, atol=1e-9)
    # In between, half as true: twice the time constant.
    np.testing.assert_allclose(follow(3.5, 0.1)[-1], 0.3 + 0.1 * 0.01 / np.expm1(0.01 / 0.4), rtol=1e-2)
    # What stays beyond the upper bound is a bank.
    np.testing.assert_allclose(follow(5.5, 0.8)[-1], 0.3 + 0.8 * 0.01 / np.expm1(0.01 / 0.2), rtol=1e-6)


def test_weights_are_the_inverse_variances():
    time = np.linspace(0.0, 0.1, 11)
    method = fusion.Weighted(saying(0.4, 0.1), saying(-0.2, 0.2))
    found = kit.follow("x", method, log(time, method, v_x=V, yaw_rate=0.0, a_y=0.0))
    np.testing.assert_allclose(found["v_y"], (0.4 * 100.0 - 0.2 * 25.0) / 125.0)
    np.testing.assert_allclose(found.std.v_y, 125.0**-0.5)


def test_an_answer_is_known_where_the_car_is_fast_the_sensors_speak_and_the_spread_is_small():
    time = np.linspace(0.0, 2.0, 201)
    v_x = np.where(time < 1.0, V, 2.0)
    yaw_rate = np.where((time > 0.3) & (time < 0.8), np.nan, 0.0)
    guarded = common.guard(CAR, saying(0.4, 0.5), (common.YAW_RATE,))
    found = sideslip.estimate(guarded, log(time, guarded, v_x=v_x, yaw_rate=yaw_rate, a_y=0.0))
    heard = (time <= 0.3 + 0.3 + 1e-9) | (time >= 0.8)
    np.testing.assert_array_equal(found.known.sideslip, heard & (time < 1.0))
    wide = common.guard(CAR, saying(0.4, 1.2), (common.YAW_RATE,))
    found = sideslip.estimate(wide, log(time, wide, v_x=V, yaw_rate=0.0, a_y=0.0))
    assert not np.asarray(found.known.v_y).any() and (np.asarray(found.std.v_y) == 1.2).all()
    spun = common.guard(CAR, saying(-2.1 * V, 0.5))
    assert not np.asarray(sideslip.estimate(spun, log(time, spun, v_x=V, yaw_rate=0.0, a_y=0.0)).known.sideslip).any()
    silent = common.guard(CAR, saying(0.4, 0.5), claims=False)
    found = sideslip.estimate(silent, log(time, silent, v_x=V, yaw_rate=0.0, a_y=0.0))
    assert np.isnan(found.std.v_y).all() and np.asarray(found.known.v_y).all()


def test_the_sideslip_of_a_lateral_velocity_has_the_spread_of_its_slope():
    said = common.sideslip_answer(jnp.asarray(1.0), jnp.asarray(10.0), True, jnp.asarray(0.2))
    slope = jax.grad(lambda v_y: jnp.arctan2(v_y, 10.0))(1.0)
    np.testing.assert_allclose([said.mean.sideslip, said.std.sideslip], [np.arctan2(1.0, 10.0), 0.2 * slope])
    standing = common.sideslip_answer(jnp.asarray(0.0), jnp.asarray(0.0), True, jnp.asarray(0.2))
    assert np.isfinite(np.asarray(standing.mean)).all() and np.isfinite(np.asarray(standing.std)).all()


def _rotating(system, t, x, u):
    return type(x)(system[0][0] * x.v_y + system[0][1] * x.yaw_rate, system[1][0] * x.v_y + system[1][1] * x.yaw_rate)


def test_a_stiff_step_is_of_second_order_and_forgets_what_is_stiff():
    step, matrix = StiffStep(_rotating), np.array([[-8.0, -19.0], [1.3, -7.0]])
    errors = []
    for h in (0.02, 0.01):
        x = LateralState(jnp.asarray(0.3), jnp.asarray(-0.2))
        for k in range(round(0.2 / h)):
            x = step(matrix, k * h, (k + 1) * h, x, None)
        errors.append(np.abs(np.asarray(x) - expm(0.2 * matrix) @ [0.3, -0.2]).max())
    assert errors[0] < 1e-3 and 3.0 < errors[0] / errors[1] < 5.0
    gone = step(1e6 * np.array([[-1.0, -2.0], [1.0, -1.0]]), 0.0, 10.0, LateralState(*jnp.ones(2)), None)
    assert np.abs(np.asarray(gone)).max() < 1e-4


def test_elimination_solves_a_system():
    rng = np.random.default_rng(0)
    matrix, right = np.eye(4) + 0.3 * rng.normal(size=(4, 4)), rng.normal(size=4)
    np.testing.assert_allclose(solve(matrix.tolist(), right.tolist()), np.linalg.solve(matrix, right), rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "key", "unit"),
    [
        ("steering_torque", "steering_ratio", "-"),
        ("motor_moment", "wheel_radius", "m"),
        ("two_track", "track_front", "m"),
    ],
)
def test_what_a_car_s_file_lacks_is_named(name, key, unit):
    with pytest.raises(InputError, match=rf"sideslip: .*: the car's file has no .*{key} \({unit}\)"):
        sideslip.METHODS[name].make(dataclasses.replace(CAR, **{key: None}))


def test_a_method_has_its_own_filter():
    time = np.linspace(0.0, 0.1, 11)
    recording = Recording(time, {"v_x": V + 0 * time, "steer": 0 * time})
    for call in (
        lambda: sideslip.estimate(CAR, recording, method="open_loop", key=jax.random.key(0)),
        lambda: sideslip.live(CAR, method="open_loop", key=jax.random.key(0)),
    ):
        with pytest.raises(InputError, match="a method has its own filter and key"):
            call()
