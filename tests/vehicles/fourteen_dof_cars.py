"""Cars of fourteen degrees of freedom for the tests: odd in every parameter, so that nothing cancels by chance."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import tyres
from jaxveh.roads import LEVEL, Ground
from jaxveh.tyres import AbstractTyre, Forces
from jaxveh.vehicles import FourteenDOF


class Inputs(NamedTuple):
    steer: Any = 0.0
    drive_torque: Any = 0.0
    brake_torque: Any = 0.0


def inputs(steer=0.0, drive_torque=0.0, brake_torque=0.0, dtype=float):
    return Inputs(*[jnp.asarray(v, dtype) for v in (steer, drive_torque, brake_torque)])


class Frictionless(AbstractTyre):
    """Ice: the road pushes along its normal alone."""

    def forces(self, contact, state=None):
        return Forces()


class AllMoments(AbstractTyre):
    """Every force and moment, linear and quick to compile; camber and load count. `share`: of them all; 0 is ice."""

    share: Any = eqx.field(converter=jnp.asarray, default=1.0)

    def forces(self, contact, state=None):
        load, slip, camber = self.share * contact.load, contact.slip_angle, contact.camber
        return Forces(
            F_x=18.0 * load * contact.slip_ratio,
            F_y=load * (14.0 * slip + 0.9 * camber),
            M_x=-0.05 * load * camber - 0.01 * load * slip,
            M_y=-0.004 * load,
            M_z=load * (0.02 * camber - 0.4 * slip),
        )


def mf(load=4000.0):
    return tyres.typical_mf_tyre(load, radius=0.33)


def brush(load=4000.0, half_length=0.06):
    return tyres.Brush(20.0 * load, 17.0 * load, friction=1.05, half_length=half_length)


def make(front: AbstractTyre | None = None, rear: AbstractTyre | None = None, **changed) -> FourteenDOF:
    """A middle-class car."""
    front = brush() if front is None else front
    values = dict(
        sprung_mass=1370.0, unsprung_mass_front=38.0, unsprung_mass_rear=42.0,
        roll_inertia=540.0, pitch_inertia=2100.0, yaw_inertia=2300.0, roll_yaw_product=35.0,
        front_axle_to_cg=1.11, rear_axle_to_cg=1.57, track_front=1.54, track_rear=1.51, cg_height=0.58,
        spring_front=26e3, spring_rear=23e3, damper_front=1900.0, damper_rear=1700.0,
        anti_roll_front=13e3, anti_roll_rear=6e3, roll_centre_front=0.06, roll_centre_rear=0.11,
        pitch_slope_front=0.07, pitch_slope_rear=-0.09, tyre_stiffness=2.1e5, tyre_damping=90.0,
        wheel_radius=0.33, wheel_inertia=1.3, drag=0.4, rolling_resistance=0.011,
        front=front, rear=front if rear is None else rear,
    ) | changed  # fmt: skip
    return FourteenDOF(**values)


def lossless(**changed) -> FourteenDOF:
    """On ice, without dampers and drag: its energy stays."""
    none = dict(damper_front=0.0, damper_rear=0.0, tyre_damping=0.0, drag=0.0, rolling_resistance=0.0)
    return make(Frictionless(), **(none | changed))


def moving(car, u=None, v_x=20.0, **values):
    """A state in which everything moves."""
    odd = dict(
        v_x=v_x, v_y=0.4, v_z=-0.13, z=car.cg_height + 0.011, roll=0.05, pitch=-0.03, yaw=0.8,
        roll_rate=0.21, pitch_rate=-0.17, yaw_rate=0.35,
        travel_fl=0.012, travel_fr=-0.017, travel_rl=0.006, travel_rr=-0.011,
        travel_rate_fl=0.2, travel_rate_fr=-0.31, travel_rate_rl=0.12, travel_rate_rr=-0.08,
        omega_fl=61.0, omega_fr=62.5, omega_rl=60.2, omega_rr=62.0,
    ) | values  # fmt: skip
    return car.start(0.0, inputs() if u is None else u, **odd)


def evaluate(car, x, u, ground=LEVEL):
    """Not compiled: a test looks once or twice, and compiling takes a hundred times as long as looking."""
    return car.evaluate(0.0, x, u, ground)


def roll_out(car, x, us, dt=0.001, grade=0.0):
    """States and outputs at the beginning of each step of RK4, inputs held over it; (T,) in each field."""
    return _roll_out(car, x, us, jnp.asarray(dt), Ground(grade=jnp.asarray(grade)))


@eqx.filter_jit
def _roll_out(car, x, us, dt, ground):
    # The stages are a loop, so that the car is compiled once.
    shares = jnp.array([0.0, 0.5, 0.5, 1.0]), jnp.array([1.0, 2.0, 2.0, 1.0]) / 6.0

    def step(x, u):
        def stage(carried, share):
            k, end = carried
            here = jax.tree.map(lambda v, d: v + share[0] * dt * d, x, k)
            k, shown = car.evaluate(0.0, here, u, ground)
            return (k, jax.tree.map(lambda v, d: v + share[1] * dt * d, end, k)), shown

        (_, end), shown = jax.lax.scan(stage, (jax.tree.map(jnp.zeros_like, x), x), shares)
        return end, (x, jax.tree.map(lambda v: v[0], shown))

    return jax.lax.scan(step, x, us)[1]


def held(u, steps=4000):
    """The same inputs at every step."""
    return jax.tree.map(lambda v: jnp.broadcast_to(v, (steps,)), u)
