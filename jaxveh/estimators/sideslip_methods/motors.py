"""The single track with the yaw moment of wheel torques: eq 10 of the review (section 1.5), for cars with a motor in each
wheel."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax

from jaxveh import filters, numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import UNNAMED, positive
from jaxveh.estimators.car_file import keys_of
from jaxveh.estimators.contract import Need
from jaxveh.estimators.sideslip_methods.common import Guarded, slowest_of
from jaxveh.estimators.sideslip_methods.single_track import (
    LateralState,
    full_state,
    in_filter,
    lateral_model,
    report,
    rolling_below,
    single_track,
)
from jaxveh.estimators.sideslip_methods.stiff_step import StiffStep
from jaxveh.io import CarSpecification
from jaxveh.statespace import StateSpace
from jaxveh.vehicles import SingleTrack
from jaxveh.vehicles import kit as vehicles

TORQUES = tuple(Need(f"torque_{at}", "N m", throughout=True) for at in vehicles.CORNERS)


class MotorTrack(eqx.Module):
    """A single track with torques at its wheels: `track_front`, `track_rear`, `wheel_radius` (m); `slowest` as in `Lateral`.

    Eq 10, of the review's [34, 83]:

        m a_y = F_xf sin(delta) + F_yf cos(delta) + F_yr
        I_z dr/dt = (F_xf sin(delta) + F_yf cos(delta)) l_f - F_yr l_r + T

    Erratum: the printed first term of both lines has F_yf in the place of F_xf. T is the yaw moment of the longitudinal forces,
    which are torque over radius (eq 12 without the wheels' inertia).
    """

    car: SingleTrack = eqx.field(metadata=UNNAMED)
    slowest: jax.Array = positive("m/s")
    track_front: jax.Array = positive("m")
    track_rear: jax.Array = positive("m")
    wheel_radius: jax.Array = positive("m")

    def accelerations(self, x: LateralState, u) -> tuple[Any, Any]:
        """Lateral acceleration (m/s^2) and yaw acceleration (rad/s^2)."""
        car: Any = self.car
        front, rear = car.contacts(full_state(car, x), u)
        steer = u.steer + car.steer_offset
        sine, cosine = numerics.sin(steer), numerics.cos(steer)
        left, right, rear_left, rear_right = (getattr(u, f"torque_{at}") / self.wheel_radius for at in vehicles.CORNERS)
        F_front = (left + right) * sine + car.front.forces(front).F_y * cosine
        F_rear = car.rear.forces(rear).F_y
        across = 0.5 * self.track_front * (right - left) * cosine + 0.5 * self.track_rear * (rear_right - rear_left)
        moment = F_front * car.front_axle_to_cg - F_rear * car.rear_axle_to_cg + across
        return (F_front + F_rear) / car.mass, moment / car.yaw_inertia


def derivatives(system: MotorTrack, t, x: LateralState, u) -> LateralState:
    """The state's time derivative."""
    del t
    a_y, yaw_acceleration = system.accelerations(x, u)
    return LateralState(a_y - u.v_x * x.yaw_rate, yaw_acceleration)


STEP = StiffStep(derivatives)


def transition(system: MotorTrack, t0, t1, x, u):
    """The state after a step, as in `single_track.transition`."""
    return rolling_below(system, STEP(system, t0, t1, x, u), u)


def observation(system: MotorTrack, t, x, u):
    """Yaw rate and lateral acceleration."""
    del t
    return record_type("Measurements", ("yaw_rate", "a_y"))(x.yaw_rate, system.accelerations(x, u)[0])


def motor_model(car: CarSpecification) -> StateSpace:
    """The state space of eq 10. **Raises** `InputError` for a file without tracks or wheel radius."""
    keys = keys_of(
        car, "sideslip: the moment of motors", dict.fromkeys(("track_front", "track_rear", "wheel_radius"), "m")
    )
    plain = lateral_model(single_track(car), slowest_of(car))
    return StateSpace(
        system=MotorTrack(single_track(car), slowest_of(car), **keys),
        transition=transition,
        observation=observation,
        report=report,
        process_noise=plain.process_noise,
        measurement_noise=plain.measurement_noise,
        prior=plain.prior,
        inputs=(*plain.inputs, *[need.channel for need in TORQUES]),
    )


def motor_moment(car: CarSpecification) -> Guarded:
    """Makes the unscented filter of eq 10 from a car's file."""
    return in_filter(car, motor_model(car), filters.Unscented(), more=TORQUES)
