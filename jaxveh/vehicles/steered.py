"""Any vehicle with a steering wheel: ratio and compliance of the steering, and the driver's torque."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, word_for
from jaxveh._core.names import as_mapping, check_names, record, record_type
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import AbstractVehicle, with_batch_shape


class Steered(AbstractVehicle):
    """`vehicle` with a steering wheel: the input `steer` is replaced by `steering_wheel` (rad, positive to the left).

    Without a `compliance` the steering is rigid: the angle of the road wheels is `steering_wheel / ratio`, without states. With a
    compliance the road wheels turn about their steering axes against the spring of column and rack, `k = 1 / compliance`. Their
    angle delta is the state `steer`, so that there is no algebraic loop (M. Abe, Vehicle Handling Dynamics, ch. 5):

        first order  (no `inertia`):  C ddelta/dt = k (steering_wheel / ratio - delta) + M
        second order, `steer_rate`:   J d2delta/dt2 = k (steering_wheel / ratio - delta) + M - C ddelta/dt
        M = sum over the front wheels of (M_z - trail F_y)

    M is the aligning moment about the steering axes; for a vehicle on one track it is that of the axle. For a vehicle without an
    aligning moment among its outputs (`SingleTrack`) `trail` must include the pneumatic trail of the tyres.

    The driver's `steering_torque` (N m, positive to the left) is the spring's moment over ratio and assistance,
    `k (steering_wheel / ratio - delta) / (ratio (1 + assist))`. For a rigid steering `-M` replaces the spring's moment.

    **Parameters**: `ratio` (-), `compliance` (rad per N m at the road wheels, both together), `damping` (N m s/rad) and `inertia`
    (kg m^2) of the road wheels with rack and column about the steering axes, `trail` (m, the distance of the contact behind the
    steering axis), `assist` (-, the torque of the power assistance over the driver's).

    **Outputs** also have `steering_wheel`, `steer` and, if the vehicle has front lateral forces among its outputs,
    `steering_torque`.

    **Raises** `InputError` for a vehicle without the input `steer`, parameters outside their domain, an inertia without a
    compliance, or a compliance for a vehicle without a front lateral force among its outputs.
    """

    vehicle: AbstractVehicle
    ratio: jax.Array = positive("-")
    compliance: jax.Array | None = positive("rad/(N m)", default=None)
    damping: jax.Array = positive("N m s/rad", default=300.0)
    inertia: jax.Array | None = positive("kg m^2", default=None)
    trail: jax.Array = parameter("m", scale=0.03, default=0.0)
    assist: jax.Array = parameter("-", scale=1.0, default=0.0)
    # Separate from the parameters, because those may be removed from the model while they are estimated.
    own_states: tuple[str, ...] = eqx.field(static=True, default=())

    def __init__(self, vehicle, ratio, compliance=None, damping=300.0, inertia=None, trail=0.0, assist=0.0):
        self.vehicle, self.ratio, self.compliance, self.damping = vehicle, ratio, compliance, damping
        self.inertia, self.trail, self.assist = inertia, trail, assist
        self.own_states = () if compliance is None else ("steer",) if inertia is None else ("steer", "steer_rate")

    def __check_init__(self):
        if not isinstance(self.vehicle, AbstractVehicle):
            raise InputError(f"Steered.vehicle = {word_for(self.vehicle)}: must be a vehicle of jaxveh.vehicles.")
        if "steer" not in self.vehicle.inputs:
            raise InputError(
                f"Steered.vehicle = {word_for(self.vehicle)}: its inputs are {', '.join(self.vehicle.inputs)}; "
                "steer must be one of them."
            )
        check_parameters(self)
        check("Steered.assist", self.assist, lambda v: v >= 0, "at least 0")
        if self.inertia is not None and self.compliance is None:
            raise InputError("Steered.compliance = None: must be given (rad/(N m)) together with an inertia.")

    @property
    def inputs(self):
        return tuple("steering_wheel" if name == "steer" else name for name in self.vehicle.inputs)

    @property
    def state_type(self):
        """The vehicle's states, then `steer` (rad) with a compliance and `steer_rate` (rad/s) with an inertia."""
        return record_type("SteeredState", (*self.vehicle.state_type._fields, *self.own_states))

    @property
    def units(self):
        own = {"steering_wheel": "rad", "steer": "rad", "steer_rate": "rad/s", "steering_torque": "N m"}
        return self.vehicle.units | own

    @property
    def wheel_positions(self):
        return self.vehicle.wheel_positions

    def motion(self, x, u):
        return self.vehicle.motion(*self._inner(x, u))

    def start(self, t, u, **values):
        """The vehicle's start with the road wheels at `steering_wheel / ratio`."""
        check_names("start", values, self.state_type._fields)
        steer = values.get("steer", u.steering_wheel / self.ratio)
        rest = {name: value for name, value in values.items() if name not in self.own_states}
        inner = self.vehicle.start(t, _steering(u, steer), **rest)
        own = {"steer": steer, "steer_rate": values.get("steer_rate", 0.0)}
        return self.state_type(*inner, *[numerics.as_wide_as(own[name], inner[0]) for name in self.own_states])

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        inner_x, inner_u = self._inner(x, u)
        rates, outputs = self.vehicle.evaluate(t, inner_x, inner_u, ground)
        moment = _aligning_moment(outputs, self.trail)
        shown = outputs._asdict() | {"steering_wheel": u.steering_wheel}
        shown.setdefault("steer", inner_u.steer)
        own = ()
        if self.own_states:
            if moment is None:
                raise InputError(
                    f"Steered.vehicle = {word_for(self.vehicle)}: has no front lateral force among its outputs "
                    "to deflect the steering; compliance must be None."
                )
            spring = (u.steering_wheel / self.ratio - x.steer) / self.compliance
            own = self._steering_rates(x, spring + moment)
            moment = -spring
        if moment is not None:
            shown["steering_torque"] = -moment / (self.ratio * (1.0 + self.assist))
        return self.state_type(*rates, *own), with_batch_shape(record("SteeredOutputs", shown))

    def _steering_rates(self, x, moment) -> tuple:
        if "steer_rate" not in self.own_states:
            return (moment / self.damping,)
        return x.steer_rate, (moment - self.damping * x.steer_rate) / self.inertia

    def _inner(self, x, u):
        steer = u.steering_wheel / self.ratio if not self.own_states else x.steer
        inner = self.vehicle.state_type(*x[: len(x) - len(self.own_states)])
        return inner, _steering(u, steer)


def _steering(u: Any, steer: Any) -> Any:
    """The vehicle's own inputs: the angle of the road wheels instead of that of the steering wheel."""
    given = {"steer" if name == "steering_wheel" else name: value for name, value in as_mapping(u).items()}
    return record("Inputs", given | {"steer": steer})


def _aligning_moment(outputs: Any, trail: Any) -> Any:
    """The moment of the road on the front wheels about their steering axes, N m; None if the vehicle has no such outputs."""
    if hasattr(outputs, "F_y_fl"):
        return (outputs.M_z_fl + outputs.M_z_fr) - trail * (outputs.F_y_fl + outputs.F_y_fr)
    if hasattr(outputs, "F_yf"):
        return getattr(outputs, "M_zf", 0.0) - trail * outputs.F_yf
    return None
