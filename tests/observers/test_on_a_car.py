"""Observers of a car's sideslip, from yaw rate and lateral acceleration: a wrong start, a bank, a road that turns slippery."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording, estimators, observers, run, sensors
from jaxveh import statespace as ss
from jaxveh.tyres import Brush
from jaxveh.vehicles import SingleTrack

DT, SPEED, ROWS = 0.01, 25.0, 1500
U = {"v_x": SPEED}


def car(friction=0.9):
    tyre = lambda stiffness: Brush(slip_stiffness=1e5, cornering_stiffness=stiffness, friction=friction)
    return SingleTrack(
        mass=1420.0, yaw_inertia=2124.0, front_axle_to_cg=0.96, rear_axle_to_cg=1.59, front=tyre(9.0e4), rear=tyre(1.2e5)
    )  # fmt: skip


def model(**settings):
    return estimators.state_space(car(), sensors.esc(), report=(), solver=diffrax.Euler(), **settings)


def frictions(car):
    return (car.front.friction, car.rear.friction)


@eqx.filter_jit
def _roll(model, x, rows, friction):
    def body(x, now):
        row, mu = now
        there = eqx.tree_at(lambda m: frictions(m.system.vehicle), model, (mu, mu))
        seen = there.observation(row.t, x, row.u)
        return there.transition(row.t, row.t + DT, x, row.u), (x, tuple(getattr(seen, c) for c in model.channels))

    return jax.lax.scan(body, x, (rows, friction))[1]


def drive(model, start, steer, friction=0.9, seed=0):
    """What the car really does: its states (T, n), and what its sensors say of it with their noise."""
    rows, rng = len(steer), np.random.default_rng(seed)
    time = DT * np.arange(rows)
    inputs = {"steer": steer, "v_x": np.full(rows, SPEED)}
    blank = Recording(time, {**inputs, **{name: np.full(rows, np.nan) for name in model.channels}})
    x = type(model.prior.mean)(*[jnp.asarray(float(value)) for value in start])
    states, seen = _roll(model, x, model.rows(blank), jnp.broadcast_to(jnp.asarray(friction), rows))
    std = model.measurement_noise.std
    noisy = {
        n: np.asarray(v) + float(getattr(std, n)) * rng.normal(size=rows)
        for n, v in zip(std._fields, seen, strict=True)
    }
    return np.stack(states, axis=1), Recording(time, {**inputs, **noisy})


def steering(size=0.04):
    t = DT * np.arange(ROWS)
    return size * np.sin(2.0 * np.pi * 0.5 * t) + 0.5 * size * np.sin(2.0 * np.pi * 0.17 * t)


def gain(poles=(-12.0, -14.0)):
    return observers.place_poles(model(), poles, dt=DT, u=U, leave=("yaw",))


def sideslip_rms(v_y, states, where=slice(None)):
    return float(np.sqrt(np.mean(np.square(np.arctan2(np.asarray(v_y) - states[:, 0], SPEED))[where])))


@pytest.mark.parametrize("kind", ["Luenberger", "sliding mode"])
def test_sideslip_is_nearer_than_open_loop_from_a_wrong_start(kind):
    states, recording = drive(model(), (2.0, 0.0, 0.3), steering())
    fast = gain((-20.0, -22.0))
    observer = observers.Luenberger(fast)
    if kind == "sliding mode":
        switching = np.zeros((3, 2))
        switching[0, 1], switching[2, 0] = -0.01, 0.002
        observer = observers.SlidingMode(fast, switching, [0.02, 0.5])
    found = run(observer, model(), recording).mean.v_y
    alone = run(observers.Luenberger(np.zeros((3, 2))), model(), recording).mean.v_y
    early = slice(0, 100)
    assert sideslip_rms(found, states, early) < 0.8 * sideslip_rms(alone, states, early)
    late = slice(20, 60)
    assert sideslip_rms(found, states, late) < 0.2 * sideslip_rms(alone, states, late)


def test_lyapunov_s_condition_holds_while_the_forces_fall_with_lateral_velocity():
    # Imsland et al. (2006): the measured acceleration pulls v_y to where the tyres' forces agree. Below their peak one
    # quadratic form falls everywhere; where both axles slide, forces tell nothing of v_y.
    start = model().prior.mean
    at = lambda v_y, r: (type(start)(jnp.asarray(v_y), jnp.asarray(0.0), jnp.asarray(r)), U)
    normal = [at(v_y, r) for v_y in (0.0, -0.8, -0.4, 0.4, 0.8) for r in (-0.15, 0.0, 0.15)]
    rate = observers.contraction_rate(model(), gain(), [at(0.0, 0.0), *normal], dt=DT, leave=("yaw",))
    at_rest = observers.contraction_rate(model(), gain(), [at(0.0, 0.0)], dt=DT, leave=("yaw",))
    # At the point of linearisation it is the slower pole: as many channels as states move, each mode on its own.
    assert 0.0 < rate < at_rest == pytest.approx(12.0)
    assert observers.contraction_rate(model(), gain(), [at(0.0, 0.0), at(9.0, 0.0)], dt=DT, leave=("yaw",)) < 0.0
    with pytest.raises(InputError, match="a step multiplies the error by"):
        observers.contraction_rate(model(), -30 * gain(), [at(0.0, 0.0)], dt=DT, leave=("yaw",))


def test_a_car_s_yaw_leaves_no_trace_and_is_named():
    with pytest.raises(InputError, match="2 of 3 directions.*in yaw does not"):
        observers.place_poles(model(), (-12.0, -13.0, -14.0), dt=DT, u=U)
    with pytest.raises(InputError, match="leave: .*a_y depends on yaw_rate"):
        observers.place_poles(model(), (-12.0,), dt=DT, u=U, leave=("yaw", "yaw_rate"))


def test_a_bank_is_the_disturbance_of_the_lateral_velocity():
    # Gravity along the bank is not felt by the accelerometer: -g sin(0.06).
    bank = -9.81 * np.sin(0.06)
    banked = ss.with_disturbances(model(), {"v_y": 1.0})
    states, recording = drive(banked, (0.0, 0.0, 0.0, bank), steering(0.02))
    observer = observers.extended_state(banked, 6.0, dt=DT, u=U, leave=("yaw",))
    found = run(observer, banked, recording).mean
    late = slice(200, None)
    assert abs(np.mean(np.asarray(found.disturbance_v_y)[late]) - bank) < 0.05 * abs(bank)
    blind = run(observers.Luenberger(gain((-6.0, -6.0))), model(), recording)
    assert sideslip_rms(found.v_y, states, late) < 0.5 * sideslip_rms(blind.mean.v_y, states, late)


def test_a_road_that_turns_slippery_is_adapted_to():
    drop = 500
    friction = np.where(np.arange(ROWS) < drop, 0.9, 0.5)
    states, recording = drive(model(), (0.0, 0.0, 0.0), steering(), friction)
    joint = model(estimate=frictions, prior=0.3)
    bounds = dict.fromkeys(("front_friction", "rear_friction"), (0.1, 1.2))
    observer = observers.Adaptive(gain(), dict.fromkeys(bounds, 0.2), bounds=bounds)
    found = run(observer, joint, recording)
    front, rear = np.asarray(found.mean.front_friction), np.asarray(found.mean.rear_friction)
    for mu in (front, rear):
        assert abs(np.mean(mu[drop - 100 : drop]) - 0.9) < 0.1
        assert abs(np.mean(mu[-300:]) - 0.5) < 0.05
    fixed = run(observers.Luenberger(gain()), model(), recording)
    late = slice(drop + 300, None)
    assert sideslip_rms(found.mean.v_y, states, late) < 0.2 * sideslip_rms(fixed.mean.v_y, states, late)
