"""`simulate` warns of a steer that no car has: degrees in a replay, or inputs of a manoeuvre of one's own in another order."""

import types
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import JaxvehWarning, Recording, manoeuvres, vehicles
from jaxveh._core.names import record
from jaxveh.simulation import simulate
from jaxveh.simulation.steered import warn_of_steer
from jaxveh.vehicles.steering import STEER_UNITS

TIME = np.arange(0.0, 0.5, 0.05)
CARS = {
    "linear": lambda: vehicles.linear_single_track(vehicles.passenger_car()),
    "single track": vehicles.passenger_car,
}


def replayed(steer):
    channels = {"steer": steer * np.sin(2 * np.pi * TIME), "v_x": np.full(TIME.size, 20.0)}
    return manoeuvres.replay(Recording(TIME, channels))


class Swapped(manoeuvres.AbstractManoeuvre):
    duration: float = 0.5

    def inputs(self, t):
        return manoeuvres.DriverInputs(20.0 + 0 * t, 0.02 + 0 * t, 0 * t)


@pytest.mark.parametrize("car", CARS)
@pytest.mark.parametrize(("manoeuvre", "size"), [(replayed(2.0), 2), (Swapped(), 20)], ids=["degrees", "swapped"])
def test_a_steer_that_no_car_has_gets_a_warning(car, manoeuvre, size):
    with pytest.warns(JaxvehWarning, match=rf"steer is -?{size}(\.\d+)? rad at t = .* more than any road wheel turns"):
        simulate(CARS[car](), manoeuvre)


@pytest.mark.parametrize("car", CARS)
def test_the_steer_of_a_car_and_one_under_jit_get_none(car):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulate(CARS[car](), replayed(0.7))
        jax.jit(lambda car: simulate(car, replayed(2.0))["true.yaw_rate"])(CARS[car]())
        drives = jax.vmap(lambda scale: simulate(CARS[car](), replayed(2.0 * scale))["true.yaw_rate"])(jnp.ones(2))
    assert jnp.isfinite(drives).all()


@pytest.mark.parametrize("name", STEER_UNITS)
def test_every_wheel_angle_is_looked_at_as_far_as_the_drive_reached(name):
    late = np.where(TIME > 0.28, 30.0, 0.0)
    drive = lambda reached: types.SimpleNamespace(u=record("Inputs", {"v_x": TIME, name: late}), reached=reached)
    with pytest.warns(JaxvehWarning, match=f"{name} is 30 rad at t = 0.3 s"):
        warn_of_steer(drive(TIME.size), TIME)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_steer(drive(5), TIME)
        # The steering wheel of a `Steered` car turns further.
        wheel = record("Inputs", {"steering_wheel": late})
        warn_of_steer(types.SimpleNamespace(u=wheel, reached=TIME.size), TIME)
