"""FourteenDOF against Lagrange's equations of energies that are written down independently, and its balance of energy."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fourteen_dof_cars import AllMoments, Frictionless, Inputs, evaluate, inputs, lossless, make, moving
from fourteen_dof_lagrange import CORNERS, Mechanism, body_to_world, rotation

from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.wheels import gravity

pytestmark = pytest.mark.product

ODD = dict(toe_front=0.004, toe_rear=-0.003, camber_front=-0.02, camber_rear=0.015)


def smooth_sign(speed):
    """The direction against which brakes push: the curve of fifth order from -1 to 1 over 15/16 m/s to either side."""
    s = jnp.clip(speed / (15 / 16), -1.0, 1.0)
    return (15 * s - 10 * s**3 + 3 * s**5) / 8


def wheels(values, prefix):
    return jnp.stack([getattr(values, f"{prefix}_{c}") for c in CORNERS])


def other_power(car, mechanism, x, u, shown):
    """Power of the forces that no potential makes, as a function of the velocities; the tyres' forces as the car says them."""
    q, _ = mechanism.coordinates(x)
    up = jnp.array([0.0, 0.0, 1.0])
    sinks = jnp.maximum(car.wheel_radius - mechanism.slants(q), 0.0)
    radii = car.wheel_radius - sinks / 3
    axes = mechanism.axes @ body_to_world(q).T
    ahead = jnp.cross(axes, up)
    ahead = ahead / jnp.linalg.norm(ahead, axis=1, keepdims=True)
    left = jnp.cross(up, ahead)
    arms = -mechanism.slants(q)[:, None] * jnp.cross(ahead, axes)
    F_x, F_y, load = wheels(shown, "F_x"), wheels(shown, "F_y"), wheels(shown, "load")
    M_x, M_y, M_z = wheels(shown, "M_x"), wheels(shown, "M_y"), wheels(shown, "M_z")
    omegas = wheels(x, "omega")
    # What the tyre's spring makes of the load is in the potential.
    damped = load - car.tyre_stiffness * sinks / jnp.sqrt(1 - axes[:, 2] ** 2)
    push = F_x[:, None] * ahead + F_y[:, None] * left + damped[:, None] * up
    own = M_x[:, None] * ahead + M_y[:, None] * left + M_z[:, None] * up
    whole = own + jnp.cross(arms, push)
    about = lambda moment: jnp.sum(moment * axes, 1)
    on_body = whole - about(whole)[:, None] * axes
    on_spin = about(own) - radii * F_x - car.rolling_resistance * load * radii * smooth_sign(omegas * radii)
    share = jnp.array([0.5, 0.5, 0.0, 0.0]) * u.drive_torque
    slow = 0.5 * jnp.array([0.65, 0.65, 0.35, 0.35]) * u.brake_torque
    drag = car.drag * x.v_x * jnp.abs(x.v_x)
    dampers = jnp.stack([car.damper_front, car.damper_front, car.damper_rear, car.damper_rear])

    def power(qd):
        moves = jax.jvp(mechanism.centres, (q,), (qd,))[1]
        R, Rd = jax.jvp(body_to_world, (q,), (qd,))
        W = Rd @ R.T
        omega = jnp.stack([W[2, 1], W[0, 2], W[1, 0]])
        turns = jax.lax.stop_gradient(qd_now[10:])
        torque = share - slow * smooth_sign(turns * radii)
        return (
            jnp.sum(push * moves)
            + jnp.sum(on_body @ omega)
            + on_spin @ mechanism.spins(q, qd)
            + torque @ qd[10:]
            - drag * (rotation(2, x.yaw)[:, 0] @ qd[:3])
            - jnp.sum(dampers * jax.lax.stop_gradient(qd_now[6:10]) * qd[6:10])
        )

    qd_now = mechanism.coordinates(x)[1]
    return power


@eqx.filter_jit
def expected_rates(car, x, u, ground, shown):
    """The state's time derivative by Lagrange's equations, with the tyres' forces of the outputs `shown`."""
    fall = rotation(2, x.yaw) @ jnp.stack([jnp.asarray(g) for g in gravity(ground)])
    mechanism = Mechanism(car, u.steer, fall)
    q, qd = mechanism.coordinates(x)
    qdd = mechanism.accelerations(q, qd, other_power(car, mechanism, x, u, shown))
    linear = rotation(2, x.yaw).T @ qdd[:3] - jnp.cross(
        jnp.array([0.0, 0.0, 1.0]) * x.yaw_rate, jnp.stack([x.v_x, x.v_y, x.v_z])
    )
    spins = jax.jvp(mechanism.spins, (q, qd), (qd, qdd))[1]
    return jnp.concatenate([linear, qd[2:10], qdd[3:10], spins])


def lagrange(car, x, u, ground, shown):
    """Of any car by one compilation: the tyres are in the outputs, the ground is of arrays."""
    bare = eqx.tree_at(lambda c: (c.front, c.rear), car, (Frictionless(), Frictionless()))
    return expected_rates(bare, x, u, jax.tree.map(jnp.asarray, ground), shown)


def in_order(found):
    order = ("v_x", "v_y", "v_z", "z", "roll", "pitch", "yaw", *[f"travel_{c}" for c in CORNERS])
    order += ("roll_rate", "pitch_rate", "yaw_rate", *[f"travel_rate_{c}" for c in CORNERS])
    order += tuple(f"omega_{c}" for c in CORNERS)
    return jnp.stack([getattr(found, name) for name in order])


CASES = {
    "ice": lambda: (lossless(), inputs(), LEVEL),
    "brush": lambda: (make(), inputs(0.07, 300.0, 150.0), LEVEL),
    "slope": lambda: (make(**ODD), inputs(-0.04, -200.0), Ground(grade=jnp.asarray(0.08), bank=jnp.asarray(-0.11))),
    "moments": lambda: (make(AllMoments(), **ODD), inputs(0.05, 500.0), LEVEL),
}


@pytest.mark.parametrize("case", CASES)
def test_accelerations_are_those_of_lagrange(case):
    car, u, ground = CASES[case]()
    for values in ({}, {"roll": -0.4, "pitch": 0.5, "roll_rate": -1.5, "pitch_rate": 2.0, "yaw_rate": -1.2}):
        x = moving(car, u, **values)
        rate, shown = evaluate(car, x, u, ground)
        found, expected = np.asarray(in_order(rate)), np.asarray(lagrange(car, x, u, ground, shown))
        assert np.max(np.abs(expected)) > 10
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10 * np.max(np.abs(expected)))


@eqx.filter_jit
def _drive(car, x, u_of, seconds, rtol):
    """The state after so many seconds, and the work that the car says it took up; (x, work)."""

    def rates(t, carried, args):
        car, _ = args
        rate, shown = car.evaluate(t, carried[0], u_of(t))
        lost = shown.tyre_dissipation + shown.damper_dissipation + shown.brake_dissipation + shown.drag_dissipation
        return rate, shown.drive_power - lost

    times = jnp.linspace(0.0, seconds, 11)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rates), diffrax.Dopri8(), 0.0, seconds, None, (x, jnp.zeros(())), (car, None),
        saveat=diffrax.SaveAt(ts=times), max_steps=200_000,
        stepsize_controller=diffrax.PIDController(rtol=rtol, atol=rtol),
    )  # fmt: skip
    return solution.ys


def drive(car, x, u_of, seconds, rtol=1e-11):
    """Tolerance and time are operands: one program for all of them."""
    return _drive(car, x, u_of, np.asarray(seconds), np.asarray(rtol))


def energies(car, states, u_of, seconds):
    return _energies(car, states, u_of, np.asarray(seconds))


@eqx.filter_jit
def _energies(car, states, u_of, seconds):
    def one(x, t):
        mechanism = Mechanism(car, u_of(t).steer)
        return mechanism.energy(*mechanism.coordinates(x))

    return jax.vmap(one)(states, jnp.linspace(0.0, seconds, 11))


def pedals(steer, drive_torque, brake_torque):
    """Inputs over time: held steer, a torque that swings, brakes from 0.8 s on."""
    return jax.tree_util.Partial(_pedals, *map(jnp.asarray, (steer, drive_torque, brake_torque)))


def _pedals(steer, drive_torque, brake_torque, t):
    return Inputs(steer, drive_torque * jnp.sin(4.0 * t), brake_torque * jnp.clip(t - 0.8, 0.0, 1.0))


def test_energy_stays_without_friction_and_dampers():
    # On ice; the tyre's class is that of the next test's, so that both are one program.
    car = eqx.tree_at(lambda c: (c.front, c.rear), lossless(), (AllMoments(0.0), AllMoments(0.0)))
    x = car.start(
        0.0, inputs(), v_x=3.0, v_y=-1.0, z=0.60, roll=0.05, pitch=-0.03, yaw_rate=0.7, roll_rate=0.4, pitch_rate=0.3,
        travel_fl=0.02, travel_rate_rr=0.4,
    )  # fmt: skip
    none = pedals(0.0, 0.0, 0.0)
    states, work = drive(car, x, none, 4.0)
    energy = np.asarray(energies(car, states, none, 4.0))
    rest = car.start(0.0, inputs(), v_x=3.0, v_y=-1.0)
    swing = energy[0] - energies(car, jax.tree.map(lambda v: jnp.broadcast_to(v, (11,)), rest), none, 4.0)[0]
    assert swing > 500  # J of bouncing, rolling, pitching, yawing
    assert np.ptp(np.asarray(states.z)) > 0.02 and np.ptp(np.asarray(states.roll)) > 0.05
    assert np.ptp(np.asarray(states.pitch)) > 0.03
    np.testing.assert_array_equal(work, 0.0)
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-8 * swing)


@pytest.mark.parametrize("tyre", [pytest.param("brush", marks=pytest.mark.full), "moments"])
def test_energy_lost_is_what_the_outputs_say(tyre):
    car = make(AllMoments() if tyre == "moments" else None, **ODD)
    seconds = 1.5
    # Held steer: a steer that turns does work on the wheels.
    u_of = pedals(0.06, 2500.0, 3000.0)
    x = car.start(0.0, u_of(jnp.asarray(0.0)), v_x=22.0, roll=0.03, pitch_rate=0.3, z=0.60)
    states, work = drive(car, x, u_of, seconds, rtol=1e-9)
    energy = np.asarray(energies(car, states, u_of, seconds))
    spent = energy - energy[0]
    assert np.ptp(spent) > 2e4
    np.testing.assert_allclose(spent, np.asarray(work), rtol=0, atol=1e-6 * np.ptp(spent))


@pytest.mark.parametrize("name", ["tyre_dissipation", "damper_dissipation", "brake_dissipation", "drag_dissipation"])
def test_nothing_makes_energy(name):
    """Static tyres with limited slip, at random motions: what is lost is positive."""
    car, rng, u = make(), np.random.default_rng(3), inputs(0.03, 0.0, 800.0)
    n = 300
    draw = lambda middle, spread: jnp.asarray(middle + spread * rng.standard_normal(n))
    x = car.start(0.0, u)
    x = x._replace(v_x=draw(10.0, 10.0), v_y=draw(0.0, 2.0), v_z=draw(0.0, 0.3), yaw_rate=draw(0.0, 0.5))
    x = x._replace(**{f"omega_{c}": draw(30.0, 30.0) for c in CORNERS})
    x = x._replace(**{f"travel_rate_{c}": draw(0.0, 0.4) for c in CORNERS})
    x = jax.tree.map(lambda v: jnp.broadcast_to(v, (n,)), x)
    lost = np.asarray(getattr(evaluate(car, x, u)[1], name))
    assert lost.shape == (n,) and np.max(lost) > 100
    assert np.min(lost) >= 0
