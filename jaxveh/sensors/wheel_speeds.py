"""Wheel speeds of a control unit, which counts the edges of toothed rings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, check_one_of
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.sensors.device import AbstractInstrument
from jaxveh.sensors.randomness import subkey
from jaxveh.sensors.signal import Signal, apply_all, as_signals, check_signals
from jaxveh.vehicles import kit as vehicles

_SPEEDS = tuple(f"wheel_speed_{wheel}" for wheel in vehicles.CORNERS)
_SPINS = tuple(f"omega_{wheel}" for wheel in vehicles.CORNERS)
_SEEN = {f"omega_{wheel}": f"omega_to_body_{wheel}" for wheel in vehicles.CORNERS}
_TEETH_TAG, _START_TAG = 100, 101
_LONG = 1e3
"""The time (s) since the last edge of a wheel that stands still at the start."""


class _Ring(NamedTuple):
    """The state of the counter for each wheel: the angle from where the last edge belongs (in teeth), the time since it
    passed, the last speed, and the error with which the next edge is placed (in teeth)."""

    way: Any
    since: Any
    held: Any
    error: Any


class WheelSpeeds(AbstractInstrument):
    """Wheel speed sensors on toothed rings, with the arithmetic of the unit that counts them.

    - `signals`: a mapping from channels to their errors (`Signal`). The channels are `wheel_speed_fl` ... (m/s, at the
      stored `radius`) and `omega_fl` ... (rad/s). Channels given as names only have no errors. The difference between a
      tyre's radius and the stored radius is the signal's `scale`: a smaller tyre spins faster at the same speed.
      `noise` and the other errors are added to those of the teeth.
    - `teeth`: edges per revolution. `method`: "M" counts the edges of one period, so that speeds are multiples of
      `2 pi / (teeth period)`; "M/T" divides them by the time between the last edges of two periods, which is exact at
      constant speed, and between edges keeps the last speed until a lower speed is certain (Ohmae et al., IEEE Trans.
      Industrial Electronics 29, 1982).
    - `tooth_error`: standard deviation of the position of each edge, relative to the pitch of the teeth ("M/T" only).
    - `lowest`: below this speed (in the channel's unit) the channel is zero or NaN, as given by `below`, "zero" or "nan".
    - `signed`: whether the sensors measure the direction; most do not, and send the magnitude.

    The sensors are fixed to the body: if the car has the outputs `omega_to_body_fl` ..., which differ from `omega_fl`
    ... by approximately the pitch rate, they count those. The angle between two samples is computed from their mean
    spin, and the wheel is taken to have turned steadily before the first sample. The position of a wheel between two
    edges at the start is random (without a key: the middle).

    **Raises** `InputError` for numbers out of range, unknown channels, or speeds without a radius.
    """

    signals: dict[str, Signal] = eqx.field(converter=as_signals, default=_SPEEDS)
    radius: jax.Array | None = positive("m", default=None)
    lowest: jax.Array | None = positive("unit", default=None)
    tooth_error: jax.Array | None = positive("-", default=None)
    teeth: int = eqx.field(static=True, default=48)
    method: str = eqx.field(static=True, default="M/T")
    below: str = eqx.field(static=True, default="zero")
    signed: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        check_signals("WheelSpeeds.signals", self.signals, (*_SPEEDS, *_SPINS))
        check_parameters(self)
        check("WheelSpeeds.teeth", self.teeth, lambda n: (n >= 1) & (n == n // 1), "a whole number of at least 1")
        check_one_of("WheelSpeeds.method", self.method, ("M", "M/T"))
        check_one_of("WheelSpeeds.below", self.below, ("zero", "nan"))
        if self.tooth_error is not None:
            check("WheelSpeeds.tooth_error", self.tooth_error, lambda e: e <= 0.1, "at most 0.1 of the pitch")
        if self.radius is None and any(name in _SPEEDS for name in self.signals):
            raise InputError(
                "WheelSpeeds.radius = None: speeds in m/s need the radius (m) that the control unit stores."
            )

    @property
    def channels(self) -> tuple[str, ...]:
        """The measured channels, front left first."""
        return tuple(name for name in (*_SPEEDS, *_SPINS) if name in self.signals)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each channel, m/s or rad/s."""
        return {name: "m/s" if name in _SPEEDS else "rad/s" for name in self.channels}

    @property
    def needs(self) -> tuple[str, ...]:
        """The spins of the wheels that are measured."""
        return tuple(name for name in _SPINS if name in self.signals or _speed_of(name) in self.signals)

    @property
    def may_use(self) -> tuple[str, ...]:
        """The spins of these wheels relative to the body."""
        return tuple(_SEEN[name] for name in self.needs)

    @property
    def pitch(self) -> float:
        """The angle from edge to edge, rad."""
        return 2 * math.pi / self.teeth

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """Wheel speeds by channel."""
        omega = jnp.stack([outputs.get(_SEEN[name], outputs[name]) for name in self.needs], axis=-1)
        counted = dict(zip(self.needs, self._count(omega, key).T, strict=True))
        true = dict(counted)
        for name in self.needs:
            if _speed_of(name) in self.signals:
                true[_speed_of(name)] = self.radius * counted[name]
        said = apply_all(self.signals, (*_SPEEDS, *_SPINS), true, self.period, key)
        return said if self.lowest is None else {name: self._cut(value, self.lowest) for name, value in said.items()}

    def _cut(self, value: jax.Array, lowest: jax.Array) -> jax.Array:
        nothing = 0.0 if self.below == "zero" else jnp.nan
        return jnp.where(jnp.abs(value) < lowest, nothing, value)

    def _count(self, omega: jax.Array, key: Any) -> jax.Array:
        """The spins (n, wheels) computed from counted edges."""
        spin = 0.5 * (omega + jnp.concatenate([omega[:1], omega[:-1]]))
        teeth = jnp.abs(spin) * (self.period / self.pitch)
        errors = jnp.zeros_like(teeth)
        if self.tooth_error is not None and key is not None and self.method == "M/T":
            errors = self.tooth_error * self._by_wheel(numerics.normal, subkey(key, _TEETH_TAG), teeth[:, 0])
        _, counted = jax.lax.scan(lambda ring, row: self._next(ring, row), self._start(teeth[0], key), (teeth, errors))
        return counted * jnp.sign(spin) if self.signed else counted

    def _start(self, teeth: jax.Array, key: Any) -> _Ring:
        way = jnp.full_like(teeth, 0.5)
        if key is not None:
            way = self._by_wheel(numerics.uniform, subkey(key, _START_TAG), teeth[0])
        turns = teeth > 0
        since = jnp.where(turns, jnp.minimum(way * self.period / numerics.or_one(teeth, turns), _LONG), _LONG)
        return _Ring(way, since, self.pitch / self.period * teeth, jnp.zeros_like(teeth))

    def _by_wheel(self, draw: Callable, key: Any, like: jax.Array) -> jax.Array:
        """Random numbers in the shape of `like` for each wheel (last axis), independent of which other wheels are measured."""
        return jnp.stack([draw(subkey(key, name), like.shape, like.dtype) for name in self.needs], axis=-1)

    def _next(self, ring: _Ring, row: tuple) -> tuple[_Ring, jax.Array]:
        """One period; `row`: the angle turned in it, `teeth`, and the position error of the edge after its last one."""
        teeth, error = row
        gone = ring.way + teeth
        # A slow wheel turns through an edge's error in many periods: the edge keeps its place until it has passed.
        edges = jnp.maximum(jnp.floor(gone - ring.error), 0.0)
        way = gone - edges
        new = edges > 0
        waited = ring.since + self.period
        passed = jnp.minimum((way - ring.error) / numerics.or_one(teeth, new), 1.0) * self.period
        since = jnp.where(new, passed, waited)
        # By their errors two edges may be in the wrong order if a wheel passes little more than one edge in a period.
        between = jnp.maximum(waited - since, 1e-3 * self.period)
        slower = jnp.minimum(ring.held, self.pitch / waited)
        timed = jnp.where(new, self.pitch * edges / numerics.or_one(between, new), slower)
        said = timed if self.method == "M/T" else self.pitch / self.period * edges
        return _Ring(way, since, timed, jnp.where(new, error, ring.error)), said


def _speed_of(spin: str) -> str:
    return spin.replace("omega", "wheel_speed")
