"""What ends a simulation before its time: standstill, a wheel that lifts."""

from __future__ import annotations

from collections.abc import Callable

import diffrax
import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_positive
from jaxveh.simulation.driven import Driven
from jaxveh.simulation.falling import Falling
from jaxveh.vehicles import kit


class Event(eqx.Module):
    """Ends a simulation when `condition(driven, t, x)`, a real number, falls through zero.

    `condition` sees the `Driven` car, the time and its `DrivenState`; `name` is what the recording's source says.
    """

    condition: Callable = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def of_solver(self, tolerance: float) -> diffrax.Event:
        """The same for diffrax; the instant is found to `tolerance` (s)."""

        def crossing(t, y, args, **_):
            # diffrax compares it with a number of the default precision, whatever that of the car is. Looked at and kept for
            # the next step it must be one number: rounded in two ways, a fall that ends a step would be seen by neither.
            return numerics.fence(jnp.asarray(self.condition(args, t, y), float), firm=True)

        return diffrax.Event(crossing, Falling(tolerance=tolerance), direction=False)


def standstill(speed: float = 0.1) -> Event:
    """The car's forward speed falls below `speed` (m/s). **Raises** `InputError` for a speed that is not positive."""
    check_positive("standstill: speed", speed, "m/s")
    return Event(_Slower(float(speed)), f"standstill (below {speed:g} m/s)")


def wheel_lift(load: float = 1.0) -> Event:
    """The load of any wheel falls below `load` (N). **Raises** `InputError` for a load that is not positive.

    The car must have loads a wheel (`load_fl` ...); looking at them computes the tyres' forces once more a step.
    """
    check_positive("wheel_lift: load", load, "N")
    return Event(_Lighter(float(load)), f"wheel lift (below {load:g} N)")


class _Slower(eqx.Module):
    speed: float = eqx.field(static=True)

    def __call__(self, driven: Driven, t, x):
        u = driven.inputs(t, x)
        return jnp.abs(driven.car.vehicle.motion(driven.car.split(x.car)[0], u).v_x) - self.speed


class _Lighter(eqx.Module):
    load: float = eqx.field(static=True)

    def __call__(self, driven: Driven, t, x):
        outputs = driven.see(t, x)[1]
        if not set(kit.wheel_names("load")) <= set(outputs._fields):
            raise InputError(f"wheel_lift: the car has no loads a wheel; its outputs are {', '.join(outputs._fields)}.")
        least = outputs.load_fl
        for name in kit.wheel_names("load")[1:]:
            least = jnp.minimum(least, getattr(outputs, name))
        return least - self.load
