"""The car on four wheels without spin: longitudinal, lateral and yaw, driven and braked by torques."""

from __future__ import annotations

import equinox as eqx
import jax

from jaxveh._core.names import record
from jaxveh._core.parameter import parameter, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.tyres import AbstractTyre
from jaxveh.vehicles.drive import AbstractDrive, AxleDrive
from jaxveh.vehicles.load_transfer import AbstractLoadTransfer, LaggedLoads, planar_loads
from jaxveh.vehicles.traction import drive_power, driven_wheels, torque_acceleration
from jaxveh.vehicles.two_track import (
    AbstractPlanarTwoTrack,
    air_drag,
    body_outputs,
    check_car,
    filled,
    positions_of,
    rolling_wheels,
    started,
    state_type,
    touching,
    tyres_of,
    wheel_outputs,
)
from jaxveh.vehicles.wheels import body_forces, gravity

STATES = ("v_x", "v_y", "yaw", "yaw_rate")


class TwoTrack3DOF(AbstractPlanarTwoTrack):
    """`SevenDOF` without its stiff spins: wheel forces follow at once from the torques.

    With X_i, Y_i the road's forces on the wheels in the car's axes, (x_i, y_i) their places, g_x, g_y gravity along a sloping
    road (R. Rajamani, Vehicle Dynamics and Control, 2nd ed., ch. 8.3):

        m (dv_x/dt - v_y r) = sum X_i - drag v_x |v_x| + m g_x
        m (dv_y/dt + v_x r) = sum Y_i + m g_y
        I_z dr/dt           = sum (x_i Y_i - y_i X_i + M_z,i)

    A wheel's longitudinal force is its torque over the radius, as `traction.within_grip` lets it share the road's grip with the
    lateral force; the tyre's own F_x does not count. Torques that differ from wheel to wheel (`FourMotors`) turn the car. What
    spins the wheels up is left out (4 J / r^2 beside the mass: about 3 %). Loads follow `load_transfer`; slip angles are
    regularised below `crawl_speed` (m/s), and brakes and rolling resistance turn round smoothly about 0.5 m/s.

    **Parameters**: `mass` (kg), `yaw_inertia` (kg m^2), `front_axle_to_cg`, `rear_axle_to_cg`, `track_front`, `track_rear`,
    `cg_height`, `wheel_radius` (m), `front` and `rear`: the tyre of a wheel on each axle (`mirrored`: the right wheels' is its
    mirror image), `grip` (-: the greatest longitudinal force over load, times the road's friction), `drag` (N s^2/m^2),
    `rolling_resistance` (-), `front_roll_share` (-: the front axle's share of the lateral load transfer; None: by the static
    loads), `drive` and `load_transfer`.

    **Inputs**: `steer` (rad at the road wheels) and those of `drive` and `load_transfer`.

    **Raises** `InputError` for parameters outside their domain, or a tyre that is none.
    """

    mass: jax.Array = positive("kg")
    yaw_inertia: jax.Array = positive("kg m^2")
    front_axle_to_cg: jax.Array = positive("m")
    rear_axle_to_cg: jax.Array = positive("m")
    track_front: jax.Array = positive("m")
    track_rear: jax.Array = positive("m")
    cg_height: jax.Array = positive("m")
    front: AbstractTyre  # pyright: ignore[reportGeneralTypeIssues]
    rear: AbstractTyre  # pyright: ignore[reportGeneralTypeIssues]
    wheel_radius: jax.Array = positive("m", default=0.32)
    grip: jax.Array = positive("-", default=1.0)
    drag: jax.Array = parameter("N s^2/m^2", scale=0.4, default=0.0)
    rolling_resistance: jax.Array = parameter("-", scale=0.01, default=0.0)
    front_roll_share: jax.Array | None = parameter("-", scale=0.1, default=None)
    drive: AbstractDrive = eqx.field(default_factory=AxleDrive)
    load_transfer: AbstractLoadTransfer = eqx.field(default_factory=LaggedLoads)
    mirrored: bool = eqx.field(static=True, default=True)
    crawl_speed: float = eqx.field(static=True, default=3.0)

    def __check_init__(self):
        check_car(self)

    @property
    def inputs(self):
        return ("steer", *self.drive.inputs, *self.load_transfer.inputs)

    @property
    def state_type(self):
        """`v_x`, `v_y`, `yaw`, `yaw_rate`, then the states of the load transfer and of dynamic tyres (`fl_<name>` ...)."""
        return state_type(self, "TwoTrack3DOFState", STATES)

    def start(self, t, u, **values):
        """Straight running; `v_x` is the speed (m/s), 0 unless given."""
        return started(self, dict.fromkeys(STATES), u.steer, values, lambda x: self._contacts(x, u, LEVEL)[0])

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        tyres, (drive, brake) = tyres_of(self), self.drive.torques(u)
        contacts, moves = self._contacts(x, u, ground)
        states = tyres.states(x)
        forces = driven_wheels(self, tyres.forces(contacts, states), contacts, moves, drive, brake)
        push = body_forces(positions_of(self), moves, forces)
        g_x, g_y, _ = gravity(ground)
        a_x = (push.F_x - air_drag(self.drag, x.v_x)) / self.mass
        a_y = push.F_y / self.mass
        yaw_acceleration = push.M_z / self.yaw_inertia
        rates = (
            a_x + g_x + x.v_y * x.yaw_rate, a_y + g_y - x.v_x * x.yaw_rate, x.yaw_rate, yaw_acceleration,
            *self.load_transfer.rates(x, push.F_x / self.mass, a_y), *tyres.rates(contacts, states),
        )  # fmt: skip
        shown = body_outputs(self.motion(x, u), a_x, a_y, yaw_acceleration, u.steer, push) | wheel_outputs(
            contacts, forces
        )
        shown["drive_power"] = drive_power(self, drive, moves)
        return self.state_type(*rates), record("TwoTrack3DOFOutputs", filled(shown, push.F_y))

    def _contacts(self, x, u, ground: Ground):
        moves = rolling_wheels(self, x.v_x, x.v_y, x.yaw_rate, u.steer)
        _, g_y, g_z = gravity(ground)
        steady = torque_acceleration(self, *self.drive.torques(u), x.v_x, ground), x.v_x * x.yaw_rate - g_y
        loads = planar_loads(self, *self.load_transfer.felt(x, u, steady), g_z)
        return touching(self, moves, loads, ground), moves
