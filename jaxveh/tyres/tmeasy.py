"""TMeasy: a tyre described by a few numbers that can be read off measured curves at one load and at twice that load."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import check, check_one_of, check_positive, is_concrete
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load
from jaxveh.tyres.slip import theoretical

MOST_LOAD = 3.0
"""The load over the nominal load up to which the interpolation is used."""

LEAST_GRIP = 1e-6
"""The lower bound of the friction by which slips are divided. Below it only the forces scale."""

NO_SLIP = 1e-12
"""Below this normalised slip the direction is not resolved: its square would underflow in float32."""


class TMeasyCurve(eqx.Module):
    """Force over slip in one direction at one load: rise, peak and sliding.

    `initial_stiffness` dF_0 (N) is the slope at zero slip. The force is `F_max` (N) at the slip `s_max` (-), and `F_slide` (N)
    from the slip `s_slide` (-) on. Slips are theoretical: sliding speed over rolling speed.

    **Raises** `InputError` for numbers that are not positive, `s_slide` not above `s_max`, `F_slide` above `F_max`, or a slope
    below `2 F_max / s_max`, with which the curve would turn the wrong way before its peak.
    """

    initial_stiffness: jax.Array = positive("N")
    s_max: jax.Array = positive("-")
    F_max: jax.Array = positive("N")
    s_slide: jax.Array = positive("-")
    F_slide: jax.Array = positive("N")

    def __check_init__(self):
        check_parameters(self)
        _check_greater("TMeasyCurve.s_slide", self.s_slide, self.s_max, "greater than s_max")
        _check_at_most("TMeasyCurve.F_slide", self.F_slide, self.F_max, "at most F_max")
        # A slope of exactly 2 F_max / s_max is allowed, in whatever precision it was computed.
        least = 2 * self.F_max / self.s_max * (1 - 1e-6)
        _check_greater("TMeasyCurve.initial_stiffness", self.initial_stiffness, least, "at least 2 F_max / s_max")


class _Numbers(NamedTuple):
    """The numbers of an interpolated curve: at one load or in one direction."""

    initial_stiffness: Any
    s_max: Any
    F_max: Any
    s_slide: Any
    F_slide: Any


class TMeasyTrail(eqx.Module):
    """The pneumatic trail over lateral slip.

    `start` (m, at zero slip), `s_zero` (-, the slip of its first zero), `s_end` (-, the slip from which on it is zero).

    **Raises** `InputError` for numbers that are not positive, or `s_end` not above `s_zero`.
    """

    start: jax.Array = positive("m")
    s_zero: jax.Array = positive("-")
    s_end: jax.Array = positive("-")

    def __check_init__(self):
        check_parameters(self)
        _check_greater("TMeasyTrail.s_end", self.s_end, self.s_zero, "greater than s_zero")

    def __call__(self, slip):
        """The trail, m, at a lateral slip of any shape: a blend of a line and a cubic, then slightly negative, then zero."""
        slip = jnp.abs(slip)
        mix = self.s_zero / self.s_end
        x = jnp.minimum(slip / self.s_zero, 1.0)
        first = (1 - mix) * (1 - x) + mix * (1 - (3 - 2 * x) * x**2)
        left = jnp.clip((self.s_end - slip) / (self.s_end - self.s_zero), 0.0, 1.0)
        second = -(1 - mix) * jnp.maximum(slip / self.s_zero - 1, 0.0) * left**2
        return self.start * jnp.where(slip < self.s_zero, first, second)


class TMeasy(AbstractTyre):
    """TMeasy in combined slip (G. Rill, Road Vehicle Dynamics: Fundamentals and Modeling, CRC Press, 2012, ch. 3).

    `longitudinal`, `lateral`: the curves at the `nominal_load` (N). `twice_longitudinal`, `twice_lateral`: the curves at twice
    that load (None: forces and slopes double, slips stay the same). `trail`: the pneumatic trail (None: no aligning moment).

    - Load: forces and slopes lie on the parabola through zero and both loads, slips on the line through both loads. From three
      nominal loads on, forces are proportional to the load.
    - Friction: forces and the slips of the curve and of the trail scale with the contact's friction; slopes stay the same.
    - Each curve: `F = dF_0 s / (1 + q (q + dF_0 s_max / F_max - 2))` with `q = s / s_max` up to the peak, then a falling part,
      then F_slide, with a continuous first derivative.
    - `after_peak`, the falling part: `cubic` (the default, as in the book of 2012) is
      `F_max - (F_max - F_slide) t^2 (3 - 2 t)` with `t = (s - s_max) / (s_slide - s_max)`. `parabolas` (G. Rill & A. Arrieta
      Castro, Road Vehicle Dynamics: Fundamentals and Modeling with MATLAB, 2nd ed., CRC Press, 2020, ch. 3, and tools such as
      Project Chrono) is `F_max - a (s - s_max)^2` up to `s_* = s_max + (F_max - F_slide) / (a (s_slide - s_max))`, then
      `F_slide + b (s_slide - s)^2` with `b = a (s_* - s_max) / (s_slide - s_*)`; `a = F_max^2 / (dF_0 s_max^3)` makes the second
      derivative continuous at the peak. Where s_* is beyond s_slide the parabolas do not fit, and the cubic is used. In combined
      slip the force can jump at the direction where this changes.
    - Combined: slips are divided by `s_x_max / (s_x_max + s_y_max) + (F_x_max / dF_x0) / (F_x_max / dF_x0 + F_y_max / dF_y0)`,
      and likewise for y. The curve for the direction of the normalised slip has its numbers on the ellipses between the two
      curves, and the force points in that direction.

    If the slopes over normalised slip differ between the directions, the force has no total derivative at zero slip (it is a
    cone). The derivatives there are those along each direction.

    **Raises** `InputError` for curves that are invalid at zero or three nominal loads, an unknown `after_peak`, or a contact
    without a load.
    """

    longitudinal: TMeasyCurve
    lateral: TMeasyCurve
    nominal_load: jax.Array = positive("N")
    twice_longitudinal: TMeasyCurve | None = None
    twice_lateral: TMeasyCurve | None = None
    trail: TMeasyTrail | None = None
    after_peak: str = eqx.field(static=True, default="cubic")

    def __check_init__(self):
        check_parameters(self)
        check_one_of("TMeasy.after_peak", self.after_peak, AFTER_PEAK)
        _check_loads("TMeasy.twice_longitudinal", self.longitudinal, self.twice_longitudinal)
        _check_loads("TMeasy.twice_lateral", self.lateral, self.twice_lateral)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x, F_y (N), and M_z (N m) where there is a trail."""
        load = need_load(contact, "TMeasy")
        ratio = jnp.minimum(load / self.nominal_load, MOST_LOAD)
        x = _at_load(self.longitudinal, self.twice_longitudinal, ratio)
        y = _at_load(self.lateral, self.twice_lateral, ratio)
        # The friction m scales slips and forces of the curves equally: F(s) = m F_1(s / m).
        limit = contact.friction * (load / self.nominal_load)
        grip = jnp.maximum(numerics.as_wide_as(contact.friction, load), LEAST_GRIP)
        slip_x, slip_y = (slip / grip for slip in theoretical(contact))
        F_x, F_y = (limit * force for force in _combined_forces(x, y, slip_x, slip_y, AFTER_PEAK[self.after_peak]))
        if self.trail is None:
            return Forces(F_x=F_x, F_y=F_y)
        return Forces(F_x=F_x, F_y=F_y, M_z=-contact.direction * self.trail(slip_y) * F_y)


def _combined_forces(x: _Numbers, y: _Numbers, slip_x, slip_y, after_peak):
    """The forces in both directions, in the unit of the curves' forces."""
    peaks, bends = x.s_max + y.s_max, x.F_max / x.initial_stiffness + y.F_max / y.initial_stiffness
    norm_x = x.s_max / peaks + x.F_max / x.initial_stiffness / bends
    norm_y = y.s_max / peaks + y.F_max / y.initial_stiffness / bends
    n_x, n_y = slip_x / norm_x, slip_y / norm_y
    slip = numerics.hypot(n_x, n_y)
    moves = slip > NO_SLIP
    slip = numerics.or_one(slip, moves)
    cosine, sine = jnp.where(moves, n_x / slip, 1.0), jnp.where(moves, n_y / slip, 0.0)

    between = lambda along, across: numerics.hypot(along * cosine, across * sine)
    curve = _Numbers(
        initial_stiffness=between(x.initial_stiffness * norm_x, y.initial_stiffness * norm_y),
        s_max=between(x.s_max / norm_x, y.s_max / norm_y),
        F_max=between(x.F_max, y.F_max),
        s_slide=between(x.s_slide / norm_x, y.s_slide / norm_y),
        F_slide=between(x.F_slide, y.F_slide),
    )
    secant = _secant(curve, slip, after_peak)
    F_x = jnp.where(moves, secant, x.initial_stiffness * norm_x) * n_x
    F_y = jnp.where(moves, secant, y.initial_stiffness * norm_y) * n_y
    return F_x, F_y


def _secant(curve: _Numbers, slip, after_peak):
    """Force over slip at a positive slip."""
    stiffness, s_max, F_max, s_slide, _ = curve
    q = jnp.minimum(slip / s_max, 1.0)
    rise = stiffness / (1 + q * (q + stiffness * s_max / F_max - 2))
    fall = after_peak(curve, jnp.clip(slip, s_max, s_slide)) / slip
    return jnp.where(slip < s_max, rise, fall)


def _cubic(curve: _Numbers, slip):
    """The force between `s_max` and `s_slide`."""
    t = (slip - curve.s_max) / (curve.s_slide - curve.s_max)
    return curve.F_max - (curve.F_max - curve.F_slide) * t**2 * (3 - 2 * t)


def _parabolas(curve: _Numbers, slip):
    """The force between `s_max` and `s_slide`: two parabolas that meet in value and slope, or the cubic where they cannot."""
    stiffness, s_max, F_max, s_slide, F_slide = curve
    bend = F_max**2 / (stiffness * s_max**3)
    meet = s_max + (F_max - F_slide) / (bend * (s_slide - s_max))
    fits = meet < s_slide
    left = numerics.or_one(s_slide - meet, fits)
    first = F_max - bend * (slip - s_max) ** 2
    second = F_slide + bend * (meet - s_max) / left * (s_slide - slip) ** 2
    return jnp.where(fits, jnp.where(slip < meet, first, second), _cubic(curve, slip))


AFTER_PEAK = {"cubic": _cubic, "parabolas": _parabolas}


def _at_load(one: TMeasyCurve, two: TMeasyCurve | None, ratio) -> _Numbers:
    """The curve at a `ratio` of load over nominal load. Forces and slopes are divided by the ratio, so that they are finite at
    zero load."""
    numbers = _Numbers(*(getattr(one, name) for name in _Numbers._fields))
    if two is None:
        return numbers
    force = lambda at_one, at_two: 2 * at_one - at_two / 2 - (at_one - at_two / 2) * ratio
    slip = lambda at_one, at_two: at_one + (at_two - at_one) * (ratio - 1)
    along = _Numbers(initial_stiffness=force, s_max=slip, F_max=force, s_slide=slip, F_slide=force)
    return _Numbers(*(f(getattr(one, name), getattr(two, name)) for name, f in along._asdict().items()))


def _check_greater(name: str, value, other, allowed: str) -> None:
    if is_concrete(value, other):
        check(name, value, lambda v: v > np.asarray(other), allowed)


def _check_at_most(name: str, value, other, allowed: str) -> None:
    if is_concrete(value, other):
        check(name, value, lambda v: v <= np.asarray(other), allowed)


def _check_loads(name: str, one: TMeasyCurve, two: TMeasyCurve | None) -> None:
    """Check the curves at both ends of the loads: but for a common factor all is linear in the load, so they hold between."""
    if two is None:
        return
    for ratio in (0.0, MOST_LOAD):
        at, advice = (
            _at_load(one, two, ratio),
            f"This is the interpolated curve at {ratio:g} nominal loads: check {{}} of both loads.",
        )
        for field, value in at._asdict().items():
            check_positive(f"{name}: {field}", value, advice=advice.format(field))
        _check_greater(f"{name}: s_slide", at.s_slide, at.s_max, f"greater than s_max ({ratio:g} nominal loads)")
        _check_at_most(f"{name}: F_slide", at.F_slide, at.F_max, f"at most F_max ({ratio:g} nominal loads)")
