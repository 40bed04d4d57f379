"""A car on four wheels with lateral and yaw motion at a given speed."""

from __future__ import annotations

from typing import ClassVar

from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.given_speed import AbstractToldSpeed, longitudinal_acceleration
from jaxveh.vehicles.steering import steer_outputs
from jaxveh.vehicles.two_track import body_outputs, wheel_outputs
from jaxveh.vehicles.upright_body import AbstractUprightTwoTrack
from jaxveh.vehicles.wheels import body_forces, gravity


class TwoTrack2DOF(AbstractToldSpeed, AbstractUprightTwoTrack):
    """A rigid car on four freely rolling wheels at a given forward speed: `SingleTrack` with tracks and lateral load transfer.

    With X_i, Y_i the road's forces on the wheels in the car's axes, (x_i, y_i) their positions (R. Rajamani, Vehicle Dynamics
    and Control, 2nd ed., ch. 8.3, with v_x given):

        m (dv_y/dt + v_x r) = sum Y_i + m g_y
        I_z dr/dt           = sum (x_i Y_i - y_i X_i + M_z,i)

    Loads follow `load_transfer`.

    **Inputs**: those of `steering` (`steer`, rad at the road wheels), `v_x` (m/s), those of `load_transfer`, and optionally the
    longitudinal acceleration, `a_x` (of an ideal accelerometer) or `v_x_rate`; without it the speed is assumed constant.

    **Raises** `InputError` for parameters outside their domain, or a tyre that is not a tyre of `jaxveh.tyres`.
    """

    body_states: ClassVar[tuple[str, ...]] = ("v_y", "yaw", "yaw_rate")

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        road = self.on_road(x, u, ground)
        push = body_forces(self.places, road.moves, road.forces)
        g_x, g_y, _ = gravity(ground)
        a_x, a_y = longitudinal_acceleration(x, u, g_x), push.F_y / self.mass
        yaw_acceleration = push.M_z / self.yaw_inertia
        rates = (
            a_y + g_y - u.v_x * x.yaw_rate, x.yaw_rate, yaw_acceleration,
            *self.load_transfer.rates(x, a_x, a_y), *road.tyre_rates,
        )  # fmt: skip
        steers = steer_outputs(self.steering, road.steers)
        shown = body_outputs(self.motion(x, u), a_x, a_y, yaw_acceleration, steers, push)
        return self.rates_and_outputs(rates, shown | wheel_outputs(road.contacts, road.forces))
