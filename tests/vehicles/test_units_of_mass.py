"""No car has a mass or a force of its own: a car a millionth as heavy, with tyres and springs as weak, moves the same way."""

import re

import jax.numpy as jnp
import numpy as np
import pytest
from test_every_vehicle import CARS, ROUGH, made, stirred

from jaxveh._core.parameter import every_parameter, pick, put

SHARE = 1e-6


def power(unit):
    """Of the unit of mass in a unit: `N/rad`, `kg m^2`, `W`."""
    above, _, below = unit.partition("/")
    count = lambda part: len(re.findall(r"\b(?:kg|N|W|J|Pa)\b", part))
    return count(above) - count(below)


@pytest.mark.parametrize("name", CARS)
def test_a_car_a_millionth_as_heavy_moves_the_same_way(name):
    car, (x, u) = made(name), stirred(name)
    found = tuple(every_parameter(car).values())
    light = put(car, found, [value * SHARE ** power(p.unit) for p, value in zip(found, pick(car, found), strict=True)])
    units = car.units
    push = type(u)(*[value * SHARE ** power(units.get(n, "-")) for n, value in u._asdict().items()])
    # MF-Tyre adds a millionth to what it divides by.
    near = 1e-3 if "MF-Tyre" in name else 1e-6
    rates, outputs = car.evaluate(0.0, x, u, ROUGH)
    light_rates, light_outputs = light.evaluate(0.0, x, push, ROUGH)
    for n, rate in rates._asdict().items():
        np.testing.assert_allclose(getattr(light_rates, n), rate, rtol=near, atol=near, err_msg=n)
    for n, value in outputs._asdict().items():
        shown = jnp.asarray(getattr(light_outputs, n)) / SHARE ** power(units[n])
        np.testing.assert_allclose(shown, value, rtol=near, atol=near, err_msg=n)
