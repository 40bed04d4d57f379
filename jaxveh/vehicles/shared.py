"""Parameters that several kinds of cars share, each declared once. They are keyword arguments."""

from __future__ import annotations

import abc
from dataclasses import KW_ONLY
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_positive, word_for
from jaxveh._core.names import check_names, record, record_type
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.tyres import AbstractTyre
from jaxveh.vehicles.axles import AxleTyres
from jaxveh.vehicles.base import AbstractVehicle, with_batch_shape
from jaxveh.vehicles.small_size import small_size
from jaxveh.vehicles.steering import AbstractSteeredByRoadWheels

CRAWL = 3.0
"""The speed below which the slips of a full-size car are regularised by default, m/s."""


class AbstractPlaneBody(AbstractVehicle):
    """A car whose planar motion is that of one mass.

    **Parameters** of the body: `mass` (kg) and `yaw_inertia` (kg m^2) of the whole car.
    """

    _: KW_ONLY
    mass: jax.Array = positive("kg")
    yaw_inertia: jax.Array = positive("kg m^2")


class AbstractTwoAxle(AbstractSteeredByRoadWheels):
    """A car with two axles.

    **Parameters** of the axles: `front_axle_to_cg`, `rear_axle_to_cg` (m, from the centre of gravity), and `crawl_speed` (m/s),
    below which slips are regularised: by default 3 m/s, in a car with a wheelbase of less than 2 m times the root of its
    wheelbase over 2 m (Froude's law).

    **Raises** `InputError` for parameters outside their domain.
    """

    _: KW_ONLY
    front_axle_to_cg: jax.Array = positive("m")
    rear_axle_to_cg: jax.Array = positive("m")
    crawl_speed: float | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        check_parameters(self)
        if self.crawl_speed is not None:
            check_positive(f"{type(self).__name__}.crawl_speed", self.crawl_speed, "m/s")

    @property
    def slip_floor(self) -> float | jax.Array:
        """The speed below which slips are regularised, m/s: `crawl_speed` or its default."""
        return CRAWL * small_size(self.wheelbase) if self.crawl_speed is None else self.crawl_speed

    @property
    def wheelbase(self) -> jax.Array:
        """The distance between the axles, m."""
        return self.front_axle_to_cg + self.rear_axle_to_cg


class AbstractOneTrack(AbstractTwoAxle, AbstractPlaneBody):
    """A car on one track: the wheels of each axle lie in its middle."""

    @property
    def wheel_positions(self):
        front, rear = (self.front_axle_to_cg, 0.0), (-self.rear_axle_to_cg, 0.0)
        return front, front, rear, rear


class AbstractOnTyres(AbstractTwoAxle):
    """A car with tyres, which may have states of their own.

    **Parameters** of the tyres: `front` and `rear`, the tyre of one wheel of each axle; for a car on one track that of the
    whole axle.

    **Raises** `InputError` for a tyre that is not a tyre of `jaxveh.tyres`.
    """

    _: KW_ONLY
    front: AbstractTyre
    rear: AbstractTyre

    def __check_init__(self):
        for name in ("front", "rear"):
            tyre = getattr(self, name)
            if not isinstance(tyre, AbstractTyre):
                kind = type(self).__name__
                raise InputError(f"{kind}.{name} = {word_for(tyre)}: must be a tyre of jaxveh.tyres.")

    @property
    @abc.abstractmethod
    def tyres(self) -> Any:
        """The tyres of the wheels (`Tyres`), or on one track those of the axles (`AxleTyres`)."""

    @property
    @abc.abstractmethod
    def own_states(self) -> tuple[str, ...]:
        """The names of all states except those of dynamic tyres."""

    @abc.abstractmethod
    def contacts(self, x: Any, u: Any, ground: Ground = LEVEL) -> Any:
        """The contacts of the wheels (or axles) with the road, as the tyres need them."""

    def at_rest(self, v_x: Any) -> dict[str, Any]:
        """Own states that are not zero in straight running at `v_x` (m/s), by name; none unless a vehicle overrides this."""
        del v_x
        return {}

    @property
    def state_type(self):
        """`own_states`, then the states of dynamic tyres: `fl_<name>` ..., or on one track `front_<name>`, `rear_<name>`."""
        return record_type(f"{type(self).__name__}State", (*self.own_states, *self.tyres.state_names))

    def start(self, t, u, **values):
        """Straight running with dynamic tyres in their steady state. If the speed is a state, it is `v_x` (m/s), by default 0."""
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
        """Rates and outputs, given by name, in the form that `evaluate` returns."""
        return self.state_type(*rates), with_batch_shape(record(f"{type(self).__name__}Outputs", outputs))


class AbstractOnAxleTyres(AbstractOnTyres, AbstractOneTrack):
    """A car on one track with one tyre law per axle."""

    @property
    def tyres(self) -> AxleTyres:
        return AxleTyres(self.front, self.rear)
