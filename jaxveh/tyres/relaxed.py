"""Relaxation: a tyre's force lags behind its slip over a rolled distance, not over a time."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_one_of
from jaxveh._core.names import record, record_type
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import (
    AbstractDynamicTyre,
    AbstractTyre,
    Contact,
    Forces,
    need_slip_speed,
    need_speed,
    need_static,
)
from jaxveh.tyres.mf_tyre import MFTyre
from jaxveh.tyres.slip import practical

LEAST_SHARE = 5 / 64
"""The lower bound of a tyre's own relaxation lengths over its unloaded radius (2.5 cm for a wheel of 32 cm): they vanish with the
load, and the pole of the lag is proportional to 1 / length."""

SLIDES = 0.1
"""The limit of the slip of a sliding tyre's deflections at standstill (-): about the slip at which forces are greatest."""

STATES = {"slip": "deflection_", "force": "F_"}


class Relaxed(AbstractDynamicTyre):
    """Any tyre without states, with a first-order lag over the relaxation lengths `sigma_x` and `sigma_y` (m).

    `of="slip"` (the default): the carcass deflects, and its deflections give the slips at which the wrapped law is evaluated
    (H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., sec. 7.2, the single contact point):

        du/dt = v_sx - |v| u / sigma_x,    v_sx = omega r_e - v_x,    kappa' = u / sigma_x
        dv/dt = v_sy - |v| v / sigma_y,    v_sy = -v_y,               tan(alpha') = v / sigma_y

    The states are the deflections `deflection_x`, `deflection_y` (m), not the lagged slips. Deflections cannot jump. If the
    lengths depend on the load, a sudden change of load then changes the slip and not the force (with a lagged slip as the state
    the force would jump). The driving term is the sliding speed, slip times the contact's `slip_speed` V (|v| if it is None).
    At large slip the lag of the slip is unchanged, but the saturated force has no lag.

    `of="force"`: `sigma dF/dt = V (F_static - F)` with the states `F_x`, `F_y` (N). At large slip the force then lags by the
    whole length, which is too slow. Moments follow the static law without lag; for the aligning moment use the lag in slip.

    At standstill the deflections stay and take up all sliding. The deflection of a tyre that goes on sliding must be bounded
    (the book holds the deflection there, sec. 7.2.2). The deflections therefore decay with the speed
    max(|v|, min(V, |v_s| / `SLIDES`)), which is |v| wherever V is |v|. Slow sliding then ends at a slip of `SLIDES`, faster
    sliding at the static law's slip.

    A direction without a length has no lag and no state. If both lengths are None, an `MFTyre` uses its own,
    `outputs(contact).sigma_x` and `.sigma_y` at the contact's load, at least `LEAST_SHARE` of its unloaded radius. `start` is the
    steady state at the contact's slips. Below a vehicle's crawl speed these are smaller than v_s / |v|, and the state moves on
    from there. The fastest pole is `-V / sigma`: RK4 needs steps below `2.78 sigma / V` (2.3 ms at 60 m/s with 0.05 m).

    **Raises** `InputError` for lengths that are not positive, no lengths for a tyre without its own, a tyre with states, an
    unknown `of`, or (`derivatives`) a contact without a speed.
    """

    tyre: AbstractTyre
    sigma_x: jax.Array | None = positive("m", default=None)
    sigma_y: jax.Array | None = positive("m", default=None)
    of: str = eqx.field(static=True, default="slip")
    # Separate from the lengths, because those are removed from the model while they are estimated.
    lags: tuple[str, ...] = eqx.field(static=True, default=())
    own: bool = eqx.field(static=True, default=False)

    def __init__(self, tyre: AbstractTyre, sigma_x=None, sigma_y=None, of: str = "slip"):
        need_static("Relaxed.tyre", tyre)
        check_one_of("Relaxed.of", of, STATES)
        given = tuple(axis for axis, sigma in (("x", sigma_x), ("y", sigma_y)) if sigma is not None)
        if not given and not isinstance(tyre, MFTyre):
            raise InputError(
                f"Relaxed.sigma_x, sigma_y = None: {type(tyre).__name__} has no relaxation lengths of its own; "
                "give at least one in m."
            )
        self.tyre, self.sigma_x, self.sigma_y, self.of = tyre, sigma_x, sigma_y, of
        self.lags, self.own = given or ("x", "y"), not given

    @property
    def state_names(self) -> tuple[str, ...]:
        return tuple(STATES[self.of] + axis for axis in self.lags)

    def start(self, contact: Contact):
        settled = self._settled_state(contact)
        shape = jnp.broadcast_shapes(*[jnp.shape(value) for value in settled])
        return record_type("RelaxedState", self.state_names)(*[jnp.broadcast_to(value, shape) for value in settled])

    def derivatives(self, contact: Contact, state: Any):
        slip_speed, lengths = need_slip_speed(contact, "Relaxed"), self._lengths(contact)
        if self.of == "force":
            rates = {
                name: slip_speed * ((end - getattr(state, name)) / lengths[axis])
                for name, axis, end in zip(self.state_names, self.lags, self._settled_state(contact), strict=True)
            }
            return record("RelaxedState", rates)
        slips = dict(zip("xy", practical(contact), strict=True))
        forgets = self._forgets(contact, slips)
        rates = {
            name: slip_speed * slips[axis] - forgets * (getattr(state, name) / lengths[axis])
            for name, axis in zip(self.state_names, self.lags, strict=True)
        }
        return record("RelaxedState", rates)

    def _forgets(self, contact: Contact, slips: dict):
        """The speed, m/s, with which the deflections decay."""
        speed = need_speed(contact, "Relaxed")
        if contact.slip_speed is None:
            return speed
        slides = contact.slip_speed * numerics.hypot(slips["x"], slips["y"])
        return jnp.maximum(speed, jnp.minimum(contact.slip_speed, slides / SLIDES))

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """The wrapped law at the slips of the deflections, or the lagged forces with the moments of the wrapped law."""
        if state is None:
            raise InputError("state = None: Relaxed has states of its own; `start(contact)` gives the steady state.")
        if self.of == "force":
            lagged = {name: getattr(state, name) for name in self.state_names}
            return self.tyre.forces(contact)._replace(**lagged)
        lengths, slips = self._lengths(contact), {}
        if "x" in self.lags:
            slips["slip_ratio"] = state.deflection_x / lengths["x"]
        if "y" in self.lags:
            slips["lateral_slip"] = state.deflection_y / lengths["y"]
            slips["slip_angle"] = numerics.arctan(slips["lateral_slip"])
        return self.tyre.forces(contact._replace(**slips))

    def _settled_state(self, contact: Contact) -> list:
        """The steady values of the states at this contact, in the order of `lags`."""
        if self.of == "force":
            forces = self.tyre.forces(contact)
            return [jnp.asarray(getattr(forces, name)) for name in self.state_names]
        lengths, slips = self._lengths(contact), dict(zip("xy", practical(contact), strict=True))
        return [lengths[axis] * slips[axis] for axis in self.lags]

    def _lengths(self, contact: Contact) -> dict:
        if not (self.own and isinstance(self.tyre, MFTyre)):
            return {"x": self.sigma_x, "y": self.sigma_y}
        found = self.tyre.outputs(contact)
        least = LEAST_SHARE * self.tyre.structure.UNLOADED_RADIUS
        return {"x": jnp.maximum(found.sigma_x, least), "y": jnp.maximum(found.sigma_y, least)}
