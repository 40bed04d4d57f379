"""Manoeuvres by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax

from jaxveh._core.errors import check_key, check_one_of
from jaxveh.manoeuvres.base import AbstractManoeuvre, check_drive
from jaxveh.manoeuvres.braking import braking_in_a_turn, mu_jump_braking
from jaxveh.manoeuvres.courses import iso_lane_change, iso_obstacle_avoidance, slalom_course, steady_circle
from jaxveh.manoeuvres.cruise import cruise
from jaxveh.manoeuvres.driver import AbstractDriver
from jaxveh.manoeuvres.options import check_options
from jaxveh.manoeuvres.random_steering import random_steering
from jaxveh.manoeuvres.standard_steering import ramp_steer, sine_with_dwell, slalom
from jaxveh.manoeuvres.steering import double_lane_change, step_steer, swept_sine


class DriveSettings(NamedTuple):
    """The settings of a named manoeuvre: `speed` (m/s), `steer` (rad at the road wheels), `options` by name, `key`."""

    speed: float
    steer: float
    options: dict
    key: jax.Array


class NamedManoeuvre(NamedTuple):
    """A named manoeuvre.

    `make`: the function that makes it; `help`: one line about it; `closed_loop`: whether its driver uses feedback;
    `pedals`: whether its inputs include pedals.
    """

    make: Callable[[DriveSettings], AbstractManoeuvre | AbstractDriver]
    help: str
    closed_loop: bool = False
    pedals: bool = False


MANOEUVRES: dict[str, NamedManoeuvre] = {
    "double-lane-change": NamedManoeuvre(
        lambda d: double_lane_change(d.speed, d.steer, **d.options), "one sine period of steer and its mirror image, open loop"
    ),
    "step-steer": NamedManoeuvre(lambda d: step_steer(d.speed, d.steer, **d.options), "a steer step (ISO 7401)"),
    "swept-sine": NamedManoeuvre(
        lambda d: swept_sine(d.speed, d.steer, **d.options), "sine steer with rising frequency (ISO 7401)"
    ),
    "sine-with-dwell": NamedManoeuvre(
        lambda d: sine_with_dwell(d.speed, d.steer, **d.options), "0.7 Hz sine steer, held at its second peak (FMVSS 126)"
    ),
    "ramp-steer": NamedManoeuvre(
        lambda d: ramp_steer(d.speed, d.steer, **d.options), "slowly growing steer at constant speed (ISO 4138)"
    ),
    "slalom": NamedManoeuvre(lambda d: slalom(d.speed, d.steer, **d.options), "sine periods of steer, open loop"),
    "random-steering": NamedManoeuvre(
        lambda d: random_steering(d.speed, d.steer, d.key, **d.options), "random steer in a band (ISO 7401); steer is its std"
    ),
    "braking-in-a-turn": NamedManoeuvre(
        lambda d: braking_in_a_turn(d.speed, d.steer, **d.options), "braking with constant steer (ISO 7975)", pedals=True
    ),
    "mu-jump-braking": NamedManoeuvre(
        lambda d: mu_jump_braking(d.speed, **d.options), "braking straight ahead, for roads mu-jump and split-mu", pedals=True
    ),
    "cruise": NamedManoeuvre(
        lambda d: cruise(d.speed, d.key, **d.options), "straight ahead, varying speed and pedals, for mass and grade", pedals=True
    ),
    "iso-lane-change": NamedManoeuvre(
        lambda d: iso_lane_change(d.speed, **d.options), "double lane change between cones (ISO 3888-1)", closed_loop=True
    ),
    "iso-obstacle-avoidance": NamedManoeuvre(
        lambda d: iso_obstacle_avoidance(d.speed, **d.options), "obstacle avoidance between cones (ISO 3888-2)", closed_loop=True
    ),
    "slalom-course": NamedManoeuvre(
        lambda d: slalom_course(d.speed, **d.options), "slalom between cones, closed loop", closed_loop=True
    ),
    "steady-circle": NamedManoeuvre(
        lambda d: steady_circle(to_speed=d.speed, **d.options), "a circle at slowly rising speed (ISO 4138)", closed_loop=True
    ),
}  # fmt: skip
"""Manoeuvres by name, for programs: each is made from speed, steer, options and a key, as far as it needs them."""


def named_manoeuvre(
    name: str, speed: float, steer: float = 0.05, key: jax.Array | None = None, **options
) -> AbstractManoeuvre | AbstractDriver:
    """The manoeuvre or driver of this name in `MANOEUVRES`.

    `speed` (m/s; for "steady-circle" the final speed), `steer` (rad at the road wheels, if the manoeuvre has one), `key`: for
    random manoeuvres (default `jax.random.key(0)`), `options`: keyword arguments of its function, such as `duration`.

    **Raises** `InputError` for an unknown name or option, with a list of the known ones, and as its function does.
    """
    check_one_of("manoeuvre", name, MANOEUVRES)
    check_options(name, options)
    if key is not None:
        check_key("named_manoeuvre", key)
    check_drive(speed, 1.0, steer)
    return MANOEUVRES[name].make(DriveSettings(speed, steer, options, jax.random.key(0) if key is None else key))
