"""What an inertial unit has felt in the last moments: by how much the car has turned and its velocity changed since a late
measurement was true.

Satellites, cameras and their networks are late by tenths of a second. What they say is of the state of then, which is the state
of now less what was felt since. That is known without a vehicle: it needs no state that is delayed, and no filter that goes back.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxveh import numerics

SLOTS = 32
"""How many pieces of the past are kept; rows that come closer than a share of the lag go into one."""


class Window(NamedTuple):
    """Pieces of the past, the newest last, (`SLOTS`,) each: how long each is (`span`, s; 0 of one that is not used yet), by how
    much the car turned in it (rad) and its velocity changed (m/s, in the axes at the piece's end), and the rates of yaw and roll
    at its end (rad/s)."""

    span: Any
    turned: Any
    gained_x: Any
    gained_y: Any
    yaw_rate: Any
    roll_rate: Any


class Past(NamedTuple):
    """What happened in the last moments: how far the car `turned` (rad), `gained_x`, `gained_y`: what was felt in sum (m/s, in
    the axes of now), the rates of yaw and roll then (`spun`, `rolled`, rad/s), and whether that is known (`covered`)."""

    turned: Any
    gained_x: Any
    gained_y: Any
    spun: Any
    rolled: Any
    covered: Any


def empty_window(like: Any) -> Window:
    """Nothing is known of the past."""
    nothing = jnp.zeros(SLOTS, jnp.result_type(like))
    return Window(nothing, nothing, nothing, nothing, nothing, nothing)


def window_after(window: Window, piece: Window, lag: Any) -> Window:
    """The window with one more `piece` (of scalars). It joins the newest one as long as that is short against the `lag` (s)."""
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
    """The sum of the last `lag` seconds, the piece in which they begin counted by its share."""
    began = jnp.cumsum(window.span[::-1])[::-1]
    ended = began - window.span
    used = window.span > 0
    length = jnp.where(used, window.span, 1.0)
    share = jnp.where(used, jnp.clip((lag - ended) / length, 0.0, 1.0), 0.0)
    turned = share * window.turned
    later = jnp.cumsum(turned[::-1])[::-1] - turned
    # Of a piece that counts in part it is the later part, less turned against the end than all of it on the average.
    x, y = rotate(window.gained_x, window.gained_y, later - 0.5 * (1.0 - share) * window.turned)
    # Rates run linearly within a piece; before the first they are its own.
    before = lambda leaf: jnp.where(jnp.roll(used, 1).at[0].set(False), jnp.roll(leaf, 1), leaf)
    within = used & (lag >= ended) & (lag < began)
    then = lambda leaf: jnp.sum(jnp.where(within, leaf + share * (before(leaf) - leaf), 0.0))
    covered = lag <= began[0] * (1 + 1e-5)
    return Past(
        jnp.sum(turned), jnp.sum(share * x), jnp.sum(share * y), then(window.yaw_rate), then(window.roll_rate), covered
    )


def rotate(x: Any, y: Any, angle: Any) -> tuple[Any, Any]:
    """A vector in axes that are turned by `angle` (rad, to the left) against those in which it is given."""
    c, s = numerics.cos(angle), numerics.sin(angle)
    return c * x + s * y, c * y - s * x


def _joined(one: Window, other: Window) -> Window:
    """Two pieces as one, in the axes at the end of the second."""
    x, y = rotate(one.gained_x, one.gained_y, other.turned)
    return Window(
        one.span + other.span, one.turned + other.turned, x + other.gained_x, y + other.gained_y, other.yaw_rate,
        other.roll_rate,
    )  # fmt: skip
