"""What filters believe: the body's three states on Fiala tyres, moved by the dynamics or by an autoregression."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh.experiments.model_adaptive_pf.drives import Drive, times
from jaxveh.experiments.model_adaptive_pf.settings import Study
from jaxveh.statespace import (
    AbstractNoise,
    CauchyGaussianMixture,
    Continuous,
    Discrete,
    Gaussian,
    Heun,
    Prior,
    Propagate,
    Row,
    StateSpace,
)
from jaxveh.tyres import Relaxed
from jaxveh.vehicles import TwoTrack3DOF

INPUTS = ("steer", "drive_torque", "brake_torque")

SPREAD = {"v_y": 0.2, "yaw_rate": 0.02}
"""The prior's, m/s and rad/s, about straight running."""


DEFLECTION = 0.002
"""The prior's spread of a tyre's deflection, m: a third of a degree of slip."""


class BodyState(NamedTuple):
    """`v_x`, `v_y` (m/s) and `yaw_rate` (rad/s)."""

    v_x: Any
    v_y: Any
    yaw_rate: Any


class Regressed(NamedTuple):
    """A car, and what each state keeps from row to row (-): the autoregression's coefficients."""

    car: TwoTrack3DOF
    keeps: BodyState


def dynamics(
    study: Study, car: TwoTrack3DOF, start_speed, law: AbstractNoise | None = None, more: tuple[str, ...] = ()
) -> StateSpace:
    """The car's equations of motion with wheel torques and steer as inputs; `start_speed` m/s, the first that was measured;
    `more` inputs of which the car knows nothing.

    Deflections of the tyres, where they have such, are states, too, without noise of their own.
    """
    noise = {"v_x": study.v_x_noise, "v_y": study.v_y_noise, "yaw_rate": study.yaw_noise}
    return StateSpace(
        system=car, transition=Propagate(_rates, Heun()), observation=_observation, report=_report,
        process_noise=Continuous(Gaussian(noise)), measurement_noise=gaussian(study) if law is None else law,
        prior=prior(study, start_speed, tuple(name for name in car.state_type._fields if name.endswith("deflection_y"))),
        inputs=(*INPUTS, *more), input_path="linear",
    )  # fmt: skip


def lagging_car(study: Study, car: TwoTrack3DOF) -> TwoTrack3DOF:
    """The car on the same tyres with the study's relaxation length."""
    tyres = lambda c: (c.front, c.rear)
    return eqx.tree_at(tyres, car, [Relaxed(tyre, sigma_y=study.relaxation) for tyre in tyres(car)])


def autoregression(study: Study, car: TwoTrack3DOF, start_speed, law: AbstractNoise) -> StateSpace:
    """Eq 25 with p = 1 in the place of the equations of motion: each state keeps a share of its last value, and walks.

    What sensors say is still the car's: of the lateral acceleration the tyres' force.
    """
    noise = {"v_x": study.walk_v_x, "v_y": study.walk_v_y, "yaw_rate": study.walk_yaw}
    one = jnp.ones_like(start_speed)
    return StateSpace(
        system=Regressed(car, BodyState(one, one, one)), transition=_decay, observation=_regression_observation,
        report=_report, process_noise=Discrete(Gaussian(noise)), measurement_noise=law, prior=prior(study, start_speed),
        inputs=INPUTS,
    )  # fmt: skip


def prior(study: Study, start_speed, lags: tuple[str, ...] = ()) -> Prior:
    """Straight running at the first speed that was measured."""
    zero = 0.0 * start_speed
    spread = {"v_x": 2.0 * study.v_x, **SPREAD, **dict.fromkeys(lags, DEFLECTION)}
    kind = record_type("MovedState", spread) if lags else BodyState
    return Prior(kind(start_speed, *[zero] * (len(spread) - 1)), spread)


def gaussian(study: Study) -> Gaussian:
    """The data sheet's noise."""
    return Gaussian(study.stds)


def mixture(study: Study) -> CauchyGaussianMixture:
    """Eqs 12 to 14 with their errata corrected: the data sheet's variance R, and Cauchy tails of the scale sqrt(R / 2)."""
    scales = {name: std * 0.5**0.5 for name, std in study.stds.items()}
    return CauchyGaussianMixture(study.weight, scales, study.stds)


def rows_of(study: Study, drive: Drive) -> Row:
    """The drive as rows of these models."""
    u = record_type("Inputs", INPUTS)(*(getattr(drive, name) for name in INPUTS))
    y = record_type("Measurements", study.stds)(*(getattr(drive, name) for name in study.stds))
    return Row(times(study), u, y)


def _whole(car: TwoTrack3DOF, x: Any):
    """The car's state; of its yaw nothing depends."""
    return car.state_type(**{"yaw": 0.0 * x.yaw_rate, **x._asdict()})


def _rates(car: TwoTrack3DOF, t, x, u):
    rates = car.derivatives(t, _whole(car, x), u)
    return type(x)(*(getattr(rates, name) for name in x._fields))


def _observation(car: TwoTrack3DOF, t, x, u):
    a_y = car.outputs(t, _whole(car, x), u).a_y
    return record_type("BodyOutputs", ("v_x", "a_y", "yaw_rate"))(x.v_x, a_y, x.yaw_rate)


def _decay(system: Regressed, t0, t1, x, u):
    return BodyState(*(share * value for share, value in zip(system.keeps, x, strict=True)))


def _regression_observation(system: Regressed, t, x, u):
    return _observation(system.car, t, x, u)


def _report(system, t, x, u):
    return record_type("Report", (*BodyState._fields, "sideslip"))(*x[:3], numerics.arctan2(x.v_y, x.v_x))
