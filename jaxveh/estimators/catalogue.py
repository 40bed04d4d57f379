"""All methods of all quantities as text: description, source, channels, and the keys of the car's file that each method needs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.estimators.method import AbstractMethod, AbstractSmoothable
from jaxveh.estimators.method_of_car import MethodOfCar
from jaxveh.io import AxleTyre, CarSpecification

FULL_CAR = CarSpecification(
    mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.5, front_cornering_stiffness=1.1e5,
    rear_cornering_stiffness=1.3e5, name="every key", cg_height=0.55, track_front=1.5, track_rear=1.5, steering_ratio=16.0,
    steer_offset=0.0, steering="front", rear_steer_ratio=0.0, rear_steer_ratio_fast=0.0, rear_steer_speed=20.0,
    sensor_position=(0.0, 0.0, 0.0), reference_position=(0.0, 0.0, 0.0), low_pass=20.0, wheel_radius=0.32,
    wheel_inertia=1.2, drag=0.4, rolling_resistance=0.012, front_drive=1.0, front_brake=0.65, brake_torque_per_pressure=1.6e-3,
    antenna_position=(-0.5, 0.0, 0.9), satellite_delay=0.15, inertial_delay=0.01, camera_delay=0.08,
    roll_gradient=0.006, roll_frequency=1.6, roll_damping=0.3, pitch_gradient=0.004,
    front=AxleTyre(B=8.0, C=1.3, D=9000.0, E=-0.5), rear=AxleTyre(B=12.0, C=1.3, D=8300.0, E=-0.5),
)  # fmt: skip
"""A car's file with every key, of which one at a time is left out or changed to find the methods that need or use it."""


REAR_STEER = {"rear_steer_ratio": -0.2, "rear_steer_ratio_fast": 0.1, "rear_steer_speed": 20.0}
"""Keys of a car whose rear wheels are steered in a ratio to the front wheels, and their values in one."""


def catalogue(quantities: Mapping[str, ModuleType]) -> str:
    """A Markdown table per quantity. For each method: its name (the recommended one in bold), description, source, the channels
    that it reads (optional ones in brackets), and the optional keys of the car's file that it needs. A last table has the keys
    that the recommended methods use."""
    parts = []
    for name, module in quantities.items():
        shown = ", ".join(f"`{field}` ({unit})" for field, unit in module.SHOWN.items())
        lines = [f"## {name}", "", f"Shown: {shown}.", "", "| method | what it is | from | reads | asks for |"]
        lines += ["| --- | --- | --- | --- | --- |"]
        lines += [_row(method, one, module) for method, one in module.METHODS.items()]
        parts.append("\n".join(lines))
    return "\n\n".join([*parts, _keys_table(quantities)]) + "\n"


def _keys_table(quantities: Mapping[str, ModuleType]) -> str:
    """A Markdown table of the keys of a car's file: which recommended methods use each."""
    used = {name: keys_used(module.METHODS[module.RECOMMENDED]) for name, module in quantities.items()}
    lines = ["## Keys of the car's file", "", "The recommended methods that use each key.", "", "| key | quantities |"]
    lines += ["| --- | --- |"]
    for entry in dataclasses.fields(CarSpecification):
        names = [name for name, keys in used.items() if entry.name in keys]
        if names:
            lines.append(f"| `{entry.name}` | {'all' if len(names) == len(used) else ', '.join(names)} |")
    return "\n".join(lines)


def keys_asked(method: MethodOfCar) -> tuple[str, ...]:
    """The optional keys of a car's file without which the method cannot be made."""
    optional = [entry.name for entry in dataclasses.fields(CarSpecification) if entry.default is None]
    return tuple(key for key in optional if not _made(method, dataclasses.replace(FULL_CAR, **{key: None})))


def keys_used(method: MethodOfCar, among: Iterable[str] | None = None) -> tuple[str, ...]:
    """The keys of a car's file that the method uses, of all keys or those `among`: for other values of them it has other numbers,
    or is another method. Names and words are not among them."""
    wanted = [entry.name for entry in dataclasses.fields(FULL_CAR)] if among is None else list(among)
    steered = dataclasses.replace(FULL_CAR, steering="four-wheel", **REAR_STEER)
    used = []
    for car, keys in (
        (FULL_CAR, set(wanted) - {*REAR_STEER}),
        (steered, {*REAR_STEER} if method.any_steering else set()),
    ):
        made = method.make(car)
        values = {key: getattr(car, key) for key in keys}
        numbers = {key: value for key, value in values.items() if not (value is None or isinstance(value, str))}
        other = lambda key, car=car, values=values: dataclasses.replace(car, **{key: _another(values[key])})
        used += [key for key in numbers if not _same(made, method.make(other(key)))]
    return tuple(key for key in wanted if key in used)


def _another(value: Any) -> Any:
    """A slightly different value of a key."""
    if isinstance(value, tuple):
        return tuple(one + 0.1 for one in value)
    if isinstance(value, AxleTyre):
        return dataclasses.replace(value, D=0.95 * value.D)
    return 0.95 * value + (1e-3 if value == 0.0 else 0.0)


def _same(one: AbstractMethod, other: AbstractMethod) -> bool:
    """Whether two methods are of one structure and have the same numbers."""
    numbers = [jax.tree.leaves(eqx.filter(method, eqx.is_array)) for method in (one, other)]
    plain = lambda leaf: jax.random.key_data(leaf) if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key) else leaf
    return jax.tree.structure(one) == jax.tree.structure(other) and all(
        np.array_equal(plain(a), plain(b)) for a, b in zip(*numbers, strict=True)
    )


def _made(method: MethodOfCar, car: CarSpecification) -> bool:
    try:
        method.make(car)
    except InputError:
        return False
    return True


def _row(name: str, method: MethodOfCar, module: ModuleType) -> str:
    made = method.of_centre(FULL_CAR)
    needs = made.needs
    more = ["can be smoothed"] if isinstance(made, AbstractSmoothable) else []
    more += ["rear wheels may be steered"] if method.any_steering else []
    help = f"{method.help} ({'; '.join(more)})" if more else method.help
    reads = [f"[{need.channel}]" if need.optional else need.channel for need in needs]
    shown = f"**{name}**" if name == module.RECOMMENDED else name
    asked = ", ".join(keys_asked(method)) or "nothing more"
    return f"| {shown} | {help} | {method.source} | {', '.join(_short(reads))} | {asked} |"


def _short(channels: list[str]) -> list[str]:
    """The channels with those of the four wheels combined into one."""
    found: list[str] = []
    for channel in channels:
        plain = channel.strip("[]")
        stem, _, corner = plain.rpartition("_")
        if corner in ("fl", "fr", "rl", "rr") and stem:
            channel = channel.replace(plain, f"{stem}_*")
        if channel not in found:
            found.append(channel)
    return found
