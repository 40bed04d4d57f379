"""Relaxation: a tyre's force follows its slip over the road it has rolled, not over time."""

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

LEAST_LENGTH = 0.025
"""The least of a tyre's own relaxation lengths, m: they vanish with the load, and the lag's pole goes with 1 / length."""

SLIDES = 0.1
"""The slip that a sliding tyre's deflections do not exceed at standstill (-): about where forces are greatest."""

STATES = {"slip": "deflection_", "force": "F_"}


class Relaxed(AbstractDynamicTyre):
    """Any tyre without states, with a first-order lag over the relaxation lengths `sigma_x` and `sigma_y` (m).

    `of="slip"` (the default): the carcass deflects, and its deflections give the slips that the wrapped law sees
    (H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., sec. 7.2, the single contact point):

        du/dt = v_sx - |v| u / sigma_x,    v_sx = omega r_e - v_x,    kappa' = u / sigma_x
        dv/dt = v_sy - |v| v / sigma_y,    v_sy = -v_y,               tan(alpha') = v / sigma_y

    The states are the deflections `deflection_x`, `deflection_y` (m) and not the lagged slips: they are what cannot jump, so
    that with lengths that go with the load a sudden load changes the slip and not the force (a slip that lags would let the
    force jump). The driving term is the sliding speed itself, slip times the contact's `slip_speed` V (|v|, where it is None).
    At large slip the lag in slip is unchanged while the force, once saturated, follows at once.

    `of="force"`: `sigma dF/dt = V (F_static - F)`, states `F_x`, `F_y` (N); at large slip the force then lags by the whole
    length, which is too slow. Moments follow the static law without lag: for the aligning moment use the lag in slip.

    At standstill deflections hold what they have and take up all sliding. A tyre that slides on and on must not deflect without
    bound (the book holds the deflection there, sec. 7.2.2): the speed that forgets is max(|v|, min(V, |v_s| / `SLIDES`)), which
    is |v| wherever V is. So slow sliding ends at a slip of `SLIDES`, faster sliding at the static law's slip.

    A direction without a length does not lag and has no state. With neither length an `MFTyre` takes its own,
    `outputs(contact).sigma_x` and `.sigma_y` (kept above `LEAST_LENGTH`), at the contact's load. `start` is the state settled at
    the contact's slips; below a vehicle's crawl speed, where those are less than v_s / |v|, it goes on from there. The pole is
    at most `-V / sigma`: RK4 needs steps below `2.78 sigma / V` (2.3 ms at 60 m/s with 0.05 m).

    **Raises** `InputError` for lengths that are not positive, no lengths for a tyre that has none of its own, a tyre with
    states, an unknown `of`, or (`derivatives`) a contact without a speed.
    """

    tyre: AbstractTyre
    sigma_x: jax.Array | None = positive("m", default=None)
    sigma_y: jax.Array | None = positive("m", default=None)
    of: str = eqx.field(static=True, default="slip")
    # Kept apart from the lengths, which may be taken out while they are estimated.
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
        """The speed, m/s, at which deflections leave the contact."""
        speed = need_speed(contact, "Relaxed")
        if contact.slip_speed is None:
            return speed
        slides = contact.slip_speed * numerics.hypot(slips["x"], slips["y"])
        return jnp.maximum(speed, jnp.minimum(contact.slip_speed, slides / SLIDES))

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """What the wrapped law gives at the slips that the deflections make, or its moments beside the lagged forces."""
        if state is None:
            raise InputError("state = None: Relaxed has states of its own; `start(contact)` gives the settled ones.")
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
        """The states' values after a long way at this contact, in the order of `lags`."""
        if self.of == "force":
            forces = self.tyre.forces(contact)
            return [jnp.asarray(getattr(forces, name)) for name in self.state_names]
        lengths, slips = self._lengths(contact), dict(zip("xy", practical(contact), strict=True))
        return [lengths[axis] * slips[axis] for axis in self.lags]

    def _lengths(self, contact: Contact) -> dict:
        if not (self.own and isinstance(self.tyre, MFTyre)):
            return {"x": self.sigma_x, "y": self.sigma_y}
        found = self.tyre.outputs(contact)
        return {"x": jnp.maximum(found.sigma_x, LEAST_LENGTH), "y": jnp.maximum(found.sigma_y, LEAST_LENGTH)}
