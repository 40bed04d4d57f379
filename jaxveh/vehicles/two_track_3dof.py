"""A car on four wheels without spin: longitudinal, lateral and yaw motion, driven and braked by torques."""

from __future__ import annotations

from typing import ClassVar

from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.steering import steer_outputs
from jaxveh.vehicles.traction import AbstractSpinless, drive_over_road, drive_power
from jaxveh.vehicles.two_track import air_drag, body_outputs, wheel_outputs
from jaxveh.vehicles.upright_body import AbstractUprightTwoTrack
from jaxveh.vehicles.wheels import gravity


class TwoTrack3DOF(AbstractSpinless, AbstractUprightTwoTrack):
    """`SevenDOF` without its stiff wheel spins: longitudinal wheel forces follow directly from the torques.

    With X_i, Y_i the road's forces on the wheels in the car's axes, (x_i, y_i) their positions, g_x, g_y gravity along a sloping
    road (R. Rajamani, Vehicle Dynamics and Control, 2nd ed., ch. 8.3):

        m (dv_x/dt - v_y r) = sum X_i - drag v_x |v_x| + m g_x
        m (dv_y/dt + v_x r) = sum Y_i + m g_y
        I_z dr/dt           = sum (x_i Y_i - y_i X_i + M_z,i)

    The longitudinal force of a wheel is its torque over the radius, and shares the road's grip with the lateral force as in
    `traction.within_grip`. The tyre's own F_x has no effect. Torques that differ between left and right (`FourMotors`) turn the
    car. The torque that accelerates the wheels' spin is neglected (4 J / r^2 is about 3 % of the mass). Loads follow
    `load_transfer`. Brakes and rolling resistance change sign smoothly below 0.94 m/s (`wheels.STANDSTILL`).

    **Inputs**: those of `steering` (`steer`, rad at the road wheels), `drive` and `load_transfer`.

    **Raises** `InputError` for parameters outside their domain, or a tyre that is not a tyre of `jaxveh.tyres`.
    """

    body_states: ClassVar[tuple[str, ...]] = ("v_x", "v_y", "yaw", "yaw_rate")

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        road, forces, push, drive = drive_over_road(self, x, u, ground)
        g_x, g_y, _ = gravity(ground)
        a_x = (push.F_x - air_drag(self.drag, x.v_x)) / self.mass
        a_y = push.F_y / self.mass
        yaw_acceleration = push.M_z / self.yaw_inertia
        rates = (
            a_x + g_x + x.v_y * x.yaw_rate, a_y + g_y - x.v_x * x.yaw_rate, x.yaw_rate, yaw_acceleration,
            *self.load_transfer.rates(x, push.F_x / self.mass, a_y), *road.tyre_rates,
        )  # fmt: skip
        steers = steer_outputs(self.steering, road.steers)
        shown = body_outputs(self.motion(x, u), a_x, a_y, yaw_acceleration, steers, push)
        shown |= wheel_outputs(road.contacts, forces)
        shown["drive_power"] = drive_power(self, drive, road.moves)
        return self.rates_and_outputs(rates, shown)
