"""Prepares a real log for a filter of sideslip, looking back only, so that a live loop can do the same."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import check_kind, check_positive
from jaxveh._core.lengths import common_length, shorten
from jaxveh._core.parameter import positive
from jaxveh._core.recording import Recording
from jaxveh.estimators.contract import Need, check_needs
from jaxveh.estimators.live import AbstractCleaning, clean_recording
from jaxveh.estimators.rear_axle import CHANNEL, STEERED, USUAL_WHEELBASE, rolling_below
from jaxveh.estimators.rear_steer import CHANNEL as STEER_REAR
from jaxveh.sensors import LowPass

A_X_CUTOFF = 1.6
"""Hz: the axle loads follow the longitudinal acceleration, not its vibration."""

FORCE_CUTOFF = 1.0
"""Hz, for a car of the usual wheelbase: removes the body's vibration from the axle's force, whose curve is not straight."""

A_Y_STEP, A_Y_RANGE = 8.0, 40.0
"""m/s^2: a sample that differs from the last good one by more than `A_Y_STEP`, or exceeds `A_Y_RANGE`, is a spike."""

YAW_RATE_STEP, YAW_ACCELERATION = 0.15, 25.0
"""rad/s and rad/s^2, for a car of the usual wheelbase: a sample is a spike if it differs from the last good one by more than
noise and the quickest car allow."""

OUTLYING = 20.0
"""A spike also differs by more than this many times the mean change from row to row: some channels are nothing but noise."""

MEMORY = 1.0
"""s: the time over which that mean is taken."""

LONGEST_SPIKE = 0.1
"""s: a deviation that lasts longer is not a spike."""

LONGEST_STILL = 0.5
"""s: a channel of a moving car that stays the same to the last digit for longer counts as stuck."""

LONGEST_HOLD = 0.3
"""s: the last good acceleration and yaw rate replace missing ones for so long; after that the car is assumed to turn steadily,
and, where the yaw rate is missing, its lateral velocity is assumed constant."""

BLIND = (
    Need("v_x", "m/s", throughout=True),
    Need("yaw_rate", "rad/s"),
    Need("a_y", "m/s^2", optional=True),
    Need("a_x", "m/s^2", optional=True),
)
"""The channels from which sideslip is estimated, blind. Without a_x, the changes of the speed replace it; without a_y, every turn
is assumed steady, and then no tyre can be calibrated."""


class Watched(NamedTuple):
    """The record of one channel: the last good value and its time (s), the raw value of the row before, the time (s) since which
    it has been the same, and the mean size of its changes from row to row, over about `MEMORY`."""

    value: Any
    time: Any
    raw: Any
    since: Any
    change: Any


class RearAxleMemory(NamedTuple):
    """The row before: time (s), speed, a_x; the states of the low-passes; the records of the measured channels; the low-passes of
    the integrals of a_y and v_x yaw_rate, less the integrals (m/s); the angle of steered rear wheels (rad) and its low-pass."""

    t: Any
    v_x: Any
    a_x: Any
    slow_a_x: Any
    smooth_a_y: Any
    smooth_yaw_rate: Any
    a_y: Watched
    yaw_rate: Watched
    a_y_behind: Any
    turning_behind: Any
    felt: Any
    steer: Any = None


class RearAxleCleaning(AbstractCleaning):
    """Turns a log's channels into the inputs of `rear_axle_model` and its balance: 0, or NaN where the force is unknown.

    Spikes and stuck samples count as missing, and missing a_y and yaw_rate are held for a while. a_x is low-passed (first order);
    a_y and yaw_rate are used raw for the integral and low-passed (second order) for the force. The growth of the integral since
    the low-passed rows is added to the balance, so that the low-pass causes no delay. `wheelbase` (m). `rear_steer`: the rows
    have the angle of steered rear wheels, as `RearSteer` prepares them.
    """

    wheelbase: jax.Array = positive("m", default=USUAL_WHEELBASE)
    rear_steer: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        check_positive("RearAxleCleaning.wheelbase", self.wheelbase, "m")

    @property
    def channels(self):
        return (*(need.channel for need in BLIND), *((STEER_REAR,) if self.rear_steer else ()))

    @property
    def inputs(self):
        return tuple(need.channel for need in BLIND if need.throughout)

    def first(self, t, values):
        v_x, raw = values["v_x"], values["yaw_rate"]
        none = jnp.zeros_like(v_x)
        known = lambda value: jnp.where(jnp.isnan(value), none, value)
        yaw_rate = known(raw)
        a_y, a_x = jnp.where(jnp.isnan(values["a_y"]), v_x * yaw_rate, values["a_y"]), known(values["a_x"])
        slow = self._a_x_low_pass(v_x).start(a_x)
        smooth = [self._low_pass(v_x).start(value) for value in (a_y, yaw_rate)]
        watched = [Watched(value, t, values[name], t, none) for name, value in (("a_y", a_y), ("yaw_rate", yaw_rate))]
        # As after a long time at this acceleration: the low-pass lags by its delay.
        behind = lambda rate: (-rate * self._low_pass(v_x).delay, rate)
        felt = (a_y, v_x * yaw_rate)
        a_y_behind, turning_behind = (behind(rate) for rate in felt)
        memory = RearAxleMemory(
            t, v_x, values["a_x"], slow, smooth[0], smooth[1], watched[0], watched[1], a_y_behind, turning_behind, felt,
            self._steer(None, values, none),
        )  # fmt: skip
        row = self._row(memory, none, jnp.isnan(raw), ~jnp.isnan(values["a_y"]), v_x, a_y, yaw_rate)
        return memory, row | self._steered(memory)

    def next(self, memory, t, values):
        dt, v_x = t - memory.t, values["v_x"]
        quick, moves = (USUAL_WHEELBASE / self.wheelbase).astype(v_x.dtype), v_x > 1.0
        # No accelerometer at all, or no measurement of it yet.
        none = jnp.isnan(values["a_y"]) & jnp.isnan(memory.a_y.raw)
        turned, yaw_rate = _watch_yaw_rate(memory.yaw_rate, t, values["yaw_rate"], moves, quick)
        pushed, a_y = _watch_a_y(memory.a_y, t, values["a_y"], moves)
        # Loggers repeat the last row where a sensor is slower than the log.
        repeated = (values["yaw_rate"] == memory.yaw_rate.raw) & (values["a_y"] == memory.a_y.raw)
        old = lambda one: t - one.time > LONGEST_HOLD
        # Where the yaw rate is unknown, lateral velocity is assumed constant.
        felt = old(yaw_rate) | ~(none | old(a_y))
        rate = yaw_rate.value
        push = jnp.where(none | old(a_y) | old(yaw_rate), v_x * rate, a_y.value)
        lost = jnp.isnan(turned) | jnp.isnan(pushed) | repeated
        told = jnp.where(jnp.isnan(values["a_x"]), (v_x - memory.v_x) / dt, values["a_x"])
        before = jnp.where(jnp.isnan(memory.a_x), told, memory.a_x)
        slow = self._a_x_low_pass(v_x).step(memory.slow_a_x, before, told, dt)
        one, (a_y_before, turning_before) = self._low_pass(v_x), memory.felt
        after = RearAxleMemory(
            t, v_x, told, slow,
            one.step(memory.smooth_a_y, a_y_before, push, dt), one.step(memory.smooth_yaw_rate, memory.yaw_rate.value, rate, dt),
            a_y, yaw_rate,
            _behind(one, memory.a_y_behind, a_y_before, dt), _behind(one, memory.turning_behind, turning_before, dt),
            (push, v_x * rate),
            self._steer(memory.steer, values, dt),
        )  # fmt: skip
        return after, self._row(after, dt, lost, felt, v_x, push, rate) | self._steered(after)

    def _steer(self, before, values, dt) -> tuple[Any, Any] | None:
        """The angle of the rear wheels and its low-pass after a row; `before`: after the row before."""
        if not self.rear_steer:
            return None
        angle, low_pass = values[STEER_REAR], self._low_pass(values["v_x"])
        return angle, low_pass.start(angle) if before is None else low_pass.step(before[1], before[0], angle, dt)

    def _steered(self, memory) -> dict[str, Any]:
        """The inputs `rear_axle.STEERED`."""
        return dict(zip(STEERED, (memory.steer[0], memory.steer[1][0]), strict=True)) if self.rear_steer else {}

    def _row(self, memory, dt, lost, felt, v_x, a_y, yaw_rate):
        low_pass = self._low_pass(v_x)
        slow = (v_x < rolling_below(self.wheelbase)) | (dt <= 0)
        (smooth_a_y, _), (smooth, change) = memory.smooth_a_y, memory.smooth_yaw_rate
        none = jnp.zeros_like(v_x)
        # Where the acceleration is unknown, nothing compensates the low-pass' delay: the raw yaw rate is used.
        told = lambda usual, steady: jnp.where(felt, usual, steady)
        return {
            "v_x": v_x, "a_x": memory.slow_a_x[0], "yaw_rate": yaw_rate, "turning": v_x * yaw_rate, "a_y": a_y,
            "yaw_rate_smooth": told(smooth, yaw_rate), "yaw_acceleration": change,
            "a_y_smooth": told(smooth_a_y, v_x * yaw_rate), "a_y_lead": -memory.a_y_behind[0],
            "turning_lead": -memory.turning_behind[0], "lag": low_pass.delay, "step": jnp.maximum(dt, 1e-6),
            "felt": told(none + 1, none), CHANNEL: jnp.where(lost | slow | ~felt, jnp.nan, none),
        }  # fmt: skip

    def _a_x_low_pass(self, like) -> LowPass:
        return LowPass(jnp.asarray(A_X_CUTOFF, like.dtype), 1)

    def _low_pass(self, like) -> LowPass:
        return LowPass((FORCE_CUTOFF * (USUAL_WHEELBASE / self.wheelbase) ** 0.5).astype(like.dtype), 2)


def without_wild_values(recording: Recording, wheelbase: float) -> Recording:
    """The recording with yaw rate and a_y missing where they are spikes or stuck."""
    time, v_x = (np.asarray(values, float) for values in (recording.time, recording["v_x"]))
    channels = [np.asarray(recording[name], float) for name in ("yaw_rate", "a_y")]
    # The rows that are added have no value, and no part in the usual change.
    more = np.full(common_length(len(time)) - len(time), np.nan)
    rows = [jnp.asarray(np.append(values, more)) for values in (time - time[0], v_x, *channels)]
    good = shorten(_good(tuple(rows), jnp.asarray(USUAL_WHEELBASE / wheelbase)), len(time))
    return recording.replace(yaw_rate=np.asarray(good[0]), a_y=np.asarray(good[1]))


@eqx.filter_jit
def _good(rows: tuple, quick) -> tuple[Any, Any]:
    """The yaw rate and a_y of all rows, NaN where they are not good."""

    def start(value):
        there = jnp.isfinite(value)
        first = value[jnp.argmax(there)]
        # Here the channel's usual change is known beforehand.
        usual = jnp.nan_to_num(jnp.nanmedian(jnp.abs(jnp.diff(value))))
        return Watched(first, rows[0][jnp.argmax(there)], first, rows[0][0], usual)

    def body(before, row):
        t, v_x, yaw_rate, a_y = row
        turned, one = _watch_yaw_rate(before[0], t, yaw_rate, v_x > 1.0, quick)
        pushed, other = _watch_a_y(before[1], t, a_y, v_x > 1.0)
        return (one, other), (turned, pushed)

    return jax.lax.scan(body, (start(rows[2]), start(rows[3])), rows)[1]


def _watch_yaw_rate(before: Watched, t, value, moves, quick) -> tuple[Any, Watched]:
    return _watch(before, t, value, moves, YAW_RATE_STEP * quick**0.5, YAW_ACCELERATION * quick, 1e3)


def _watch_a_y(before: Watched, t, value, moves) -> tuple[Any, Watched]:
    return _watch(before, t, value, moves, A_Y_STEP, 0.0, A_Y_RANGE)


def _behind(low_pass: LowPass, state, rate, dt):
    """The low-pass of an integral less the integral itself, after `dt` seconds in which it grows by `rate`."""
    value, change = low_pass.step(state, jnp.zeros_like(rate), rate * dt, dt)
    return value - rate * dt, change


def _watch(before: Watched, t, value, moves, step: float, rate: float, most: float) -> tuple[Any, Watched]:
    """A channel's value, NaN where it is a spike or has not changed for too long, and its record after the row."""
    missing = jnp.isnan(value)
    size = jnp.abs(value - before.value)
    jump = (size > step + rate * (t - before.time)) & (size > OUTLYING * before.change)
    spike = (jump & (t - before.time < LONGEST_SPIKE)) | (jnp.abs(value) > most)
    since = jnp.where(value == before.raw, before.since, t)
    stuck = moves & (t - since > LONGEST_STILL)
    good = ~(missing | spike | stuck)
    kept = lambda new, old: jnp.where(good, new, old)
    share = (t - before.time) / MEMORY
    # An outlier counts for no more than the limit, so that a channel that becomes noisy is accepted again.
    change = jnp.where(
        missing, before.change, before.change + jnp.minimum(share, 1.0) * (jnp.minimum(size, step) - before.change)
    )
    after = Watched(
        kept(value, before.value), kept(t, before.time), jnp.where(missing, before.raw, value), since, change
    )
    return jnp.where(good, value, jnp.nan), after


def clean(recording: Recording, cleaning: AbstractCleaning | None = None) -> Recording:
    """Clean a log as the filter of sideslip reads it: see `RearAxleCleaning`.

    **Raises** `InputError` where a channel is missing, or a speed is NaN (fill it first with `recording.fill`).
    """
    if cleaning is not None:
        check_kind("cleaning", cleaning, AbstractCleaning, "Such as the `cleaning` of estimators.sideslip.live(car).")
    check_needs("sideslip", BLIND, recording)
    absent = {need.channel: np.full(len(recording), np.nan) for need in BLIND if need.channel not in recording}
    return clean_recording(RearAxleCleaning() if cleaning is None else cleaning, recording.replace(**absent))
