"""The interface of all tyre laws: a law takes the contact with the road and returns forces and moments."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.contracts import Checked, contract
from jaxveh._core.errors import InputError, check_kind, word_for
from jaxveh._core.own_results import names, of_kind, states
from jaxveh._core.parameter import check_parameters
from jaxveh._core.parameter_table import WithParameters


class Contact(NamedTuple):
    """The contact of a tyre with the road at one instant: scalars, or arrays that broadcast against each other.

    - `slip_angle` (rad): positive gives positive lateral force, `-atan2(v_yw, |v_xw|)` in the wheel's axes.
    - `slip_ratio` (-): positive when driving, `(omega r_e - v_xw) / |v_xw|`.
    - `load` (N): normal force, positive; None if unknown (laws that need it raise an error). A negative load means that the
      wheel is off the ground.
    - `camber` (rad): inclination about the wheel's x axis (x forward, y left, z up).
    - `friction` (-): the road's friction over that of the road on which the tyre's parameters hold.
    - `speed` (m/s): forward speed |v_xw| of the contact point; None if unknown (laws that need it raise an error or use their
      nominal speed, as each law documents).
    - `pressure` (Pa): inflation pressure; None means the tyre's own.
    - `turn_slip` (1/m): curvature of the contact point's path as far as the wheel turns with it, phi_t of the book (4.75) in
      ISO-W's sign; laws without turn slip ignore it.
    - `lateral_slip` (-): tan(slip_angle), if the caller has it already, as vehicles do; laws that use the tangent then need no
      trigonometry. None: they compute it. Code that replaces the slip angle must replace this field too.
    - `slip_speed` (m/s): the speed to which the slips are relative: `slip_ratio` and tan(slip_angle) times it are the sliding
      speeds of the contact point, at standstill too. Vehicles, which regularise their slips at low speed, set it. None: the
      slips are relative to the speed itself.
    - `direction` (-): 1 if the wheel travels forwards, -1 backwards, with a smooth transition in a vehicle. The pneumatic trail
      lies behind the wheel's centre as seen in this direction. Laws with an aligning moment multiply it by this value, sgn V_cx
      of the book. The rest of a law is that of forward travel. This includes rolling resistance, whose sign the vehicle reverses.
    """

    slip_angle: Any = 0.0
    slip_ratio: Any = 0.0
    load: Any = None
    camber: Any = 0.0
    friction: Any = 1.0
    speed: Any = None
    pressure: Any = None
    turn_slip: Any = 0.0
    lateral_slip: Any = None
    slip_speed: Any = None
    direction: Any = 1.0


class Forces(NamedTuple):
    """The forces (N) and moments (N m) of the road on a tyre, in the wheel's axes (x forward, y left, z up).

    Fields broadcast against each other. Components that a law does not model are the Python number 0.0. `M_x` is the
    overturning, `M_y` the rolling resistance, `M_z` the aligning moment.
    """

    F_x: Any = 0.0
    F_y: Any = 0.0
    M_x: Any = 0.0
    M_y: Any = 0.0
    M_z: Any = 0.0


class AbstractTyre(Checked, WithParameters, eqx.Module):
    """A tyre, or the tyres of an axle together: an elementwise force law whose array leaves are its parameters.

    **Raises** `InputError` for parameters outside their domain.
    """

    drawn_by = "tyre"
    called = "tyre law"
    _contract = contract(forces=of_kind(Forces))

    def __check_init__(self):
        check_parameters(self)

    @abc.abstractmethod
    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """The forces and moments at a contact; `state` is None except for a tyre with states of its own."""


class AbstractDynamicTyre(AbstractTyre):
    """A tyre with states of its own (relaxation, bristles). A vehicle with such tyres includes them in its own state.

    `forces(contact, state)` needs the tyre's state, a NamedTuple of scalars with the fields `state_names`.
    """

    _contract = contract(state_names=names, start=states, derivatives=states)

    # Not an `eqx.AbstractVar`: under postponed annotations that would be a field, which `Relaxed` would never set. A copy of a
    # tyre with a field that is not set has another tree structure.
    @property
    @abc.abstractmethod
    def state_names(self) -> tuple[str, ...]:
        """The names of the tyre's states."""

    @abc.abstractmethod
    def start(self, contact: Contact) -> Any:
        """The steady state at a constant contact."""

    @abc.abstractmethod
    def derivatives(self, contact: Contact, state: Any) -> Any:
        """The state's time derivative, the same NamedTuple."""


def need_load(contact: Contact, tyre: str):
    """The load, zero where the wheel is off the ground. Raises `InputError` if the contact has no load."""
    if contact.load is None:
        raise InputError(f"contact.load = None: {tyre} scales with load; give the wheel's (or axle's) load in N.")
    return jnp.maximum(contact.load, 0.0)


def need_speed(contact: Contact, tyre: str):
    """The speed. Raises `InputError` if the contact has no speed."""
    if contact.speed is None:
        raise InputError(f"contact.speed = None: {tyre} needs the wheel's forward speed in m/s.")
    return contact.speed


def need_slip_speed(contact: Contact, tyre: str):
    """The speed to which the slips are relative. Raises `InputError` if the contact has no speed."""
    return need_speed(contact, tyre) if contact.slip_speed is None else contact.slip_speed


def need_static(name: str, tyre) -> None:
    """Raise `InputError` unless `tyre` is a tyre without states; wrappers accept only such tyres."""
    if not isinstance(tyre, AbstractTyre):
        raise InputError(f"{name} = {word_for(tyre)}: must be a tyre of jaxveh.tyres.")
    if isinstance(tyre, AbstractDynamicTyre):
        raise InputError(f"{name} = {word_for(tyre)}: must be a tyre without states of its own.")


def cornering_stiffness(tyre: AbstractTyre, contact: Contact) -> jax.Array:
    """The slope of the lateral force over slip angle, N/rad, at a contact of scalars, for any tyre without states.

    At zero slip it is the cornering stiffness of the book.
    """
    check_kind("cornering_stiffness: tyre", tyre, AbstractTyre, "tyres.Linear(8e4) is one.")
    check_kind("cornering_stiffness: contact", contact, Contact, "tyres.Contact(0.0, load=4000.0) is one.")
    slip = jnp.asarray(contact.slip_angle, jnp.result_type(float if contact.load is None else contact.load))
    return jax.jvp(
        lambda a: tyre.forces(contact._replace(slip_angle=a, lateral_slip=None)).F_y, (slip,), (jnp.ones_like(slip),)
    )[1]
