"""The one contract of a tyre: how it touches the road goes in, forces and moments come out."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh._core.parameter import check_parameters
from jaxveh._core.parameter_table import WithParameters


class Contact(NamedTuple):
    """How a tyre touches the road at one instant; scalars, or arrays that broadcast against each other.

    - `slip_angle` (rad): positive gives positive lateral force, `-atan2(v_yw, |v_xw|)` in the wheel's axes.
    - `slip_ratio` (-): positive when driving, `(omega r_e - v_xw) / |v_xw|`.
    - `load` (N): normal force, positive; None where it is not known (laws that need it raise). A negative load is a
      wheel off the ground.
    - `camber` (rad): inclination about the wheel's x axis (x forward, y left, z up).
    - `friction` (-): the road's friction over that of the road on which the tyre's parameters hold.
    - `speed` (m/s): forward speed |v_xw| of the contact point; None where it is not known (laws that need it raise, or take
      their nominal one, as they say).
    - `pressure` (Pa): inflation pressure; None means the tyre's own.
    - `turn_slip` (1/m): curvature of the contact point's path as far as the wheel turns with it, phi_t of the book (4.75) in
      ISO-W's sign; laws without it ignore it.
    - `lateral_slip` (-): tan(slip_angle), from whoever has it at hand, as a vehicle does: laws that want the tangent need no
      trigonometry then. None: they take it themselves. Who replaces a slip angle replaces this too.
    - `slip_speed` (m/s): what the slips are relative to, so that `slip_ratio` and tan(slip_angle) times it are the speeds with
      which the contact point slides, at standstill too. Vehicles regularise their slips at low speed and say by what; None: by
      the speed itself.
    - `direction` (-): 1 where the wheel travels forwards, -1 backwards, and smooth between in a vehicle. The pneumatic trail lies
      behind the wheel's centre as seen in this direction; laws of an aligning moment multiply it by this, sgn V_cx of the book.
      All else of a law is that of travelling forwards, rolling resistance too, whose sign vehicles reverse themselves.
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
    """What the road does to a tyre, in the wheel's axes (x forward, y left, z up): forces in N, moments in N m.

    Fields broadcast against each other; what a law does not have is the Python number 0.0. `M_x` is the overturning,
    `M_y` the rolling resistance, `M_z` the aligning moment.
    """

    F_x: Any = 0.0
    F_y: Any = 0.0
    M_x: Any = 0.0
    M_y: Any = 0.0
    M_z: Any = 0.0


class AbstractTyre(WithParameters, eqx.Module):
    """A tyre (or an axle's tyres together): an elementwise force law, its array leaves are its parameters.

    **Raises** `InputError` for parameters outside their domain.
    """

    drawn_by = "tyre"
    called = "tyre law"

    def __check_init__(self):
        check_parameters(self)

    @abc.abstractmethod
    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """Forces and moments at a contact; `state` is None except for a tyre with states of its own."""


class AbstractDynamicTyre(AbstractTyre):
    """A tyre with states of its own (relaxation, bristles); a vehicle carries them among its states.

    `forces(contact, state)` then needs the state, a NamedTuple of scalars with the fields `state_names`.
    """

    state_names: eqx.AbstractVar[tuple[str, ...]]

    @abc.abstractmethod
    def start(self, contact: Contact) -> Any:
        """The state that has settled at a constant contact."""

    @abc.abstractmethod
    def derivatives(self, contact: Contact, state: Any) -> Any:
        """The state's time derivative, the same NamedTuple."""


def need_load(contact: Contact, tyre: str):
    """The load, zero where the wheel is off the ground; raises `InputError` where the contact does not say."""
    if contact.load is None:
        raise InputError(f"contact.load = None: {tyre} scales with load; give the wheel's (or axle's) load in N.")
    return jnp.maximum(contact.load, 0.0)


def need_speed(contact: Contact, tyre: str):
    """The speed; raises `InputError` where the contact does not say."""
    if contact.speed is None:
        raise InputError(f"contact.speed = None: {tyre} needs the wheel's forward speed in m/s.")
    return contact.speed


def need_slip_speed(contact: Contact, tyre: str):
    """What the slips are relative to; raises `InputError` where the contact does not say."""
    return need_speed(contact, tyre) if contact.slip_speed is None else contact.slip_speed


def need_static(name: str, tyre) -> None:
    """Raise `InputError` unless `tyre` is a tyre without states, which is what a wrapper can wrap."""
    if not isinstance(tyre, AbstractTyre):
        raise InputError(f"{name} = {type(tyre).__name__}: must be a tyre of jaxveh.tyres.")
    if isinstance(tyre, AbstractDynamicTyre):
        raise InputError(f"{name} = {type(tyre).__name__}: must be a tyre without states of its own.")


def cornering_stiffness(tyre: AbstractTyre, contact: Contact) -> jax.Array:
    """Slope of the lateral force over slip angle, N/rad, at a contact of scalars; any tyre without states.

    At zero slip it is the cornering stiffness of the book.
    """
    slip = jnp.asarray(contact.slip_angle, jnp.result_type(float if contact.load is None else contact.load))
    return jax.jvp(
        lambda a: tyre.forces(contact._replace(slip_angle=a, lateral_slip=None)).F_y, (slip,), (jnp.ones_like(slip),)
    )[1]
