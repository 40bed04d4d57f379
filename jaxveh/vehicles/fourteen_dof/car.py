"""The car with fourteen degrees of freedom: a body, four wheels on suspensions, and their spins."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh import numerics
from jaxveh._core.parameter import check_parameters
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import Motion
from jaxveh.vehicles.fourteen_dof.checks import check_fourteen_dof
from jaxveh.vehicles.fourteen_dof.dynamics import Accelerations, Inertia, accelerations
from jaxveh.vehicles.fourteen_dof.kinematics import Body, angle_accelerations, body_of, to_body, to_road
from jaxveh.vehicles.fourteen_dof.parameters import AbstractSuspendedTwoTrack
from jaxveh.vehicles.fourteen_dof.shown import UNITS, attitude_outputs, by_wheel, moments
from jaxveh.vehicles.fourteen_dof.suspension import (
    Wheel,
    joints,
    sunk_at_rest,
    suspension_forces,
    unsprung,
    wheel_at,
)
from jaxveh.vehicles.fourteen_dof.tyre_contact import ROLLING_SHARE, Touch, axles, reaction, touch
from jaxveh.vehicles.fourteen_dof.vectors import Vector, add, dot, minus, times
from jaxveh.vehicles.steering import steer_outputs
from jaxveh.vehicles.two_track import air_drag, body_outputs, wheel_outputs
from jaxveh.vehicles.wheels import (
    SPINS,
    Wheels,
    body_forces,
    each_wheel,
    frictions,
    gravity,
    heights,
    sum_of_wheels,
    travel_direction,
    wheel_names,
    wheels_of,
)

BODY = ("v_x", "v_y", "v_z", "z", "roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate")


class FourteenDOF(AbstractSuspendedTwoTrack):
    """A rigid body with all six degrees of freedom, four unsprung masses on springs and four wheels that spin: the true car.

    The equations are exact for this mechanism, for angles of any size (pitch below 90 degrees), and conserve energy:

    - The mass of a wheel moves along a straight joint fixed in the body. The joint is inclined so that the contact point turns
      about the roll centre (`roll_centre`) and moves forward by `pitch_slope` per metre of bump travel: in front a positive
      slope is anti-dive, at the rear a negative one is anti-squat and anti-lift. Wheels keep their angle to the body: the camber
      is that of the body plus `camber`.
    - `omega` is the total spin of a wheel about its axle. A sensor on the body measures it less the body's angular velocity
      about the axle (about the pitch rate), the output `omega_to_body`. The wheels' angular momentum causes gyroscopic moments,
      except that of a changing steer.
    - A tyre is a spring and a damper in the wheel's plane, and its load is never negative. The contact point is where this plane
      meets the road below the centre. The tyre rolls with the unloaded radius less a third of the compression, which is also the
      arm of its longitudinal force about the axle: with the smaller loaded radius the tyres would generate energy. The tyre's
      moments M_x, M_y, M_z are included; that of rolling resistance reverses its sign with the direction of travel, and
      `rolling_resistance` is added to it.
    - The road is the plane of x and y. A road's `height` raises the contact point of each tyre: it does not tilt the forces, and
      its rate of change does not enter the tyre's damping. Slopes tilt gravity. Air drag acts on the centre of gravity of the
      sprung mass.

    Speeds, position and accelerations are those of the centre of gravity of the *sprung mass*, in the intermediate axes (x, y in
    the road's plane). `a_x`, `a_y`, `a_z` are the signals of an ideal accelerometer there in these axes (a_z = g at rest).
    Springs are preloaded for rest on a level road, the position of `start`. Slips are those of `wheels.contact`. Brakes and
    rolling resistance change sign smoothly below 0.94 m/s (`wheels.STANDSTILL`). Wheel hop (about 10 Hz) and spins (see
    `SevenDOF`) are stiff.

    The equations follow from d'Alembert's principle, see `dynamics.accelerations`. The degrees of freedom are those of T. Shim
    and C. Ghike, Vehicle System Dynamics 45 (2007) 191, here with joints inclined for the roll centres and without linearisation.

    **Inputs**: those of `steering` (`steer`, rad at the road wheels) and of `drive`.

    **Outputs** in addition to those of `SevenDOF`: `z`, `v_z`, `roll`, `pitch`, their rates and accelerations, `a_z`,
    `camber_fl`, `travel_fl` (m, up), `travel_rate_fl`, `suspension_force_fl` (N), `omega_to_body_fl` (rad/s), `M_x_fl`, `M_y_fl`
    ..., and the powers (W) that leave the car: `tyre_dissipation` (slip, moments, rolling, tyre damping), `damper_dissipation`,
    `brake_dissipation`, `drag_dissipation`. With `drive_power` they balance the change of energy.

    **Raises** `InputError` for parameters outside their domain, an inertia that is not positive definite, tyres too soft to
    carry the car, or a tyre that is not a tyre of `jaxveh.tyres`.
    """

    def __check_init__(self):
        check_parameters(self)
        check_fourteen_dof(self)

    @property
    def inputs(self):
        return (*self.steering.inputs, *self.drive.inputs)

    @property
    def own_states(self):
        """The states of the body, then travels, their rates and spins."""
        return (*BODY, *wheel_names("travel"), *wheel_names("travel_rate"), *SPINS)

    @property
    def units(self):
        return dict(UNITS)

    def motion(self, x, u):
        return Motion(0.0, 0.0, x.yaw, x.v_x, x.v_y, x.yaw_rate)

    def at_rest(self, v_x):
        """The height and the spins on a level road, at rest or rolling freely with `v_x` (m/s)."""
        spins = [v_x / (self.wheel_radius - ROLLING_SHARE * sunk) for sunk in sunk_at_rest(self)]
        return {"z": self.cg_height, **dict(zip(SPINS, spins, strict=True))}

    def contacts(self, x, u, ground: Ground = LEVEL) -> Wheels:
        return self._stand(x, self._steers(x, u), ground).contacts

    def _steers(self, x, u) -> Wheels:
        """The angles of the wheels, rad, without `ackermann` and toe."""
        return self.steering.angles(self, u, x.v_x)

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        steers, tyres, omegas = self._steers(x, u), self.tyres, wheels_of(x, "omega")
        stand = self._stand(x, steers, ground)
        body, states, g = stand.body, tyres.states(x), Vector(*gravity(ground))
        forces = tyres.forces(stand.contacts, states)
        roads = each_wheel(
            lambda at, how, f, omega: reaction(self, body, at, how, f, omega),
            stand.contacts,
            stand.touches,
            forces,
            omegas,
        )
        shafts = self._shafts(stand, u, omegas)
        suspension, damping = suspension_forces(self, wheels_of(x, "travel"), wheels_of(x, "travel_rate"))
        found = self._accelerate(x, stand, roads, shafts, suspension, omegas, g)
        roll, pitch, yaw = angle_accelerations(body.axes, x, body.omega, found.angular)
        linear = to_road(body.axes, found.linear)
        spins = each_wheel(lambda road, shaft: (road.spin + shaft.torque) / self.wheel_inertia, roads, shafts)
        rates = (
            linear.x + x.v_y * x.yaw_rate, linear.y - x.v_x * x.yaw_rate, linear.z, x.v_z,
            x.roll_rate, x.pitch_rate, x.yaw_rate, roll, pitch, yaw,
            *wheels_of(x, "travel_rate"), *found.travels, *spins, *tyres.rates(stand.contacts, states),
        )  # fmt: skip
        felt = minus(linear, g)
        push = body_forces(
            each_wheel(lambda wheel, how: _below(body, wheel, how), stand.wheels, stand.touches),
            each_wheel(lambda how: how.moves, stand.touches),
            forces,
        )
        shown = body_outputs(self.motion(x, u), felt.x, felt.y, yaw, steer_outputs(self.steering, steers), push)
        shown |= attitude_outputs(x, roll, pitch, felt.z)
        shown |= wheel_outputs(stand.contacts, forces, omegas) | moments(forces)
        shown |= by_wheel(
            camber=each_wheel(lambda at: at.camber, stand.contacts), travel=wheels_of(x, "travel"),
            travel_rate=wheels_of(x, "travel_rate"), suspension_force=suspension,
            omega_to_body=each_wheel(lambda shaft: shaft.turns, shafts),
        )  # fmt: skip
        shown |= {
            "drive_power": sum_of_wheels(each_wheel(lambda shaft: shaft.drive_power, shafts)),
            "tyre_dissipation": sum_of_wheels(each_wheel(lambda road: road.dissipation, roads)),
            "damper_dissipation": sum_of_wheels(
                each_wheel(lambda force, rate: force * rate, damping, wheels_of(x, "travel_rate"))
            ),
            "brake_dissipation": sum_of_wheels(each_wheel(lambda shaft: shaft.brake_power, shafts)),
            "drag_dissipation": air_drag(self.drag, x.v_x) * x.v_x,
        }
        return self.rates_and_outputs(rates, shown)

    @numerics.fence_results
    def _stand(self, x, steers: Wheels, ground: Ground) -> Stand:
        """The position of body and wheels on the road, computed without tyre forces."""
        body = body_of(x)
        wheels = each_wheel(
            lambda joint, travel, rate: wheel_at(joint, travel, rate, body),
            joints(self), wheels_of(x, "travel"), wheels_of(x, "travel_rate"),
        )  # fmt: skip
        turned = axles(self, steers)
        both = each_wheel(
            lambda wheel, axis, omega, mu, road: touch(self, body, wheel, axis, omega, mu, road),
            wheels, turned, wheels_of(x, "omega"), frictions(ground), heights(ground),
        )  # fmt: skip
        return Stand(body, wheels, turned, Wheels(*[b[0] for b in both]), Wheels(*[b[1] for b in both]))

    @numerics.fence_results
    def _shafts(self, stand: Stand, u, omegas: Wheels) -> Wheels:
        """The torques of motors and brakes, which react on the body."""
        drive, brake = self.drive.torques(u)

        def one(axis, how, omega, driving, braking):
            turns = omega - dot(axis, stand.body.omega)
            slowing = braking * travel_direction(turns * how.radius)
            return Shaft(driving - slowing, turns, driving * turns, slowing * turns)

        return each_wheel(one, stand.axles, stand.touches, omegas, drive, brake)

    def _accelerate(self, x, stand: Stand, roads, shafts, suspension, omegas, g: Vector) -> Accelerations:
        """The accelerations under gravity, drag and reaction torques on the body, and gravity and the road on the wheels."""
        axes = stand.body.axes
        g = to_body(axes, g)
        force = add(times(self.sprung_mass, g), times(-air_drag(self.drag, x.v_x), axes.forward))
        moments = each_wheel(
            lambda road, shaft, axis: minus(road.moment, times(shaft.torque, axis)), roads, shafts, stand.axles
        )
        momentum = each_wheel(lambda omega, axis: times(self.wheel_inertia * omega, axis), omegas, stand.axles)
        return accelerations(
            Inertia(self.sprung_mass, self.roll_inertia, self.pitch_inertia, self.yaw_inertia, self.roll_yaw_product),
            joints(self),
            stand.wheels,
            stand.body.omega,
            add(*momentum),
            force,
            add(*moments),
            each_wheel(lambda road, mass: add(road.force, times(mass, g)), roads, unsprung(self)),
            suspension,
        )


class Stand(NamedTuple):
    """The car on the road: the body, and for each wheel its centre, axis (in the body's axes), contact and `Touch`."""

    body: Body
    wheels: Wheels
    axles: Wheels
    contacts: Wheels
    touches: Wheels


class Shaft(NamedTuple):
    """The torque on a wheel (N m), its spin relative to the body (rad/s), the power of its motor and that of its brake (W)."""

    torque: Any
    turns: Any
    drive_power: Any
    brake_power: Any


def _below(body: Body, wheel: Wheel, how: Touch) -> tuple[Any, Any]:
    """The contact point of a wheel: x, y (m) from the centre of gravity, in the intermediate axes."""
    at = add(to_road(body.axes, wheel.place), how.arm)
    return at.x, at.y
