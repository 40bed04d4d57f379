"""Every car in other units of mass, length and time: all parameters, states, inputs and outputs scale as their units say.

A car of a tenth of the size and a five hundredth of the mass, in times shortened so that gravity is the same, moves likewise. A
parameter or output with a wrong unit, and a number with a dimension inside a formula, do not.
"""

import dataclasses
import re

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from test_every_vehicle import CARS, ROUGH

from jaxveh._core.names import record
from jaxveh.tyres.mf_tyre import aligning, formula

MASS, LENGTH = 0.002, 0.1
TIME = LENGTH**0.5
FORCE = MASS * LENGTH / TIME**2
BASE = {
    "kg": MASS, "m": LENGTH, "s": TIME, "rad": 1.0, "Hz": 1 / TIME, "N": FORCE, "Pa": FORCE / LENGTH**2,
    "W": FORCE * LENGTH / TIME,
}  # fmt: skip
SPEEDS = ("crawl_speed",)
"""Settings with a unit that are no parameters."""
SPEED = 15.0
SIZES = {
    "m/s": 0.5, "rad": 0.03, "rad/s": 0.3, "m": 0.01, "m/s^2": 0.5, "rad/s^2": 0.3,
    "N m": 300.0, "N": 500.0, "-": 0.01, "Pa": 1e6,
}  # fmt: skip
"""Of random states and inputs."""


@pytest.fixture(autouse=True)
def small_guards(monkeypatch):
    """MF-Tyre has a number without a unit in its denominators, some of which are newtons: it shows in wheels that hardly touch
    the road."""
    for module in (formula, aligning):
        monkeypatch.setattr(module, "EPSILON", 1e-12)


def factor(unit):
    """What one of the unit is in the other units."""
    words = re.sub(r"(?<=[A-Za-z0-9)]) (?=[A-Za-z(])", "*", unit.replace("^", "**"))
    return 1.0 if unit == "-" else eval(words, {"__builtins__": {}}, BASE)


def scaled(value):
    """A module with every parameter in the other units, and so what is in it."""
    if type(value) is tuple:
        return tuple(scaled(one) for one in value)
    if not isinstance(value, eqx.Module):
        return value
    # Not by its constructor, whose arguments may be others than its fields.
    made = object.__new__(type(value))
    for field in dataclasses.fields(value):
        part, unit = getattr(value, field.name), "m/s" if field.name in SPEEDS else field.metadata.get("unit")
        part = scaled(part) if unit is None or part is None else part * factor(unit)
        object.__setattr__(made, field.name, part)
    return made


def unit_of(car, name):
    """Also of the states of tyres, and of the world position, which cars need not declare."""
    return car.units.get(name, "m" if "deflection" in name or name in ("x", "y") else "-")


def in_other_units(car, values, rate=1.0):
    return type(values)(*[value * factor(unit_of(car, name)) * rate for name, value in values._asdict().items()])


def assert_likewise(car, small, large, rate=1.0):
    wanted = in_other_units(car, large, rate)
    for name in large._fields:
        at_least = 1e-9 * factor(unit_of(car, name)) * rate
        np.testing.assert_allclose(
            getattr(small, name),
            getattr(wanted, name),
            rtol=1e-7,
            atol=at_least,
            err_msg=f"{name}, {unit_of(car, name)}",
        )


def assert_moves_alike(car, seed):
    rng, small = np.random.default_rng(seed), scaled(car)
    u = record("Inputs", {name: jnp.asarray(SIZES[car.units[name]] * rng.uniform(0.5, 1.5)) for name in car.inputs})
    u = u._replace(v_x=jnp.asarray(SPEED)) if "v_x" in car.inputs else u
    start = {"v_x": jnp.asarray(SPEED)} if "v_x" in car.state_type._fields else {}
    x = car.start(0.0, u, **start)
    assert_likewise(
        car, small.start(0.0, in_other_units(car, u), **{name: v * factor("m/s") for name, v in start.items()}), x
    )
    x = type(x)(*[value + SIZES[unit_of(car, name)] * rng.standard_normal() for name, value in x._asdict().items()])
    rates, outputs = car.evaluate(0.0, x, u, ROUGH)
    ground = type(ROUGH)(*[v * (LENGTH if "height" in name else 1.0) for name, v in ROUGH._asdict().items()])
    of_small = small.evaluate(0.0, in_other_units(car, x), in_other_units(car, u), ground)
    assert_likewise(car, of_small[0], rates, 1 / TIME)
    assert_likewise(car, of_small[1], outputs)


@pytest.mark.parametrize("name", CARS)
def test_every_car_moves_alike_in_other_units(name):
    assert_moves_alike(CARS[name].make(), 0)
