"""Cars of the tests' own: a linear single track at the wanted speed, and a mass on a slope that torques drive."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import manoeuvres
from jaxveh.manoeuvres import Motion


class Linear(NamedTuple):
    """A car on linear tyres: kg, kg m^2, m, N/rad an axle."""

    mass: float = 1500.0
    yaw_inertia: float = 2500.0
    front: float = 1.2
    rear: float = 1.5
    front_stiffness: float = 90e3
    rear_stiffness: float = 110e3

    @property
    def understeer_gradient(self):
        share = self.rear / self.front_stiffness - self.front / self.rear_stiffness
        return self.mass / (self.front + self.rear) * share

    def rates(self, motion, steer):
        across_front = (motion.v_y + self.front * motion.yaw_rate) / motion.v_x
        front = self.front_stiffness * (steer - across_front)
        rear = -self.rear_stiffness * (motion.v_y - self.rear * motion.yaw_rate) / motion.v_x
        cosine, sine = jnp.cos(motion.yaw), jnp.sin(motion.yaw)
        return (
            motion.v_x * cosine - motion.v_y * sine,
            motion.v_x * sine + motion.v_y * cosine,
            motion.yaw_rate,
            (front + rear) / self.mass - motion.v_x * motion.yaw_rate,
            (self.front * front - self.rear * rear) / self.yaw_inertia,
        )


def runge_kutta(rates, x0, times):
    """The states (a pytree) at the times."""
    dt = times[1] - times[0]
    # The stages are a loop, so that the rates are compiled once.
    shares, weights = jnp.asarray([0.0, 0.5, 0.5, 1.0]), jnp.asarray([1.0, 2.0, 2.0, 1.0]) / 6

    def step(x, t):
        def stage(carried, now):
            slope, end = carried
            share, weight = now
            slope = rates(t + share * dt, jax.tree.map(lambda a, k: a + share * dt * k, x, slope))
            return (slope, jax.tree.map(lambda a, k: a + weight * dt * k, end, slope)), None

        still = jax.tree.map(jnp.zeros_like, x)
        return jax.lax.scan(stage, (still, x), (shares, weights))[0][1], x

    return jax.lax.scan(step, x0, times)[1]


def drive(car, driver, times, start=(0.0, 0.0, 0.0)):
    """`driven` as NumPy arrays. How long the driver would drive is no matter, so that drivers of a kind share a program."""
    return jax.tree.map(np.asarray, driven(car, dataclasses.replace(driver, duration=1.0), times, start))


@jax.jit
def driven(car, driver, times, start):
    """A linear car at the wanted speed under a driver, from (x, y, yaw): its motion and his state, (T,) each."""

    def motion_of(t, body):
        x, y, yaw, v_y, yaw_rate = body
        return Motion(x, y, yaw, driver.speed.at(t)[0], v_y, yaw_rate)

    def rates(t, state):
        body, own = state
        motion = motion_of(t, body)
        steer = driver.inputs(t, motion, own).steer
        return car.rates(motion, steer), driver.derivatives(t, motion, own)

    zero = jnp.zeros_like(times[0])
    body = (*[zero + value for value in start], zero, zero)
    bodies, own = runge_kutta(rates, (body, driver.start(times[0], motion_of(times[0], body))), times)
    return jax.vmap(motion_of)(times, bodies), own


def clearance(x, y, yaw, width, length, course, centre=0.0):
    """The clearance of a body that is driven through a course, and whether it passes."""
    return [np.asarray(found) for found in _clearance(x, y, yaw, width, length, course.lanes, centre)]


@jax.jit
def _clearance(x, y, yaw, width, length, lanes, centre):
    # The lanes are operands: one program for all courses of as many.
    at = (x, y, yaw, width, length, manoeuvres.Course("of these lanes", lanes), centre)
    return manoeuvres.clearance(*at), manoeuvres.passes(*at)


def push(driver, times, mass, radius, grade, v_0):
    """`pushed` as NumPy arrays."""
    return jax.tree.map(np.asarray, pushed(driver, times, mass, radius, grade, v_0))


@jax.jit
def pushed(driver, times, mass, radius, grade, v_0):
    """A mass that torques push along a slope, without drag of its own: speeds, inputs and states, (T,) each."""
    motion_of = lambda v: Motion(0.0 * v, 0.0 * v, 0.0 * v, v, 0.0 * v, 0.0 * v)

    def rates(t, state):
        v, own = state
        u = driver.inputs(t, motion_of(v), own)
        force = (u.drive_torque - u.brake_torque) / radius
        return force / mass - 9.80665 * jnp.sin(grade), driver.derivatives(t, motion_of(v), own)

    v_0 = v_0 + jnp.zeros_like(times[0])
    v, own = runge_kutta(rates, (v_0, driver.start(times[0], motion_of(v_0))), times)
    return v, jax.vmap(lambda t, v, own: driver.inputs(t, motion_of(v), own))(times, v, own), own
