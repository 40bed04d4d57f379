"""The do-nothing baseline: a linear single track that reads steer and speed only, and no other sensor."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, word_for
from jaxveh._core.lengths import common_length, lengthen, lengthen_time
from jaxveh._core.names import record
from jaxveh._core.recording import Recording
from jaxveh.estimators.contract import Need, check_needs
from jaxveh.io import CarSpecification, with_road_steer
from jaxveh.statespace import Propagate, Row
from jaxveh.tyres import AbstractDynamicTyre, Linear
from jaxveh.vehicles import SingleTrack, from_specification, linear, linear_single_track


def _derivatives(car: SingleTrack, t, x, u):
    return car.derivatives(t, x, u)


PROPAGATE = Propagate(_derivatives)
NEEDS = (Need("steer", "rad", throughout=True), Need("v_x", "m/s", throughout=True))


def open_loop(car: Any, recording: Recording) -> dict[str, np.ndarray]:
    """Simulate a linear single track from `steer` (rad) and `v_x` (m/s) alone, from straight running at the first row.

    It has the axles' own cornering stiffnesses at their static loads, without load transfer: `car` is a single track, or any car
    of which `vehicles.linear_single_track` makes one. **Returns** by name, (T,) each: `v_y` (m/s), `yaw_rate` (rad/s),
    `sideslip` (rad). **Raises** `InputError` for channels that are missing or have gaps, for a car without axles, or one that
    needs more inputs than `steer`.
    """
    check_needs("open_loop", NEEDS, recording)
    time, inputs = recording.time, (recording["steer"], recording["v_x"])
    length = common_length(len(recording))
    # So that float32 resolves the steps of a log whose stamps count from 1970.
    time = lengthen_time(np.asarray(time) - np.asarray(time)[0], length)
    found = open_loop_of(car, time, *lengthen(inputs, length))
    return {name: np.asarray(values)[: len(recording)] for name, values in found.items()}


def _linear_car(car: Any) -> SingleTrack:
    """The single track on linear tyres of a car, whose stiffness does not depend on the load."""
    plain = _on_linear_tyres(car)
    if plain.steering.inputs != ("steer",):
        raise InputError(
            f"open_loop: car.steering = {word_for(plain.steering)}: needs {', '.join(plain.steering.inputs)}; must be a "
            "steering whose only input is steer."
        )
    return plain


def _on_linear_tyres(car: Any) -> SingleTrack:
    if isinstance(car, SingleTrack) and not any(isinstance(t, AbstractDynamicTyre) for t in (car.front, car.rear)):
        return linear(eqx.tree_at(lambda c: c.cg_height, car, None, is_leaf=lambda leaf: leaf is None))
    plain = linear_single_track(car)
    return SingleTrack(
        mass=plain.mass, yaw_inertia=plain.yaw_inertia, front_axle_to_cg=plain.front_axle_to_cg,
        rear_axle_to_cg=plain.rear_axle_to_cg, front=Linear(plain.front_stiffness), rear=Linear(plain.rear_stiffness),
        steering=plain.steering,
    )  # fmt: skip


def do_nothing(car: CarSpecification, recording: Recording) -> dict[str, np.ndarray]:
    """`v_y` and `sideslip` of the car's file by `open_loop`; zeros where `steer` or `v_x` is missing."""
    recording = with_road_steer(car, recording)
    steered = all(name in recording and np.isfinite(np.asarray(recording[name])).any() for name in ("steer", "v_x"))
    if not steered:
        return dict.fromkeys(("v_y", "sideslip"), np.zeros(len(recording)))
    found = open_loop(from_specification(car), recording)
    return {name: found[name] for name in ("v_y", "sideslip")}


@eqx.filter_jit
def open_loop_of(car: Any, time, steer, v_x) -> dict[str, jax.Array]:
    """The same as `open_loop` for (T,) arrays, which may be traced."""
    inputs = {"steer": jnp.asarray(steer), "v_x": jnp.asarray(v_x)}
    states = _drive(_linear_car(car), Row(jnp.asarray(time), record("Inputs", inputs), ()))
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
