"""Kinematic filters on exact motions of a rigid body, cars on four wheels, and what the methods are worth on simulated cars."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from method_logs import CAR

from jaxveh import Recording, manoeuvres, roads, sensors, simulate, vehicles
from jaxveh._core.names import record
from jaxveh.estimators import sideslip
from jaxveh.estimators.sideslip_methods import four_wheels, kinematic, single_track
from jaxveh.vehicles import GRAVITY

pytestmark = pytest.mark.full


def derivative(f):
    return jax.vmap(jax.grad(f))


def body(time, lean):
    """A motion of a rigid body and what an ideal inertial unit says of it: speed, v_y, roll, pitch and yaw as functions of
    time."""
    v_x, v_y = (lambda t: 18.0 + 2.0 * jnp.sin(0.5 * t)), (lambda t: 0.6 * jnp.sin(0.9 * t) + 0.2 * jnp.sin(2.1 * t))
    roll, pitch = (lambda t: lean * jnp.sin(0.4 * t + 0.3)), (lambda t: 0.5 * lean * jnp.sin(0.7 * t))
    yaw = lambda t: 0.3 * t + 0.2 * jnp.sin(0.5 * t)
    at = {name: jax.vmap(f)(time) for name, f in (("v_x", v_x), ("v_y", v_y), ("roll", roll), ("pitch", pitch))}
    slope = {
        n: derivative(f)(time) for n, f in (("v_x", v_x), ("v_y", v_y), ("roll", roll), ("pitch", pitch), ("yaw", yaw))
    }
    s, c = jnp.sin(at["roll"]), jnp.cos(at["roll"])
    nose, level = jnp.sin(at["pitch"]), jnp.cos(at["pitch"])
    p = slope["roll"] - slope["yaw"] * nose
    q = slope["pitch"] * c + slope["yaw"] * level * s
    r = -slope["pitch"] * s + slope["yaw"] * level * c
    # The road's own gravity, in axes turned by yaw, then pitch, then roll.
    gravity = -GRAVITY * nose, GRAVITY * s * level, GRAVITY * c * level
    none = jnp.zeros_like(time)
    velocity, turn = jnp.stack([at["v_x"], at["v_y"], none]), jnp.stack([p, q, r])
    force = jnp.stack([slope["v_x"], slope["v_y"], none]) + jnp.cross(turn, velocity, axis=0) + jnp.stack(gravity)
    said = dict(zip(("a_x", "a_y", "a_z", "roll_rate", "pitch_rate", "yaw_rate"), (*force, p, q, r), strict=True))
    return said | {"v_x": at["v_x"]}, at


def recording(time, channels):
    return Recording(np.asarray(time), {name: np.asarray(value) for name, value in channels.items()})


def test_six_axes_tell_lateral_velocity_through_any_roll_and_pitch_and_a_plane_filter_on_a_plane():
    time = jnp.arange(3000.0) * 0.01
    said, truth = body(time, 0.08)
    found = sideslip.estimate(CAR, recording(time, said), method="six_axis")
    late = np.asarray(time) > 10.0
    error = np.asarray(found["v_y"] - truth["v_y"])[late]
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert np.mean((error / np.asarray(found.std.v_y)[late]) ** 2) < 1.0
    plane = lambda lean: sideslip.estimate(CAR, recording(time, body(time, lean)[0]), method="kinematic_kalman")["v_y"]
    rms = lambda v_y: float(np.sqrt(np.mean(np.asarray(v_y - truth["v_y"])[late] ** 2)))
    assert rms(plane(0.0)) < 0.03 and rms(plane(0.08)) > 0.2


def test_the_equations_of_the_six_axes_are_those_of_the_motion():
    time = jnp.arange(50.0) * 0.1
    said, truth = body(time, 0.3)
    slopes = {n: np.gradient(np.asarray(body(jnp.arange(5001.0) * 0.001, 0.3)[1][n]), 0.001)[::100][:50] for n in truth}
    u = record("Inputs", {name: said[name] for name in kinematic.six_axis_model().inputs})
    x = kinematic.BodyState(truth["v_x"], truth["v_y"], 0.0 * time, truth["roll"], truth["pitch"])
    rates = kinematic.body_drift(None, 0.0, x, u)
    for name in truth:
        np.testing.assert_allclose(getattr(rates, name)[1:], slopes[name][1:], atol=1e-5)
    np.testing.assert_allclose(rates.v_z, 0.0, atol=1e-9)


@pytest.mark.parametrize(("name", "lean"), [("two_track", False), ("roll_3dof", True)])
def test_a_car_on_four_wheels_finds_its_own_motion(name, lean):
    method = sideslip.METHODS[name].make(CAR)
    model = method.inner.model

    def row(x, t):
        u = record("Inputs", {"steer": 0.03 * jnp.sin(3.0 * t), "v_x": 20.0 + 0.0 * t})
        seen, shown = model.observation(t, x, u), model.report(t, x, u)
        return model.transition(t, t + 0.01, x, u), (u._asdict() | seen._asdict(), shown.v_y, getattr(x, "roll", t))

    start = jax.tree.map(jnp.zeros_like, model.prior.mean)
    time = jnp.arange(300.0) * 0.01
    _, (channels, v_y, roll) = jax.jit(lambda x: jax.lax.scan(row, x, time))(start)
    found = sideslip.estimate(CAR, recording(time, channels), method=name)
    assert np.sqrt(np.mean(np.asarray(found["v_y"] - v_y) ** 2)) < 5e-3 * np.abs(v_y).max()
    if lean:
        # In a left turn the left side rises, and the accelerometer on the body says more.
        inputs = record("Inputs", {"steer": 0.0, "v_x": 20.0})
        leaning = type(model.prior.mean)(*[jnp.asarray(value) for value in (0.0, 0.0, 0.05, 0.0)])
        felt = four_wheels.leaning_observation(model.system, 0.0, leaning, inputs).a_y
        upright = model.system.car.outputs(0.0, single_track.full_state(model.system.car, leaning), inputs).a_y
        np.testing.assert_allclose(felt, upright * np.cos(0.05) + GRAVITY * np.sin(0.05))
        turning = np.asarray(channels["a_y"]) > 3.0
        assert (np.asarray(roll)[turning] > 0.0).mean() > 0.9


def test_the_recommended_method_says_what_live_says():
    time = np.arange(60) * 0.01
    yaw_rate = 0.2 * np.sin(3.0 * time)
    channels = {"v_x": 20.0 + 0 * time, "yaw_rate": yaw_rate, "a_y": 20.0 * yaw_rate, "a_x": 0 * time}
    found = sideslip.estimate(CAR, recording(time, channels), method=sideslip.RECOMMENDED)
    live = sideslip.live(CAR)
    rows = [(float(time[k]), {name: float(values[k]) for name, values in channels.items()}) for k in range(60)]
    belief, said = live.init(*rows[0])
    for k, row in enumerate(rows):
        if k:
            belief, said = live.step(belief, *row)
        for field in said.mean._fields:
            np.testing.assert_allclose(found[field][k], getattr(said.mean, field), rtol=1e-8, atol=1e-10)
            np.testing.assert_allclose(getattr(found.std, field)[k], getattr(said.std, field), rtol=1e-8)


def simulated(steer, seed=7):
    """A sedan of seven degrees of freedom in random steering, with the noise and offsets of usual sensors, and the truth."""
    numbers = vehicles.sets.sedan()
    car = vehicles.build(numbers, vehicles.SevenDOF)
    driver = manoeuvres.random_steering(22.0, steer, jax.random.key(seed), lowest=0.1, highest=0.6, duration=20.0)
    found = simulate(car, driver, dt=0.01, max_step=0.0025, start={"v_x": 22.0}, road=roads.Level())
    rng, true = (
        np.random.default_rng(seed),
        {name: np.asarray(found[f"true.{name}"]) for name in ("v_y", "sideslip", "v_x", "steer")},
    )
    unit = sensors.IMU(("a_x", "a_y", "a_z", "roll_rate", "pitch_rate", "yaw_rate"), rate=100.0)
    outputs = {n: jnp.asarray(found[f"true.{n}"]) for n in (*unit.needs, "v_x")}
    ideal = unit.say(jnp.asarray(found.time), outputs, None)
    noise = {"a": (0.05, 0.05), "r": (np.radians(0.1), np.radians(0.05))}
    level = lambda name: noise["a" if name.startswith("a_") else "r"]
    rows = len(true["v_x"])
    said = {
        n: np.asarray(v) + level(n)[0] * rng.normal(size=rows) + level(n)[1] * rng.normal() for n, v in ideal.items()
    }
    said |= {
        "v_x": true["v_x"] + 0.05 * rng.normal(size=rows),
        "steer": true["steer"] + np.radians(0.05) * rng.normal(),
    }
    return (
        dataclasses.replace(vehicles.specification_of(numbers), steering_ratio=16.0),
        recording(found.time, said),
        true,
    )


BETTER = ("adapted_stiffness", "ekf", "luenberger", "sliding_mode", "six_axis")
"""In a sedan at the limit than the open loop, all by a fifth at least."""


def test_methods_are_better_than_the_open_loop_at_the_limit_and_their_spreads_are_honest():
    car, log, truth = simulated(0.045)
    rms = {}
    for name in ("open_loop", *BETTER):
        found = sideslip.estimate(car, log, method=name)
        error = np.asarray(found["sideslip"]) - truth["sideslip"]
        rms[name] = np.degrees(np.sqrt(np.mean(error[200:] ** 2)))
        std = np.asarray(found.std.sideslip)[200:]
        if name in ("adapted_stiffness", "six_axis"):
            assert 0.1 < np.mean((error[200:] / std) ** 2) < 5.0, name
        else:
            assert np.isnan(std).all()
    assert rms["open_loop"] > 0.5
    for name in BETTER:
        assert rms[name] < 0.8 * rms["open_loop"], (name, rms)
