"""Mass and grade of a car that the filter's own model drives: known answers, honest spreads, mistakes named."""

import functools

import jax
import numpy as np
import pytest

from jaxveh import InputError, Recording, estimators, filters, manoeuvres, roads, vehicles
from jaxveh._core.bijectors import Real
from jaxveh.simulation import simulate
from jaxveh.vehicles import Longitudinal, sets

MASS, DT = 1500.0, 0.1


def car(mass=MASS):
    return Longitudinal(mass, wheel_radius=0.3, drag=0.4, rolling_resistance=0.012)


@functools.cache
def drive():
    """80 s of a drive over a wavy road with restless pedals, and what sensors say of it."""
    keys = jax.random.split(jax.random.key(0), 3)
    road = roads.RandomRoad(grade=roads.gauss_markov(0.02, 300.0, keys[0], shortest=200.0, count=20))
    foot = manoeuvres.cruise(20.0, keys[1], pedal_noise=0.3 * MASS * 0.3, duration=80.0, count=20)
    found = simulate(car(), foot, road=road, dt=DT, max_step=0.05)
    rng = np.random.default_rng(0)
    channels = {
        "v_x": found["true.v_x"] + 0.02 * rng.normal(size=len(found)),
        "a_x": found["true.a_x"] + 0.05 + 0.05 * rng.normal(size=len(found)),
        "drive_torque": found["drive_torque"],
        "brake_torque": found["brake_torque"],
    }
    return Recording(found.time, channels), np.asarray(found["true.grade"])


def estimate(recording, grade_rate_walk=3e-3, **options):
    model = estimators.mass_and_grade.model(car(1100.0), start_speed=20.0, grade_rate_walk=grade_rate_walk, **options)
    return filters.run(filters.Unscented(), model, recording)


def test_mass_and_grade_are_found_from_speed_alone():
    recording, grade = drive()
    found = estimate(recording)
    assert abs(found.mean.mass[-1] / MASS - 1) < 0.02
    assert abs(found.mean.mass[-1] - MASS) < 4 * found.std.mass[-1] < 0.1 * MASS
    assert np.sqrt(np.mean((np.asarray(found.mean.grade)[300:] - grade[300:]) ** 2)) < np.deg2rad(0.15)


def test_an_accelerometer_s_offset_is_a_state():
    recording, _ = drive()
    # Without the offset's state 0.05 m/s^2 are taken for force.
    aided = estimate(recording, a_x=0.05, a_x_bias=0.1)
    assert abs(aided.mean.bias[-1] - 0.05) < 0.02
    assert abs(aided.mean.mass[-1] / MASS - 1) < 0.01
    assert aided.std.mass[-1] < estimate(recording).std.mass[-1]


def test_a_mass_may_be_additive_and_a_grade_may_walk():
    model = estimators.mass_and_grade.model(car(1100.0), mass_domain=Real(), grade_walk=2e-3, grade_rate_walk=None)
    assert model.states == ("v_x", "grade", "mass")
    np.testing.assert_allclose(model.prior.mean.mass, 1100.0)
    np.testing.assert_allclose(np.sqrt(np.diagonal(model.prior.covariance()))[2], 0.4 * 1100.0)
    assert set(model.process_noise.law.names) == {"v_x", "grade"}


def test_the_model_is_the_vehicle_s_own():
    """The truck of the sets, on a grade, at one instant, by hand."""
    truck = vehicles.build(sets.truck(), Longitudinal)
    model = estimators.mass_and_grade.model(truck, a_x=0.05, a_x_bias=0.1)
    x = type(model.prior.mean)(v_x=15.0, grade=0.03, grade_rate=0.001, bias=0.2, mass=np.log(truck.mass))
    u = model.row(0.0, {"drive_torque": 2000.0, "brake_torque": 0.0}, {}).u
    after = model.transition(0.0, 1e-4, x, u)
    m, r = float(truck.mass), float(truck.wheel_radius)
    moving = m + 4 * float(truck.wheel_inertia) / r**2
    g = vehicles.GRAVITY
    force = 2000.0 / r - float(truck.rolling_resistance) * m * g * np.cos(0.03) - float(truck.drag) * 225.0
    rate = (force - m * g * np.sin(0.03)) / moving
    np.testing.assert_allclose((after.v_x - 15.0) / 1e-4, rate, rtol=1e-4)
    np.testing.assert_allclose((after.grade - 0.03) / 1e-4, 0.001, rtol=1e-6)
    np.testing.assert_allclose(model.observation(0.0, x, u).a_x, rate + g * np.sin(0.03) + 0.2, rtol=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"v_x": 0.0}, r"mass_and_grade: v_x = 0\.0: must be positive"),
        ({"a_x": -1.0}, r"mass_and_grade: a_x = -1\.0"),
        ({"grade_walk": -1.0}, r"grade_walk = -1\.0: must be at least 0 rad per root second"),
        ({"grade_rate_walk": 0.0}, r"grade_rate_walk = 0\.0: must be positive"),
        ({"a_x_bias": 0.1}, "a_x_bias: there is no accelerometer"),
    ],
)
def test_mistakes_are_named(options, message):
    with pytest.raises(InputError, match=message):
        estimators.mass_and_grade.model(car(), **options)
