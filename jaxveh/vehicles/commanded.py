"""Any vehicle with the inputs steer and speed, commanded by steering rate and acceleration instead."""

from __future__ import annotations

import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh._core.names import check_names, record, record_type
from jaxveh._core.parts import check_parts
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import AbstractVehicle, with_batch_shape
from jaxveh.vehicles.limits import AccelerationLimits, SteerLimits
from jaxveh.vehicles.wheels import gravity

OWN = ("steer", "v_x")
KNOWN = (*OWN, "a_x", "v_x_rate", "steer_rate")
"""The inputs that the vehicle inside a `Commanded` may have."""


class Commanded(AbstractVehicle):
    """`vehicle` with `steer` (rad) and `v_x` (m/s) as its first two states: the form of CommonRoad's KS, KST and ST models
    (Althoff & Würsching, CommonRoad: Vehicle Models, 2020), and of many planners.

        dsteer/dt = steer_rate,    dv_x/dt = acceleration

    Both are limited by `steer_limits` and `acceleration_limits` if these are given. If the vehicle has the inputs `v_x_rate` or
    `steer_rate`, they are the limited ones. If it has the input `a_x`, that is the signal of an accelerometer,
    `dv_x/dt - v_y yaw_rate` less gravity along the road.

    **Inputs**: `steer_rate` (rad/s at the road wheels) and `acceleration` (m/s^2). The outputs also have `steer`, `steer_rate`
    and `v_x_rate`, with limits applied, unless the vehicle has them itself.

    **Raises** `InputError` unless the vehicle has the inputs `steer` and `v_x`, and optionally `a_x`, `v_x_rate`, `steer_rate`.
    """

    vehicle: AbstractVehicle
    steer_limits: SteerLimits | None = None
    acceleration_limits: AccelerationLimits | None = None

    def __check_init__(self):
        check_parts(self)
        inputs = self.vehicle.inputs
        if not set(OWN) <= set(inputs) <= set(KNOWN):
            raise InputError(
                f"Commanded.vehicle has the inputs {', '.join(inputs)}: "
                "must be steer and v_x, and optionally a_x, v_x_rate, steer_rate."
            )

    @property
    def inputs(self):
        return ("steer_rate", "acceleration")

    @property
    def state_type(self):
        """`steer`, `v_x`, then the states of the vehicle."""
        return record_type("CommandedState", (*OWN, *self.vehicle.state_type._fields))

    @property
    def units(self):
        own = {"steer": "rad", "v_x": "m/s", "steer_rate": "rad/s"}
        return own | dict.fromkeys(("acceleration", "v_x_rate"), "m/s^2") | self.vehicle.units

    @property
    def wheel_positions(self):
        return self.vehicle.wheel_positions

    def motion(self, x, u):
        return self.vehicle.motion(self._inner(x), self._inputs(x, u, LEVEL))

    def start(self, t, u, **values):
        """Straight running; `v_x` is the speed (m/s), 0 unless given."""
        check_names("start", values, self.state_type._fields)
        zero = jnp.zeros_like(u.steer_rate)
        own = [jnp.asarray(values.get(name, zero), jnp.result_type(zero)) for name in OWN]
        given = record("Given", {"steer": own[0], "v_x": own[1], **dict.fromkeys(KNOWN[2:], zero)})
        return self.state_type(*own, *self.vehicle.start(t, given, **{k: v for k, v in values.items() if k not in OWN}))

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        inner = self._inputs(x, u, ground)
        steer_rate, v_x_rate = self._limit_commands(x, u)
        rates, outputs = self.vehicle.evaluate(t, self._inner(x), inner, ground)
        own = {"steer": x.steer, "steer_rate": steer_rate, "v_x_rate": v_x_rate}
        shown = record("CommandedOutputs", own | outputs._asdict())
        return self.state_type(steer_rate, v_x_rate, *rates), with_batch_shape(shown)

    def _inner(self, x):
        return self.vehicle.state_type(*x[len(OWN) :])

    def _limit_commands(self, x, u):
        steer_rate = u.steer_rate if self.steer_limits is None else self.steer_limits.limit(x.steer, u.steer_rate)
        wished, limits = u.acceleration, self.acceleration_limits
        return steer_rate, wished if limits is None else limits.limit(x.v_x, wished)

    def _inputs(self, x, u, ground: Ground):
        """The inputs of the vehicle inside."""
        steer_rate, v_x_rate = self._limit_commands(x, u)
        known = {"steer": x.steer, "v_x": x.v_x, "a_x": v_x_rate, "v_x_rate": v_x_rate, "steer_rate": steer_rate}
        told = record("CommandedInputs", {name: known[name] for name in self.vehicle.inputs})
        if "a_x" not in told._fields:
            return told
        moves = self.vehicle.motion(self._inner(x), told)
        return told._replace(a_x=v_x_rate - moves.v_y * moves.yaw_rate - gravity(ground)[0])
