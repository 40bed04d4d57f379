"""The single-track model with forward speed as a state, driven and braked by torques."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any

import equinox as eqx
import jax

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.tyres import Contact, Forces
from jaxveh.vehicles import two_track
from jaxveh.vehicles.base import Motion, over_ground
from jaxveh.vehicles.load_transfer import AbstractLoadTransfer, QuasiStatic, axle_loads
from jaxveh.vehicles.shared import AbstractOnAxleTyres
from jaxveh.vehicles.steering import axle_angles
from jaxveh.vehicles.traction import AbstractSpinless, driven_forces
from jaxveh.vehicles.wheels import WheelMotion, contact, gravity, is_straight, rolling

STATES = ("v_x", "v_y", "yaw", "yaw_rate")

UNITS = {
    **two_track.UNITS,
    **dict.fromkeys(("slip_angle_front", "slip_angle_rear"), "rad"),
    **dict.fromkeys(("F_xf", "F_xr", "F_yf", "F_yr", "load_front", "load_rear"), "N"),
    **dict.fromkeys(("M_zf", "M_zr"), "N m"),
}


class SingleTrack3DOF(AbstractSpinless, AbstractOnAxleTyres):
    """A vehicle on one track with variable speed: the states are v_x, v_y, yaw and yaw rate.

    With X, Y the axles' forces in the car's axes, a and b the axles' distances from the centre of gravity (R. Rajamani, Vehicle
    Dynamics and Control, 2nd ed., ch. 2 and 13.4, on one track):

        m (dv_x/dt - v_y r) = X_f + X_r - drag v_x |v_x| + m g_x
        m (dv_y/dt + v_x r) = Y_f + Y_r + m g_y
        I_z dr/dt           = a Y_f - b Y_r + M_z,f + M_z,r

    Wheel spin is not modelled: the longitudinal forces of the axles are torque over radius, and share the road's grip with the
    lateral forces as in `traction.within_grip`. The tyres' own F_x has no effect. Load moves between the axles with the a_x of
    `load_transfer`. The a_y of that has no effect, although `LaggedLoads` has it as a state.

    **Parameters**: `cg_height` (m). The torques of the wheels of an axle are added.

    **Inputs**: those of `steering` (`steer`, rad at the road wheels), `drive` and `load_transfer`. **Outputs** have `steer_rear`
    if the rear axle is steered.

    **Raises** `InputError` for parameters outside their domain, or a tyre that is not a tyre of `jaxveh.tyres`.
    """

    _: KW_ONLY
    cg_height: jax.Array = positive("m")
    load_transfer: AbstractLoadTransfer = eqx.field(default_factory=QuasiStatic)

    @property
    def own_states(self):
        """`v_x`, `v_y`, `yaw`, `yaw_rate`, then the states of the load transfer."""
        return (*STATES, *self.load_transfer.state_names)

    @property
    def units(self):
        return dict(UNITS)

    def motion(self, x, u):
        return Motion(0.0, 0.0, x.yaw, x.v_x, x.v_y, x.yaw_rate)

    def contacts(self, x, u, ground: Ground = LEVEL) -> tuple[Contact, Contact]:
        return self._stand(x, u, ground)[1]

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        tyres, (drive, brake) = self.tyres, self.drive.torques(u)
        steers, contacts, moves = self._stand(x, u, ground)
        states = tyres.states(x)
        pushing, slowing = (drive.fl + drive.fr, drive.rl + drive.rr), (brake.fl + brake.fr, brake.rl + brake.rr)
        front, rear = (
            driven_forces(self, force, at, move.along, *torques)
            for force, at, move, *torques in zip(
                tyres.forces(contacts, states), contacts, moves, pushing, slowing, strict=True
            )
        )
        (X_f, Y_f), (X_r, Y_r) = (turn_forces(*axle) for axle in zip((front, rear), moves, strict=True))
        X = X_f + X_r
        M_z = self.front_axle_to_cg * Y_f - self.rear_axle_to_cg * Y_r + (front.M_z + rear.M_z)
        g_x, g_y, _ = gravity(ground)
        a_x = (X - two_track.air_drag(self.drag, x.v_x)) / self.mass
        a_y = (Y_f + Y_r) / self.mass
        yaw_acceleration = M_z / self.yaw_inertia
        rates = (
            a_x + g_x + x.v_y * x.yaw_rate, a_y + g_y - x.v_x * x.yaw_rate, x.yaw_rate, yaw_acceleration,
            *self.load_transfer.rates(x, X / self.mass, a_y), *tyres.rates(contacts, states),
        )  # fmt: skip
        shown = {
            "v_x": x.v_x,
            "v_y": x.v_y,
            "yaw": x.yaw,
            "yaw_rate": x.yaw_rate,
            "yaw_acceleration": yaw_acceleration,
            "a_x": a_x,
            "a_y": a_y,
            "sideslip": numerics.arctan2(x.v_y, x.v_x),
            **over_ground(x.yaw, x.v_x, x.v_y),
            "steer": steers[0],
            **({} if is_straight(steers[1]) else {"steer_rear": steers[1]}),
            "slip_angle_front": contacts[0].slip_angle,
            "slip_angle_rear": contacts[1].slip_angle,
            "load_front": contacts[0].load,
            "load_rear": contacts[1].load,
            **{
                f"{name}{axle}": getattr(f, name)
                for name in ("F_x", "F_y", "M_z")
                for axle, f in zip("fr", (front, rear), strict=True)
            },
            "drive_power": (pushing[0] * moves[0].along + pushing[1] * moves[1].along) / self.wheel_radius,
        }
        return self.rates_and_outputs(rates, shown)

    def _stand(self, x, u, ground: Ground):
        """The angles, contacts and motions of the axles."""
        g = _, g_y, g_z = gravity(ground)
        steady = self.steady_a_x(x, u, ground, g), x.v_x * x.yaw_rate - g_y
        loads = axle_loads(self, self.load_transfer.felt_accelerations(x, u, steady)[0], g_z)
        friction = 0.5 * (ground.friction_fl + ground.friction_fr), 0.5 * (ground.friction_rl + ground.friction_rr)
        steers = axle_angles(self.steering.angles(self, u, x.v_x))
        turned = [(1.0, 0.0) if is_straight(one) else (numerics.cos(one), numerics.sin(one)) for one in steers]
        places = self.wheel_positions[::2]
        moves = [rolling(p, x.v_x, x.v_y, x.yaw_rate, *turn) for p, turn in zip(places, turned, strict=True)]
        front, rear = (
            contact(move, load, mu, self.slip_floor) for move, load, mu in zip(moves, loads, friction, strict=True)
        )
        return steers, (front, rear), moves


def turn_forces(forces: Forces, move: WheelMotion) -> tuple[Any, Any]:
    """The forces of an axle along and across the car, N."""
    if is_straight(move.sine):
        return forces.F_x, forces.F_y
    return forces.F_x * move.cosine - forces.F_y * move.sine, forces.F_x * move.sine + forces.F_y * move.cosine
