"""Any vehicle with its position in the world, on a road that changes with the position."""

from __future__ import annotations

from jaxveh import numerics
from jaxveh._core.errors import InputError, word_for
from jaxveh._core.names import check_names, record, record_type
from jaxveh._core.parts import check_parts
from jaxveh.roads import LEVEL, AbstractRoad, Ground, under
from jaxveh.vehicles.base import AbstractVehicle, Motion, with_batch_shape

PLACE = ("x", "y")


class Travelling(AbstractVehicle):
    """`vehicle` with its position `x`, `y` (m, world) as the first two states.

        dx/dt = v_x cos(yaw) - v_y sin(yaw),    dy/dt = v_x sin(yaw) + v_y cos(yaw)

    With a `road` (`jaxveh.roads`) each wheel has the friction and the height at its own position, and the car the slopes at its
    position. Without a road the ground is the argument of `evaluate`. The outputs also have `x`, `y` and, with a road, `grade`
    and `bank` (rad, in the car's axes), `friction_fl` ... and `height_fl` ...

    **Raises** `InputError` for a road that is not a road of `jaxveh.roads`.
    """

    vehicle: AbstractVehicle
    road: AbstractRoad | None = None

    def __check_init__(self):
        if not (self.road is None or isinstance(self.road, AbstractRoad)):
            raise InputError(f"Travelling.road = {word_for(self.road)}: must be a road of jaxveh.roads, or None.")
        check_parts(self)

    @property
    def inputs(self):
        return self.vehicle.inputs

    @property
    def state_type(self):
        """`x`, `y`, then the states of the vehicle."""
        return record_type("TravellingState", (*PLACE, *self.vehicle.state_type._fields))

    @property
    def units(self):
        own = {**dict.fromkeys(PLACE, "m"), **dict.fromkeys(("grade", "bank"), "rad")}
        of_wheels = {f: "-" if f.startswith("friction") else "m" for f in Ground._fields if f not in own}
        return own | of_wheels | self.vehicle.units

    @property
    def wheel_positions(self):
        return self.vehicle.wheel_positions

    def motion(self, x, u):
        return self.vehicle.motion(self._inner(x), u)._replace(x=x.x, y=x.y)

    def start(self, t, u, **values):
        check_names("start", values, self.state_type._fields)
        inner = self.vehicle.start(t, u, **{name: value for name, value in values.items() if name not in PLACE})
        place = [numerics.as_wide_as(values.get(name, 0.0), inner[0]) for name in PLACE]
        return self.state_type(*place, *inner)

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        inner, moves = self._inner(x), self.motion(x, u)
        if self.road is not None:
            ground = under(self.road, x.x, x.y, moves.yaw, self.wheel_positions)
        rates, outputs = self.vehicle.evaluate(t, inner, u, ground)
        shown = {"x": x.x, "y": x.y, **outputs._asdict()}
        if self.road is not None:
            shown |= ground._asdict()
        return self.state_type(*_velocity(moves), *rates), with_batch_shape(record("TravellingOutputs", shown))

    def _inner(self, x):
        return self.vehicle.state_type(*x[len(PLACE) :])


def _velocity(moves: Motion):
    cosine, sine = numerics.cos(moves.yaw), numerics.sin(moves.yaw)
    return moves.v_x * cosine - moves.v_y * sine, moves.v_x * sine + moves.v_y * cosine
