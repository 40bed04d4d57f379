"""Cars whose wheels do not slip: geometry of circles, and the trailer behind."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from planar_cars import point

from jaxveh import InputError, vehicles


def wheel_across(vehicle, x, u, wheel, angle):
    """Speed of a wheel's contact point across the wheel, from the motion alone."""
    moves, (px, py) = vehicle.motion(x, u), vehicle.wheel_positions[wheel]
    along, across = moves.v_x - moves.yaw_rate * py, moves.v_y + moves.yaw_rate * px
    return float(across * np.cos(angle) - along * np.sin(angle))


@pytest.mark.parametrize("ahead", [0.0, 1.1, 2.7])
@pytest.mark.parametrize("v_x", [8.0, -3.0])
def test_no_wheel_slides_sideways(ahead, v_x):
    vehicle = vehicles.Kinematic(2.7, ahead)
    x, u = point(vehicle, steer=0.3, v_x=v_x)
    np.testing.assert_allclose([wheel_across(vehicle, x, u, w, 0.3) for w in (0, 1)], 0.0, atol=1e-14)
    np.testing.assert_allclose([wheel_across(vehicle, x, u, w, 0.0) for w in (2, 3)], 0.0, atol=1e-14)


def test_outputs_of_a_circle():
    vehicle = vehicles.Kinematic(2.7, 1.5)
    x, u = point(vehicle, steer=0.2, v_x=6.0)
    out = vehicle.outputs(0.0, x, u)
    rear, own = 2.7 / np.tan(0.2), np.hypot(2.7 / np.tan(0.2), 1.5)
    np.testing.assert_allclose(out.curvature, 1 / rear, rtol=1e-12)
    np.testing.assert_allclose(out.yaw_rate, 6.0 / rear, rtol=1e-12)
    np.testing.assert_allclose(out.sideslip, np.arcsin(1.5 / own), rtol=1e-12)
    np.testing.assert_allclose(np.hypot(out.v_x, out.v_y), own * out.yaw_rate, rtol=1e-12)
    # The accelerometer points at the circle's centre: speed^2 over radius.
    np.testing.assert_allclose(np.hypot(out.a_x, out.a_y), own * out.yaw_rate**2, rtol=1e-12)
    np.testing.assert_allclose(out.a_y, 6.0 * out.yaw_rate, rtol=1e-12)


def test_a_travelling_car_closes_its_circle():
    vehicle = vehicles.Travelling(vehicles.Kinematic(2.7, 1.5))
    _, u = point(vehicle.vehicle, steer=0.2, v_x=6.0)
    x = vehicle.start(0.0, u)
    steps = 400
    dt = 2 * np.pi / (6.0 * np.tan(0.2) / 2.7) / steps

    def step(x, _):
        rates = lambda x: vehicle.derivatives(0.0, x, u)
        add = lambda x, k, h: jax.tree.map(lambda a, b: a + h * b, x, k)
        k1 = rates(x)
        k2 = rates(add(x, k1, 0.5 * dt))
        k3 = rates(add(x, k2, 0.5 * dt))
        k4 = rates(add(x, k3, dt))
        return jax.tree.map(lambda a, p, q, r, s: a + dt / 6 * (p + 2 * q + 2 * r + s), x, k1, k2, k3, k4), None

    end, _ = jax.lax.scan(step, x, length=steps)
    np.testing.assert_allclose([end.x, end.y, end.yaw], [0.0, 0.0, 2 * np.pi], atol=1e-7)


def test_the_trailers_axle_does_not_slide():
    vehicle = vehicles.KinematicTrailer(2.7, 6.0, 0.8)
    x, u = point(vehicle, steer=0.25, v_x=5.0)
    rates, out = vehicle.evaluate(0.0, x, u)
    turning = rates.yaw + rates.hitch_angle
    # Hitch and trailer axle in the car's directions.
    hitch = np.array([5.0, -0.8 * rates.yaw])
    back = -6.0 * np.array([np.cos(x.hitch_angle), np.sin(x.hitch_angle)])
    axle = hitch + turning * np.array([-back[1], back[0]])
    along = np.array([np.cos(x.hitch_angle), np.sin(x.hitch_angle)])
    np.testing.assert_allclose(along[0] * axle[1] - along[1] * axle[0], 0.0, atol=1e-14)
    np.testing.assert_allclose(out.trailer_v_x, along @ axle, rtol=1e-12)
    np.testing.assert_allclose(out.trailer_yaw, 0.5 - 0.3, rtol=1e-12)


@pytest.mark.parametrize("behind", [0.0, 0.8])
def test_in_a_steady_turn_car_and_trailer_have_one_centre(behind):
    """sin(alpha) R + c cos(alpha) = -l: the trailer's axle points at the centre of the turn too."""
    vehicle = vehicles.KinematicTrailer(2.7, 6.0, behind)
    radius = 2.7 / np.tan(0.2)
    angle = -np.arcsin(6.0 / np.hypot(radius, behind)) - np.arctan2(behind, radius)
    x, u = point(vehicle, steer=0.2, v_x=5.0, hitch_angle=angle)
    np.testing.assert_allclose(vehicle.derivatives(0.0, x, u).hitch_angle, 0.0, atol=1e-14)


def test_forwards_the_trailer_follows_and_backwards_it_jackknifes():
    vehicle = vehicles.KinematicTrailer(2.7, 6.0)
    rate = lambda v_x, angle: float(
        vehicle.derivatives(0.0, *point(vehicle, steer=0.0, v_x=v_x, hitch_angle=angle)).hitch_angle
    )
    assert rate(5.0, 0.3) < 0 < rate(-5.0, 0.3)
    assert rate(-5.0, np.pi / 2) == 0
    assert rate(-5.0, -1.6) == 0
    assert rate(5.0, 1.6) < -0.5


def test_at_walking_speed_the_linear_single_track_is_kinematic():
    dynamic = vehicles.build(vehicles.sets.passenger_car(), vehicles.LinearSingleTrack)
    kinematic = vehicles.Kinematic(dynamic.wheelbase, dynamic.rear_axle_to_cg)
    x, u = point(kinematic, steer=1e-3, v_x=0.1)
    np.testing.assert_allclose(dynamic.yaw_rate_gain(0.1) * 1e-3, kinematic.motion(x, u).yaw_rate, rtol=1e-4)
    np.testing.assert_allclose(dynamic.sideslip_gain(0.1) * 1e-3, kinematic.outputs(0.0, x, u).sideslip, rtol=1e-4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: vehicles.Kinematic(0.0), r"Kinematic\.wheelbase = 0\.0: must be positive"),
        (lambda: vehicles.Kinematic(2.7, float("inf")), r"Kinematic\.rear_axle_to_reference = inf: must be finite"),
        (lambda: vehicles.KinematicTrailer(2.7, -6.0), r"KinematicTrailer\.trailer_length = -6\.0"),
        (lambda: vehicles.KinematicTrailer(2.7, 6.0, hitch_limit=4.0), r"hitch_limit = 4\.0: must be in \(0, pi\] rad"),
    ],
)
def test_bad_parameters_raise(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_gradient_of_the_wheelbase_is_that_of_the_circle():
    x, u = point(vehicles.Kinematic(2.7), steer=0.2, v_x=6.0)
    slope = jax.grad(lambda length: vehicles.Kinematic(length).derivatives(0.0, x, u).yaw)(jnp.asarray(2.7))
    np.testing.assert_allclose(slope, -6.0 * np.tan(0.2) / 2.7**2, rtol=1e-12)
