"""A window of the inertial unit's measurements: turn and velocity change of the car since the time of a delayed measurement.

Satellites, cameras and their networks are delayed by tenths of a second. Their measurements belong to a past state, which is the
present state less the inertial measurements since. This needs no vehicle model, no delayed states, and no filter that goes back.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxveh import numerics

SLOTS = 32
"""Number of pieces of the past; rows that are closer than a share of the lag are joined to one piece."""


class Window(NamedTuple):
    """Pieces of the past, the newest last, (`SLOTS`,) each: the duration `span` (s; 0 for an unused piece), the angle `turned`
    (rad), the velocity changes `gained_x` and `gained_y` (m/s, in the axes at the piece's end), and the yaw and roll rates at its
    end (rad/s)."""

    span: Any
    turned: Any
    gained_x: Any
    gained_y: Any
    yaw_rate: Any
    roll_rate: Any


class Past(NamedTuple):
    """The motion over a lag: the angle `turned` (rad); the integrals of the measured accelerations, `gained_x` and `gained_y`
    (m/s, in the present axes); the yaw and roll rates at its beginning, `spun` and `rolled` (rad/s); and whether the window
    reaches back so far, `covered`."""

    turned: Any
    gained_x: Any
    gained_y: Any
    spun: Any
    rolled: Any
    covered: Any


def empty_window(like: Any) -> Window:
    """A window without a past."""
    nothing = jnp.zeros(SLOTS, jnp.result_type(like))
    return Window(nothing, nothing, nothing, nothing, nothing, nothing)


def window_after(window: Window, piece: Window, lag: Any) -> Window:
    """The window with one more `piece` (of scalars), which is joined to the newest one while that is short against `lag` (s)."""
    newest = Window(*[leaf[-1] for leaf in window])
    joined = _joined(newest, piece)
    joins = joined.span <= 1.2 * lag / (SLOTS - 4)
    pushed = lambda leaf, own: jnp.concatenate([leaf[1:], own[None]])
    put = lambda leaf, own: leaf.at[-1].set(own)
    return Window(*[
        jnp.where(joins, put(leaf, both), pushed(leaf, own))
        for leaf, both, own in zip(window, joined, piece, strict=True)
    ])  # fmt: skip


def look_back(window: Window, lag: Any) -> Past:
    """The motion over the last `lag` (s); the piece in which it begins counts in part."""
    began = jnp.cumsum(window.span[::-1])[::-1]
    ended = began - window.span
    used = window.span > 0
    length = jnp.where(used, window.span, 1.0)
    share = jnp.where(used, jnp.clip((lag - ended) / length, 0.0, 1.0), 0.0)
    turned = share * window.turned
    later = jnp.cumsum(turned[::-1])[::-1] - turned
    # A piece that counts in part counts with its later part, which on average is turned less against the end than the whole.
    x, y = rotate(window.gained_x, window.gained_y, later - 0.5 * (1.0 - share) * window.turned)
    # Rates are linear within a piece, and constant within the first.
    before = lambda leaf: jnp.where(jnp.roll(used, 1).at[0].set(False), jnp.roll(leaf, 1), leaf)
    within = used & (lag >= ended) & (lag < began)
    then = lambda leaf: jnp.sum(jnp.where(within, leaf + share * (before(leaf) - leaf), 0.0))
    covered = lag <= began[0] * (1 + 1e-5)
    return Past(
        jnp.sum(turned), jnp.sum(share * x), jnp.sum(share * y), then(window.yaw_rate), then(window.roll_rate), covered
    )


def rotate(x: Any, y: Any, angle: Any) -> tuple[Any, Any]:
    """The components of a vector in axes that are turned by `angle` (rad, to the left) against the given ones."""
    c, s = numerics.cos(angle), numerics.sin(angle)
    return c * x + s * y, c * y - s * x


def _joined(one: Window, other: Window) -> Window:
    """Two pieces joined to one, in the axes at the end of the second."""
    x, y = rotate(one.gained_x, one.gained_y, other.turned)
    return Window(
        one.span + other.span, one.turned + other.turned, x + other.gained_x, y + other.gained_y, other.yaw_rate,
        other.roll_rate,
    )  # fmt: skip
