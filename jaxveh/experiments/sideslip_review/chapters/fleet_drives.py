"""The drives of the chapters: cars of fourteen degrees of freedom, and the measurements of all their devices."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics, roads, sensors
from jaxveh._core.parameter import parameter, positive
from jaxveh.experiments.sideslip_review.chapters.fleet import KNOWN, STEERING_RATIO, true_car
from jaxveh.experiments.sideslip_review.chapters.scenarios import Scenario
from jaxveh.manoeuvres import AbstractManoeuvre, DriverInputs, SpeedControl
from jaxveh.roads import AbstractRoad
from jaxveh.simulation import simulate
from jaxveh.vehicles import FourteenDOF, linear_single_track

DEGREE = math.pi / 180

CORNERS = ("fl", "fr", "rl", "rr")

AXES = ("a_x", "a_y", "a_z", "roll_rate", "pitch_rate", "yaw_rate")

SPEED = 25.0
"""m/s."""

SATELLITES_LATE, TRAIL = KNOWN["satellite_delay"], 0.03
"""s, and m: distance of the front wheels' contact behind the steering axis."""

STEER_OFFSET = 0.5 * DEGREE / STEERING_RATIO
"""rad at the road wheels: the steering angle that `sensors.production_car` measures in straight running."""

SMALL = 0.5 * DEGREE
"""rad: up to this slip angle a tyre is linear."""

EVENT = 0.5
"""Share of the drive after which the driver brakes or accelerates, and the friction changes."""


class Wander(AbstractManoeuvre):
    """Random steering, at a speed that varies at random and changes by `change` (m/s) within 2 s half way."""

    steer: jax.Array = parameter("rad", scale=0.01)
    frequencies: jax.Array = parameter("Hz", scale=1.0)
    phases: jax.Array = parameter("rad", scale=1.0)
    wander: jax.Array = parameter("m/s", scale=1.0)
    slow_frequencies: jax.Array = parameter("Hz", scale=0.1)
    slow_phases: jax.Array = parameter("rad", scale=1.0)
    change: jax.Array = parameter("m/s", scale=10.0)
    duration: float = eqx.field(static=True)

    def inputs(self, t: Any) -> DriverInputs:
        t = jnp.asarray(t, jnp.result_type(self.steer))
        v_x, v_x_rate = jax.jvp(self._v_x, (t,), (jnp.ones_like(t),))
        inside = numerics.smooth_step(t) * numerics.smooth_step(self.duration - t)
        steer = self.steer * numerics.sum_of_harmonics(t, self.frequencies, self.phases) * inside
        return DriverInputs(steer=steer, v_x=v_x, v_x_rate=v_x_rate)

    def _v_x(self, t):
        waver = self.wander * numerics.sum_of_harmonics(t, self.slow_frequencies, self.slow_phases)
        return SPEED + waver + self.change * numerics.smooth_step((t - EVENT * self.duration) / 2.0)


class Frictions(AbstractRoad):
    """Friction that changes at `at_distance` (m), and is less by the share `split` to the right of the middle."""

    before: jax.Array = positive("-")
    after: jax.Array = positive("-")
    split: jax.Array = parameter("-", scale=0.1)
    at_distance: jax.Array = parameter("m", scale=100.0)

    def at(self, s: Any, y: Any = 0.0) -> roads.Surface:
        s = jnp.asarray(s, jnp.result_type(self.before))
        right = 1.0 - numerics.smooth_step(jnp.asarray(y, s.dtype) / 0.2 + 0.5)
        level = self.before + (self.after - self.before) * numerics.smooth_step((s - self.at_distance) / 0.5)
        friction = level * (1.0 - self.split * right)
        return roads.Surface(friction, jnp.zeros_like(friction), jnp.zeros_like(friction), jnp.zeros_like(friction))


def drive_once(built: FourteenDOF, scenario: Scenario, key, *, duration: float) -> dict[str, Any]:
    """One drive: the devices' measurements by channel, the truth as `true.` channels, (T,) each, and the car's own numbers.

    A pure function of arrays, for `vmap` over cars, scenarios and keys.
    """
    car_key, steer_key, speed_key, road_key, offset_key, sensor_key, more_key = jax.random.split(key, 7)
    car = true_car(built, scenario, car_key)
    driver = SpeedControl(
        _wander(scenario, steer_key, speed_key, duration),
        car.vehicle.mass,
        wheel_radius=car.vehicle.wheel_radius,
    )
    found = simulate(
        car, driver, _devices(built, scenario, offset_key), sensor_key, road=_road(scenario, road_key, duration),
        max_step=0.0025, solver="explicit", start={"v_x": SPEED}, throw=False,
    )  # fmt: skip
    channels = _on_a_road_that_turns({name: found[name] for name in found.names}, jnp.asarray(found.time))
    channels |= _made_of(built, scenario, channels, jnp.asarray(found.time), more_key, duration)
    # Relative to the file's tyres: the road's friction times the car's own draw.
    grip = car.vehicle.front.scaling.LMUY / built.front.scaling.LMUY
    friction = grip * sum(channels[f"true.friction_{at}"] for at in CORNERS) / 4.0
    return channels | {"true.friction": friction} | _own_numbers(car.vehicle, channels)


def _on_a_road_that_turns(said: dict[str, Any], time) -> dict[str, Any]:
    """Adds what the quasi-static roads of the simulation leave out: the road's own rates of roll and pitch in the
    gyroscopes; and makes the true roll that against the horizon."""
    roll_rate, pitch_rate = road_rates(said["true.grade"], said["true.bank"], said["true.yaw"], time)
    return said | {
        "roll_rate": said["roll_rate"] + roll_rate,
        "pitch_rate": said["pitch_rate"] + pitch_rate,
        "true.roll_rate": said["true.roll_rate"] + roll_rate,
        "true.roll": roll_of_horizon(said["true.grade"], said["true.bank"], said["true.roll"], said["true.pitch"]),
    }


def road_rates(grade, bank, yaw, time):
    """Rates (rad/s) of roll and pitch of the plane of a road with these slopes (rad, (T,)), under a car of this heading: the
    angular velocity of the axes of the road's plane, in these axes, which are those of `vehicles.kit.gravity`."""
    along, across = numerics.tan(grade), numerics.tan(bank)
    one, none = jnp.ones_like(along), jnp.zeros_like(along)
    unit = lambda *v: jnp.stack(v, -1) / jnp.linalg.norm(jnp.stack(v, -1), axis=-1, keepdims=True)
    x, z = unit(one, none, along), unit(-along, -across, one)
    axes = jnp.stack([x, jnp.cross(z, x), z], -1)
    c, s = numerics.cos(yaw), numerics.sin(yaw)
    heading = jnp.stack(
        [jnp.stack([c, -s, none], -1), jnp.stack([s, c, none], -1), jnp.stack([none, none, one], -1)], -2
    )
    turned = heading @ axes
    step = time[1] - time[0]
    spin = jnp.swapaxes(turned, 1, 2) @ (jnp.gradient(turned, axis=0) / step)
    return spin[:, 2, 1], spin[:, 0, 2]


def roll_of_horizon(grade, bank, roll, pitch):
    """The roll (rad) against the horizon of a body with this roll and pitch on a road of these slopes."""
    along, across = numerics.tan(grade), numerics.tan(bank)
    run = numerics.sqrt(1.0 + along * along)
    rise = numerics.sqrt(run * run + across * across)
    # The vertical in the road's plane, then rotated by the body's pitch and roll.
    x, y, z = along / run, across / (run * rise), 1.0 / rise
    z = numerics.cos(pitch) * z + numerics.sin(pitch) * x
    c, s = numerics.cos(roll), numerics.sin(roll)
    return numerics.arctan2(c * y + s * z, c * z - s * y)


def _own_numbers(car: FourteenDOF, channels: dict[str, Any]) -> dict[str, Any]:
    """The truth of mass, stiffness and geometry, in every row.

    The stiffness of an axle is the slope of its force over its wheels' slip angle in this drive: with the camber and steer
    of the leaning body it is some 15 % less than that of its tyres on a rig.
    """
    plain, like = linear_single_track(car), channels["true.v_x"]
    summed = lambda name, axle: channels[f"true.{name}_{axle}l"] + channels[f"true.{name}_{axle}r"]
    slope = lambda axle: slope_at_zero(summed("F_y", axle), 0.5 * summed("slip_angle", axle))
    own = {
        "mass": plain.mass, "yaw_inertia": plain.yaw_inertia, "front_axle_to_cg": plain.front_axle_to_cg,
        "front_cornering_stiffness": slope("f"), "rear_cornering_stiffness": slope("r"),
        "steering_ratio": jnp.asarray(STEERING_RATIO), "steer_offset": jnp.asarray(STEER_OFFSET),
    }  # fmt: skip
    return {f"true.{name}": jnp.broadcast_to(value, like.shape) for name, value in own.items()}


def slope_at_zero(force, slip):
    """The slope (N/rad) of a force (T,) over a slip angle (T,) through zero, from the rows with little slip (`SMALL`)."""
    small = jnp.abs(slip) < SMALL
    return jnp.sum(jnp.where(small, force * slip, 0.0)) / jnp.sum(jnp.where(small, slip**2, 0.0))


def _made_of(
    built: FourteenDOF, scenario: Scenario, said: dict[str, Any], time, key, duration: float
) -> dict[str, Any]:
    """Channels computed from the measurements: the road wheels' steer, each wheel's torque, the brakes' pressure, a second
    antenna's heading (as late as the course), the torque at the steering wheel without assistance, and satellite channels
    without values in the outage."""
    heading_key, torque_key = jax.random.split(key)
    share = built.drive.front_drive
    drive = dict(zip(CORNERS, (share, share, 1.0 - share, 1.0 - share), strict=True))
    wheels = {
        f"torque_{at}": 0.5 * part * said["drive_torque"] - said[f"brake_torque_{at}"] for at, part in drive.items()
    }
    late = round(SATELLITES_LATE / 0.01)
    heading = jnp.concatenate([jnp.full(late, said["true.yaw"][0]), said["true.yaw"][:-late]])
    heading = heading + 0.2 * DEGREE * jax.random.normal(heading_key, heading.shape)
    silent = (time > duration / 3.0) & (time <= duration / 3.0 + scenario.outage)
    heard = {"speed": said["speed"], "course": said["course"]}
    heard |= {"heading": jnp.where(jnp.isnan(said["speed"]), jnp.nan, heading)}
    pressure = {"brake_pressure": said["brake_torque"] / KNOWN["brake_torque_per_pressure"]}
    moment = sum(said[f"true.M_z_{at}"] - TRAIL * said[f"true.F_y_{at}"] for at in ("fl", "fr"))
    felt = -moment / STEERING_RATIO + 0.05 * jax.random.normal(torque_key, time.shape)
    steer = {"steer": said["steering_wheel"] / STEERING_RATIO}
    return (
        steer
        | wheels
        | pressure
        | {name: jnp.where(silent, jnp.nan, one) for name, one in heard.items()}
        | {"steering_torque": felt}
    )


def _wander(scenario: Scenario, steer_key, speed_key, duration: float) -> Wander:
    frequencies, phases = numerics.band_harmonics(steer_key, 0.1, 0.6, 20)
    slow_frequencies, slow_phases = numerics.gauss_markov_harmonics(speed_key, 8.0, 0.2, 20)
    return Wander(
        steer=scenario.steer, frequencies=frequencies, phases=phases, wander=scenario.wander, slow_frequencies=slow_frequencies,
        slow_phases=slow_phases, change=scenario.wheelspin - scenario.drop, duration=duration,
    )  # fmt: skip


def _road(scenario: Scenario, key, duration: float) -> roads.Combined:
    grade_key, bank_key = jax.random.split(key)
    slope = lambda std, key: eqx.tree_at(
        lambda v: v.std, roads.gauss_markov(1.0, 150.0, key, shortest=50.0, count=20), jnp.asarray(std)
    )
    shape = roads.RandomRoad(grade=slope(scenario.grade, grade_key), bank=slope(scenario.bank, bank_key))
    friction = Frictions(scenario.friction, scenario.friction_later, scenario.split, EVENT * SPEED * duration)
    return roads.Combined(friction=friction, grade=shape)


def _devices(built: FourteenDOF, scenario: Scenario, key) -> sensors.Suite:
    """The devices of `sensors.production_car`, with the inertial unit's other axes and random offsets, and the torques of
    the control units."""
    made = sensors.production_car(built.wheel_radius, steering_ratio=STEERING_RATIO)
    inertial, *others = made.devices
    acceleration, rate = (inertial.signals[name] for name in ("a_x", "yaw_rate"))
    draws = scenario.offsets * jax.random.normal(key, (len(AXES),))
    offset = lambda signal, draw: eqx.tree_at(lambda one: one.bias, signal, draw * signal.bias)
    signals = {
        name: offset(acceleration if name.startswith("a_") else rate, draw)
        for name, draw in zip(AXES, draws, strict=True)
    }
    unit = dataclasses.replace(inertial, signals=signals)
    torque = sensors.Signal(noise=10.0, scale=0.03)
    brakes = sensors.BrakeTorque(
        {f"brake_torque_{at}": torque for at in CORNERS} | {"brake_torque": torque}, rate=100.0, lag=0.02
    )
    motor = sensors.MotorTorque({"drive_torque": torque}, rate=100.0, lag=0.05)
    return sensors.Suite((unit, *others, brakes, motor))
