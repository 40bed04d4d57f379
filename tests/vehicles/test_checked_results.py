"""Mistakes in a vehicle of one's own are reported with the name of the vehicle and of the method."""

import dataclasses

import jax.numpy as jnp
import pytest

import jaxveh
from jaxveh import InputError, estimators, manoeuvres, sensors, vehicles
from jaxveh.kit import record_type
from jaxveh.roads import LEVEL

KNOWN = vehicles.passenger_car()
PARAMETERS = {field.name: getattr(KNOWN, field.name) for field in dataclasses.fields(KNOWN)}


class Same(vehicles.SingleTrack):
    """The single track as it is."""


class Swapped(vehicles.SingleTrack):
    """Outputs before rates."""

    def evaluate(self, t, x, u, ground=LEVEL):
        return super().evaluate(t, x, u, ground)[::-1]


class Plain(vehicles.SingleTrack):
    """Rates without names."""

    def evaluate(self, t, x, u, ground=LEVEL):
        rates, outputs = super().evaluate(t, x, u, ground)
        return tuple(rates), outputs


class RatesAlone(vehicles.SingleTrack):
    """No outputs."""

    def evaluate(self, t, x, u, ground=LEVEL):
        return super().evaluate(t, x, u, ground)[0]


class Three(vehicles.SingleTrack):
    """A result too many."""

    def evaluate(self, t, x, u, ground=LEVEL):
        return (*super().evaluate(t, x, u, ground), x)


class Dictionary(vehicles.SingleTrack):
    """Outputs as a dict."""

    def evaluate(self, t, x, u, ground=LEVEL):
        rates, outputs = super().evaluate(t, x, u, ground)
        return rates, outputs._asdict()


class WithoutUnit(vehicles.SingleTrack):
    """An output without a unit."""

    @property
    def units(self):
        return {name: unit for name, unit in super().units.items() if name != "sideslip"}


MISTAKES = {
    Swapped: r"Swapped.evaluate: its first result is .*sideslip.*must be .*\(.*yaw_rate\)\. The order is \(rates, outputs\)",
    Plain: r"Plain.evaluate: its first result is tuple: must be .*yaw_rate",
    RatesAlone: r"RatesAlone.evaluate: returned .*: must return two, \(rates, outputs\)",
    Three: r"Three.evaluate: returned 3 results: must return two",
    Dictionary: r"Dictionary.evaluate: its second result is dict: must be a NamedTuple",
}


@pytest.mark.parametrize("kind", MISTAKES, ids=lambda kind: kind.__name__)
def test_each_mistake_is_said_by_simulation_and_by_filters(kind):
    car = kind(**PARAMETERS)
    with pytest.raises(InputError, match=MISTAKES[kind]):
        jaxveh.simulate(car, manoeuvres.double_lane_change(20.0, 0.02), dt=0.02)
    with pytest.raises(InputError, match=MISTAKES[kind]):
        estimators.state_space(car, sensors.esc(yaw_rate=0.005, a_y=0.1))


def test_an_output_without_a_unit_is_named():
    with pytest.raises(InputError, match=r"WithoutUnit.units: has no sideslip: each input and output must have a unit"):
        jaxveh.simulate(WithoutUnit(**PARAMETERS), manoeuvres.double_lane_change(20.0, 0.02), dt=0.02)


def test_a_sound_vehicle_answers_as_before():
    car, u = Same(**PARAMETERS), record_type("Inputs", ("steer", "v_x"))(jnp.asarray(0.02), jnp.asarray(20.0))
    x = car.start(0.0, u)
    for found, expected in zip(car.evaluate(0.0, x, u), KNOWN.evaluate(0.0, x, u), strict=True):
        assert found == expected
