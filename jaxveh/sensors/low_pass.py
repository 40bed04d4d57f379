"""The low-pass of a sensor: as an ordinary differential equation in a model, and applied to channels."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_kind, check_one_of, check_positive, check_single, is_concrete
from jaxveh._core.names import as_names, check_names
from jaxveh._core.parameter import positive
from jaxveh._core.recording import Recording, check_recording

_DAMPING = math.sqrt(0.5)


class LowPass(eqx.Module):
    """A Butterworth low-pass of order 1 or 2 with unit gain at frequency zero: -3 dB at `cutoff_hz` (Hz).

    Order 2 (default): `y'' + sqrt(2) w y' + w^2 y = w^2 u` with `w = 2 pi cutoff`; order 1: `y' + w y = w u`. At low
    frequencies its delay is `delay` (s). S. Butterworth, On the theory of filter amplifiers (1930).
    """

    cutoff_hz: jax.Array = positive("Hz", default=20.0)
    order: int = eqx.field(static=True, default=2)

    def __check_init__(self):
        check_positive("LowPass.cutoff_hz", self.cutoff_hz, "Hz")
        check_one_of("LowPass.order", self.order, (1, 2))

    @property
    def omega(self) -> jax.Array:
        """The cutoff frequency, rad/s."""
        return (2 * math.pi) * self.cutoff_hz

    @property
    def delay(self) -> jax.Array:
        """The group delay at low frequencies, s: `2 zeta / w` (order 2) or `1 / w`."""
        return (2 * _DAMPING if self.order == 2 else 1.0) / self.omega

    def state_names(self, channel: str) -> tuple[str, ...]:
        """The filter's states for a channel: `<channel>_filtered` and, for order 2, `<channel>_filtered_rate`."""
        return (f"{channel}_filtered", f"{channel}_filtered_rate")[: self.order]

    def start(self, u: Any) -> tuple:
        """The settled states for a constant input u."""
        return (u, jnp.zeros_like(u))[: self.order]

    def derivatives(self, state: tuple, u: Any) -> tuple:
        """The states' time derivatives for an input u."""
        w = self.omega
        if self.order == 1:
            return (w * (u - state[0]),)
        value, rate = state
        return rate, w * (w * (u - value) - 2 * _DAMPING * rate)

    def step(self, state: tuple, u0: Any, u1: Any, dt: Any) -> tuple:
        """The states after `dt` seconds in which the input changes linearly from u0 to u1: exact for any step."""
        w, ramp, lag = self.omega, (u1 - u0) / dt, self.delay
        # For a ramp the filter settles to the ramp, later by its delay; the difference of the initial state from it
        # decays freely.
        if self.order == 1:
            return (u1 - ramp * lag + (state[0] - (u0 - ramp * lag)) * jnp.exp(-w * dt),)
        value, rate = state[0] - (u0 - ramp * lag), state[1] - ramp
        decay = _DAMPING * w
        turn = w * math.sqrt(1 - _DAMPING**2)
        cosine, sine, fade = numerics.cos(turn * dt), numerics.sin(turn * dt), jnp.exp(-decay * dt)
        new_value = fade * (value * cosine + (rate + decay * value) / turn * sine)
        new_rate = fade * (rate * cosine - (decay * rate + w * w * value) / turn * sine)
        return u1 - ramp * lag + new_value, ramp + new_rate


def low_pass(recording: Recording, channels, cutoff_hz: float = 20.0, order: int = 2) -> Recording:
    """The recording with the causal low-pass of a sensor applied to other channels, so that all have the same delay.

    In a recording whose gyroscope and accelerometers are low-passed but whose inputs are not, pass the inputs through
    the same filter. A channel is taken to be linear between rows (steps may be irregular) and constant before the first
    row; the filter's equation is solved exactly. It is differentiable with respect to the channels' values.

    **Raises** `InputError` for an unknown channel, one that is not finite throughout, a cutoff that is not positive
    or an order other than 1 and 2.
    """
    check_recording("low_pass", recording)
    check_kind("low_pass: channels", channels, Iterable, "A channel's name, or several.")
    channels = as_names(channels)
    check_names("low_pass", channels, recording.names)
    check_single(cutoff_hz=cutoff_hz)
    if isinstance(recording.time, np.ndarray):
        steps = np.diff(recording.time)
    else:
        steps = jnp.diff(recording.time)
    filtered = {}
    for name in channels:
        values = recording[name]
        if is_concrete(values) and not np.isfinite(np.asarray(values)).all():
            first = int(np.argmin(np.isfinite(np.asarray(values))))
            raise InputError(
                f"low_pass: {name} = {float(values[first])} at t = {recording.time[first]} s: must be finite throughout, "
                f'as a low-pass needs every row. Fill it first: recording.fill("{name}", "linear").'
            )
        device = LowPass(jnp.asarray(cutoff_hz, values.dtype), order)
        filtered[name] = filtered_rows(device, values, jnp.asarray(steps, values.dtype))
    return recording.replace(**filtered)


@eqx.filter_jit
def filtered_rows(device: LowPass, values: jax.Array, steps: jax.Array) -> jax.Array:
    """The low-passed rows of `values` (T, ...), with `steps` (T - 1,) between them (s); the filter starts settled at
    the first row."""

    def body(state, row):
        state = device.step(state, *row)
        return state, state[0]

    _, rest = jax.lax.scan(body, device.start(values[0]), (values[:-1], values[1:], steps))
    return jnp.concatenate([values[:1], rest])
