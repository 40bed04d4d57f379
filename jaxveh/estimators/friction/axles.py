"""Friction from the axles' lateral forces, which follow from inertial sensors: by the tyre curve, by the steering torque, over a
window."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.friction import brush_curve
from jaxveh.estimators.friction.curve_follower import CurveBelief, CurveFollower
from jaxveh.estimators.friction.laws import PlanarCar
from jaxveh.estimators.friction.motion import Told, next_told, start_told
from jaxveh.estimators.friction.scalar import Follower
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.two_axles import LATERAL

LEAST_FORCE = 0.15
"""Share of the axle's limit on dry road: a linear force below this does not show whether the curve bends."""


class AxlesTold(NamedTuple):
    """The motion; steer (rad), yaw rate (rad/s) and a_y (m/s^2) with the same low-pass filter; and the last measurements of yaw
    rate and a_y."""

    told: Told
    steer: Any
    yaw_rate: Any
    a_y: Any
    last_yaw_rate: Any
    last_a_y: Any


class Axles(eqx.Module):
    """Lateral forces of both axles by equation 15, and the difference of their slip angles, which needs no lateral velocity:
    `alpha_f - alpha_r = delta - l r / v`. All signals have a low-pass filter of `lag` (s); its derivative of the yaw rate is the
    yaw acceleration.
    """

    car: PlanarCar
    lag: jax.Array = positive("s", default=0.06)

    def start(self, t, values) -> AxlesTold:
        """The memory after the first row."""
        told, zero = start_told(t, values, self.car.late), jnp.zeros_like(t)
        known = lambda name: jnp.where(jnp.isnan(values[name]), zero, values[name])
        return AxlesTold(told, told.steer, known("yaw_rate"), known("a_y"), known("yaw_rate"), known("a_y"))

    def next(self, last: AxlesTold, t, values) -> AxlesTold:
        """The memory after the next row."""
        dt = jnp.clip(t - last.told.t, 0.0, 1.0)
        told = next_told(last.told, t, values, self.car.late)
        # The bilinear low-pass filter, whose exact derivative is `(x - slow) / lag`.
        share = dt / (2.0 * self.lag + dt)
        held = lambda name, old: jnp.where(jnp.isnan(values[name]), old, values[name])
        yaw_rate, a_y = held("yaw_rate", last.last_yaw_rate), held("a_y", last.last_a_y)
        follow = lambda slow, old, new: slow + share * (new + old - 2.0 * slow)
        return AxlesTold(
            told, follow(last.steer, last.told.steer, told.steer), follow(last.yaw_rate, last.last_yaw_rate, yaw_rate),
            follow(last.a_y, last.last_a_y, a_y), yaw_rate, a_y,
        )  # fmt: skip

    def forces(self, now: AxlesTold):
        """The lateral forces of front and rear axle, N."""
        turn = (now.last_yaw_rate - now.yaw_rate) / self.lag
        return self.car.axle_forces(now.a_y / (1.0 + self.car.lean), turn)

    def slip_difference(self, now: AxlesTold):
        """The front slip angle less the rear slip angle, rad."""
        return now.steer - self.car.steer_offset - self.car.wheelbase * now.yaw_rate / now.told.v_x

    def residual(self, forces, difference, log_friction, stiffer):
        """The measured front force (N) less that of the brush curve at the front slip angle; the rear slip angle follows from the
        rear force. `stiffer`: logarithms of front and rear stiffness over the file's."""
        mu, car = jnp.exp(log_friction), self.car
        front, rear = (
            axle.stiffness * jnp.exp(more) for axle, more in zip((car.front, car.rear), stiffer, strict=True)
        )
        behind = brush_curve.slip_of(forces[1], rear, mu * car.rear.peak)
        return forces[0] - brush_curve.force(difference + behind, front, mu * car.front.peak)

    def bend(self, forces, difference, log_friction, stiffer):
        """The missing share (-) of the linear front force, in the measured force or in the one predicted with this friction,
        whichever is more; 0 at small slip, where it would be noise."""
        mu, car = jnp.exp(log_friction), self.car
        rear = brush_curve.slip_of(forces[1], car.rear.stiffness * jnp.exp(stiffer[1]), mu * car.rear.peak)
        linear = car.front.stiffness * jnp.exp(stiffer[0]) * jnp.abs(difference + rear)
        foretold = forces[0] - self.residual(forces, difference, log_friction, stiffer)
        least = jnp.minimum(jnp.abs(forces[0]), jnp.abs(foretold))
        enough = linear > LEAST_FORCE * car.front.peak
        return jnp.where(enough, 1.0 - least / numerics.or_one(linear, enough), 0.0)


class LateralCurve(AbstractMethod):
    """Friction from an axle's brush curve: the front force at the front slip angle.

    The rear force gives the rear slip angle (the brush's inverse), which with steer and yaw rate gives the front slip angle; the
    front force at this angle gives the friction. In the linear range friction is not observable, because the force grows with
    ln mu only by `F - alpha dF/dalpha`.

    Both axles' stiffnesses are estimated, too, with the follower's standard deviation as prior.

    `force_noise` (-): error of the front force as a share of itself; `noise` (-): as a share of the static load. Rows update the
    friction if more than `knee` (-) of the linear force is missing.
    """

    axles: Axles
    follower: CurveFollower
    force_noise: jax.Array = positive("-", default=0.04)
    noise: jax.Array = positive("-", default=0.0125)
    knee: jax.Array = positive("-", default=0.2)

    @property
    def needs(self):
        return LATERAL

    def first(self, t, values):
        now, state = self.axles.start(t, values), self.follower.start()
        return (now, state), self.follower.says(state, now.told.moves)

    def next(self, memory, t, values):
        last, state = memory
        now = self.axles.next(last, t, values)
        dt = jnp.clip(t - last.told.t, 0.0, 1.0)
        forces, difference = self.axles.forces(now), self.axles.slip_difference(now)
        noise = self.noise * self.axles.car.static_loads()[0] + self.force_noise * jnp.abs(forces[0])
        residual = lambda x: self.axles.residual(forces, difference, x[0], (x[1], x[2]))
        tells = self.axles.bend(forces, difference, state.log_friction, state.stiffer) > self.knee
        here = now.told.moves & ~jnp.isnan(values["a_y"])
        state = self.follower.next(state, dt, residual, noise, here, tells)
        return (now, state), self.follower.says(state, now.told.moves)


class AligningTorque(AbstractMethod):
    """Friction from the steering torque: the pneumatic trail shrinks from the smallest slip on, so that it shows friction sooner
    than the force (the review names the chain; the trail is the brush's, `t_0 (1 - g)^3 / (1 - g + g^2 / 3)`).

    The torque of the road on both front wheels is that at the steering wheel times `steering_ratio` (-), without friction and
    assistance of the steering: `M = F_yf (caster_trail + t)`. `caster_trail`, `pneumatic_trail` t_0 (m): a car's file has
    neither; the defaults are a guess, and the answer is only as good as they are. `torque_noise` (N m at the steering wheel),
    `trail_noise` (m).
    """

    axles: Axles
    follower: Follower
    steering_ratio: jax.Array = positive("-")
    caster_trail: jax.Array = positive("m", default=0.015)
    pneumatic_trail: jax.Array = positive("m", default=0.02)
    torque_noise: jax.Array = positive("N m", default=0.1)
    trail_noise: jax.Array = positive("m", default=0.001)

    @property
    def needs(self):
        return (*LATERAL, Need("steering_torque", "N m"))

    def first(self, t, values):
        now, state = self.axles.start(t, values), self.follower.start()
        torque = jnp.where(jnp.isnan(values["steering_torque"]), 0.0, values["steering_torque"])
        return (now, torque, state), self.follower.says(state, now.told.moves)

    def next(self, memory, t, values):
        last, torque, state = memory
        now = self.axles.next(last, t, values)
        dt = jnp.clip(t - last.told.t, 0.0, 1.0)
        measured = values["steering_torque"]
        here = now.told.moves & ~jnp.isnan(measured) & ~jnp.isnan(values["a_y"])
        share = 1.0 - jnp.exp(-dt / self.axles.lag)
        torque = torque + jnp.where(jnp.isnan(measured), 0.0, share * (jnp.where(here, measured, torque) - torque))
        force = self.axles.forces(now)[0]
        limit = self.axles.car.front.peak

        def residual(x):
            trail = self.pneumatic_trail * brush_curve.trail_share(force, jnp.exp(x) * limit)
            return self.steering_ratio * torque - force * (self.caster_trail + trail)

        noise = self.steering_ratio * self.torque_noise + self.trail_noise * jnp.abs(force)
        state = self.follower.next(state, dt, residual, noise, here)
        return (now, torque, state), self.follower.says(state, now.told.moves)


class Window(NamedTuple):
    """The last samples, (N,) each: both forces (N), slip differences (rad), their weights; the time of the newest (s)."""

    front: Any
    rear: Any
    difference: Any
    weight: Any
    time: Any


class HybridObserver(AbstractMethod):
    """An observer, and nonlinear least squares over a window where it is better (figure 3 of the review; reference [101]).

    The observer (`lateral`) follows row by row. Its gain fails at large front and small rear slip angles, and without excitation.
    Over a window of samples every `every` (s), a few Gauss-Newton steps on the same residuals find ln mu at once. The window's
    information is `sum (dF / d ln mu)^2 / noise^2`, where samples within `correlation` (s) count as one. Where it is above
    `enough` (-) and its variance of ln mu is below the observer's, the answer is that of least squares, and the observer
    continues from it.
    """

    lateral: LateralCurve
    every: jax.Array = positive("s", default=0.1)
    enough: jax.Array = positive("-", default=30.0)
    correlation: jax.Array = positive("s", default=2.0)
    samples: int = eqx.field(static=True, default=20)

    @property
    def needs(self):
        return LATERAL

    def first(self, t, values):
        memory, said = self.lateral.first(t, values)
        none = jnp.zeros((self.samples,), t.dtype)
        return (memory, Window(none, none, none, none, t)), said

    def next(self, memory, t, values):
        inner, window = memory
        (now, state), _ = self.lateral.next(inner, t, values)
        axles = self.lateral.axles
        front, rear = axles.forces(now)
        difference = axles.slip_difference(now)
        tells = axles.bend((front, rear), difference, state.log_friction, state.stiffer) > self.lateral.knee
        sample = (front, rear, difference, jnp.where(now.told.moves & tells, 1.0, 0.0))
        # Slightly earlier, so that the choice of rows does not depend on rounding.
        due = t - window.time >= 0.95 * self.every
        push = lambda old, new: jnp.where(due, jnp.concatenate([old[1:], new[None]]), old)
        front, rear, difference, weight = map(push, window[:4], sample)
        window = Window(front, rear, difference, weight, jnp.where(due, t, window.time))
        mean, information, pull = self._least_squares(window, state)
        told = _told_by_window(state.covariance, information, pull)
        better = due & now.told.moves & (information > self.enough) & (told[0, 0] < state.covariance[0, 0])
        state = state._replace(
            mean=jnp.where(better, state.mean.at[0].set(mean), state.mean),
            covariance=jnp.where(better, told, state.covariance),
        )
        return ((now, state), window), self.lateral.follower.says(state, now.told.moves)

    def _least_squares(self, window: Window, state: CurveBelief):
        """ln mu, its information, and its derivatives by the logarithms of front and rear stiffness (2,): three damped
        Gauss-Newton steps with the observer's stiffnesses."""
        axles, lateral, x = self.lateral.axles, self.lateral, state.mean
        forces = (window.front, window.rear)
        noise = lateral.noise * axles.car.static_loads()[0] + lateral.force_noise * jnp.abs(window.front)
        weighed = lambda x: window.weight * axles.residual(forces, window.difference, x[0], (x[1], x[2])) / noise
        share = jnp.minimum(self.every / self.correlation, 1.0)
        information, pull = jnp.zeros_like(x[0]), jnp.zeros_like(x[1:])
        for _ in range(3):
            errors, slopes = weighed(x), jax.jacfwd(weighed)(x)
            own = slopes[:, 0]
            total = jnp.sum(own**2) + 1.0
            information, pull = share * jnp.sum(own**2), -(own @ slopes[:, 1:]) / total
            log_friction = x[0] - jnp.clip(jnp.sum(own * errors) / total, -0.3, 0.3)
            x = x.at[0].set(jnp.clip(log_friction, jnp.log(0.05), jnp.log(1.5)))
        return x[0], information, pull


def _told_by_window(P, information, pull):
    """The covariance where ln mu is that of a window only: that of its noise, and that of the stiffnesses' errors."""
    across = P[1:, 1:] @ pull
    own = 1.0 / jnp.maximum(information, 1.0) + pull @ across
    return P.at[0, 0].set(own).at[0, 1:].set(across).at[1:, 0].set(across)
