"""The drives: a truck or a car of seven degrees of freedom over a road of random grade."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import manoeuvres, numerics, roads, vehicles
from jaxveh._core.recording import Recording
from jaxveh.experiments.mass_grade_aukf.settings import Study
from jaxveh.manoeuvres import AbstractManoeuvre, ChangingSpeed
from jaxveh.simulation import simulate
from jaxveh.statespace import Gaussian
from jaxveh.vehicles import Longitudinal, SevenDOF, sets

AIR = 0.5 * 1.22 * 0.32 * 2.25
"""N s^2/m^2: half of density, drag coefficient and area of the paper's car."""

HARMONICS = 20
"""Number of harmonics in speeds, pedals and grades."""

LENGTH_OF_A_TOUCH = 2.0
"""s."""


class Drive(NamedTuple):
    """The channels that filters may use, (T,) each, and the truth.

    `v_x` (m/s) and `a_x` (m/s^2) are measured; `torque` (N m) is that of the drive and, where it is known, of the brakes, at
    the wheels; `braking` (0 or 1): whether the brake pedal is touched. `true_v_x` (m/s), `true_grade` (rad), `true_a_x`
    (m/s^2).
    """

    v_x: Any
    a_x: Any
    torque: Any
    braking: Any
    true_v_x: Any
    true_grade: Any
    true_a_x: Any


def times(study: Study, rows: int) -> jax.Array:
    """The times of the first rows, s."""
    return jnp.asarray(np.arange(rows) * study.dt)


def numbers_of(study: Study) -> vehicles.CarNumbers:
    """The numbers of the study's vehicle."""
    if study.name == "truck":
        return dataclasses.replace(sets.truck(), mass=study.mass)
    return dataclasses.replace(
        sets.ev(), mass=study.mass, wheel_radius=0.33, drag=AIR, rolling_resistance=0.015, four_motors=False
    )


def model_car(study: Study) -> Longitudinal:
    """The filters' vehicle; its mass is the truth's, to be replaced by a guess."""
    return vehicles.build(numbers_of(study), Longitudinal)


class Touching(AbstractManoeuvre):
    """A manoeuvre that adds to the pedals, with touches of the brake: pulses of `torque` (N m) that begin at each of
    `starts` (s)."""

    manoeuvre: AbstractManoeuvre
    starts: jax.Array
    torque: jax.Array
    duration: float = eqx.field(static=True)
    adds_to_pedals = True

    def inputs(self, t):
        own = self.manoeuvre.inputs(t)
        return own._replace(brake_torque=own.brake_torque + self.pulses(t))

    def pulses(self, t):
        """The touches' torque at the times t, N m."""
        since = jnp.asarray(t)[..., None] - self.starts
        up, down = numerics.smooth_step(since / 0.2), numerics.smooth_step((since - LENGTH_OF_A_TOUCH) / 0.2)
        return self.torque * jnp.sum(up - down, axis=-1)


def manoeuvre_of(study: Study, pedals, key) -> Touching:
    """How the vehicle of the study is driven, with pedal noise of `pedals` m/s^2."""
    car, (speed_key, drive_key, touch_key) = model_car(study), jax.random.split(key, 3)
    per_acceleration = study.mass * car.wheel_radius
    if study.start_speed is None:
        speed = manoeuvres.wavering_speed(
            study.speed, study.speed_std, speed_key, time=study.speed_time, fastest=study.speed_time, count=HARMONICS
        )
    else:
        speed = ChangingSpeed(study.start_speed, study.speed, start=0.5, time=study.start_time)
    cruise = manoeuvres.cruise(
        study.speed, drive_key, speed_std=0.0, pedal_noise=pedals * per_acceleration, pedal_time=study.pedal_time,
        duration=study.duration, count=HARMONICS,
    )  # fmt: skip
    cruise = eqx.tree_at(lambda m: m.speed, cruise, speed)
    # One touch in each equal part of the seconds from 12 to 30.
    part = 18.0 / max(study.touches, 1)
    free = jax.random.uniform(touch_key, (study.touches,)) * (part - LENGTH_OF_A_TOUCH - 0.5)
    starts = 12.0 + part * jnp.arange(float(study.touches)) + free
    return Touching(manoeuvre=cruise, starts=starts, torque=study.touch * per_acceleration, duration=study.duration)


def drive_once(study: Study, pedals, key) -> Drive:
    """One drive with pedal noise of `pedals` m/s^2; a pure function, for `vmap`."""
    road_key, drive_key, sensor_key, _bias_key = jax.random.split(key, 4)
    numbers = numbers_of(study)
    truth = vehicles.build(numbers, SevenDOF)
    grade = roads.gauss_markov(
        study.grade_std, study.grade_length, road_key, shortest=study.grade_shortest, count=HARMONICS
    )
    manoeuvre = manoeuvre_of(study, pedals, drive_key)
    speed = study.speed if study.start_speed is None else study.start_speed
    # The studies choose `max_step` so that RK4 holds the wheels' spins at their own lowest speed.
    found = simulate(
        truth, manoeuvre, None, road=roads.RandomRoad(grade=grade), dt=study.dt, max_step=study.max_step, solver="explicit",
        start={"v_x": manoeuvre.manoeuvre.speed.at(0.0)[0] if study.start_speed is None else speed}, throw=False,
    )  # fmt: skip
    return _measure(study, found, manoeuvre, sensor_key)


def _measure(study: Study, found: Recording, manoeuvre: Touching, key) -> Drive:
    t = times(study, round(study.duration / study.dt) + 1)
    pulses = manoeuvre.pulses(t)
    # The torque of the motor (or the retarder) acts in both directions and is known; that of the friction brake in a touch
    # is not.
    torque = found["drive_torque"] - found["brake_torque"] + pulses
    noise = Gaussian({"v_x": study.v_x, "a_x": study.a_x}).sample(key, t.shape)
    a_x = found["true.a_x"]
    return Drive(
        v_x=found["true.v_x"] + noise["v_x"],
        a_x=a_x + noise["a_x"],
        torque=torque,
        braking=(pulses > 0).astype(a_x.dtype),
        true_v_x=found["true.v_x"],
        true_grade=found["true.grade"],
        true_a_x=a_x,
    )


def disturb(drive: Drive, *, late: int = 0, offset: float = 0.0, scale: float = 1.0) -> Drive:
    """Drives, (..., T), with a torque signal that is `late` rows late and `scale` times too large, and an accelerometer with
    an `offset` (m/s^2)."""
    rows = np.maximum(np.arange(np.shape(drive.torque)[-1]) - late, 0)
    return drive._replace(torque=scale * np.asarray(drive.torque)[..., rows], a_x=np.asarray(drive.a_x) + offset)
