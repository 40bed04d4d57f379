"""The car of seven degrees of freedom: longitudinal, lateral, yaw, and the spin of four wheels."""

from __future__ import annotations

import equinox as eqx
import jax

from jaxveh._core.names import record
from jaxveh._core.parameter import parameter, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.tyres import AbstractTyre
from jaxveh.vehicles.drive import AbstractDrive, AxleDrive
from jaxveh.vehicles.load_transfer import AbstractLoadTransfer, LaggedLoads, planar_loads
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
from jaxveh.vehicles.wheels import (
    body_forces,
    each_wheel,
    gravity,
    sum_of_wheels,
    travel_direction,
    wheel_names,
    wheels_of,
)

SPINS = wheel_names("omega")
STATES = ("v_x", "v_y", "yaw", "yaw_rate", *SPINS)


class SevenDOF(AbstractPlanarTwoTrack):
    """A rigid car on four wheels that spin: the truth of many papers and the work horse of simulations.

    With X_i, Y_i the road's forces on the wheels in the car's axes, (x_i, y_i) the wheels' places, T_i the torques and
    g_x, g_y gravity along a sloping road (R. Rajamani, Vehicle Dynamics and Control, 2nd ed., ch. 8.3; Qin et al. 2014):

        m (dv_x/dt - v_y r) = sum X_i - drag v_x |v_x| + m g_x
        m (dv_y/dt + v_x r) = sum Y_i + m g_y
        I_z dr/dt           = sum (x_i Y_i - y_i X_i + M_z,i)
        J_w domega_i/dt     = T_i - r_e (F_x,i + f_r F_z,i) - brakes

    Both front wheels turn by the steer. Loads follow `load_transfer`. Slips are those of `wheels.contact`, regularised below
    `crawl_speed` (m/s); brakes and rolling resistance turn round smoothly about 0.5 m/s, so that standstill is an ordinary
    point. The spins are stiff: their poles are about `-C_x r_e^2 / (J_w |v|)`, 200 1/s at 20 m/s and thousands at walking
    speed, which `simulate` looks at when it chooses its solver.

    **Parameters**: `mass` (kg), `yaw_inertia` (kg m^2), `front_axle_to_cg`, `rear_axle_to_cg`, `track_front`, `track_rear`,
    `cg_height`, `wheel_radius` (m, effective), `wheel_inertia` (kg m^2), `front` and `rear`: the tyre of a wheel on each axle
    (`mirrored`: the right wheels' is its mirror image), `drag` (N s^2/m^2), `rolling_resistance` (-), `front_roll_share` (-:
    the front axle's share of the lateral load transfer; None: by the static loads), `drive` and `load_transfer`.

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
    wheel_inertia: jax.Array = positive("kg m^2", default=1.2)
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
        """The body's and the wheels' states, then those of the load transfer and of dynamic tyres (`fl_<name>` ...)."""
        return state_type(self, "SevenDOFState", STATES)

    def start(self, t, u, **values):
        """Straight running with wheels that roll freely; `v_x` is the speed (m/s), 0 unless given."""
        rolls = lambda given, zero: given.get("v_x", zero) / self.wheel_radius
        body = {name: rolls if name in SPINS else None for name in STATES}
        return started(self, body, u.steer, values, lambda x: self._contacts(x, u, LEVEL)[0])

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        tyres = tyres_of(self)
        contacts, moves = self._contacts(x, u, ground)
        states = tyres.states(x)
        forces = tyres.forces(contacts, states)
        push = body_forces(positions_of(self), moves, forces)
        g_x, g_y, _ = gravity(ground)
        # Multiplied by inverses, which belong to the car and not to the instant: a division costs five multiplications.
        inverse_mass = 1.0 / self.mass
        a_x = (push.F_x - air_drag(self.drag, x.v_x)) * inverse_mass
        a_y = push.F_y * inverse_mass
        yaw_acceleration = push.M_z * (1.0 / self.yaw_inertia)
        omegas = wheels_of(x, "omega")
        drive, brake = self.drive.torques(u)
        spins = each_wheel(self._spin, omegas, contacts, forces, drive, brake)
        rates = (
            a_x + g_x + x.v_y * x.yaw_rate, a_y + g_y - x.v_x * x.yaw_rate, x.yaw_rate, yaw_acceleration, *spins,
            *self.load_transfer.rates(x, push.F_x * inverse_mass, a_y), *tyres.rates(contacts, states),
        )  # fmt: skip
        shown = body_outputs(self.motion(x, u), a_x, a_y, yaw_acceleration, u.steer, push)
        shown |= wheel_outputs(contacts, forces, omegas)
        shown["drive_power"] = sum_of_wheels(each_wheel(lambda torque, omega: torque * omega, drive, omegas))
        return self.state_type(*rates), record("SevenDOFOutputs", filled(shown, push.F_y))

    def _contacts(self, x, u, ground: Ground):
        moves = rolling_wheels(self, x.v_x, x.v_y, x.yaw_rate, u.steer)
        a_x, a_y = self.load_transfer.felt(x, u, self._steady(x, u, ground))
        loads = planar_loads(self, a_x, a_y, gravity(ground)[2])
        speeds = each_wheel(lambda omega: omega * self.wheel_radius, wheels_of(x, "omega"))
        return touching(self, moves, loads, ground, speeds), moves

    def _steady(self, x, u, ground: Ground):
        """Accelerations of a steady turn under these torques, m/s^2; what no load transfer asks for is never computed."""
        drive, brake = self.drive.torques(u)
        torque = sum_of_wheels(drive) - sum_of_wheels(brake) * travel_direction(x.v_x)
        return torque * (1.0 / (self.mass * self.wheel_radius)), x.v_x * x.yaw_rate - gravity(ground)[1]

    def _spin(self, omega, at, force, drive, brake):
        slowing = (brake + self.rolling_resistance * at.load * self.wheel_radius) * travel_direction(
            omega * self.wheel_radius
        )
        return (drive - slowing - self.wheel_radius * force.F_x) * (1.0 / self.wheel_inertia)
