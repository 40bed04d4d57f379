"""The car that rolls, driven by torques: longitudinal, lateral, yaw and roll."""

from __future__ import annotations

import equinox as eqx
import jax

from jaxveh._core.names import record
from jaxveh._core.parameter import parameter, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.tyres import AbstractTyre
from jaxveh.vehicles.drive import AbstractDrive, AxleDrive
from jaxveh.vehicles.load_transfer import AbstractLoadTransfer, LaggedLoads
from jaxveh.vehicles.rolling_body import (
    AbstractRollingTwoTrack,
    check_rolling_car,
    roll_accelerations,
    roll_loads,
    roll_outputs,
)
from jaxveh.vehicles.traction import drive_power, driven_wheels, torque_acceleration
from jaxveh.vehicles.two_track import (
    air_drag,
    body_outputs,
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

STATES = ("v_x", "v_y", "yaw", "yaw_rate", "roll", "roll_rate")


class Roll4DOF(AbstractRollingTwoTrack):
    """`TwoTrack3DOF` with a body that rolls: longitudinal, lateral, yaw and roll.

    Around the roll axis, which joins the roll centres, the sprung mass leans on springs and dampers; all else stays upright. The
    equations, coupled by the sprung mass's height over the axis, are exact in the roll angle but for the inertias' tilting, and
    stand in `rolling_body.roll_accelerations`; for small angles and rates they are those of R. Rajamani (Vehicle Dynamics and
    Control, 2nd ed., ch. 15) and M. Abe (Vehicle Handling Dynamics, ch. 6), there partly in SAE axes, here in ISO 8855: roll is
    positive with the left side up, which is how a car leans in a left turn, and its centre of gravity then moves by -h sin(phi):

        m (dv_x/dt - v_y r)                         = sum X_i - drag v_x |v_x| + m g_x
        m (dv_y/dt + v_x r) - m_s h dp/dt           = sum Y_i + m g_y
        I_z dr/dt - I_xz dp/dt                      = sum (x_i Y_i - y_i X_i + M_z,i)
        (I_x + m_s h^2) dp/dt - I_xz dr/dt - m_s h (dv_y/dt + v_x r - g_y) = (m_s g h - K) phi - C p

    The states v_x and v_y are speeds of the point on the roll axis below the centre of gravity at rest. Outputs and `motion` (so
    the place, too) are of the moving centre of gravity of the whole car: its speeds `rolling_body.swing` ahead of the states',
    `a_x` and `a_y` what an accelerometer there says. Wheels neither steer nor tilt with roll.
    Wheel loads are those of `rolling_body.roll_loads`, wheel forces those of the torques as in `TwoTrack3DOF`.

    **Parameters**: `mass`, `sprung_mass` (kg: the whole car's, and that of what rolls), `yaw_inertia` (kg m^2, whole car),
    `roll_inertia` (kg m^2: of the sprung mass about its own centre of gravity), `roll_yaw_product` (kg m^2: the integral
    of x z dm over what rolls, about the point of the roll axis below the car's centre of gravity),
    `front_axle_to_cg`, `rear_axle_to_cg`, `track_front`, `track_rear`, `cg_height` (m, whole car), `unsprung_height` (m: the
    centre of gravity of what does not roll), `roll_centre_front`, `roll_centre_rear` (m over the road), `roll_stiffness_front`,
    `roll_stiffness_rear` (N m/rad, springs and bars), `roll_damping_front`, `roll_damping_rear` (N m s/rad), `front` and `rear`:
    the tyre of a wheel on each axle (`mirrored`: the right wheels' is its mirror image), `wheel_radius` (m), `grip` (-: the
    greatest longitudinal force over load, times the road's friction), `drag` (N s^2/m^2), `rolling_resistance` (-), `drive` and
    `load_transfer` (for what passes from body to wheels at once, and the axles' loads); slip angles are regularised below
    `crawl_speed` (m/s).

    **Inputs**: `steer` (rad at the road wheels) and those of `drive` and `load_transfer`.

    **Raises** `InputError` for parameters outside their domain (a body that its springs cannot hold upright is), or a tyre that
    is none.
    """

    mass: jax.Array = positive("kg")
    sprung_mass: jax.Array = positive("kg")
    yaw_inertia: jax.Array = positive("kg m^2")
    roll_inertia: jax.Array = positive("kg m^2")
    front_axle_to_cg: jax.Array = positive("m")
    rear_axle_to_cg: jax.Array = positive("m")
    track_front: jax.Array = positive("m")
    track_rear: jax.Array = positive("m")
    cg_height: jax.Array = positive("m")
    roll_stiffness_front: jax.Array = positive("N m/rad")
    roll_stiffness_rear: jax.Array = positive("N m/rad")
    front: AbstractTyre  # pyright: ignore[reportGeneralTypeIssues]
    rear: AbstractTyre  # pyright: ignore[reportGeneralTypeIssues]
    roll_damping_front: jax.Array = parameter("N m s/rad", scale=1000.0, default=2000.0)
    roll_damping_rear: jax.Array = parameter("N m s/rad", scale=1000.0, default=2000.0)
    roll_centre_front: jax.Array = parameter("m", scale=0.1, default=0.05)
    roll_centre_rear: jax.Array = parameter("m", scale=0.1, default=0.1)
    roll_yaw_product: jax.Array = parameter("kg m^2", scale=50.0, default=0.0)
    unsprung_height: jax.Array = positive("m", default=0.32)
    wheel_radius: jax.Array = positive("m", default=0.32)
    grip: jax.Array = positive("-", default=1.0)
    drag: jax.Array = parameter("N s^2/m^2", scale=0.4, default=0.0)
    rolling_resistance: jax.Array = parameter("-", scale=0.01, default=0.0)
    drive: AbstractDrive = eqx.field(default_factory=AxleDrive)
    load_transfer: AbstractLoadTransfer = eqx.field(default_factory=LaggedLoads)
    mirrored: bool = eqx.field(static=True, default=True)
    crawl_speed: float = eqx.field(static=True, default=3.0)

    def __check_init__(self):
        check_rolling_car(self)

    @property
    def inputs(self):
        return ("steer", *self.drive.inputs, *self.load_transfer.inputs)

    @property
    def state_type(self):
        """`v_x`, `v_y`, `yaw`, `yaw_rate`, `roll`, `roll_rate`, then the states of the load transfer and of dynamic tyres."""
        return state_type(self, "Roll4DOFState", STATES)

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
        g_x, g_y, g_z = gravity(ground)
        X = push.F_x - air_drag(self.drag, x.v_x)
        a_x, a_y = X / self.mass, push.F_y / self.mass
        found = roll_accelerations(self, x, X, push.F_y, push.M_z, g_z)
        rates = (
            found.a_x + g_x + x.v_y * x.yaw_rate, found.a_y + g_y - x.v_x * x.yaw_rate, x.yaw_rate, found.yaw,
            x.roll_rate, found.roll,
            *self.load_transfer.rates(x, push.F_x / self.mass, a_y), *tyres.rates(contacts, states),
        )  # fmt: skip
        shown = body_outputs(self.motion(x, u), a_x, a_y, found.yaw, u.steer, push)
        shown |= roll_outputs(x, found.roll) | wheel_outputs(contacts, forces)
        shown["drive_power"] = drive_power(self, drive, moves)
        return self.state_type(*rates), record("Roll4DOFOutputs", filled(shown, push.F_y))

    def _contacts(self, x, u, ground: Ground):
        moves = rolling_wheels(self, x.v_x, x.v_y, x.yaw_rate, u.steer)
        _, g_y, g_z = gravity(ground)
        steady = torque_acceleration(self, *self.drive.torques(u), x.v_x, ground), x.v_x * x.yaw_rate - g_y
        loads = roll_loads(self, x, *self.load_transfer.felt(x, u, steady), g_z)
        return touching(self, moves, loads, ground), moves
