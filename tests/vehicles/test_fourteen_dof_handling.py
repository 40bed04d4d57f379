"""FourteenDOF in steady turns and manoeuvres: moment balance, roll gradient, anti-dive, the limit of stiff springs."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from fourteen_dof_cars import brush, evaluate, held, inputs, make, roll_out
from fourteen_dof_lagrange import Mechanism, body_to_world

from jaxveh.vehicles import GRAVITY, AxleDrive, SevenDOF
from jaxveh.vehicles.wheels import wheel_names

UNKNOWN = ("v_y", "z", "roll", "pitch", "yaw_rate", *wheel_names("travel"), *wheel_names("omega"))
POINT = brush(half_length=1e-9)
"""A tyre without aligning moment: where the roll axis is inclined, or wheels lean, that moment turns the body too."""
BALANCED = (
    "v_x",
    "v_y",
    "v_z",
    "roll_rate",
    "pitch_rate",
    "yaw_rate",
    *wheel_names("travel_rate"),
    *wheel_names("omega"),
)


@eqx.filter_jit
def _residuals(car, x, unknown, steer):
    """What is out of balance, a column for each column of the unknown."""
    at = x._replace(**dict(zip(UNKNOWN, unknown[:-1], strict=True)))
    rate = car.derivatives(0.0, at, inputs()._replace(steer=steer, drive_torque=1e3 * unknown[-1]))
    return jnp.stack([jnp.broadcast_to(getattr(rate, name), unknown.shape[1:]) for name in BALANCED])


def steady(car, v_x, steer):
    """The state and inputs of a steady turn, by Newton's method with differences for slopes."""
    x = car.start(0.0, inputs(), v_x=v_x)
    unknown = np.array([*[float(getattr(x, name)) for name in UNKNOWN], 0.0])
    for _ in range(12):
        moved = unknown[:, None] + np.eye(len(unknown), len(unknown) + 1, 1) * 1e-7
        columns = np.asarray(_residuals(car, x, moved, np.asarray(steer)))
        value, slope = columns[:, 0], (columns[:, 1:] - columns[:, :1]) / 1e-7
        unknown = unknown - np.linalg.solve(slope, value)
    assert np.max(np.abs(value)) < 1e-8
    x = x._replace(**{name: jnp.asarray(found) for name, found in zip(UNKNOWN, unknown[:-1], strict=True)})
    return x, inputs(steer, 1e3 * unknown[-1])


@eqx.filter_jit
def mechanism_of(car, x, steer):
    """Places and masses of its wheels, its rotation, its inertia, and at this steer the wheels' axes and slants."""
    mechanism, turned = Mechanism(car), Mechanism(car, steer)
    q, _ = mechanism.coordinates(x._replace(yaw=jnp.zeros(())))
    return mechanism.centres(q), mechanism.masses, body_to_world(q), mechanism.inertia, turned.axes, turned.slants(q)


def test_load_transfer_of_a_steady_turn_balances_the_moments():
    """About the point of the road below the sprung mass: the loads hold weights, centrifugal forces and turning momenta."""
    # With the torque behind and free front wheels no moment about an axle has a part about the car's x.
    car = make(POINT, roll_yaw_product=0.0, rolling_resistance=0.0, drive=AxleDrive(front_drive=0.0))
    x, u = steady(car, 22.0, 0.03)
    shown = evaluate(car, x, u)[1]
    centres, unsprung, R, inertia, axes, slants = (np.asarray(found) for found in mechanism_of(car, x, 0.03))
    places = np.vstack([[0.0, 0.0, float(x.z)], centres])
    masses = np.array([1370.0, *unsprung])
    rate = float(x.yaw_rate)
    accelerations = np.array([-rate * float(x.v_y), rate * float(x.v_x)]) - rate**2 * places[:, :2]
    loads = np.array([float(getattr(shown, name)) for name in wheel_names("load")])
    turned = R @ inertia @ R.T
    spin = np.sum([1.3 * float(w) * R[:, 1] for w in [getattr(x, name) for name in wheel_names("omega")]][2:], axis=0)
    front = np.array([-np.sin(0.03), np.cos(0.03), 0.0])
    spin = spin + 1.3 * float(x.omega_fl + x.omega_fr) * R @ front
    momentum = np.cross([0.0, 0.0, rate], turned @ [0.0, 0.0, rate] + spin)
    # Roll: weights and loads on their levers, and heights times lateral forces of inertia.
    axes = axes @ R.T
    contacts = places[1:, 1] + places[1:, 2] * axes[:, 2] * axes[:, 1] / (1 - axes[:, 2] ** 2)
    roll = np.sum(contacts * loads) - GRAVITY * np.sum(masses * places[:, 1])
    roll += np.sum(masses * places[:, 2] * accelerations[:, 1]) - momentum[0]
    # The arm of longitudinal forces about an axle that rolls and pitches: rolling radius instead of the slant.
    F_x = np.array([float(getattr(shown, name)) for name in wheel_names("F_x")])
    roll += np.sum((slants - 0.33 + (0.33 - slants) / 3) * F_x * axes[:, 0])
    transfer = abs(loads[1] + loads[3] - loads[0] - loads[2]) * 0.76
    assert transfer > 3000
    assert abs(roll) < 1e-8 * transfer
    np.testing.assert_allclose(loads.sum(), GRAVITY * masses.sum(), rtol=1e-10)


@pytest.mark.parametrize("centres", [(0.0, 0.0), (0.06, 0.11), (0.3, -0.05)])
def test_roll_gradient_is_the_closed_form(centres):
    """Of small angles on hard tyres, by virtual work: contact points stay, wheels of radius R turn with the body.

    The roll axis at the height e is fixed in the body, so that the centre of gravity at h sinks by (h / 2 - e) roll^2:
    roll (K - m_s g (h - 2 e) - m_u g R) = (m_s (h - e) + m_u R) a_y + spin momentum times yaw rate.
    """
    front, rear = centres
    car = make(
        POINT, roll_centre_front=front, roll_centre_rear=rear, tyre_stiffness=2e8, roll_yaw_product=0.0, drag=0.0,
        pitch_slope_front=0.0, pitch_slope_rear=0.0, rolling_resistance=0.0,
    )  # fmt: skip
    x, u = steady(car, 20.0, 1e-4)
    shown = evaluate(car, x, u)[1]
    axis = (1.57 * front + 1.11 * rear) / (1.11 + 1.57)
    K = 1.54**2 * (26e3 / 2 + 13e3) + 1.51**2 * (23e3 / 2 + 6e3)
    weights = GRAVITY * (1370.0 * (0.58 - 2 * axis) + 160.0 * 0.33)
    spin = 1.3 * sum(float(getattr(x, name)) for name in wheel_names("omega")) * float(x.yaw_rate)
    expected = (float(shown.a_y) * (1370.0 * (0.58 - axis) + 160.0 * 0.33) + spin) / (K - weights)
    assert float(x.roll) > 0
    np.testing.assert_allclose(float(x.roll), expected, rtol=1e-3)


def test_positive_slopes_in_front_and_negative_behind_hold_the_body_level():
    level, dives = (
        make(pitch_slope_front=0.15, pitch_slope_rear=-0.15),
        make(pitch_slope_front=0.0, pitch_slope_rear=0.0),
    )
    u = inputs(0.0, 0.0, 2000.0)
    pitches = []
    for car in (level, dives):
        states, _ = roll_out(car, car.start(0.0, u, v_x=25.0), held(u))
        pitches.append(float(states.pitch[1500]))
    assert 0.005 < pitches[0] < 0.85 * pitches[1]  # nose down both, one less


def test_stiff_springs_make_a_seven_dof_car():
    """A lane change at 0.3 g: the stiffer, the nearer to a rigid car of the same whole mass."""
    lighter = 38.0 * 1.11 / 1.57  # the wheels' common centre of gravity is the body's
    shared = dict(front_axle_to_cg=1.11, rear_axle_to_cg=1.57, track_front=1.54, track_rear=1.51, wheel_inertia=1.3)
    masses = np.array([38.0, 38.0, lighter, lighter])
    x_w, y_w = np.array([1.11, 1.11, -1.57, -1.57]), 0.5 * np.array([1.54, 1.54, 1.51, 1.51])
    rigid = SevenDOF(
        mass=1370.0 + masses.sum(), yaw_inertia=2300.0 + np.sum(masses * (x_w**2 + y_w**2)), cg_height=0.58,
        wheel_radius=0.33, front=brush(), rear=brush(), **shared,
    )  # fmt: skip
    t = 0.0005 * np.arange(4000)
    us = held(inputs())._replace(steer=jnp.asarray(0.027 * np.sin(2 * np.pi * 0.5 * t)))
    expected, _ = roll_out(rigid, rigid.start(0.0, inputs(), v_x=20.0), us, 0.0005)
    distances = []
    for share in (1.0, 60.0):
        stiff = {
            f"{kind}_{axle}": share * v for kind, v in (("spring", 25e3), ("damper", 2e3)) for axle in ("front", "rear")
        }
        car = make(
            unsprung_mass_rear=lighter, roll_yaw_product=0.0, drag=0.0, rolling_resistance=0.0,
            tyre_stiffness=2e5 * share, tyre_damping=100.0 * share, **stiff,
        )  # fmt: skip
        found, shown = roll_out(car, car.start(0.0, inputs(), v_x=20.0), us, 0.0005)
        assert np.max(np.abs(shown.a_y)) > 2.5
        distances.append(
            [
                float(np.max(np.abs(getattr(found, name) - getattr(expected, name))) / np.ptp(getattr(expected, name)))
                for name in ("yaw_rate", "v_y")
            ]
        )
    soft, stiff = distances
    assert max(stiff) < 0.01
    assert soft[0] > 3 * stiff[0]
