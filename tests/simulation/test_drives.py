"""Drives with drivers, roads, devices and events; solvers by stiffness."""

import sys
import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import light, lightest, peak, seven

from jaxveh import InputError, JaxvehWarning, manoeuvres, roads, simulation, vehicles
from jaxveh.simulation import simulate, stiffness

KEY = jax.random.key(3)


def straight(speed=20.0, duration=1.0):
    return manoeuvres.step_steer(speed, 0.0, start=0.1, duration=duration)


def test_a_car_with_pedals_holds_the_speed_of_a_manoeuvre_that_says_one():
    drive = simulate(lightest(drag=0.4, rolling_resistance=0.012), straight(duration=6.0), dt=0.1)
    assert {"drive_torque", "brake_torque", "steer"} <= set(drive.names)
    np.testing.assert_allclose(drive["true.v_x"], 20.0, atol=0.05)
    assert drive["drive_torque"][-1] > 50.0 > drive["brake_torque"][-1]
    np.testing.assert_allclose(drive["true.x"][-1], 120.0, atol=0.3)


def test_a_cruise_is_driven_at_its_speed_and_the_noise_of_the_foot_is_added():
    car = vehicles.Longitudinal(1500.0, drag=0.4, rolling_resistance=0.012)
    found = {}
    for noise, error in ((0.0, 0.1), (50.0, 0.3)):
        wanted = manoeuvres.cruise(20.0, KEY, speed_std=1.0, pedal_noise=noise, pedal_time=0.1, duration=30.0)
        drive = simulate(car, wanted, dt=0.1)
        np.testing.assert_allclose(drive["true.v_x"], wanted.speed.v_x(drive.time), atol=error)
        found[noise] = np.asarray(drive["drive_torque"] - drive["brake_torque"])
    own = wanted.inputs(drive.time)
    foot = np.asarray(own.drive_torque - own.brake_torque)
    assert np.corrcoef(found[50.0] - found[0.0], foot)[0, 1] > 0.8


def test_braking_by_torque_slows_as_newton_says():
    brakes = manoeuvres.mu_jump_braking(
        20.0, deceleration=3.0, mass=1500.0, wheel_radius=0.32, brake_at=0.5, duration=3.0
    )
    drive = simulate(lightest(), brakes, dt=0.1)
    assert float(np.min(drive["true.a_x"])) == pytest.approx(-3.0, abs=0.15)
    # What the wheels' spins hold is braked, too: 4 J / r^2 of 47 kg beside 1500.
    assert drive["true.v_x"][-1] == pytest.approx(20.0 - 3.0 * 2.35, abs=0.4)


def test_friction_is_that_of_the_place_where_each_wheel_stands():
    split = roads.SplitMu(1.0, 0.3)
    drive = simulate(light(), straight(), road=split, dt=0.05)
    np.testing.assert_allclose(drive["true.friction_fl"], 1.0, atol=1e-6)
    np.testing.assert_allclose(drive["true.friction_rr"], 0.3, atol=1e-6)
    jump = roads.MuJump(1.0, 0.4, 10.0)
    drive = simulate(light(), straight(), road=jump, dt=0.01)
    front = np.asarray(drive["true.friction_fl"]) < 0.7
    rear = np.asarray(drive["true.friction_rl"]) < 0.7
    first = lambda where: float(drive["true.x"][np.argmax(where)])
    assert first(front) == pytest.approx(10.5 - 1.2, abs=0.2)
    assert first(rear) == pytest.approx(10.5 + 1.4, abs=0.2)


def test_a_hill_slows_a_car_without_engine():
    """Rolling freely on a steady grade: the energy is that of a mass point."""
    hill = roads.Profile(np.asarray([0.0, 1000.0]), grade=np.asarray([0.05, 0.05]))
    drive = simulate(
        lightest(), manoeuvres.mu_jump_braking(20.0, brake_at=5.0, deceleration=1e-3, duration=6.0), road=hill, dt=0.5
    )
    v, x = np.asarray(drive["true.v_x"]), np.asarray(drive["true.x"])
    np.testing.assert_allclose(v**2 / 2 + 9.80665 * np.sin(0.05) * x, 200.0, rtol=1e-3)
    np.testing.assert_allclose(drive["true.a_x"], 0.0, atol=1e-3)


def test_standstill_ends_a_braking():
    brakes = manoeuvres.mu_jump_braking(
        10.0, brake_at=0.2, deceleration=5.0, mass=1500.0, wheel_radius=0.32, duration=5.0
    )
    drive = simulate(lightest(), brakes, until=simulation.standstill(0.2), dt=0.01)
    assert drive.time[-1] < 3.0
    assert float(drive["true.v_x"][-1]) == pytest.approx(0.2, abs=0.06)
    assert "standstill (below 0.2 m/s) at t = 2." in drive.source
    assert np.all(np.isfinite(np.asarray(drive["true.v_x"])))


def test_rows_after_an_event_are_nan_under_jit():
    brakes = manoeuvres.mu_jump_braking(
        10.0, brake_at=0.2, deceleration=5.0, mass=1500.0, wheel_radius=0.32, duration=3.0
    )
    run = jax.jit(lambda car: simulate(car, brakes, until=simulation.standstill(1.0), dt=0.1)["true.v_x"])
    v = np.asarray(run(lightest()))
    assert v.shape == (31,)
    assert np.isnan(v[-1]) and np.isfinite(v[10])


def test_a_wheel_that_lifts_ends_a_drive():
    tall = eqx.tree_at(lambda car: car.cg_height, light(), np.asarray(1.4))
    drive = simulate(tall, manoeuvres.step_steer(20.0, 0.06, start=0.1, duration=2.0), until=simulation.wheel_lift(5.0))
    assert "wheel lift" in drive.source and drive.time[-1] < 1.5
    least = min(float(drive[f"true.load_{wheel}"][-1]) for wheel in ("fl", "rl"))
    assert 0.0 <= least < 200.0
    with pytest.raises(InputError, match="no load per wheel"):
        simulate(vehicles.passenger_car(), straight(), until=simulation.wheel_lift())


def test_the_fastest_pole_is_the_spectral_radius():
    driven = simulation.driven_car(seven(), straight())
    x = jax.jit(lambda: driven.start(jnp.asarray(0.0), float, v_x=7.0))()
    flat, back = jax.flatten_util.ravel_pytree(x)
    jacobian = jax.jit(jax.jacfwd(lambda z: jax.flatten_util.ravel_pytree(driven.derivatives(0.0, back(z)))[0]))(flat)
    expected = np.max(np.abs(np.linalg.eigvals(np.asarray(jacobian))))
    assert expected > 500.0
    assert float(jax.jit(lambda x: simulation.fastest_pole(driven, 0.0, x))(x)) == pytest.approx(expected, rel=0.02)


def test_a_slow_car_gets_short_steps_and_a_crawling_one_an_implicit_solver():
    assert stiffness.choose(200.0, 0.002).max_step == 0.002
    assert stiffness.choose(2500.0, 0.002).max_step == pytest.approx(1e-3)
    crawling = stiffness.choose(50000.0, 0.002)
    assert crawling.controller is not None


@pytest.mark.full
def test_steps_that_are_too_long_are_never_silent():
    """At walking speed the spins are faster than 2 ms can hold: insisting warns, "auto" does not need to."""
    drive = manoeuvres.step_steer(3.0, 0.05, start=0.1, duration=0.6)
    with pytest.warns(JaxvehWarning, match=r"steps of 0\.002 s are too long for a motion of \d+ 1/s at t = .*max_step"):
        simulate(seven(wheel_inertia=0.6), drive, solver="explicit", throw=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        auto = simulate(seven(wheel_inertia=0.6), drive)
    exact = simulate(seven(wheel_inertia=0.6), drive, max_step=2e-4)
    assert peak(auto["true.yaw_rate"] - exact["true.yaw_rate"]) < 1e-4 * peak(exact["true.yaw_rate"])
    assert peak(auto["true.omega_fl"] - exact["true.omega_fl"]) < 1e-4 * peak(exact["true.omega_fl"])


@pytest.mark.full
def test_the_implicit_solver_and_equal_steps_agree():
    steer = manoeuvres.step_steer(20.0, 0.03, start=0.1, duration=0.6)
    found = [simulate(vehicles.passenger_car(), steer, solver=solver, dt=0.05) for solver in ("implicit", "explicit")]
    np.testing.assert_allclose(found[0]["true.yaw_rate"], found[1]["true.yaw_rate"], atol=1e-5)


def test_unknown_solvers_and_roads_are_refused():
    with pytest.raises(InputError, match=r"solver = 'rk4': must be one of 'auto', 'explicit', 'implicit'"):
        simulate(light(), straight(), solver="rk4")
    with pytest.raises(InputError, match="Travelling.road = [0-9.]+: must be a road"):
        simulate(light(), straight(), road=3)
    with pytest.raises(InputError, match="must be a manoeuvre or a driver"):
        simulate(light(), 3)


@pytest.mark.parametrize("long", [True, False], ids=["long", "short"])
def test_progress_is_told_while_it_runs_where_that_is_long(long, monkeypatch):
    monkeypatch.setattr(sys.modules["jaxveh.simulation.solve"], "TOLD_FROM", 20 if long else 10_000)
    heard = []
    simulate(lightest(), straight(duration=0.5), progress=lambda done, total, stage: heard.append(done / total))
    assert heard[0] == 0.0 and heard[-1] == 1.0 and heard == sorted(heard)
    assert (len(heard) > 20) == long
