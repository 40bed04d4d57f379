"""Events that end a simulation early: standstill, wheel lift."""

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

    `condition` gets the `Driven` car, the time and its `DrivenState`; `name` appears in the recording's source.
    """

    condition: Callable = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def of_solver(self, tolerance: float) -> diffrax.Event:
        """The diffrax event of this one; its instant is found to `tolerance` (s)."""

        def crossing(t, y, args, **_):
            # diffrax compares the value with a number of the default precision, whatever the precision of the car. The value
            # that is tested and the one that is kept for the next step must be equal: if they were rounded differently, both
            # would miss a fall at the end of a step.
            return numerics.fence(jnp.asarray(self.condition(args, t, y), float), firm=True)

        return diffrax.Event(crossing, Falling(tolerance=tolerance), direction=False)


def standstill(speed: float = 0.1) -> Event:
    """The car's forward speed falls below `speed` (m/s). **Raises** `InputError` for a speed that is not positive."""
    check_positive("standstill: speed", speed, "m/s")
    return Event(_Slower(float(speed)), f"standstill (below {speed:g} m/s)")


def wheel_lift(load: float = 1.0) -> Event:
    """The load of any wheel falls below `load` (N). **Raises** `InputError` for a load that is not positive.

    The car must have a load per wheel (`load_fl` ...). The event computes the tyre forces once more per step.
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
            raise InputError(
                f"wheel_lift: the car has no load per wheel; its outputs are {', '.join(outputs._fields)}."
            )
        least = outputs.load_fl
        for name in kit.wheel_names("load")[1:]:
            least = jnp.minimum(least, getattr(outputs, name))
        return least - self.load
