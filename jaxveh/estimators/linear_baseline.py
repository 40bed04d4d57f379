"""The do-nothing baseline: a linear single track that listens to steer and speed and to no sensor."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.names import record
from jaxveh._core.recording import Recording
from jaxveh.statespace import Propagate, Row
from jaxveh.vehicles import SingleTrack, linear


def _derivatives(car: SingleTrack, t, x, u):
    return car.derivatives(t, x, u)


PROPAGATE = Propagate(_derivatives)


def open_loop(car: SingleTrack, recording: Recording) -> dict[str, np.ndarray]:
    """What a linear single track makes of `steer` (rad) and `v_x` (m/s) alone, from straight running at the first row.

    The car's own cornering stiffnesses at its static loads, without load transfer. **Returns** by name, (T,) each: `v_y`
    (m/s), `yaw_rate` (rad/s), `sideslip` (rad). **Raises** `InputError` for missing channels.
    """
    plain = linear(eqx.tree_at(lambda c: c.cg_height, car, None, is_leaf=lambda leaf: leaf is None))
    inputs = {name: jnp.asarray(recording[name]) for name in ("steer", "v_x")}
    states = _drive(plain, Row(jnp.asarray(recording.time), record("Inputs", inputs), ()))
    v_y, yaw_rate = np.asarray(states.v_y), np.asarray(states.yaw_rate)
    return {"v_y": v_y, "yaw_rate": yaw_rate, "sideslip": np.arctan2(v_y, np.asarray(recording["v_x"]))}


@eqx.filter_jit
def _drive(car: SingleTrack, rows: Row):
    start = jax.tree.map(lambda _: jnp.zeros((), rows.t.dtype), car.state_type(0, 0, 0))

    def body(state, pair):
        now, then = pair
        moved = PROPAGATE(car, now.t, then.t, state, now.u)
        return moved, moved

    pairs = jax.tree.map(lambda leaf: leaf[:-1], rows), jax.tree.map(lambda leaf: leaf[1:], rows)
    _, states = jax.lax.scan(body, start, pairs)
    return jax.tree.map(lambda first, rest: jnp.append(first, rest), start, states)
