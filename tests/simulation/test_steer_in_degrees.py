"""`simulate` warns of a steer that no car has: degrees in a replay, or inputs of a manoeuvre of one's own in another order."""

import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import JaxvehWarning, Recording, manoeuvres, vehicles
from jaxveh.simulation import simulate

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
