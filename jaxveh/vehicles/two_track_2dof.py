"""The car on four wheels at a given speed: lateral and yaw."""

from __future__ import annotations

import equinox as eqx
import jax

from jaxveh._core.names import record
from jaxveh._core.parameter import parameter, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.tyres import AbstractTyre
from jaxveh.vehicles.given_speed import longitudinal_acceleration
from jaxveh.vehicles.load_transfer import AbstractLoadTransfer, QuasiStatic, planar_loads
from jaxveh.vehicles.two_track import (
    AbstractPlanarTwoTrack,
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

STATES = ("v_y", "yaw", "yaw_rate")


class TwoTrack2DOF(AbstractPlanarTwoTrack):
    """A rigid car on four freely rolling wheels at a given forward speed: `SingleTrack` with tracks and lateral load transfer.

    With X_i, Y_i the road's forces on the wheels in the car's axes, (x_i, y_i) their places (R. Rajamani, Vehicle Dynamics and
    Control, 2nd ed., ch. 8.3, with v_x given):

        m (dv_y/dt + v_x r) = sum Y_i + m g_y
        I_z dr/dt           = sum (x_i Y_i - y_i X_i + M_z,i)

    Both front wheels turn by the steer. Loads follow `load_transfer`; slip angles are regularised below `crawl_speed` (m/s).

    **Parameters**: `mass` (kg), `yaw_inertia` (kg m^2), `front_axle_to_cg`, `rear_axle_to_cg`, `track_front`, `track_rear`,
    `cg_height` (m), `front` and `rear`: the tyre of a wheel on each axle (`mirrored`: the right wheels' is its mirror image),
    `front_roll_share` (-: the front axle's share of the lateral load transfer; None: by the static loads), `load_transfer`.

    **Inputs**: `steer` (rad at the road wheels), `v_x` (m/s), those of `load_transfer`, and if there is one the longitudinal
    acceleration, `a_x` (of an ideal accelerometer) or `v_x_rate`; without, the speed counts as constant.

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
    front_roll_share: jax.Array | None = parameter("-", scale=0.1, default=None)
    load_transfer: AbstractLoadTransfer = eqx.field(default_factory=QuasiStatic)
    mirrored: bool = eqx.field(static=True, default=True)
    crawl_speed: float = eqx.field(static=True, default=3.0)

    def __check_init__(self):
        check_car(self)

    @property
    def inputs(self):
        return ("steer", "v_x", *self.load_transfer.inputs)

    @property
    def state_type(self):
        """`v_y`, `yaw`, `yaw_rate`, then the states of the load transfer and of dynamic tyres (`fl_<name>` ...)."""
        return state_type(self, "TwoTrack2DOFState", STATES)

    def start(self, t, u, **values):
        return started(self, dict.fromkeys(STATES), u.v_x, values, lambda x: self._contacts(x, u, LEVEL)[0])

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        tyres = tyres_of(self)
        contacts, moves = self._contacts(x, u, ground)
        states = tyres.states(x)
        forces = tyres.forces(contacts, states)
        push = body_forces(positions_of(self), moves, forces)
        g_x, g_y, _ = gravity(ground)
        a_x, a_y = longitudinal_acceleration(x, u, g_x), push.F_y / self.mass
        yaw_acceleration = push.M_z / self.yaw_inertia
        rates = (
            a_y + g_y - u.v_x * x.yaw_rate, x.yaw_rate, yaw_acceleration,
            *self.load_transfer.rates(x, a_x, a_y), *tyres.rates(contacts, states),
        )  # fmt: skip
        shown = body_outputs(self.motion(x, u), a_x, a_y, yaw_acceleration, u.steer, push) | wheel_outputs(
            contacts, forces
        )
        return self.state_type(*rates), record("TwoTrack2DOFOutputs", filled(shown, push.F_y))

    def _contacts(self, x, u, ground: Ground):
        moves = rolling_wheels(self, u.v_x, x.v_y, x.yaw_rate, u.steer)
        g_x, g_y, g_z = gravity(ground)
        steady = longitudinal_acceleration(x, u, g_x), u.v_x * x.yaw_rate - g_y
        loads = planar_loads(self, *self.load_transfer.felt(x, u, steady), g_z)
        return touching(self, moves, loads, ground), moves
