"""The review's own equations, as printed and as they should be, on the electric car.

Errata. The letter k is the stiffness of one tyre in (1) and (2), of an axle in (16) and (17). (4): the second term of H must be
`k_alpha tan(alpha) / ((1 - lambda) mu F_z)`, and the force below H = 1/2 is missing, `lambda / (1 - lambda) k_lambda`. (5) has
the opposite sign of (6) and (7). (15): F_yr has no cos(delta_f). (17): `l r / v - delta`, not plus.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import numpy as np

from jaxveh import vehicles
from jaxveh._core.names import record
from jaxveh.experiments.report import Table
from jaxveh.experiments.sideslip_review.drives import numbers_of
from jaxveh.vehicles import GRAVITY, LinearSingleTrack

SPEED, STEER = 20.0, 0.02
"""m/s and rad of the steady turn."""


class Line(NamedTuple):
    """A quantity: its equation, in words, its `printed` and its `corrected` value, and what it `should` be."""

    equation: str
    what: str
    printed: float
    corrected: float
    should: float


def equations() -> Table:
    """What the printed equations say."""
    rows = [tuple(line) for line in (*_steady(), *_place(), *_slipping(), *_sign(), *_rear())]
    return Table(
        "The review's equations, as printed and with their errata corrected",
        ("equation", "quantity", "as printed", "corrected", "should be"),
        rows,
    )


def steady_turn(speed: float = SPEED, steer: float = STEER) -> tuple[float, float, float]:
    """Sideslip (rad), yaw rate (rad/s) and a_y (m/s^2) of the linear single track in a steady turn, from its own equations."""
    car = vehicles.build(numbers_of(), LinearSingleTrack)
    u = record("Inputs", {"steer": np.float64(steer), "v_x": np.float64(speed)})

    def rates(x):
        found = car.derivatives(0.0, car.state_type(x[0], 0.0 * x[0], x[1]), u)
        return jax.numpy.stack([found.sideslip, found.yaw_rate])

    zero = jax.numpy.zeros(2)
    sideslip, yaw_rate = np.linalg.solve(np.asarray(jax.jacfwd(rates)(zero)), -np.asarray(rates(zero)))
    return float(sideslip), float(yaw_rate), float(speed * yaw_rate)


def steer_sideslip(k_f: float, k_r: float, speed: float = SPEED, steer: float = STEER) -> float:
    """Eq 1, k of one tyre: sideslip of a steer angle, rad."""
    car = numbers_of()
    a, b, l, m = car.front_axle_to_cg, car.rear_axle_to_cg, car.wheelbase, car.mass or 0.0
    above = 1 - m * a * speed**2 / (2 * b * k_r * l)
    return above / (1 - m * (a * k_f - b * k_r) * speed**2 / (2 * l**2 * k_f * k_r)) * b / l * steer


def sensed_sideslip(k_r: float, yaw_rate: float, a_y: float, speed: float = SPEED) -> float:
    """Eq 2, k of one tyre: sideslip of yaw rate and a_y, rad."""
    car = numbers_of()
    return (
        car.rear_axle_to_cg / speed * yaw_rate
        - (car.mass or 0.0) * car.front_axle_to_cg / (2 * car.wheelbase * k_r) * a_y
    )


def _stiffnesses() -> tuple[float, float]:
    values = numbers_of().values()
    return values["front_stiffness"], values["rear_stiffness"]


def _steady() -> list[Line]:
    C_f, C_r = _stiffnesses()
    sideslip, yaw_rate, a_y = steady_turn()
    shown = lambda value: math.degrees(value)
    return [
        Line(
            "1", "sideslip of steer, degrees (k read as an axle's; corrected: a tyre's)",
            shown(steer_sideslip(C_f, C_r)), shown(steer_sideslip(C_f / 2, C_r / 2)), shown(sideslip),
        ),
        Line(
            "2", "sideslip of yaw rate and a_y, degrees (likewise)",
            shown(sensed_sideslip(C_r, yaw_rate, a_y)), shown(sensed_sideslip(C_r / 2, yaw_rate, a_y)), shown(sideslip),
        ),
    ]  # fmt: skip


def _place() -> list[Line]:
    """Eq 17: where the centre of gravity is, of a steady turn."""
    car, (C_f, C_r), (_, yaw_rate, a_y) = numbers_of(), _stiffnesses(), steady_turn()
    share = lambda sign: (
        (1 + C_f / ((car.mass or 0.0) * a_y) * (car.wheelbase * yaw_rate / SPEED + sign * STEER)) / (C_f / C_r + 1)
    )
    return [Line("17", "l_f / l", share(1), share(-1), car.front_axle_to_cg / car.wheelbase)]


def braking(
    ratio: float, slip_angle: float, printed: bool, k: float = 50000.0, k_a: float = 35000.0, limit: float = 3000.0
):
    """Eq 4: the braking force of a wheel (N) at a slip ratio and slip angle, `limit` = mu F_z (N)."""
    across = (ratio if printed else 1.0) * k_a * math.tan(slip_angle)
    H = math.hypot(ratio * k, across) / ((1 - ratio) * limit)
    full = ratio / (1 - ratio) * k
    if H <= 0.5 and not printed:
        return full
    return full * (1 / H - 1 / (4 * H**2))


def _slipping() -> list[Line]:
    """Eq 4 at small slip, where the force is nearly k_lambda lambda, and beside a slip angle."""
    small = Line(
        "4",
        "braking force, N, slip ratio 0.01, rolling straight",
        braking(0.01, 0.0, True),
        braking(0.01, 0.0, False),
        505.05,
    )
    angle = math.radians(5.0)
    cornering = 35000.0 * math.tan(angle) / 0.95
    length = math.hypot(50000.0 * 0.05 / 0.95, cornering)
    h = length / 3000.0
    right = 50000.0 * 0.05 / 0.95 * (1 / h - 1 / (4 * h**2))
    beside = Line("4", "the same at 0.05 and 5 degrees", braking(0.05, angle, True), braking(0.05, angle, False), right)
    return [small, beside]


def _sign() -> list[Line]:
    """Eqs 5 and 6 at one slip angle: forces of opposite sign."""
    alpha, k, limit = 0.03, 35000.0, 0.9 * 0.5 * 1230.0 * GRAVITY / 2
    parabola = k * alpha - k**2 * alpha**2 / (4 * limit)
    exponential = limit * (1 - math.exp(-k / limit * alpha))
    return [Line("5", "F_y, N, at a slip angle of 0.03 rad (eq 6 beside it)", -parabola, parabola, exponential)]


def _rear() -> list[Line]:
    """Eq 15: the rear axle's force does not depend on the steer."""
    car, a_y, steer = numbers_of(), 5.0, 0.3
    force = car.front_axle_to_cg * (car.mass or 0.0) * a_y / car.wheelbase
    return [Line("15", "F_yr, N, at 5 m/s^2 and 0.3 rad of steer", force / math.cos(steer), force, force)]
