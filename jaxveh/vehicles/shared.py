"""Parameters that cars of several kinds share, each declared once. They are given by keyword."""

from __future__ import annotations

import abc
from dataclasses import KW_ONLY
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.names import check_names, record, record_type
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.tyres import AbstractTyre
from jaxveh.vehicles.axles import AxleTyres
from jaxveh.vehicles.base import AbstractVehicle, with_batch_shape
from jaxveh.vehicles.steering import AbstractSteeredByRoadWheels


class AbstractPlaneBody(AbstractVehicle):
    """A car that moves as one mass.

    **Parameters** of the body: `mass` (kg) and `yaw_inertia` (kg m^2) of the whole car.
    """

    _: KW_ONLY
    mass: jax.Array = positive("kg")
    yaw_inertia: jax.Array = positive("kg m^2")


class AbstractTwoAxle(AbstractSteeredByRoadWheels):
    """A car on two axles.

    **Parameters** of the axles: `front_axle_to_cg`, `rear_axle_to_cg` (m, from the centre of gravity); slips are regularised
    below `crawl_speed` (m/s).

    **Raises** `InputError` for parameters outside their domain.
    """

    _: KW_ONLY
    front_axle_to_cg: jax.Array = positive("m")
    rear_axle_to_cg: jax.Array = positive("m")
    crawl_speed: float = eqx.field(static=True, default=3.0)

    def __check_init__(self):
        check_parameters(self)
        check_positive(f"{type(self).__name__}.crawl_speed", self.crawl_speed, "m/s")

    @property
    def wheelbase(self) -> jax.Array:
        """Distance between the axles, m."""
        return self.front_axle_to_cg + self.rear_axle_to_cg


class AbstractOneTrack(AbstractTwoAxle, AbstractPlaneBody):
    """A car whose axles have their wheels in the middle."""

    @property
    def wheel_positions(self):
        front, rear = (self.front_axle_to_cg, 0.0), (-self.rear_axle_to_cg, 0.0)
        return front, front, rear, rear


class AbstractOnTyres(AbstractTwoAxle):
    """A car on tyres, which may have states of their own.

    **Parameters** of the tyres: `front` and `rear`, the tyre of a wheel on each axle; of a car on one track the axle's.

    **Raises** `InputError` for a tyre that is none.
    """

    _: KW_ONLY
    front: AbstractTyre
    rear: AbstractTyre

    def __check_init__(self):
        for name in ("front", "rear"):
            tyre = getattr(self, name)
            if not isinstance(tyre, AbstractTyre):
                kind = type(self).__name__
                raise InputError(f"{kind}.{name} = {type(tyre).__name__}: must be a tyre of jaxveh.tyres.")

    @property
    @abc.abstractmethod
    def tyres(self) -> Any:
        """The tyres on the wheels: `Tyres`, or on one track `AxleTyres`."""

    @property
    @abc.abstractmethod
    def own_states(self) -> tuple[str, ...]:
        """Names of all states but those of dynamic tyres."""

    @abc.abstractmethod
    def contacts(self, x: Any, u: Any, ground: Ground = LEVEL) -> Any:
        """How the wheels (or axles) touch the road, as the tyres ask for it."""

    def at_rest(self, v_x: Any) -> dict[str, Any]:
        """Own states that are not zero where the car runs straight at `v_x` (m/s), by name; none unless a car says so."""
        del v_x
        return {}

    @property
    def state_type(self):
        """`own_states`, then the states of dynamic tyres: `fl_<name>` ..., on one track `front_<name>`, `rear_<name>`."""
        return record_type(f"{type(self).__name__}State", (*self.own_states, *self.tyres.state_names))

    def start(self, t, u, **values):
        """Straight running, and dynamic tyres that have settled; a speed that is a state is 0 unless `v_x` (m/s) is given."""
        check_names("start", values, self.state_type._fields)
        dtype = jnp.result_type(self.front_axle_to_cg)
        given = {name: jnp.asarray(value, dtype) for name, value in values.items()}
        told = [jnp.shape(getattr(u, name)) for name in self.steering.inputs]
        zero = jnp.zeros(jnp.broadcast_shapes(*told, jnp.shape(getattr(u, "v_x", 0.0))), dtype)
        rest = self.at_rest(given.get("v_x", zero))
        x = record("Own", {name: given.get(name, zero + rest.get(name, 0.0)) for name in self.own_states})
        settled = self.tyres.start(self.contacts(x, u)) if self.tyres.state_names else ()
        return self.state_type(*x, *settled)._replace(**given)

    def rates_and_outputs(self, rates: tuple, outputs: dict) -> tuple[Any, Any]:
        """Rates and outputs, by name, as `evaluate` gives them."""
        return self.state_type(*rates), with_batch_shape(record(f"{type(self).__name__}Outputs", outputs))


class AbstractOnAxleTyres(AbstractOnTyres, AbstractOneTrack):
    """A car on one track with tyres: an axle's are together one law."""

    @property
    def tyres(self) -> AxleTyres:
        return AxleTyres(self.front, self.rear)
