"""The formulas that cars share, each beside its equation in NumPy: torques within grip, loads, slopes, limits, estimates."""

import math
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import vehicles
from jaxveh.roads import LEVEL
from jaxveh.tyres import Forces
from jaxveh.vehicles import GRAVITY
from jaxveh.vehicles.limits import AccelerationLimits, SteerLimits
from jaxveh.vehicles.load_transfer import axle_loads, limit_transfer, planar_loads
from jaxveh.vehicles.sets.estimate import estimated_suspension
from jaxveh.vehicles.traction import saturate, within_grip
from jaxveh.vehicles.wheels import (
    Wheels,
    body_forces,
    corners,
    each_wheel,
    front_rear,
    gravity,
    rolling,
    sum_of_wheels,
    travel_direction,
)

END = 0.99**0.5


def test_a_demand_is_met_up_to_nine_tenths_of_the_grip_and_no_further_than_its_end():
    """Exact up to sqrt(0.99) - 0.1, from sqrt(0.99) + 0.1 on sqrt(0.99), between them the parabola that joins both smoothly."""
    wish = np.array([0.0, 0.3, -0.85, 0.96, 1.05, -1.0, 1.2, -7.0])
    held = np.minimum(np.abs(wish), END + 0.1)
    expected = np.sign(wish) * (held - np.maximum(held - (END - 0.1), 0.0) ** 2 / 0.4)
    np.testing.assert_allclose(saturate(jnp.asarray(wish)), expected, rtol=1e-12)
    np.testing.assert_allclose(saturate(jnp.asarray(5.0)), END, rtol=1e-12)


def test_a_wheel_s_forces_are_on_the_ellipse_of_its_grip():
    given = Forces(F_x=jnp.asarray(0.0), F_y=jnp.asarray(2000.0), M_x=5.0, M_y=6.0, M_z=jnp.asarray(-40.0))
    for wish, limit in ((1500.0, 3000.0), (-9000.0, 3000.0), (0.3, 0.5), (5.0, 0.0)):
        s = float(saturate(jnp.asarray(wish / max(limit, 1e-6))))
        found, left = within_grip(given, jnp.asarray(wish), jnp.asarray(limit)), (1 - s**2) ** 0.5
        np.testing.assert_allclose(found, (limit * s, 2000.0 * left, 5.0, 6.0, -40.0 * left), rtol=1e-12)


def test_the_direction_of_travel_turns_smoothly_about_standstill():
    """(15 s - 10 s^3 + 3 s^5) / 8 with s = v / (15 / 16), so that the slope at zero is 2."""
    speed = np.array([-3.0, -0.9375, -0.5, 0.0, 0.2, 0.9, 0.9375, 2.0])
    s = np.clip(speed / 0.9375, -1.0, 1.0)
    np.testing.assert_allclose(travel_direction(speed), (15 * s - 10 * s**3 + 3 * s**5) / 8, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(jax.grad(travel_direction)(0.0), 2.0, rtol=1e-12)


def test_gravity_on_a_slope_is_gravity_turned_into_the_road_s_plane():
    """The plane's normal is (-tan grade, -tan bank, 1); x lies in the vertical plane of the heading."""
    assert gravity(LEVEL) == (0.0, 0.0, -GRAVITY)
    for grade, bank in ((0.1, 0.0), (0.0, -0.2), (0.15, 0.25)):
        x = np.array([1.0, 0.0, np.tan(grade)])
        normal = np.array([-np.tan(grade), -np.tan(bank), 1.0])
        x, normal = x / np.linalg.norm(x), normal / np.linalg.norm(normal)
        down = np.array([0.0, 0.0, -GRAVITY])
        expected = down @ x, down @ np.cross(normal, x), down @ normal
        found = gravity(LEVEL._replace(grade=jnp.asarray(grade), bank=jnp.asarray(bank)))
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


def test_a_wheel_rolls_with_the_body_s_velocity_at_its_place_in_its_own_axes():
    places = corners(1.1, 1.5, 1.6, 1.4)
    assert places == ((1.1, 0.8), (1.1, -0.8), (-1.5, 0.7), (-1.5, -0.7))
    for (x, y), angle in zip(places, (0.1, 0.2, 0.0, -0.3), strict=True):
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        expected = turn @ np.array([12.0 - 0.4 * y, 0.5 + 0.4 * x])
        found = rolling((x, y), 12.0, 0.5, 0.4, math.cos(angle), 0.0 if angle == 0.0 else math.sin(angle))
        np.testing.assert_allclose(found[:2], expected, rtol=1e-12)


def test_the_body_s_forces_are_the_sum_of_the_wheels_turned_into_its_axes():
    rng = np.random.default_rng(0)
    places = corners(1.1, 1.5, 1.6, 1.4)
    angles, pushes = rng.uniform(-0.4, 0.4, 4), rng.normal(size=(4, 3))
    moves = Wheels(*[SimpleNamespace(cosine=np.cos(a), sine=np.sin(a)) for a in angles])
    forces = Wheels(*[Forces(F_x=x, F_y=y, M_z=z) for x, y, z in pushes])
    X = [f[0] * np.cos(a) - f[1] * np.sin(a) for f, a in zip(pushes, angles, strict=True)]
    Y = [f[0] * np.sin(a) + f[1] * np.cos(a) for f, a in zip(pushes, angles, strict=True)]
    turning = sum(p[0] * y - p[1] * x + f[2] for p, x, y, f in zip(places, X, Y, pushes, strict=True))
    found = body_forces(places, moves, forces)
    np.testing.assert_allclose(found[:3], (sum(X), sum(Y), turning), rtol=1e-12)
    np.testing.assert_allclose(found.F_x_wheels, X, rtol=1e-12)
    np.testing.assert_allclose(found.F_y_wheels, Y, rtol=1e-12)
    assert sum_of_wheels(Wheels(1, 20, 300, 4000)) == 4321
    assert each_wheel(lambda a, b: a - b, Wheels(1, 2, 3, 4), front_rear(10, 20)) == (-9, -8, -17, -16)


CAR = SimpleNamespace(
    mass=1500.0, front_axle_to_cg=1.1, rear_axle_to_cg=1.5, cg_height=0.6, track_front=1.6, track_rear=1.5,
    front_roll_share=0.55,
)  # fmt: skip


@pytest.mark.parametrize("share", [0.55, None])
def test_loads_balance_the_moments_of_both_accelerations(share):
    """In pitch about the axles, in roll about the middle, with the front's share; the static one where none is told."""
    car = SimpleNamespace(**{**vars(CAR), "front_roll_share": share})
    q = 1.5 / 2.6 if share is None else share
    a_x, a_y, g = 2.0, 3.0, 9.5
    loads = planar_loads(car, *map(jnp.asarray, (a_x, a_y, -g)))
    front, rear = 1500.0 * (g * 1.5 - a_x * 0.6) / 2.6, 1500.0 * (g * 1.1 + a_x * 0.6) / 2.6
    np.testing.assert_allclose(axle_loads(car, jnp.asarray(a_x), -g), (front, rear), rtol=1e-12)
    np.testing.assert_allclose((loads.fl + loads.fr, loads.rl + loads.rr), (front, rear), rtol=1e-12)
    np.testing.assert_allclose((loads.fr - loads.fl) / 2 * 1.6, q * 1500.0 * a_y * 0.6, rtol=1e-12)
    np.testing.assert_allclose((loads.rr - loads.rl) / 2 * 1.5, (1 - q) * 1500.0 * a_y * 0.6, rtol=1e-12)


@pytest.mark.parametrize("share", [0.95, 0.05])
def test_what_an_axle_on_one_wheel_cannot_take_the_other_takes(share):
    car = SimpleNamespace(**{**vars(CAR), "front_roll_share": share})
    a_y = 8.2
    loads = planar_loads(car, jnp.asarray(0.0), jnp.asarray(a_y), -9.8)
    lifted = loads.fl if share > 0.5 else loads.rl
    assert float(lifted) == 0.0
    roll = (loads.fr - loads.fl) / 2 * 1.6 + (loads.rr - loads.rl) / 2 * 1.5
    np.testing.assert_allclose(roll, 1500.0 * a_y * 0.6, rtol=1e-12)
    # Past the rollover both left wheels hang, and no load is negative.
    over = planar_loads(car, jnp.asarray(0.0), jnp.asarray(30.0), -9.8)
    np.testing.assert_allclose((over.fl, over.rl), 0.0, atol=1e-9)
    np.testing.assert_allclose(sum_of_wheels(over), 1500.0 * 9.8, rtol=1e-12)
    assert [float(limit_transfer(jnp.asarray(moved), 2.0)) for moved in (-3.0, 1.0, 3.0)] == [-2.0, 1.0, 2.0]
    # An axle that lifts leaves the weight to the other.
    np.testing.assert_allclose(axle_loads(car, jnp.asarray(90.0), -9.8), (0.0, 1500.0 * 9.8), atol=1e-9)


def test_commands_are_limited_in_rate_at_the_stops_and_by_power():
    steer = SteerLimits(-0.5, 0.6, -0.3, 0.4)
    cases = ((0.0, 0.2, 0.2), (0.0, 1.0, 0.4), (0.0, -1.0, -0.3), (0.6, 0.2, 0.0), (0.6, -0.2, -0.2), (-0.5, -0.2, 0.0))
    for angle, rate, expected in (*cases, (-0.5, 0.2, 0.2), (0.7, 0.1, 0.0)):
        assert float(steer.limit(jnp.asarray(angle), jnp.asarray(rate))) == expected
    drive = AccelerationLimits(8.0, 5.0, -10.0, 40.0)
    cases = ((3.0, 9.0, 8.0), (3.0, -9.0, -8.0), (20.0, 9.0, 2.0), (20.0, 1.5, 1.5), (20.0, -9.0, -8.0))
    for speed, wish, expected in (*cases, (40.0, 1.0, 0.0), (40.0, -1.0, -1.0), (-10.0, -1.0, 0.0), (-10.0, 1.0, 1.0)):
        assert float(drive.limit(jnp.asarray(speed), jnp.asarray(wish))) == expected


@pytest.mark.parametrize(("slip", "over"), [(0.05, 0.0), (0.15, 0.5), (0.3, 1.0)])
def test_an_anti_lock_builds_up_below_its_slips_and_releases_above(slip, over):
    """dq/dt = build (1 - q) (1 - s) - release q s, half way between the slips half of each."""
    system = vehicles.AntiLock(vehicles.named_car("compact_car", "seven-dof"), build=5.0, release=20.0)
    expected = 5.0 * (1 - 0.7) * (1 - over) - 20.0 * 0.7 * over
    np.testing.assert_allclose(system._change(jnp.asarray(0.7), jnp.asarray(slip)), expected, rtol=1e-12, atol=1e-12)


def test_an_estimated_suspension_has_the_frequencies_and_shares_of_its_description():
    known = {
        "mass": 1600.0, "yaw_inertia": 2600.0, "front_axle_to_cg": 1.2, "rear_axle_to_cg": 1.5, "cg_height": 0.56,
        "track_front": 1.55, "track_rear": 1.6, "wheel_radius": 0.32, "unsprung_mass_front": 45.0, "unsprung_mass_rear": 40.0,
    }  # fmt: skip
    s = estimated_suspension(**known)
    sprung = 1600.0 - 90.0 - 80.0
    assert s.sprung_mass == sprung and s.front_axle_to_cg + s.rear_axle_to_cg == pytest.approx(2.7)
    # Masses have their moments about the front axle and the road, and their inertia about the car's centre of gravity.
    assert sprung * s.front_axle_to_cg + 80.0 * 2.7 == pytest.approx(1600.0 * 1.2)
    assert sprung * s.cg_height + 170.0 * 0.32 == pytest.approx(1600.0 * 0.56)
    points = 90.0 * (1.2**2 + 0.775**2) + 80.0 * (1.5**2 + 0.8**2) + sprung * (1.2 - s.front_axle_to_cg) ** 2
    assert s.yaw_inertia + points == pytest.approx(2600.0)
    assert (s.pitch_inertia, s.roll_inertia) == pytest.approx((1.04 * s.yaw_inertia, sprung * (0.34 * 1.575) ** 2))
    for axle, hertz, lever, bar in (
        ("front", 1.3, s.rear_axle_to_cg, 0.2), ("rear", 1.5, s.front_axle_to_cg, 0.05),
    ):  # fmt: skip
        corner, spring = 0.5 * sprung * lever / 2.7, getattr(s, f"spring_{axle}")
        assert math.sqrt(spring / corner) / (2 * math.pi) == pytest.approx(hertz)
        assert getattr(s, f"damper_{axle}") / (2 * math.sqrt(spring * corner)) == pytest.approx(0.27)
        assert getattr(s, f"anti_roll_{axle}") == pytest.approx(bar * spring)
    assert (s.roll_centre_front, s.roll_centre_rear) == (0.05, 0.1)
    assert s.tyre_stiffness == pytest.approx(50.0 * 1600.0 * GRAVITY / 4)
