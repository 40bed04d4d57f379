"""The car that rolls, driven by torques: longitudinal, lateral, yaw and roll."""

from __future__ import annotations

from typing import ClassVar

from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.rolling_body import AbstractRollingTwoTrack, roll_accelerations, roll_outputs
from jaxveh.vehicles.steering import steer_outputs
from jaxveh.vehicles.traction import AbstractSpinless, drive_over_road, drive_power
from jaxveh.vehicles.two_track import air_drag, body_outputs, wheel_outputs
from jaxveh.vehicles.wheels import gravity


class Roll4DOF(AbstractSpinless, AbstractRollingTwoTrack):
    """`TwoTrack3DOF` with a body that rolls: longitudinal, lateral, yaw and roll.

    The body leans as that of `Roll3DOF`, with its sources, its signs (roll is positive with the left side up) and what it leaves
    out; the forward speed is a state:

        m (dv_x/dt - v_y r)                         = sum X_i - drag v_x |v_x| + m g_x
        m (dv_y/dt + v_x r) - m_s h dp/dt           = sum Y_i + m g_y
        I_z dr/dt - I_xz dp/dt                      = sum (x_i Y_i - y_i X_i + M_z,i)
        (I_x + m_s h^2) dp/dt - I_xz dr/dt - m_s h (dv_y/dt + v_x r - g_y) = (m_s g h - K) phi - C p

    The states v_x and v_y are speeds of the point on the roll axis below the centre of gravity at rest. Outputs and `motion` (so
    the place, too) are of the moving centre of gravity of the whole car: its speeds `rolling_body.swing` ahead of the states',
    `a_x` and `a_y` what an accelerometer there says. Wheels neither steer nor tilt with roll.
    Wheel loads are those of `rolling_body.roll_loads`, wheel forces those of the torques as in `TwoTrack3DOF`.

    **Inputs**: those of `steering` (`steer`, rad at the road wheels), `drive` and `load_transfer`.

    **Raises** `InputError` for parameters outside their domain (a body that its springs cannot hold upright is), or a tyre that
    is none.
    """

    body_states: ClassVar[tuple[str, ...]] = ("v_x", "v_y", "yaw", "yaw_rate", "roll", "roll_rate")

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        road, forces, push, drive = drive_over_road(self, x, u, ground)
        g_x, g_y, g_z = gravity(ground)
        X = push.F_x - air_drag(self.drag, x.v_x)
        a_x, a_y = X / self.mass, push.F_y / self.mass
        found = roll_accelerations(self, x, X, push.F_y, push.M_z, g_z)
        rates = (
            found.a_x + g_x + x.v_y * x.yaw_rate, found.a_y + g_y - x.v_x * x.yaw_rate, x.yaw_rate, found.yaw,
            x.roll_rate, found.roll,
            *self.load_transfer.rates(x, push.F_x / self.mass, a_y), *road.tyre_rates,
        )  # fmt: skip
        steers = steer_outputs(self.steering, road.steers)
        shown = body_outputs(self.motion(x, u), a_x, a_y, found.yaw, steers, push)
        shown |= roll_outputs(x, found.roll) | wheel_outputs(road.contacts, forces)
        shown["drive_power"] = drive_power(self, drive, road.moves)
        return self.rates_and_outputs(rates, shown)
