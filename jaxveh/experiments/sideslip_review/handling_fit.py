"""The handling model of a car's file, and its fit to a log: the library's method before it used the rear axle alone."""

from __future__ import annotations

import dataclasses
from typing import Any

import equinox as eqx

from jaxveh import estimators
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.experiments.sideslip_review.handling import Handling, handling_model
from jaxveh.experiments.sideslip_review.handling_cleaning import clean
from jaxveh.filters import Unscented
from jaxveh.fitting import prediction_error
from jaxveh.io import CarSpecification
from jaxveh.statespace import StateSpace
from jaxveh.tyres import MagicFormula, kit
from jaxveh.vehicles import from_specification

START = kit.GenericTyre(friction=1.1, E=0.0)
"""The tyre of axles for which a car's file has only a cornering stiffness. More friction and a rounder peak than
`kit.GENERIC_TYRE`, with which cars are drawn: without calibration, on the second halves of two logs, 0.30 degrees instead of
0.42 (Ferrari) and 48 instead of 65 (F1TENTH)."""

GENERIC_CG_HEIGHT = 0.45
"""m above ground, if a car's file has none."""

PRIOR = {
    "B": 0.3, "D": 0.15, "E": 0.25, "cg_height": 0.22, "yaw_inertia": 0.2, "steer_offset": 0.15, "steer_gain": 0.03,
    "yaw_rate_offset": 1.0, "a_y_gain": 0.03, "brake_share": 1.0, "ellipse": 0.3, "force_offset": 1.0,
    "front_asymmetry": 1.0, "rear_asymmetry": 1.0, "heading_offset": 1.0, "force_time": 0.7, "bias_time": 0.7,
    "v_y": 0.7, "yaw_rate": 0.7, "front_error": 0.5, "rear_error": 0.5, "a_y_error": 0.7, "a_y": 0.5,
}  # fmt: skip
"""Relative standard deviations of the prior by name, on each parameter's own line (unbounded ones in units of their declared
scale)."""


def chosen_parameters(model: Any):
    """The parameters and noise levels that a calibration fits."""
    s, car = model.system, model.system.car
    axles = [leaf for tyre in (car.front, car.rear) for leaf in (tyre.B, tyre.D, tyre.E)]
    body = [car.cg_height, car.yaw_inertia, car.steer_offset]
    sensors = [s.steer_gain, s.yaw_rate_offset, s.a_y_gain, s.heading_offset]
    forces = [s.brake_share, s.ellipse, s.force_offset, s.front_asymmetry, s.rear_asymmetry, s.force_time, s.bias_time]
    return (*axles, *body, *sensors, *forces, *model.process_noise.law.std, *model.measurement_noise.std)


def handling_car(car: CarSpecification) -> Handling:
    """The handling model of a car's file: with its own tyres if it has them, otherwise generic ones with its cornering
    stiffness."""
    known = from_specification(dataclasses.replace(car, cg_height=car.cg_height or GENERIC_CG_HEIGHT))
    loads = known.static_loads()
    axles = [
        tyre if given is not None and given.nominal_load is not None else _generic(tyre, load, given is not None)
        for tyre, load, given in zip((known.front, known.rear), loads, (car.front, car.rear), strict=True)
    ]
    return Handling(eqx.tree_at(lambda c: (c.front, c.rear), known, axles))


def _generic(tyre: MagicFormula, load, told: bool) -> MagicFormula:
    """An axle that scales with load: as given, at its static load, or generic with the tyre's cornering stiffness."""
    if told:
        return MagicFormula(tyre.B, tyre.C, tyre.D, tyre.E, tyre.S_h, tyre.S_v, nominal_load=load)
    return START.magic_formula(tyre.cornering_stiffness, load)


def fitted_model(told: CarSpecification, log: Recording, progress: Progress = silent) -> StateSpace:
    """The handling model with the greatest posterior on pieces of a log, blind."""
    pieces, warm_up = estimators.kit.cut_pieces(clean(log))
    start = handling_model(handling_car(told))
    fit = prediction_error(
        Unscented(), start, pieces, chosen_parameters, prior=PRIOR, warm_up=warm_up, progress=progress
    )
    return fit.model
