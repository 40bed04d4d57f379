"""A car with lateral, yaw and roll motion at a given speed."""

from __future__ import annotations

from typing import ClassVar

from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.given_speed import AbstractToldSpeed, longitudinal_acceleration
from jaxveh.vehicles.rolling_body import AbstractRollingTwoTrack, roll_accelerations, roll_outputs
from jaxveh.vehicles.steering import steer_outputs
from jaxveh.vehicles.two_track import body_outputs, wheel_outputs
from jaxveh.vehicles.wheels import body_forces, gravity


class Roll3DOF(AbstractToldSpeed, AbstractRollingTwoTrack):
    """`TwoTrack2DOF` with a rolling body: lateral, yaw and roll motion at a given forward speed.

    The sprung mass rolls on springs and dampers about the roll axis, which joins the roll centres. All other masses stay
    upright. The equations are coupled by the height of the sprung mass over the roll axis. They are exact in the roll angle,
    except that the inertias do not tilt, see `rolling_body.roll_accelerations`. For small angles and rates they are those of R.
    Rajamani (Vehicle Dynamics and Control, 2nd ed., ch. 15) and M. Abe (Vehicle Handling Dynamics, ch. 6), there partly in SAE
    axes, here in ISO 8855: roll is positive with the left side up, as in a left turn, and the sprung mass then moves by
    -h sin(phi) to the left:

        m (dv_y/dt + v_x r) - m_s h dp/dt           = sum Y_i + m g_y
        I_z dr/dt - I_xz dp/dt                      = sum (x_i Y_i - y_i X_i + M_z,i)
        (I_x + m_s h^2) dp/dt - I_xz dr/dt - m_s h (dv_y/dt + v_x r - g_y) = (m_s g h - K) phi - C p

    The state v_y is the lateral speed of the point on the roll axis below the centre of gravity at rest; v_x in these equations
    is the forward speed of that point. Inputs, outputs and `motion` (and so the position) are those of the moving centre of
    gravity of the whole car. Its velocity relative to that point is `rolling_body.swing`; `a_x` and `a_y` are the signals of an
    accelerometer there. Wheels neither steer nor tilt with roll. Wheel loads are those of `rolling_body.roll_loads`.

    **Inputs**: those of `steering` (`steer`, rad at the road wheels), `v_x` (m/s), those of `load_transfer`, and optionally the
    longitudinal acceleration, `a_x` (of an ideal accelerometer) or `v_x_rate`; without it the speed is assumed constant.

    **Raises** `InputError` for parameters outside their domain (including springs too soft to hold the body upright), or a tyre
    that is not a tyre of `jaxveh.tyres`.
    """

    body_states: ClassVar[tuple[str, ...]] = ("v_y", "yaw", "yaw_rate", "roll", "roll_rate")

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        road, centre = self.on_road(x, u, ground), self.motion(x, u)
        push = body_forces(self.places, road.moves, road.forces)
        g_x, g_y, g_z = gravity(ground)
        a_x, a_y = longitudinal_acceleration(centre, u, g_x), push.F_y / self.mass
        # The force along the car is the one required by the given speed.
        found = roll_accelerations(self, x, self.mass * a_x, push.F_y, push.M_z, g_z)
        rates = (
            found.a_y + g_y - self.wheel_speed(x, u) * x.yaw_rate, x.yaw_rate, found.yaw, x.roll_rate, found.roll,
            *self.load_transfer.rates(x, a_x, a_y), *road.tyre_rates,
        )  # fmt: skip
        steers = steer_outputs(self.steering, road.steers)
        shown = body_outputs(centre, a_x, a_y, found.yaw, steers, push)
        shown |= roll_outputs(x, found.roll) | wheel_outputs(road.contacts, road.forces)
        return self.rates_and_outputs(rates, shown)
