"""A car with longitudinal, lateral, yaw and roll motion, driven by torques."""

from __future__ import annotations

from typing import ClassVar

from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.rolling_body import AbstractRollingTwoTrack, roll_accelerations, roll_outputs
from jaxveh.vehicles.steering import steer_outputs
from jaxveh.vehicles.traction import AbstractSpinless, drive_over_road, drive_power
from jaxveh.vehicles.two_track import air_drag, body_outputs, wheel_outputs
from jaxveh.vehicles.wheels import gravity


class Roll4DOF(AbstractSpinless, AbstractRollingTwoTrack):
    """`TwoTrack3DOF` with a rolling body: longitudinal, lateral, yaw and roll motion.

    The body rolls as in `Roll3DOF`, with the same sources, signs (roll is positive with the left side up) and simplifications.
    The forward speed is a state:

        m (dv_x/dt - v_y r)                         = sum X_i - drag v_x |v_x| + m g_x
        m (dv_y/dt + v_x r) - m_s h dp/dt           = sum Y_i + m g_y
        I_z dr/dt - I_xz dp/dt                      = sum (x_i Y_i - y_i X_i + M_z,i)
        (I_x + m_s h^2) dp/dt - I_xz dr/dt - m_s h (dv_y/dt + v_x r - g_y) = (m_s g h - K) phi - C p

    The states v_x and v_y are the speeds of the point on the roll axis below the centre of gravity at rest. Outputs and `motion`
    (and so the position) are those of the moving centre of gravity of the whole car. Its velocity relative to that point is
    `rolling_body.swing`; `a_x` and `a_y` are the signals of an accelerometer there. Wheels neither steer nor tilt with roll.
    Wheel loads are those of `rolling_body.roll_loads`, wheel forces follow from the torques as in `TwoTrack3DOF`.

    **Inputs**: those of `steering` (`steer`, rad at the road wheels), `drive` and `load_transfer`.

    **Raises** `InputError` for parameters outside their domain (including springs too soft to hold the body upright), or a tyre
    that is not a tyre of `jaxveh.tyres`.
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
