"""The filters' models: the body's three states on Fiala tyres, moved by the dynamics or by an autoregression."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh.experiments.model_adaptive_pf.drives import WHEELS, Drive, times
from jaxveh.experiments.model_adaptive_pf.settings import Study
from jaxveh.statespace import (
    RK4,
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
from jaxveh.vehicles import SevenDOF, TwoTrack3DOF

INPUTS = ("steer", "drive_torque", "brake_torque")

SPREAD = {"v_y": 0.2, "yaw_rate": 0.02}
"""The prior's standard deviations, m/s and rad/s, about straight running."""


DEFLECTION = 0.002
"""The prior's standard deviation of a tyre's deflection, m: a third of a degree of slip."""


SIX = ("v_x", "v_y", "yaw_rate", "sideslip", "a_x", "a_y")
"""The reported quantities: m/s, m/s, rad/s, rad, m/s^2, m/s^2."""

RIMS = tuple(f"rim_{at}" for at in WHEELS)
"""Channels of the filters of seven degrees of freedom, m/s."""


class BodyState(NamedTuple):
    """`v_x`, `v_y` (m/s) and `yaw_rate` (rad/s)."""

    v_x: Any
    v_y: Any
    yaw_rate: Any


class Regressed(NamedTuple):
    """A car, and the share that each state keeps from row to row (-): the autoregression's coefficients."""

    car: TwoTrack3DOF
    keeps: BodyState


def dynamics(
    study: Study, car: TwoTrack3DOF, start_speed, law: AbstractNoise | None = None, more: tuple[str, ...] = ()
) -> StateSpace:
    """The car's equations of motion with wheel torques and steer as inputs; `start_speed`: the first measured speed, m/s;
    `more`: inputs that the car does not use.

    The tyres' deflections, if they have any, are further states, without noise of their own.
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
    """Eq 25 with p = 1 in place of the equations of motion: each state keeps a share of its last value, and walks.

    The measurements are still those of the car: for the lateral acceleration the tyres' force.
    """
    noise = {"v_x": study.walk_v_x, "v_y": study.walk_v_y, "yaw_rate": study.walk_yaw}
    one = jnp.ones_like(start_speed)
    return StateSpace(
        system=Regressed(car, BodyState(one, one, one)), transition=_decay, observation=_regression_observation,
        report=_report, process_noise=Discrete(Gaussian(noise)), measurement_noise=law, prior=prior(study, start_speed),
        inputs=INPUTS,
    )  # fmt: skip


class MatrixRegressed(NamedTuple):
    """A car, and the autoregression: `own` (3 by 3, -, m/s, m/s, rad/s) maps the last row's state to this row's, and
    `offset`, a state, is the contribution of earlier rows."""

    car: TwoTrack3DOF
    own: Any
    offset: BodyState


def matrix_autoregression(study: Study, car: TwoTrack3DOF, start_speed, law: AbstractNoise) -> StateSpace:
    """Eq 25 with a matrix: `x_t = A_1 x_(t-1) + A_2 X_(t-2) + ... + u`; rows before the last are the filter's means."""
    plain = autoregression(study, car, start_speed, law)
    zero = jnp.zeros_like(start_speed)
    system = MatrixRegressed(car, jnp.eye(3, dtype=zero.dtype), BodyState(zero, zero, zero))
    return StateSpace(
        system=system, transition=_matrix_decay, observation=_regression_observation, report=_report,
        process_noise=plain.process_noise, measurement_noise=law, prior=plain.prior, inputs=INPUTS,
    )  # fmt: skip


def spinning_model(study: Study, car: SevenDOF, start_speed) -> StateSpace:
    """The paper's seven degrees of freedom (eqs 1 to 8): the wheels' spins are states, and their rims' speeds are measured.

    The spins' poles are some 400 1/s at 50 km/h: two steps of Runge-Kutta in a row of 0.01 s. The tyres do not relax.
    """
    body = {"v_x": study.v_x_noise, "v_y": study.v_y_noise, "yaw_rate": study.yaw_noise}
    spins = [name for name in car.state_type._fields if name.startswith("omega")]
    turning = start_speed / study.wheel_radius
    own = {"v_x": 2.0 * study.v_x, **SPREAD, **dict.fromkeys(spins, 2.0 * study.v_x / study.wheel_radius)}
    mean = record_type("SpinningState", own)(start_speed, *[jnp.zeros_like(start_speed)] * 2, *[turning] * len(spins))
    return StateSpace(
        system=car, transition=Propagate(_rates, RK4(), 2), observation=_spinning_observation, report=_spinning_report,
        process_noise=Continuous(Gaussian(body | dict.fromkeys(spins, study.spin_noise))),
        measurement_noise=Gaussian(study.stds | dict.fromkeys(RIMS, study.rim)), prior=Prior(mean, own),
        inputs=INPUTS, input_path="linear",
    )  # fmt: skip


def heavy_dynamics(study: Study, car: TwoTrack3DOF, start_speed) -> StateSpace:
    """`dynamics` whose process noise, too, is the alpha-stable mixture of eqs 12 to 14, which the paper says is possible:
    per row the same Gaussian part, and Cauchy tails."""
    plain = dynamics(study, car, start_speed)
    stds = {"v_x": study.v_x_noise, "v_y": study.v_y_noise, "yaw_rate": study.yaw_noise}
    stds = {name: std * study.dt**0.5 for name, std in stds.items()}
    law = CauchyGaussianMixture(study.weight, {name: std * 0.5**0.5 for name, std in stds.items()}, stds)
    return eqx.tree_at(lambda model: model.process_noise, plain, Discrete(law))


def prior(study: Study, start_speed, lags: tuple[str, ...] = ()) -> Prior:
    """Straight running at the first measured speed."""
    zero = jnp.zeros_like(start_speed)
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


def spinning_rows_of(study: Study, drive: Drive) -> Row:
    """The drive as rows with the speeds of the rims."""
    rows = rows_of(study, drive)
    y = record_type("SpinningMeasurements", (*study.stds, *RIMS))(
        *rows.y, *(drive.rims[:, i] for i in range(len(RIMS)))
    )
    return rows._replace(y=y)


def _whole(car: TwoTrack3DOF | SevenDOF, x: Any):
    """The car's state with a yaw of zero, on which nothing depends."""
    return car.state_type(**{"yaw": jnp.zeros_like(x.yaw_rate), **x._asdict()})


def _rates(car: TwoTrack3DOF | SevenDOF, t, x, u):
    rates = car.derivatives(t, _whole(car, x), u)
    return type(x)(*(getattr(rates, name) for name in x._fields))


def _observation(car: TwoTrack3DOF | SevenDOF, t, x, u):
    a_y = car.outputs(t, _whole(car, x), u).a_y
    return record_type("BodyOutputs", ("v_x", "a_y", "yaw_rate"))(x.v_x, a_y, x.yaw_rate)


def _decay(system: Regressed, t0, t1, x, u):
    return BodyState(*(share * value for share, value in zip(system.keeps, x, strict=True)))


def _matrix_decay(system: MatrixRegressed, t0, t1, x, u):
    of = lambda i: sum(system.own[i, j] * value for j, value in enumerate(x))
    return BodyState(*(of(i) + added for i, added in enumerate(system.offset)))


def _regression_observation(system: Regressed | MatrixRegressed, t, x, u):
    return _observation(system.car, t, x, u)


def _spinning_observation(car: SevenDOF, t, x, u):
    body = _observation(car, t, x, u)
    rims = (car.wheel_radius * getattr(x, f"omega_{at}") for at in WHEELS)
    return record_type("SpinningOutputs", (*body._fields, *RIMS))(*body, *rims)


def _report(system, t, x, u):
    """The six states of the paper's figure 4."""
    car = getattr(system, "car", system)
    felt = car.outputs(t, _whole(car, x), u)
    return record_type("Report", SIX)(*x[:3], numerics.arctan2(x.v_y, x.v_x), felt.a_x, felt.a_y)


def _spinning_report(car: SevenDOF, t, x, u):
    seen = _spinning_observation(car, t, x, u)
    return record_type("SpinningReport", (*SIX, *RIMS))(*_report(car, t, x, u), *(getattr(seen, name) for name in RIMS))
