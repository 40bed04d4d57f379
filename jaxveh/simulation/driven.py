"""A car, its sensors and its driver as one differential equation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxveh._core.errors import InputError
from jaxveh._core.names import record
from jaxveh.manoeuvres import AbstractDriver, AbstractManoeuvre, OpenLoop, SpeedControl, as_driver
from jaxveh.manoeuvres import kit as manoeuvres_kit
from jaxveh.sensors import Instrumented
from jaxveh.statespace import cast
from jaxveh.vehicles import AbstractVehicle, Motion, Steered
from jaxveh.vehicles import kit as vehicles_kit

LEAST = 1e-6
"""Replaces a drag or rolling resistance of zero, for which the driver need not compensate."""


class DrivenState(NamedTuple):
    """The state of the car with its sensors, and the state of its driver."""

    car: Any
    driver: Any


class Driven(eqx.Module):
    """A driven car: `car` with sensors, around a `Travelling`, and the `driver` who sees how it moves."""

    car: Instrumented
    driver: AbstractDriver

    def start(self, t: Any, dtype: Any, **values: Any) -> DrivenState:
        """Straight running at the driver's speed, with the driver settled; keywords replace fields of the car's state."""
        values = {name: jnp.asarray(value, dtype) for name, value in values.items()}
        zero = jnp.zeros((), dtype)
        moves = Motion(*[values.get(name, zero) for name in Motion._fields])
        driver = self.driver.start(t, moves)
        given = self._driver_inputs(t, moves, driver)
        if "v_x" in given._fields and "v_x" not in values:
            moves = moves._replace(v_x=jnp.asarray(given.v_x, dtype))
            if "v_x" in self.car.state_type._fields:
                values["v_x"] = moves.v_x
            driver = self.driver.start(t, moves)
        car = self.car.start(t, self._driver_inputs(t, moves, driver), **values)
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), DrivenState(car, driver))

    def inputs(self, t: Any, x: DrivenState) -> Any:
        """The inputs of the car that the driver gives."""
        return self._inputs(t, x)[0]

    def derivatives(self, t: Any, x: DrivenState) -> DrivenState:
        """The state's time derivative."""
        u, moves = self._inputs(t, x)
        return DrivenState(self.car.derivatives(t, x.car, u), self.driver.derivatives(t, moves, x.driver))

    def see(self, t: Any, x: DrivenState) -> tuple[Any, Any, Any]:
        """Inputs, outputs of the car, and the sensors' measurements without noise (None without sensors)."""
        u = self.inputs(t, x)
        return u, *self.car.see(t, x.car, u)

    def _inputs(self, t, x: DrivenState):
        vehicle, _ = self.car.split(x.car)
        moves = self.car.vehicle.motion(vehicle, _unknown_inputs(self.car.vehicle)) if not self._told_speed else None
        if moves is None:
            # A car whose speed is an input moves as its driver says; the driver gives the speed without seeing it.
            blind = self.car.vehicle.motion(vehicle, _unknown_inputs(self.car.vehicle))
            given = self.driver.inputs(t, blind, x.driver)
            moves = blind._replace(v_x=given.v_x)
        return self._driver_inputs(t, moves, x.driver), moves

    @property
    def _told_speed(self) -> bool:
        return "v_x" in self.car.inputs

    def _driver_inputs(self, t, moves: Motion, driver) -> Any:
        return adapt_inputs(self.car.vehicle, self.driver.inputs(t, moves, driver), moves)


def _unknown_inputs(vehicle: AbstractVehicle) -> Any:
    """Inputs with zeros for values that are still unknown; a motion needs only the speed and the wheels' angles."""
    return record("Unknown", dict.fromkeys(("v_x", "steer", *vehicle.inputs), 0.0))


def adapt_inputs(vehicle: AbstractVehicle, given: Any, moves: Motion) -> Any:
    """The driver's inputs, extended by those that the car needs and that follow from them.

    `steering_wheel` is `steer` times the car's steering ratio. Each of four motors gets a quarter of the torques. If the wheels
    have angles of their own, which a manoeuvre does not give, the front wheels turn by `steer` and the rear ones stay straight.
    The car itself computes the acceleration `a_x` from `v_x_rate`.
    """
    missing = [name for name in vehicle.inputs if name not in given._fields]
    found = {}
    for name in missing:
        if name == "steering_wheel" and "steer" in given._fields:
            found[name] = given.steer * steering_ratio(vehicle)
        elif name in vehicles_kit.wheel_names("torque") and "drive_torque" in given._fields:
            found[name] = 0.25 * (given.drive_torque - given.brake_torque * vehicles_kit.travel_direction(moves.v_x))
        elif name in vehicles_kit.STEER_UNITS and "steer" in given._fields:
            found[name] = given.steer if name in ("steer_fl", "steer_fr") else jnp.zeros_like(given.steer)
    return record("DriverInputs", {**given._asdict(), **found}) if found else given


def steering_ratio(vehicle: Any) -> Any:
    """The steering ratio of a car with a steering wheel: that of the `Steered` among its wrappers."""
    while not isinstance(vehicle, Steered):
        vehicle = vehicle.vehicle
    return vehicle.ratio


def check_inputs(driven: Driven) -> None:
    """Raise `InputError` if the car needs an input that its driver does not give."""
    vehicle, driver = driven.car.vehicle, driven.driver
    moves = _still(vehicle)
    given = eqx.filter_eval_shape(
        lambda: adapt_inputs(vehicle, driver.inputs(0.0, moves, driver.start(0.0, moves)), moves)
    )._fields
    known = (*given, "a_x") if "v_x_rate" in given else given
    missing = [name for name in vehicle.inputs if name not in known]
    if missing:
        raise InputError(
            f"{driver_name(driver)} gives {', '.join(given)}, but {vehicle_name(vehicle)} needs {', '.join(missing)} too: "
            "add the channel to the manoeuvre (or, for a_x, leave the car's cg_height out)."
        )


SEVERAL = "For several drives at once use jax.vmap, e.g. jax.vmap(lambda car: simulate(car, manoeuvre))(cars)."
"""The remedy where numbers have an axis."""


def check_one_drive(what: str, tree: Any, evaluate: Callable[[], Any]) -> None:
    """Raise `InputError` if numbers of the tree have an axis and `evaluate()` then gives no scalars. Tables pass."""
    paths, _ = jtu.tree_flatten_with_path(eqx.filter(tree, eqx.is_inexact_array))
    names = [f"{jtu.keystr(path).strip('.')} has shape {leaf.shape}" for path, leaf in paths if leaf.ndim > 0]
    if not names:
        return
    try:
        one = all(leaf.shape == () for leaf in jax.tree.leaves(eqx.filter_eval_shape(evaluate)))
    except InputError:
        raise
    except (TypeError, ValueError):
        one = False
    if not one:
        raise InputError(f"simulate: {what}: {', '.join(names)}: must be one number each. {SEVERAL}")


def inputs_of(manoeuvre: Any, vehicle: AbstractVehicle) -> Any:
    """The inputs at the start of a manoeuvre."""
    driver, moves = as_driver(manoeuvre), _still(vehicle)
    return driver.inputs(0.0, moves, driver.start(0.0, moves))


def first_motion(driven: Driven) -> DrivenState:
    """The state's derivative at the start."""
    dtype = dtype_of(driven.car.vehicle)
    return driven.derivatives(0.0, driven.start(0.0, dtype))


def vehicle_name(vehicle: Any) -> str:
    """The class name of the car itself, without its wrappers."""
    return type(car_itself(vehicle)).__name__


def dtype_of(vehicle: AbstractVehicle) -> Any:
    """The dtype of the car's parameters, the widest if they differ, which is also that of its states."""
    return jnp.result_type(*jax.tree.leaves(eqx.filter(vehicle, eqx.is_inexact_array)) or [float])


def _still(vehicle: AbstractVehicle) -> Motion:
    return Motion(*[jnp.zeros((), dtype_of(vehicle))] * len(Motion._fields))


def driver_name(driver: Any) -> str:
    """The class name of the manoeuvre itself, without its wrappers."""
    while hasattr(driver, "manoeuvre") or hasattr(driver, "driver"):
        driver = getattr(driver, "manoeuvre", None) or driver.driver
    return type(driver).__name__


def with_pedals(manoeuvre: AbstractManoeuvre | AbstractDriver, vehicle: AbstractVehicle) -> AbstractDriver:
    """The driver of a manoeuvre. The driver works the pedals if the car has them and the manoeuvre gives only a speed, or gives
    torques that are added to those of the pedals."""
    driver = as_driver(manoeuvre)
    moves = _still(vehicle)
    given = eqx.filter_eval_shape(lambda: driver.inputs(0.0, moves, driver.start(0.0, moves)))._fields
    torques = {"drive_torque", *vehicles_kit.wheel_names("torque")}
    own = torques & set(given) and not _adds_to_pedals(driver)
    if not torques & set(vehicle.inputs) or own or "v_x" not in given:
        return driver
    car = car_itself(vehicle)
    control = SpeedControl(
        driver,
        car.mass,
        wheel_radius=car.wheel_radius,
        drag_area=jnp.maximum(car.drag * (2.0 / manoeuvres_kit.AIR_DENSITY), LEAST),
        rolling_resistance=jnp.maximum(car.rolling_resistance, LEAST),
        wheelbase=getattr(car, "wheelbase", None),
    )
    return cast(control, dtype_of(vehicle))


def _adds_to_pedals(driver: AbstractDriver) -> bool:
    return isinstance(driver, OpenLoop) and driver.manoeuvre.adds_to_pedals


def car_itself(vehicle: Any) -> Any:
    """The car without its wrappers."""
    while hasattr(vehicle, "vehicle"):
        vehicle = vehicle.vehicle
    return vehicle
