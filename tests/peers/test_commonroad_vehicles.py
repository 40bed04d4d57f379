"""CommonRoad's kinematic (KS), trailer (KST) and single-track (ST) models (commonroad-vehicle-models 3.0.2) against ours.

Their state vectors and ours hold the same quantities, and their derivatives agree to 1e-12 at random states
and inputs, at and beyond the limits of steering and acceleration too. Their g is 9.81 m/s^2: heights, which enter as h / g, are
scaled by ours over theirs. What is not the same, each with its test:

- The rate of the sideslip below 0.1 m/s has tan^2 for tan inside a square (`KinematicCrawl`); the yaw acceleration inherits it.
- Backwards, above 0.1 m/s, their tyres push the car along its sliding: slip angles do not reverse sign with the speed, so that
  all tyre forces have the opposite sign of ours.
- A trailer at a right angle stays there for ever; ours leaves where the car pulls it away.
"""

import dataclasses
import importlib
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import io, vehicles

pytestmark = pytest.mark.peers

pytest.importorskip("vehiclemodels")
# Not skipped where the package is there but has changed.
parameters = importlib.import_module("vehiclemodels.vehicle_parameters")
ks = importlib.import_module("vehiclemodels.vehicle_dynamics_ks").vehicle_dynamics_ks
kst = importlib.import_module("vehiclemodels.vehicle_dynamics_kst").vehicle_dynamics_kst
st = importlib.import_module("vehiclemodels.vehicle_dynamics_st").vehicle_dynamics_st

THEIR_G = 9.81
WITH_MASS = (1, 2, 3)
"""Vehicle 4, the tractor of a semi-trailer, has no mass: it has KS and KST alone."""
NAMES = {
    "ks": ("x", "y", "steer", "v_x", "yaw"),
    "kst": ("x", "y", "steer", "v_x", "yaw", "hitch_angle"),
    "st": ("x", "y", "steer", "v_x", "yaw", "yaw_rate", "sideslip"),
}
"""Their vectors in our names."""


class Inputs(NamedTuple):
    steer_rate: Any
    acceleration: Any


@pytest.fixture(params=[1, 2, 3, 4])
def p(request):
    return parameters.setup_vehicle_parameters(request.param)


@pytest.fixture(params=WITH_MASS)
def p_mass(request):
    return parameters.setup_vehicle_parameters(request.param)


def commanded(vehicle, p):
    steer, drive = p.steering, p.longitudinal
    return vehicles.Travelling(
        vehicles.Commanded(
            vehicle,
            steer_limits=vehicles.SteerLimits(steer.min, steer.max, steer.v_min, steer.v_max),
            acceleration_limits=vehicles.AccelerationLimits(drive.a_max, drive.v_switch, drive.v_min, drive.v_max),
        )
    )


def our_single_track(p):
    stiffness = -p.tire.p_ky1 * p.m * THEIR_G / (p.a + p.b)
    car = vehicles.LinearSingleTrack(
        mass=p.m,
        yaw_inertia=p.I_z,
        front_axle_to_cg=p.a,
        rear_axle_to_cg=p.b,
        front_stiffness=stiffness * p.b,
        rear_stiffness=stiffness * p.a,
        cg_height=p.h_s * vehicles.GRAVITY / THEIR_G,
        crawl_speed=0.1,
    )
    return commanded(vehicles.KinematicCrawl(car, below=0.1), p)


def random_rows(names, p, rng, count, speed):
    """States and inputs, many of them at and beyond the limits; `speed` is the range of v, m/s."""
    low, high = p.steering.min, p.steering.max
    steer = rng.uniform(1.2 * low, 1.2 * high, count)
    steer[: count // 8] = rng.choice([low, high], count // 8)
    columns = {
        "x": rng.uniform(-100, 100, count),
        "y": rng.uniform(-100, 100, count),
        "steer": steer,
        "v_x": rng.uniform(*speed, count),
        "yaw": rng.uniform(-7, 7, count),
        "yaw_rate": rng.uniform(-1, 1, count),
        "sideslip": rng.uniform(-0.5, 0.5, count),
        "hitch_angle": rng.uniform(-np.pi / 2, np.pi / 2, count),
    }
    commands = rng.uniform([-1.0, -15.0], [1.0, 15.0], (count, 2))
    return np.stack([columns[name] for name in names], axis=1), commands


def ours(vehicle, names, rows, commands):
    """Derivatives, one row a state, in their order."""

    @eqx.filter_jit
    def rates(vehicle, x, u):
        return vehicle.derivatives(0.0, x, u)

    columns = dict(zip(names, jnp.asarray(rows.T), strict=True))
    x = vehicle.state_type(**columns)
    found = rates(vehicle, x, Inputs(*jnp.asarray(commands.T)))
    return np.stack([np.broadcast_to(getattr(found, name), len(rows)) for name in names], axis=1)


def theirs(model, rows, commands, p):
    return np.array([model(list(row), list(u), p) for row, u in zip(rows, commands, strict=True)])


def assert_equal(found, expected):
    """To 1e-12 of the value, or of 1 where that is smaller (measured: 3e-14)."""
    np.testing.assert_array_less(np.abs(found - expected) / np.maximum(np.abs(expected), 1.0), 1e-12)


def test_the_kinematic_single_track_is_theirs(p):
    rows, commands = random_rows(NAMES["ks"], p, np.random.default_rng(1), 500, (-20.0, 60.0))
    vehicle = commanded(vehicles.Kinematic(wheelbase=p.a + p.b), p)
    assert vehicle.state_type._fields == NAMES["ks"]
    assert_equal(ours(vehicle, NAMES["ks"], rows, commands), theirs(ks, rows, commands, p))


def trailer(p):
    # The cars have no trailer: they get the tractor's.
    length = parameters.setup_vehicle_parameters(4).trailer.l_wb if p.trailer.l_wb is None else p.trailer.l_wb
    p.trailer.l_wb = length
    return commanded(vehicles.KinematicTrailer(wheelbase=p.a + p.b, trailer_length=length), p)


def test_the_trailer_is_theirs(p):
    rows, commands = random_rows(NAMES["kst"], p, np.random.default_rng(2), 500, (-20.0, 60.0))
    vehicle = trailer(p)
    assert vehicle.state_type._fields == NAMES["kst"]
    assert_equal(ours(vehicle, NAMES["kst"], rows, commands), theirs(kst, rows, commands, p))


def test_a_trailer_at_a_right_angle_leaves_it_where_it_is_pulled_away(p):
    vehicle = trailer(p)
    rows = np.array([[0, 0, steer, v, 0, 1.6] for steer in (-0.2, 0.2) for v in (-5.0, 5.0)], dtype=float)
    commands = np.zeros((4, 2))
    found, expected = ours(vehicle, NAMES["kst"], rows, commands), theirs(kst, rows, commands, p)
    assert_equal(found[:, :5], expected[:, :5])
    free = -rows[:, 3] * (np.sin(1.6) / p.trailer.l_wb + np.tan(rows[:, 2]) / (p.a + p.b))
    assert np.all(expected[:, 5] == 0)
    np.testing.assert_allclose(found[:, 5], np.minimum(free, 0.0), rtol=1e-12)
    assert np.any(found[:, 5] < -0.1)


def test_the_single_track_is_theirs_forwards(p_mass):
    rows, commands = random_rows(NAMES["st"], p_mass, np.random.default_rng(3), 1000, (0.1, 60.0))
    found, expected = ours(our_single_track(p_mass), NAMES["st"], rows, commands), theirs(st, rows, commands, p_mass)
    assert_equal(found, expected)


def test_backwards_their_tyres_push_the_other_way(p_mass):
    rows, commands = random_rows(NAMES["st"], p_mass, np.random.default_rng(4), 300, (-13.0, -0.2))
    found, expected = ours(our_single_track(p_mass), NAMES["st"], rows, commands), theirs(st, rows, commands, p_mass)
    assert_equal(found[:, :5], expected[:, :5])
    assert_equal(found[:, 5], -expected[:, 5])
    # Without tyres the sideslip turns by minus the yaw rate.
    assert_equal(found[:, 6] + rows[:, 5], -(expected[:, 6] + rows[:, 5]))


def test_at_a_crawl_all_but_the_square_is_theirs(p_mass):
    p = p_mass
    rows, commands = random_rows(NAMES["st"], p, np.random.default_rng(5), 500, (-0.0999, 0.0999))
    found, expected = ours(our_single_track(p), NAMES["st"], rows, commands), theirs(st, rows, commands, p)
    assert_equal(found[:, :5], expected[:, :5])
    tangent, lean, length = np.tan(rows[:, 2]), p.b / (p.a + p.b), p.a + p.b
    theirs_over_ours = (1 + (lean * tangent) ** 2) / (1 + (lean * tangent**2) ** 2)
    assert_equal(found[:, 6] * theirs_over_ours, expected[:, 6])
    carried = rows[:, 3] * np.sin(rows[:, 6]) * tangent / length
    assert_equal(found[:, 5] + carried * (found[:, 6] - expected[:, 6]), expected[:, 5])
    assert np.max(np.abs(found[:, 6] - expected[:, 6])) > 1e-3


def test_the_rate_of_the_kinematic_sideslip_is_ours(p_mass):
    """The derivative of atan(b tan(delta) / L), which theirs is not."""
    lean = p_mass.b / (p_mass.a + p_mass.b)
    rows = np.array([[0, 0, 0.5, 0.05, 0, 0, 0]], dtype=float)
    commands = np.array([[0.3, 0.0]])
    slope = 0.3 * float(jax.grad(lambda steer: jnp.arctan(lean * jnp.tan(steer)))(0.5))
    np.testing.assert_allclose(ours(our_single_track(p_mass), NAMES["st"], rows, commands)[0, 6], slope, rtol=1e-12)


FOLDER = Path(parameters.__file__).parent / "parameters"
CARS = {1: "ford_escort", 2: "bmw_320i", 3: "vw_vanagon", 4: "semi_trailer_truck"}


@pytest.mark.parametrize("number", CARS)
def test_their_files_read_and_are_the_cars_of_our_sets(number, p_of):
    p = p_of(number)
    spec = io.read_commonroad(FOLDER / f"parameters_vehicle{number}.yaml", FOLDER / "parameters_tire.yaml")
    ours = getattr(vehicles.sets.commonroad_cars, CARS[number])()
    for entry in dataclasses.fields(spec):
        if entry.name == "tyre":
            continue
        read, kept = getattr(spec, entry.name), getattr(ours, entry.name)
        theirs = p
        for part in entry.metadata["key"].split("."):
            theirs = getattr(theirs, part)
        assert read == (None if theirs is None else float(theirs)), entry.name
        if kept is not None:
            np.testing.assert_allclose(kept, read, rtol=5e-5, err_msg=entry.name)
    known = {name: value for name, value in spec.tyre.items() if value != 0}
    assert ours.tyre is None or dict(ours.tyre) == known


@pytest.fixture
def p_of():
    return parameters.setup_vehicle_parameters
