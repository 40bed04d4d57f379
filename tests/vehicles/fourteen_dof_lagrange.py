"""The mechanism of the car of fourteen degrees of freedom once more, written down as energies of generalised coordinates.

Coordinates q: place of the sprung mass in the world (3), roll, pitch, yaw, four travels, four wheel angles. Matrices, world
axes and autodiff: nothing of the car's own kinematics.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh.vehicles import GRAVITY

CORNERS = ("fl", "fr", "rl", "rr")
SIDES = np.array([1.0, -1.0, 1.0, -1.0])


def rotation(axis: int, angle):
    """A turn about a coordinate axis."""
    c, s = jnp.cos(angle), jnp.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    return jnp.eye(3).at[i, i].set(c).at[j, j].set(c).at[i, j].set(-s).at[j, i].set(s)


def body_to_world(q):
    return rotation(2, q[5]) @ rotation(1, q[4]) @ rotation(0, q[3])


def per_axle(front, rear):
    return jnp.stack([front, front, rear, rear])


def angular_velocity(q, qd):
    """In the body's axes, of the rotation's time derivative."""
    R, Rd = jax.jvp(body_to_world, (q,), (qd,))
    W = R.T @ Rd
    return jnp.stack([W[2, 1], W[0, 2], W[1, 0]])


class Mechanism:
    """The car's masses and springs at a fixed steer, on a road that gravity (m/s^2, world axes) does not meet at right angles."""

    def __init__(self, car, steer=0.0, gravity=(0.0, 0.0, -GRAVITY)):
        self.car, self.gravity = car, jnp.asarray(gravity)
        a, b = car.front_axle_to_cg, car.rear_axle_to_cg
        self.masses = per_axle(car.unsprung_mass_front, car.unsprung_mass_rear)
        self.preload = 0.5 * car.sprung_mass * GRAVITY / (a + b) * per_axle(b, a)
        sunk = (self.preload + self.masses * GRAVITY) / car.tyre_stiffness
        tracks = per_axle(car.track_front, car.track_rear)
        self.rest = jnp.stack([per_axle(a, -b), 0.5 * SIDES * tracks, car.wheel_radius - sunk - car.cg_height], 1)
        centres = per_axle(car.roll_centre_front, car.roll_centre_rear)
        slopes = per_axle(car.pitch_slope_front, car.pitch_slope_rear)
        self.ways = jnp.stack([slopes, SIDES * 2 * centres / tracks, jnp.ones(4)], 1)
        steers = per_axle(steer + 0.0 * a, 0.0 * a) - SIDES * per_axle(car.toe_front, car.toe_rear)
        leans = -SIDES * per_axle(car.camber_front, car.camber_rear)
        self.axes = jnp.stack(
            [rotation(2, s) @ rotation(0, g) @ jnp.array([0.0, 1.0, 0.0]) for s, g in zip(steers, leans, strict=True)]
        )
        xz = car.roll_yaw_product
        self.inertia = jnp.diag(jnp.stack([car.roll_inertia, car.pitch_inertia, car.yaw_inertia]))
        self.inertia = self.inertia.at[0, 2].set(-xz).at[2, 0].set(-xz)

    def centres(self, q):
        """The wheels' centres in the world, (4, 3)."""
        return q[:3] + (self.rest + self.ways * q[6:10, None]) @ body_to_world(q).T

    def spins(self, q, qd):
        """Each wheel's whole spin about its axle: over the body, and that of the body."""
        return qd[10:] + self.axes @ angular_velocity(q, qd)

    def kinetic(self, q, qd):
        omega = angular_velocity(q, qd)
        moves = jax.jvp(self.centres, (q,), (qd,))[1]
        return 0.5 * (
            self.car.sprung_mass * jnp.sum(qd[:3] ** 2)
            + omega @ self.inertia @ omega
            + jnp.sum(self.masses[:, None] * moves**2)
            + self.car.wheel_inertia * jnp.sum(self.spins(q, qd) ** 2)
        )

    def potential(self, q):
        car, travel = self.car, q[6:10]
        springs = per_axle(car.spring_front, car.spring_rear)
        bars = jnp.stack([car.anti_roll_front, car.anti_roll_rear])
        twist = jnp.stack([travel[0] - travel[1], travel[2] - travel[3]])
        centres = self.centres(q)
        sinks = jnp.maximum(car.wheel_radius - centres[:, 2], 0.0)
        heavy = car.sprung_mass * q[:3] + self.masses @ centres
        return (
            jnp.sum(self.preload * travel + 0.5 * springs * travel**2)
            + 0.5 * jnp.sum(bars * twist**2)
            + 0.5 * car.tyre_stiffness * jnp.sum(sinks**2)
            - self.gravity @ heavy
        )

    def energy(self, q, qd):
        return self.kinetic(q, qd) + self.potential(q)

    def accelerations(self, q, qd, power):
        """q'' of Lagrange's equations; `power(qd)` is that of all other forces at this instant, linear in the velocities."""
        mass = jax.hessian(self.kinetic, 1)(q, qd)
        carried = jax.jvp(lambda q: jax.grad(self.kinetic, 1)(q, qd), (q,), (qd,))[1]
        pull = jax.grad(self.kinetic)(q, qd) - jax.grad(self.potential)(q) + jax.grad(power)(qd)
        return jnp.linalg.solve(mass, pull - carried)

    def coordinates(self, x):
        """q and its rate out of the car's state; the wheels' angles, which nothing depends on, are zero."""
        place = jnp.stack([jnp.zeros_like(x.z), jnp.zeros_like(x.z), x.z])
        q = jnp.concatenate(
            [place, jnp.stack([x.roll, x.pitch, x.yaw, *[getattr(x, f"travel_{c}") for c in CORNERS]]), jnp.zeros(4)]
        )
        linear = rotation(2, x.yaw) @ jnp.stack([x.v_x, x.v_y, x.v_z])
        rates = jnp.stack([x.roll_rate, x.pitch_rate, x.yaw_rate, *[getattr(x, f"travel_rate_{c}") for c in CORNERS]])
        qd = jnp.concatenate([linear, rates, jnp.zeros(4)])
        omegas = jnp.stack([getattr(x, f"omega_{c}") for c in CORNERS])
        return q, qd.at[10:].set(omegas - self.spins(q, qd))
