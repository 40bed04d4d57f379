"""A single track for real logs: the effects that the textbook car leaves out are small states with given size and memory."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import UNNAMED, parameter, positive
from jaxveh.statespace import Continuous, Gaussian, Heun, Prior, Propagate, StateSpace
from jaxveh.vehicles import SingleTrack

BEND = 0.03
"""Slip angle (rad) over which the difference between left and right turns fades in, so that straight running is smooth."""

LEAST_GRIP = 0.05
"""The square of the least share of lateral grip, for any longitudinal force."""


class HandlingState(NamedTuple):
    """Lateral velocity `v_y` (m/s) and `yaw_rate` (rad/s) of the centre of gravity; the errors of the tyre laws,
    `front_error` and `rear_error`, as shares of the axles' loads; `a_y_error` (m/s^2), as from bank and roll."""

    v_y: Any
    yaw_rate: Any
    front_error: Any
    rear_error: Any
    a_y_error: Any


class HandlingReport(NamedTuple):
    """The outputs of an Estimate: speeds (m/s, rad/s), sideslip and slip angles (rad), forces of the axles (N); the errors
    of the state; `reference_sideslip` (rad): the sideslip of a reference that is rotated by `heading_offset`."""

    v_y: Any
    yaw_rate: Any
    sideslip: Any
    slip_angle_front: Any
    slip_angle_rear: Any
    F_yf: Any
    F_yr: Any
    front_error: Any
    rear_error: Any
    a_y_error: Any
    reference_sideslip: Any


class Handling(eqx.Module):
    """A single track with the additions that real logs need.

    - `car`: the single track; its axles' tyres scale with load, and load moves with `a_x` if it has a `cg_height`.
    - `steer_gain` (-), `yaw_rate_offset` (rad/s), `a_y_gain` (-): of the sensors (`car.steer_offset` is that of the steer).
    - `drag` (N/(m/s)^2), `brake_share` (-): longitudinal force `F_x = m a_x + drag v_x^2`, at the rear axle in driving and
      divided in braking; `ellipse` (-): its weight in the friction ellipse, `sqrt(1 - (ellipse F_x / D)^2)`.
    - `force_offset` (m): distance of the line of the longitudinal force to the left of the centre of gravity.
    - `front_asymmetry`, `rear_asymmetry` (-): grip lost in left turns and gained in right ones (slip angle positive).
    - `heading_offset` (rad): rotation of a reference for sideslip (an INS) against the car; moves no state.
    - `force_time`, `bias_time` (s): memory of the first-order Gauss-Markov errors in `HandlingState`.

    Inputs: `steer` (rad), `v_x` (m/s), `a_x` (m/s^2). Axes of ISO 8855.
    """

    car: SingleTrack = eqx.field(metadata=UNNAMED)
    steer_gain: jax.Array = positive("-", default=1.0)
    yaw_rate_offset: jax.Array = parameter("rad/s", scale=0.002, default=0.0)
    a_y_gain: jax.Array = positive("-", default=1.0)
    drag: jax.Array = positive("N s^2/m^2", default=0.45)
    brake_share: jax.Array = parameter("-", scale=0.1, default=0.6)
    ellipse: jax.Array = positive("-", default=0.7)
    force_offset: jax.Array = parameter("m", scale=0.05, default=0.0)
    front_asymmetry: jax.Array = parameter("-", scale=0.05, default=0.0)
    rear_asymmetry: jax.Array = parameter("-", scale=0.05, default=0.0)
    heading_offset: jax.Array = parameter("rad", scale=0.003, default=0.0)
    force_time: jax.Array = positive("s", default=0.5)
    bias_time: jax.Array = positive("s", default=3.0)

    def axle_forces(self, x: HandlingState, u):
        """Lateral forces of the axles in the body's axes and in the wheels' (N), F_x of the front (N), contacts."""
        steered = u._replace(steer=self.steer_gain * u.steer)
        steer = steered.steer + self.car.steer_offset
        contacts = self.car.contacts(_Turning(x.v_y, x.yaw_rate), steered)
        F_x = self.car.mass * u.a_x + self.drag * u.v_x**2
        driving, braking = jnp.maximum(F_x, 0.0), jnp.minimum(F_x, 0.0)
        along = (self.brake_share * braking, driving + (1 - self.brake_share) * braking)
        errors = (x.front_error, x.rear_error)
        asymmetries = (self.front_asymmetry, self.rear_asymmetry)
        tyres = (self.car.front, self.car.rear)
        F_f, F_r = (self._axle(*one) for one in zip(tyres, contacts, along, errors, asymmetries, strict=True))
        return F_f * numerics.cos(steer) + along[0] * numerics.sin(steer), F_f, F_r, F_x, contacts

    @numerics.fence_results
    def _axle(self, tyre, contact, F_x, error, asymmetry):
        # Grip in newtons at this load, of which the longitudinal force takes a share.
        grip = tyre.D * contact.load / tyre.nominal_load if tyre.nominal_load is not None else tyre.D
        left = numerics.sqrt(jnp.maximum(1 - (self.ellipse * F_x / grip) ** 2, LEAST_GRIP))
        bent = 1 - asymmetry * jnp.tanh(contact.slip_angle / BEND)
        return left * bent * tyre.forces(contact).F_y + contact.load * error


class _Turning(NamedTuple):
    """The part of a single track's state that its contacts use."""

    v_y: Any
    yaw_rate: Any


def derivatives(system: Handling, t, x: HandlingState, u) -> HandlingState:
    """The state's time derivative."""
    del t
    car = system.car
    F_yf, _, F_r, F_x, _ = system.axle_forces(x, u)
    moment = car.front_axle_to_cg * F_yf - car.rear_axle_to_cg * F_r - system.force_offset * F_x
    return HandlingState(
        v_y=(F_yf + F_r) / car.mass - u.v_x * x.yaw_rate,
        yaw_rate=moment / car.yaw_inertia,
        front_error=-x.front_error / system.force_time,
        rear_error=-x.rear_error / system.force_time,
        a_y_error=-x.a_y_error / system.bias_time,
    )


def observation(system: Handling, t, x: HandlingState, u):
    """Yaw rate and lateral acceleration as the sensors measure them."""
    del t
    F_yf, _, F_r, _, _ = system.axle_forces(x, u)
    a_y = system.a_y_gain * (F_yf + F_r) / system.car.mass + x.a_y_error
    return record_type("Measurements", ("yaw_rate", "a_y"))(x.yaw_rate + system.yaw_rate_offset, a_y)


def report(system: Handling, t, x: HandlingState, u) -> HandlingReport:
    """The outputs of an Estimate."""
    del t
    _, F_f, F_r, _, contacts = system.axle_forces(x, u)
    sideslip = numerics.arctan2(x.v_y, jnp.broadcast_to(u.v_x, jnp.shape(x.v_y)))
    return HandlingReport(
        v_y=x.v_y,
        yaw_rate=x.yaw_rate,
        sideslip=sideslip,
        slip_angle_front=contacts[0].slip_angle,
        slip_angle_rear=contacts[1].slip_angle,
        F_yf=F_f,
        F_yr=F_r,
        front_error=x.front_error,
        rear_error=x.rear_error,
        a_y_error=x.a_y_error,
        reference_sideslip=sideslip + system.heading_offset,
    )


PROPAGATE = Propagate(derivatives, Heun())
"""Heun's method: at 100 Hz its error is far below the noises, at half the work of a fourth-order method."""


def handling_model(system: Handling) -> StateSpace:
    """The state space for a real log, with noise levels from which a fit starts (given in the code, in the units of their
    channels)."""
    noise = {"v_y": 0.1, "yaw_rate": 0.05, "front_error": 0.08, "rear_error": 0.08, "a_y_error": 0.25}
    spread = {"v_y": 1.0, "yaw_rate": 0.1, "front_error": 0.04, "rear_error": 0.04, "a_y_error": 0.3}
    return StateSpace(
        system=system,
        transition=PROPAGATE,
        observation=observation,
        report=report,
        process_noise=Continuous(Gaussian(noise)),
        measurement_noise=Gaussian({"yaw_rate": 0.005, "a_y": 1.2}),
        prior=Prior(HandlingState(0.0, 0.0, 0.0, 0.0, 0.0), Gaussian(spread)),
        inputs=("steer", "v_x", "a_x"),
    )
