"""A car with seven degrees of freedom: longitudinal, lateral and yaw motion, and the spin of four wheels."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any, ClassVar

import jax

from jaxveh._core.parameter import positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.drive import AbstractDriven
from jaxveh.vehicles.steering import steer_outputs
from jaxveh.vehicles.two_track import air_drag, body_outputs, wheel_outputs
from jaxveh.vehicles.upright_body import AbstractUprightTwoTrack
from jaxveh.vehicles.wheels import (
    SPINS,
    Wheels,
    body_forces,
    each_wheel,
    gravity,
    sum_of_wheels,
    travel_direction,
    wheels_of,
)


class SevenDOF(AbstractDriven, AbstractUprightTwoTrack):
    """A rigid car on four wheels with spin: the true car of many papers and the standard model of simulations.

    With X_i, Y_i the road's forces on the wheels in the car's axes, (x_i, y_i) the positions of the wheels, T_i the torques and
    g_x, g_y gravity along a sloping road (R. Rajamani, Vehicle Dynamics and Control, 2nd ed., ch. 8.3; Qin et al. 2014):

        m (dv_x/dt - v_y r) = sum X_i - drag v_x |v_x| + m g_x
        m (dv_y/dt + v_x r) = sum Y_i + m g_y
        I_z dr/dt           = sum (x_i Y_i - y_i X_i + M_z,i)
        J_w domega_i/dt     = T_i - r_e (F_x,i + f_r F_z,i) - brakes

    Loads follow `load_transfer`. Slips are those of `wheels.contact`. Brakes and rolling resistance change sign smoothly below
    0.94 m/s (`wheels.STANDSTILL`), so that standstill is a regular point. The spins are stiff: their poles are about
    `-C_x r_e^2 / (J_w |v|)`, 200 1/s at 20 m/s and thousands at walking speed, for which there is `statespace.StabilisedRK4`.

    **Parameters**: `wheel_inertia` (kg m^2, of one wheel).

    **Inputs**: those of `steering` (`steer`, rad at the road wheels), `drive` and `load_transfer`.

    **Raises** `InputError` for parameters outside their domain, or a tyre that is not a tyre of `jaxveh.tyres`.
    """

    _: KW_ONLY
    wheel_inertia: jax.Array = positive("kg m^2", default=1.2)
    body_states: ClassVar[tuple[str, ...]] = ("v_x", "v_y", "yaw", "yaw_rate", *SPINS)

    @property
    def inputs(self):
        return (*self.steering.inputs, *self.drive.inputs, *self.load_transfer.inputs)

    def at_rest(self, v_x):
        """The spins of freely rolling wheels at `v_x` (m/s)."""
        return dict.fromkeys(SPINS, v_x / self.wheel_radius)

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        road = self.on_road(x, u, ground)
        push = body_forces(self.places, road.moves, road.forces)
        g_x, g_y, _ = gravity(ground)
        # Multiplication by inverses, which depend on the car only and not on the instant: a division costs five multiplications.
        inverse_mass = 1.0 / self.mass
        a_x = (push.F_x - air_drag(self.drag, x.v_x)) * inverse_mass
        a_y = push.F_y * inverse_mass
        yaw_acceleration = push.M_z * (1.0 / self.yaw_inertia)
        omegas = wheels_of(x, "omega")
        drive, brake = self.drive.torques(u)
        spins = each_wheel(self._spin, omegas, road.contacts, road.forces, drive, brake)
        rates = (
            a_x + g_x + x.v_y * x.yaw_rate, a_y + g_y - x.v_x * x.yaw_rate, x.yaw_rate, yaw_acceleration, *spins,
            *self.load_transfer.rates(x, push.F_x * inverse_mass, a_y), *road.tyre_rates,
        )  # fmt: skip
        steers = steer_outputs(self.steering, road.steers)
        shown = body_outputs(self.motion(x, u), a_x, a_y, yaw_acceleration, steers, push)
        shown |= wheel_outputs(road.contacts, road.forces, omegas)
        shown["drive_power"] = sum_of_wheels(each_wheel(lambda torque, omega: torque * omega, drive, omegas))
        return self.rates_and_outputs(rates, shown)

    def rim_speeds(self, x) -> Wheels:
        return each_wheel(lambda omega: omega * self.wheel_radius, wheels_of(x, "omega"))

    def steady_a_x(self, x, u, ground: Ground, g: tuple[Any, Any, Any]):
        """The longitudinal acceleration due to the torques, m/s^2, not limited by grip; computed only for loads that use it."""
        del ground, g
        drive, brake = self.drive.torques(u)
        torque = sum_of_wheels(drive) - sum_of_wheels(brake) * travel_direction(x.v_x)
        return torque * (1.0 / (self.mass * self.wheel_radius))

    def _spin(self, omega, at, force, drive, brake):
        slowing = (brake + self.rolling_resistance * at.load * self.wheel_radius) * travel_direction(
            omega * self.wheel_radius
        )
        return (drive - slowing - self.wheel_radius * force.F_x) * (1.0 / self.wheel_inertia)
