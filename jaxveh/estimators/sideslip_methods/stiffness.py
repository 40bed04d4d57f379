"""Linear tyres whose cornering stiffnesses are estimated with the state: changing stiffnesses stand in for a tyre curve."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax

from jaxveh import filters, observers
from jaxveh._core.parameter import positive
from jaxveh.estimators.sideslip_methods.common import Guarded, size_of, slowest_of
from jaxveh.estimators.sideslip_methods.observers import POLES
from jaxveh.estimators.sideslip_methods.single_track import (
    USUAL_SPEED,
    axles_of,
    in_filter,
    lateral_model,
    single_track,
)
from jaxveh.io import CarSpecification
from jaxveh.statespace import StateSpace, with_parameters
from jaxveh.tyres import AbstractTyre, Contact, Forces

SPREAD, WALK = 0.2, 0.3
"""Standard deviations of the logarithm of an axle's stiffness: that of the car's file, and that of the change in a second, in
which a tyre may go from its linear range to sliding."""

FORCE_ERROR = 0.03
"""s^0.5: as in `single_track`, for a tyre law whose stiffness is itself uncertain."""

RATE = 0.05
"""1/s: gain of the adaptation, as the growth of the variance of the stiffnesses' logarithms per second."""

LEAST, MOST = 0.2, 1.6
"""Bounds of an adapted stiffness over that of the car's file."""

DEAD_ZONE, LEAKAGE = 1.0, 0.1
"""The dead zone of the adaptation, in standard deviations of the sensors; and the rate (1/s) at which stiffnesses return to those
of the file where they are not observable."""

ROW = 0.01
"""s: step for which the gain of the adaptive observer places its poles. With other steps its error decays as fast per row."""


class ShareOfStiffness(AbstractTyre):
    """A linear tyre with a `share` (-) of the `cornering_stiffness` (N/rad) in the car's file."""

    cornering_stiffness: jax.Array = positive("N/rad")
    share: jax.Array = positive("-", default=1.0)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """Lateral force only, N."""
        return Forces(F_y=self.share * self.cornering_stiffness * contact.slip_angle)


def shares(model: StateSpace):
    """The shares of both axles' stiffnesses, as chosen parameters."""
    car = model.system.car
    return (car.front.share, car.rear.share)


def linear_model(car: CarSpecification, **noise: float) -> StateSpace:
    """The single track of a car's file on linear tyres; only its angles are nonlinear."""
    plain = single_track(car)
    axles = tuple(ShareOfStiffness(axle.stiffness) for axle in axles_of(plain))
    return lateral_model(eqx.tree_at(lambda c: (c.front, c.rear), plain, axles), slowest_of(car), **noise)


def adapted_stiffness(car: CarSpecification) -> Guarded:
    """Makes the unscented filter of the linear single track, with both stiffnesses among its states, from a car's file: section
    1.2.2, as M. Best, T. Gordon & P. Dixon do (the review's [29]) and A. von Vietinghoff et al. ([7])."""
    model = with_parameters(linear_model(car, force_error=FORCE_ERROR), shares, SPREAD, WALK)
    return in_filter(car, model, filters.Unscented(), claims=True)


def adaptive(car: CarSpecification) -> Guarded:
    """Makes the observer of the linear single track, with both stiffnesses adapted by a Lyapunov law, from a car's file: section
    1.4.7, after M. Kaminaga & G. Naito (the review's [77]), H. Cherouat et al. and H. Grip et al. ([78, 79]).

    Their Lyapunov function is the sum of squares of the errors of yaw rate and sideslip. That of `observers.Adaptive` includes
    the errors of the parameters, with which the adaptation is stable at any rate.
    """
    plain = linear_model(car)
    size = size_of(car) ** 0.5
    poles = [pole / size for pole in POLES]
    gain = observers.place_poles(plain, poles, dt=ROW * size, u={"v_x": USUAL_SPEED * size})
    model = with_parameters(plain, shares, SPREAD, 0.0)
    names = [name for name in model.states if name not in plain.states]
    bounds = dict.fromkeys(names, (LEAST, MOST))
    rates = dict.fromkeys(names, RATE)
    observer = observers.Adaptive(gain, rates, bounds=bounds, leakage=LEAKAGE, dead_zone=DEAD_ZONE)
    return in_filter(car, model, observer)
