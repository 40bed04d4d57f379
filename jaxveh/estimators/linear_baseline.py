"""The do-nothing baseline: a linear single track that reads steer and speed only, and no other sensor."""

from __future__ import annotations

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_kind, word_for
from jaxveh._core.lengths import common_length, lengthen, lengthen_time
from jaxveh._core.names import record
from jaxveh._core.recording import Recording, check_recording
from jaxveh.estimators.contract import Need, check_needs
from jaxveh.io import CarSpecification, with_road_steer
from jaxveh.io import kit as io
from jaxveh.statespace import Propagate, Row
from jaxveh.tyres import AbstractDynamicTyre, Linear
from jaxveh.vehicles import (
    AbstractSteering,
    AbstractVehicle,
    FrontSteering,
    IndependentSteering,
    RearSteering,
    SingleTrack,
    from_specification,
    linear,
    linear_single_track,
)
from jaxveh.vehicles import kit as vehicles


def _derivatives(car: SingleTrack, t, x, u):
    return car.derivatives(t, x, u)


PROPAGATE = Propagate(_derivatives)
SPEED = Need("v_x", "m/s", throughout=True)


def open_loop(car: Any, recording: Recording) -> dict[str, np.ndarray]:
    """Simulate a linear single track from the angles of the road wheels (rad) and `v_x` (m/s) alone, from straight running at the
    first row.

    The angles are the inputs of the car's steering: `steer`, and `steer_rear` of a rear axle with an angle of its own, or those
    of each wheel. The tyres have the axles' own cornering stiffnesses at their static loads, without load transfer: `car` is a
    single track, or any car of which `vehicles.linear_single_track` makes one. **Returns** by name, (T,) each: `v_y` (m/s),
    `yaw_rate` (rad/s), `sideslip` (rad). **Raises** `InputError` for channels that are missing or have gaps, or for a car without
    axles or one that is steered by something else.
    """
    check_kind("open_loop: car", car, AbstractVehicle, "A car's file is for estimators.open_loop_of_file.")
    asked = tuple(Need(name, "rad", throughout=True) for name in _steering_of(car).inputs)
    check_needs("open_loop", (*asked, SPEED), recording)
    angles = [recording[need.channel] for need in asked]
    if isinstance(_steering_of(car), IndependentSteering):
        fl, fr, rl, rr = angles
        angles = [0.5 * (fl + fr), 0.5 * (rl + rr)]
    steer, *rear = angles
    time, inputs = recording.time, (steer, recording["v_x"], *rear)
    length = common_length(len(recording))
    # So that float32 resolves the steps of a log whose stamps count from 1970.
    time = lengthen_time(np.asarray(time) - np.asarray(time)[0], length)
    found = open_loop_of(car, time, *lengthen(inputs, length))
    return {name: np.asarray(values)[: len(recording)] for name, values in found.items()}


def _linear_car(car: Any) -> SingleTrack:
    """The single track on linear tyres of a car, whose stiffness does not depend on the load. An axle whose wheels have an angle
    each has their mean."""
    plain = _on_linear_tyres(car)
    each = isinstance(_steering_of(car), IndependentSteering)
    return dataclasses.replace(plain, steering=RearSteering()) if each else plain


def _steering_of(car: Any) -> AbstractSteering:
    """The steering of a car, which may be inside another (as `vehicles.linear_single_track` looks for it)."""
    steering = getattr(vehicles.innermost_car(car), "steering", FrontSteering())
    if steering.inputs not in (("steer",), RearSteering.inputs, IndependentSteering.inputs):
        raise InputError(
            f"open_loop: car.steering = {word_for(steering)}: needs {', '.join(steering.inputs)}; must be a steering whose "
            f"inputs are steer, {' and '.join(RearSteering.inputs)}, or {', '.join(IndependentSteering.inputs)}."
        )
    return steering


def _on_linear_tyres(car: Any) -> SingleTrack:
    if isinstance(car, SingleTrack) and not any(isinstance(t, AbstractDynamicTyre) for t in (car.front, car.rear)):
        return linear(eqx.tree_at(lambda c: c.cg_height, car, None, is_leaf=lambda leaf: leaf is None))
    plain = linear_single_track(car)
    return SingleTrack(
        mass=plain.mass, yaw_inertia=plain.yaw_inertia, front_axle_to_cg=plain.front_axle_to_cg,
        rear_axle_to_cg=plain.rear_axle_to_cg, front=Linear(plain.front_stiffness), rear=Linear(plain.rear_stiffness),
        steering=plain.steering,
    )  # fmt: skip


def open_loop_of_file(car: CarSpecification, recording: Recording) -> dict[str, np.ndarray] | None:
    """`open_loop` of a car's file, along a log that has the angles of its wheels or those from which they follow
    (`io.with_road_steer`); None if one of them, or `v_x`, has no value."""
    io.check_car_file("open_loop_of_file", car)
    check_recording("open_loop_of_file", recording)
    recording, vehicle = with_road_steer(car, recording), from_specification(car)
    if not car.steers_front_alone:
        vehicle = dataclasses.replace(vehicle, steering=RearSteering())
    told = lambda name: name in recording and np.isfinite(np.asarray(recording[name])).any()
    if not all(told(name) for name in (*vehicle.steering.inputs, "v_x")):
        return None
    if not car.steers_front_alone:
        # Their sensor may be slower than the log.
        time, angle = np.asarray(recording.time, float), np.asarray(recording["steer_rear"])
        known = np.isfinite(angle)
        recording = recording.replace(steer_rear=np.interp(time, time[known], angle[known]))
    return open_loop(vehicle, recording)


def do_nothing(car: CarSpecification, recording: Recording) -> dict[str, np.ndarray]:
    """`v_y` and `sideslip` of the car's file by `open_loop`; zeros where an angle of its wheels or `v_x` is missing."""
    found = open_loop_of_file(car, recording) or {}
    return {name: found.get(name, np.zeros(len(recording))) for name in ("v_y", "sideslip")}


@eqx.filter_jit
def open_loop_of(car: Any, time, steer, v_x, steer_rear=None) -> dict[str, jax.Array]:
    """The same as `open_loop` for (T,) arrays, which may be traced. `steer_rear` (rad): of a car whose rear axle has an angle of
    its own. **Raises** `InputError` if such a car is not given one."""
    check_kind("open_loop_of: car", car, AbstractVehicle, "A car's file is for estimators.open_loop_of_file.")
    linear_car = _linear_car(car)
    inputs = {"steer": jnp.asarray(steer), "v_x": jnp.asarray(v_x)}
    if "steer_rear" in linear_car.steering.inputs:
        if steer_rear is None:
            raise InputError(
                f"open_loop_of: car.steering = {word_for(_steering_of(car))}: needs steer_rear (rad) as well."
            )
        inputs["steer_rear"] = jnp.asarray(steer_rear)
    states = _drive(linear_car, Row(jnp.asarray(time), record("Inputs", inputs), ()))
    return {
        "v_y": states.v_y, "yaw_rate": states.yaw_rate, "sideslip": numerics.arctan2(states.v_y, inputs["v_x"])
    }  # fmt: skip


def _drive(car: SingleTrack, rows: Row):
    start = jax.tree.map(lambda _: jnp.zeros((), rows.t.dtype), car.state_type(0, 0, 0))

    def body(state, pair):
        now, then = pair
        moved = PROPAGATE(car, now.t, then.t, state, now.u)
        return moved, moved

    pairs = jax.tree.map(lambda leaf: leaf[:-1], rows), jax.tree.map(lambda leaf: leaf[1:], rows)
    _, states = jax.lax.scan(body, start, pairs)
    return jax.tree.map(lambda first, rest: jnp.append(first, rest), start, states)
