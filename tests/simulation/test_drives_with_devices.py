"""Drives that devices ride along in, gradients through a whole drive, and its precision."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import light, lightest

from jaxveh import manoeuvres, roads, sensors, statespace
from jaxveh.simulation import simulate

KEY = jax.random.key(3)


def test_devices_speak_at_their_own_instants_and_say_the_past():
    imu = sensors.IMU(rate=100.0, delay=0.013)
    optical = sensors.OpticalSideslip(rate=40.0)
    steer = manoeuvres.step_steer(20.0, 0.03, start=0.1, duration=1.0)
    drive = simulate(lightest(), steer, sensors.Suite((imu, optical)))
    exact = simulate(lightest(), steer, dt=0.001, max_step=0.001)
    late = np.interp(np.maximum(drive.time - 0.013, 0.0), exact.time, exact["true.yaw_rate"])
    spoken = np.isfinite(np.asarray(drive["yaw_rate"]))
    np.testing.assert_allclose(np.flatnonzero(spoken).size, 101)
    np.testing.assert_allclose(np.asarray(drive["yaw_rate"])[spoken], late[spoken], atol=1e-5)
    np.testing.assert_allclose(
        drive["true.yaw_rate"], np.interp(drive.time, exact.time, exact["true.yaw_rate"]), atol=1e-5
    )
    assert int(np.isfinite(np.asarray(drive["v_y"])).sum()) == 41
    assert "steer" not in drive and "true.steer" in drive


@pytest.mark.full
def test_production_devices_draw_from_the_key_and_may_be_vmapped():
    suite = sensors.production_car()
    steer = manoeuvres.step_steer(20.0, 0.03, start=0.1, duration=0.5)
    one = simulate(light(), steer, suite, KEY)
    same = simulate(light(), steer, suite, KEY)
    np.testing.assert_array_equal(one["yaw_rate"], same["yaw_rate"])
    many = jax.vmap(lambda key: simulate(light(), steer, suite, key, solver="explicit"))(jax.random.split(KEY, 2))
    assert many["yaw_rate"].shape == (2, len(one))
    assert not np.allclose(np.nan_to_num(many["yaw_rate"][0]), np.nan_to_num(many["yaw_rate"][1]))


def test_gradients_go_through_driver_road_and_car():
    """Reverse mode through a closed-loop drive on a slippery road, against finite differences."""
    steer = manoeuvres.step_steer(15.0, 0.04, start=0.1, duration=0.4)

    def miss(at):
        car = eqx.tree_at(lambda c: (c.front.cornering_stiffness, c.mass), lightest(), (at[0], at[1]))
        road = roads.Level(at[2])
        drive = simulate(car, steer, road=road, dt=0.02)
        return jnp.sum(drive["true.yaw_rate"] ** 2) + 0.1 * jnp.sum((drive["true.y"]) ** 2)

    # Values and gradients by one program.
    both = jax.jit(jax.value_and_grad(miss))
    at, steps = np.asarray([160000.0, 1500.0, 0.5]), np.asarray([20.0, 0.1, 1e-4])
    expected = [(both(at + side)[0] - both(at - side)[0]) / (2 * side.sum()) for side in np.diag(steps)]
    np.testing.assert_allclose(both(at)[1], expected, rtol=1e-4)


@pytest.mark.full
def test_float32_drives_are_float32():
    car, steer = statespace.cast((light(), manoeuvres.step_steer(20.0, 0.03, start=0.1, duration=0.5)), np.float32)
    drive = simulate(car, steer, road=statespace.cast(roads.Level(0.8), np.float32), dt=0.05)
    exact = simulate(
        light(), manoeuvres.step_steer(20.0, 0.03, start=0.1, duration=0.5), road=roads.Level(0.8), dt=0.05
    )
    assert {values.dtype for values in drive.channels.values()} == {np.dtype(np.float32)}
    np.testing.assert_allclose(drive["true.yaw_rate"], exact["true.yaw_rate"], atol=1e-4)
