"""The review's own equations, as printed and corrected, on the electric car.

Errata. The letter k is the stiffness of one tyre in (1) and (2), of an axle in (16) and (17). (4): the second term of H must
be `k_alpha tan(alpha) / ((1 - lambda) mu F_z)`, and the force below H = 1/2 is missing, `lambda / (1 - lambda) k_lambda`.
(5) has the opposite sign of (6) and (7). (15): F_yr has no cos(delta_f). (17): `l r / v - delta`, not plus.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import tyres, vehicles
from jaxveh._core.names import record
from jaxveh.experiments.sideslip_review.drives import numbers_of
from jaxveh.sweeps import Table
from jaxveh.vehicles import LinearSingleTrack

SPEED, STEER = 20.0, 0.02
"""m/s and rad of the steady turn."""


class Line(NamedTuple):
    """A quantity: its `equation`, a description (`what`), its `printed` and its `corrected` value, and what it `should` be."""

    equation: str
    what: str
    printed: float
    corrected: float
    should: float


def equations() -> Table:
    """The values of the printed equations."""
    rows = [tuple(line) for line in (*_steady(), *_place(), *_slip_checks(), *_sign(), *_rear())]
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
        found = car.derivatives(0.0, car.state_type(x[0], jnp.zeros_like(x[0]), x[1]), u)
        return jnp.stack([found.sideslip, found.yaw_rate])

    zero = jnp.zeros(2)
    sideslip, yaw_rate = np.linalg.solve(np.asarray(jax.jacfwd(rates)(zero)), -np.asarray(rates(zero)))
    return float(sideslip), float(yaw_rate), float(speed * yaw_rate)


def steer_sideslip(k_f: float, k_r: float, speed: float = SPEED, steer: float = STEER) -> float:
    """Eq 1, k of one tyre: sideslip from the steer angle, rad."""
    car = numbers_of()
    a, b, l, m = car.front_axle_to_cg, car.rear_axle_to_cg, car.wheelbase, car.mass or 0.0
    above = 1 - m * a * speed**2 / (2 * b * k_r * l)
    return above / (1 - m * (a * k_f - b * k_r) * speed**2 / (2 * l**2 * k_f * k_r)) * b / l * steer


def sensed_sideslip(k_r: float, yaw_rate: float, a_y: float, speed: float = SPEED) -> float:
    """Eq 2, k of one tyre: sideslip from yaw rate and a_y, rad."""
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
            "1", "sideslip from steer, degrees (k read as an axle's; corrected: a tyre's)",
            shown(steer_sideslip(C_f, C_r)), shown(steer_sideslip(C_f / 2, C_r / 2)), shown(sideslip),
        ),
        Line(
            "2", "sideslip from yaw rate and a_y, degrees (likewise)",
            shown(sensed_sideslip(C_r, yaw_rate, a_y)), shown(sensed_sideslip(C_r / 2, yaw_rate, a_y)), shown(sideslip),
        ),
    ]  # fmt: skip


def _place() -> list[Line]:
    """Eq 17: the position of the centre of gravity from a steady turn."""
    car, (C_f, C_r), (_, yaw_rate, a_y) = numbers_of(), _stiffnesses(), steady_turn()
    share = lambda sign: (
        (1 + C_f / ((car.mass or 0.0) * a_y) * (car.wheelbase * yaw_rate / SPEED + sign * STEER)) / (C_f / C_r + 1)
    )
    return [Line("17", "l_f / l", share(1), share(-1), car.front_axle_to_cg / car.wheelbase)]


K, K_A, LIMIT = 50000.0, 35000.0, 3000.0
"""Slip stiffness (N), cornering stiffness (N/rad) and friction times load (N) of a wheel."""


def braking(ratio: float, slip_angle: float, printed: bool) -> float:
    """Eq 4: the braking force of a wheel (N) at a slip ratio (positive: braking) and a slip angle (rad)."""
    across = (ratio if printed else 1.0) * K_A * math.tan(slip_angle)
    H = math.hypot(ratio * K, across) / ((1 - ratio) * LIMIT)
    full = ratio / (1 - ratio) * K
    if H <= 0.5 and not printed:
        return full
    return full * (1 / H - 1 / (4 * H**2))


def _slip_checks() -> list[Line]:
    """Eq 4 at small slip, where the force is nearly `K lambda`, and with a slip angle; the reference is the library's HSRI
    tyre."""
    tyre, lines = tyres.HSRI(K, K_A), []
    for what, ratio, degrees in (("rolling straight", 0.01, 0.0), ("at 5 degrees", 0.05, 5.0)):
        angle = math.radians(degrees)
        contact = tyres.Contact(slip_angle=jnp.asarray(angle), slip_ratio=jnp.asarray(-ratio), load=jnp.asarray(LIMIT))
        both = braking(ratio, angle, True), braking(ratio, angle, False)
        lines.append(Line("4", f"braking force at slip {ratio:g}, {what}, N", *both, -float(tyre.forces(contact).F_x)))
    return lines


def _sign() -> list[Line]:
    """Eq 5 at one slip angle; the reference is the library's parabolic tyre, whose slip angles are those of eqs 6 and 7."""
    alpha = 0.03
    force = K_A * alpha - K_A**2 * alpha**2 / (4 * LIMIT)
    contact = tyres.Contact(slip_angle=jnp.asarray(alpha), load=jnp.asarray(LIMIT))
    should = float(tyres.Parabolic(K_A).forces(contact).F_y)
    return [Line("5", f"F_y at a slip angle of {alpha:g} rad, N", -force, force, should)]


def _rear() -> list[Line]:
    """Eq 15: the rear axle's force does not depend on the steer."""
    car, a_y, steer = numbers_of(), 5.0, 0.3
    force = car.front_axle_to_cg * (car.mass or 0.0) * a_y / car.wheelbase
    return [Line("15", "F_yr at 5 m/s^2 and 0.3 rad of steer, N", force / math.cos(steer), force, force)]
