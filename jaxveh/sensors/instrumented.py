"""A vehicle with its sensors as one differential equation, used by simulations and estimators alike."""

from __future__ import annotations

from typing import Any

import equinox as eqx

from jaxveh._core.errors import check_kind
from jaxveh._core.names import check_names, record_type
from jaxveh._core.parameter import UNNAMED
from jaxveh.sensors.sensor_set import SensorSet
from jaxveh.vehicles import AbstractVehicle


class Instrumented(eqx.Module):
    """A vehicle and the sensors on it: the state is the vehicle's, followed by those of the sensors' low-pass.

    It is elementwise, like the vehicle. `Propagate(Instrumented.derivatives)` is its transition in a filter. Without
    sensors it is the vehicle only, without measurements.

    **Raises** `InputError` for what is no vehicle, or no set of sensors.
    """

    vehicle: AbstractVehicle = eqx.field(metadata=UNNAMED)
    sensors: SensorSet | None = None

    def __check_init__(self):
        check_kind("Instrumented.vehicle", self.vehicle, AbstractVehicle, "Such as vehicles.passenger_car().")
        if self.sensors is not None:
            check_kind("Instrumented.sensors", self.sensors, SensorSet, "Such as sensors.esc().")

    @property
    def inputs(self) -> tuple[str, ...]:
        """The fields that `u` must have."""
        return self.vehicle.inputs

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of the measured channels."""
        return () if self.sensors is None else self.sensors.channels

    @property
    def state_type(self) -> Any:
        """The state's NamedTuple class: the vehicle's own if the sensors have no states."""
        own, filters = self.vehicle.state_type, self._filters
        return own if filters is None else record_type("InstrumentedState", (*own._fields, *filters.filter_names))

    def start(self, t: Any, u: Any, **values: Any) -> Any:
        """The vehicle's initial state (fields can be replaced by keyword), with the low-pass settled at its outputs."""
        check_names("start", values, self.state_type._fields)
        own = self.vehicle.state_type._fields
        vehicle = self.vehicle.start(t, u, **{name: value for name, value in values.items() if name in own})
        if self._filters is None:
            return vehicle
        state = self.state_type(*vehicle, *self._filters.start(self.vehicle.outputs(t, vehicle, u)))
        return state._replace(**{name: value for name, value in values.items() if name not in own})

    def derivatives(self, t: Any, x: Any, u: Any) -> Any:
        """The state's time derivative, as the same NamedTuple; forces are computed once."""
        vehicle, filters = self.split(x)
        rates, outputs = self.vehicle.evaluate(t, vehicle, u)
        if self._filters is None:
            return rates
        return self.state_type(*rates, *self._filters.derivatives(filters, outputs))

    def see(self, t: Any, x: Any, u: Any) -> tuple[Any, Any]:
        """The vehicle's outputs, and the measurements of the sensors without noise (None without sensors)."""
        vehicle, filters = self.split(x)
        outputs = self.vehicle.outputs(t, vehicle, u)
        return outputs, None if self.sensors is None else self.sensors.measure(outputs, filters)

    def observation(self, t: Any, x: Any, u: Any) -> Any:
        """The measurements without noise: a NamedTuple by channel (None without sensors)."""
        return self.see(t, x, u)[1]

    def outputs(self, t: Any, x: Any, u: Any) -> Any:
        """The vehicle's outputs."""
        return self.see(t, x, u)[0]

    def split(self, x: Any) -> tuple[Any, Any]:
        """The vehicle's state and the states of the low-pass (None without one)."""
        own = self.vehicle.state_type
        n = len(own._fields)
        return own(*x[:n]), None if self._filters is None else self._filters.filter_type(*x[n:])

    @property
    def _filters(self) -> SensorSet | None:
        """The sensors if they have states of their own, otherwise None."""
        return None if self.sensors is None or self.sensors.low_pass is None else self.sensors
