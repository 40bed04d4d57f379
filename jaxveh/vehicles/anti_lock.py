"""Any car with brakes, with an anti-lock system."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check, is_concrete, word_for
from jaxveh._core.names import check_names, record, record_type
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.numerics import smooth_step
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import AbstractVehicle, with_batch_shape
from jaxveh.vehicles.drive import AbstractDrive
from jaxveh.vehicles.wheels import Wheels, each_wheel, sum_of_wheels, wheel_names, wheels_of

SHARES = wheel_names("brake_share")
WISHES = wheel_names("brake_wish")
OWN = (*SHARES, *WISHES)


class AntiLock(AbstractVehicle):
    """`vehicle` with an anti-lock system that releases the brake of each wheel whose slip is too large.

    Each wheel gets the share p (-, 1 in normal braking) of the brake torque demanded by the driver. The share follows the share
    q demanded by the controller with the `lag` of the brake pressure. Both are states of the wheel, `brake_share` and
    `brake_wish`:

        dq/dt = build (1 - q) (1 - s) - release q s,    dp/dt = (q - p) / lag
        s     = smooth_step((slip - slip_low) / (slip_high - slip_low)) smooth_step(v_x / slowest - 1),   slip = -slip ratio

    A wheel braked beyond the peak of its tyre then cycles through build-up, peak, release and spin-up about three times a
    second, with slips from a few per cent to twice `slip_high` on ice (M. Burckhardt, Fahrwerktechnik: Radschlupf-Regelsysteme,
    1993, describes these phases; here they are smooth, without the steps of valves). The slip is the true one; its estimation
    by a control unit is not modelled.

    **Parameters**: `slip_low`, `slip_high` (-), `build` and `release` (1/s), `lag` (s), `slowest` (m/s, below which the system
    is off; it is fully on above twice this speed).

    **Inputs**: those of `vehicle`. The outputs also have `brake_torque_fl` ... (N m, the actual brake torques), their sum
    `brake_torque`, and the shares.

    **Raises** `InputError` for a vehicle without a `drive` or without wheel spin, or parameters outside their domain.
    """

    vehicle: AbstractVehicle
    slip_low: jax.Array = positive("-", default=0.1)
    slip_high: jax.Array = positive("-", default=0.2)
    build: jax.Array = positive("1/s", default=6.0)
    release: jax.Array = positive("1/s", default=25.0)
    lag: jax.Array = positive("s", default=0.03)
    slowest: jax.Array = positive("m/s", default=1.5)

    def __check_init__(self):
        if not isinstance(getattr(self.vehicle, "drive", None), AbstractDrive) or not hasattr(
            self.vehicle, "wheel_inertia"
        ):
            raise InputError(
                f"AntiLock.vehicle = {word_for(self.vehicle)}: must be a car with a drive and with wheel spin, such as a "
                "SevenDOF or a FourteenDOF."
            )
        check_parameters(self)
        if is_concrete(self.slip_low):
            # Of NumPy, so that they are known inside jit, too.
            low = np.asarray(self.slip_low)
            check("AntiLock.slip_high", self.slip_high, lambda v: v > low, f"above slip_low = {low}")

    @property
    def inputs(self):
        return self.vehicle.inputs

    @property
    def state_type(self):
        """The states of the vehicle, then `brake_share_fl` ... and `brake_wish_fl` ..."""
        return record_type("AntiLockState", (*self.vehicle.state_type._fields, *OWN))

    @property
    def units(self):
        own = dict.fromkeys(("brake_torque", *wheel_names("brake_torque")), "N m") | dict.fromkeys(OWN, "-")
        return self.vehicle.units | own

    @property
    def wheel_positions(self):
        return self.vehicle.wheel_positions

    def motion(self, x, u):
        return self.vehicle.motion(self._inner(x), u)

    def start(self, t, u, **values):
        """The vehicle's start with no brake released."""
        check_names("start", values, self.state_type._fields)
        inner = self.vehicle.start(t, u, **{k: v for k, v in values.items() if k not in OWN})
        one = jnp.ones_like(inner[0])
        return self.state_type(*inner, *[values.get(name, 1.0) * one for name in OWN])

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        shares = wheels_of(x, "brake_share")
        drive, asked = self.vehicle.drive.torques(u)
        brake = each_wheel(lambda torque, share: torque * share, asked, shares)
        held = eqx.tree_at(lambda car: car.drive, self.vehicle, _Held(self.vehicle.drive.inputs, drive, brake))
        rates, outputs = held.evaluate(t, self._inner(x), u, ground)
        rolls = smooth_step(self.motion(x, u).v_x / self.slowest - 1.0)
        wishes, slips = wheels_of(x, "brake_wish"), wheels_of(outputs, "slip_ratio")
        follow = each_wheel(lambda wish, share: (wish - share) / self.lag, wishes, shares)
        changes = each_wheel(lambda wish, slip: self._change(wish, -slip * rolls), wishes, slips)
        shown = outputs._asdict() | dict(zip(SHARES, shares, strict=True))
        shown |= dict(zip(wheel_names("brake_torque"), brake, strict=True)) | {"brake_torque": sum_of_wheels(brake)}
        return self.state_type(*rates, *follow, *changes), with_batch_shape(record("AntiLockOutputs", shown))

    def _change(self, wish: Any, slip: Any) -> Any:
        over = smooth_step((slip - self.slip_low) / (self.slip_high - self.slip_low))
        return self.build * (1.0 - wish) * (1.0 - over) - self.release * wish * over

    def _inner(self, x):
        return self.vehicle.state_type(*x[: -len(OWN)])


class _Held(AbstractDrive):
    """A drive with constant torques, those of one instant."""

    inputs: tuple[str, ...] = eqx.field(static=True)
    drive: Wheels
    brake: Wheels

    def torques(self, u):
        del u
        return self.drive, self.brake
