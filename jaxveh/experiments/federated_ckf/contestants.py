"""The estimators by name: what each of them gets from the others, and how it uses the sensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import filters, numerics
from jaxveh._core.names import record_type
from jaxveh.experiments.federated_ckf.drives import WHEELS, Drive, times
from jaxveh.experiments.federated_ckf.interleaved import SeenThrough, Told, stays, vector_and_covariance
from jaxveh.experiments.federated_ckf.model import (
    CHANNELS,
    State,
    joint_model,
    noise_levels,
    planar,
    rows_of,
    states_model,
)
from jaxveh.experiments.federated_ckf.settings import PARAMETERS, Study
from jaxveh.statespace import Continuous, Gaussian, Prior, StateSpace, kit

GROUPS = (("a_x", "a_y"), ("yaw_rate",), WHEELS)
"""Disjoint sensors, one group per device: accelerometers, gyroscope, wheel speeds."""

SHARED = (CHANNELS, ("a_y", "yaw_rate"))
"""The paper's Z_1 and Z_2, with the wheel speeds in the first: the first contains all of the second."""

BLOCKS = (State._fields, ("mass", "yaw_inertia", "front_axle_to_cg"), ("friction",))
"""The quantities of the three estimators."""


class Found(NamedTuple):
    """Estimates over time, (T,): speeds (m/s), yaw rate (rad/s), and (T, 4) `parameters` in physical units.

    `vector` (T, 7) and `covariance` (T, 7, 7) are the estimator's mean and covariance of three states and the logarithms of
    four parameters; the covariance of parameters that it takes as certain is zero.
    """

    v_x: Any
    v_y: Any
    yaw_rate: Any
    parameters: Any
    vector: Any
    covariance: Any


class Contestant(NamedTuple):
    """`run(study, start, drive) -> Found`, and a description, `what`."""

    run: Callable[[Study, Any, Drive], Found]
    what: str


def contestants(study: Study) -> dict[str, Contestant]:
    """All estimators by name, beginning with the one that does nothing."""
    cubature = filters.Cubature()
    shared = filters.Federated(cubature, SHARED, by_trace=True, overlapping=True)
    apart = filters.Federated(cubature, GROUPS, common=True)
    isolating = filters.Federated(cubature, GROUPS, common=True, isolate=study.isolate)
    return {
        "first guess": Contestant(_guess, "parameters stay at the first guess; states by a cubature filter"),
        "joint": Contestant(_joint(cubature), "one cubature filter of states and parameters, all sensors"),
        "joint, gated": Contestant(
            _joint(filters.Gated(cubature, study.gate)), f"the same, without innovations beyond {study.gate:g} sigma"
        ),
        "three interleaved": Contestant(
            _three(cubature), "three cubature filters that take each other's means as certain; our noises"
        ),
        "three federated, shared sensors": Contestant(
            _three(shared),
            "the paper's structure: each of the three has two local filters with the same sensors; our noises",
        ),
        "three considered": Contestant(
            _joint(filters.Dual(cubature, BLOCKS)),
            "three that allow for each other's standard deviations, but drop their cross-covariances",
        ),
        "redesigned": Contestant(
            _joint(apart),
            "cross-covariances of the three are kept; one local filter per device, each with the whole prediction",
        ),
        "redesigned, isolating": Contestant(
            _joint(isolating), "the same; a device with too large innovations is left out"
        ),
    }


def with_shares() -> Contestant:
    """The redesign with N. Carlson's shares of information instead of a common prediction."""
    what = "as redesigned, but each local filter has a third of the information, and its points lie sqrt(3) as far out"
    return Contestant(_joint(filters.Federated(filters.Cubature(), GROUPS)), what)


def _guess(study: Study, start: Any, drive: Drive) -> Found:
    model = states_model(study, planar(study, start), drive)
    keep = lambda belief: (jnp.stack(belief.mean), belief.covariance)
    _, (mean, covariance) = kit.scan_and_keep(filters.Cubature(), model, rows_of(study, drive), None, keep)
    guess = jnp.log(jnp.stack([jnp.asarray(getattr(start, name)) for name in PARAMETERS]))
    vector = jnp.concatenate([mean, jnp.broadcast_to(guess, (mean.shape[0], 4))], axis=1)
    return _result(vector, jnp.pad(covariance, ((0, 0), (0, 4), (0, 4))))


def _joint(filter_: Any):
    def run(study, start, drive):
        model = joint_model(study, start, drive)
        keep = lambda belief: (jnp.stack(belief.mean), belief.covariance)
        _, (mean, covariance) = kit.scan_and_keep(filter_, model, rows_of(study, drive), None, keep)
        return _result(mean, covariance)

    return run


def _result(vector: Any, covariance: Any) -> Found:
    v_x, v_y, yaw_rate = vector[:, 0], vector[:, 1], vector[:, 2]
    return Found(v_x, v_y, yaw_rate, jnp.exp(vector[:, 3:]), vector, covariance)


def _with_parameters(names: tuple[str, ...]):
    """A function that puts parameters, given by their logarithms, into the car."""

    def put(car, x):
        where = lambda car: [getattr(car, name) for name in names]
        return eqx.tree_at(where, car, [jnp.exp(value) for value in x])

    return put


PUT_BODY, PUT_FRICTION = _with_parameters(BLOCKS[1]), _with_parameters(BLOCKS[2])


def _three(filter_: Any):
    """The paper's three estimators, each with `filter_`, in logarithms and with the joint filter's noises."""

    def run(study, start, drive):
        car = planar(study, start)
        states = states_model(study, car, drive)
        spreads = dict(
            mass=study.mass_spread, yaw_inertia=study.inertia_spread,
            front_axle_to_cg=study.cg_spread, friction=study.friction_spread,
        )  # fmt: skip
        rows = rows_of(study, drive)
        told = Told(rows.t[0], jax.tree.map(lambda leaf: leaf[0], rows.u), car, states.prior.mean)
        turns = {
            "state": filters.Turn(
                filter_, states, lambda told: told.car,
                lambda belief, row, told: told._replace(t=row.t, u=row.u, state=belief.mean),
            )
        }  # fmt: skip
        for names, put in ((BLOCKS[1], PUT_BODY), (BLOCKS[2], PUT_FRICTION)):
            kind = record_type("State", names)
            model = StateSpace(
                transition=stays, observation=SeenThrough(put),
                process_noise=Continuous(Gaussian(dict.fromkeys(names, study.walk))),
                measurement_noise=Gaussian(noise_levels(study)),
                prior=Prior(kind(*[jnp.log(getattr(car, name)) for name in names]), {n: spreads[n] for n in names}),
                inputs=states.inputs, input_path="linear",
            )  # fmt: skip
            tell = lambda belief, row, told, put=put: told._replace(car=put(told.car, belief.mean))
            turns[names[0]] = filters.Turn(filter_, model, lambda told: told, tell)
        kept = filters.interleave(turns, rows, told, keep=vector_and_covariance).kept
        (state, P), (body, P_body), (friction, P_friction) = (kept[name] for name in turns)
        covariance = jnp.zeros((state.shape[0], 7, 7)).at[:, :3, :3].set(P)
        covariance = covariance.at[:, 3:4, 3:4].set(P_friction).at[:, 4:, 4:].set(P_body)
        return _result(jnp.concatenate([state, friction, body], axis=1), covariance)

    return run


def metrics(study: Study, found: Found, drive: Drive, truth: Any) -> dict[str, Any]:
    """Errors of a run: `<parameter>_error` (shares, at the end), `sideslip_rmse` (degrees, from `settled` on) and
    `sideslip_rmse_fault` (during the fault), `nees` of the parameters at the end and `nees_all` of states and parameters
    (mean from `settled` on), both divided by their dimensions; `v_x_rmse` and `v_y_rmse` (m/s, from `settled` on); and ten
    estimates per second.
    """
    t = times(study)
    later, wrong = t >= study.settled, (t >= study.fault_at) & (t < study.fault_at + study.fault_time)
    sideslip = numerics.arctan2(found.v_y, found.v_x)
    off = jnp.rad2deg(sideslip - drive.true_sideslip)
    rms = lambda rows: jnp.sqrt(jnp.sum(jnp.where(rows, off**2, 0.0)) / _count(rows))
    speed = lambda error: jnp.sqrt(jnp.sum(jnp.where(later, error**2, 0.0)) / _count(later))
    true = jnp.stack([drive.true_v_x, drive.true_v_y, drive.true_yaw_rate], axis=1)
    error = found.vector - jnp.concatenate([true, jnp.broadcast_to(jnp.log(truth), (t.shape[0], 4))], axis=1)
    nees = _squared_distance(error[-1, 3:], found.covariance[-1, 3:, 3:]) / 4.0
    every = jax.vmap(_squared_distance)(error, found.covariance) / 7.0
    share = jnp.abs(found.parameters[-1] / truth - 1.0)
    seen = slice(None, None, round(0.1 / study.dt))
    return {
        **{f"{name}_error": share[i] for i, name in enumerate(PARAMETERS)},
        "sideslip_rmse": rms(later),
        "sideslip_rmse_fault": rms(wrong),
        "v_x_rmse": speed(found.v_x - drive.true_v_x),
        "v_y_rmse": speed(found.v_y - drive.true_v_y),
        "nees": nees,
        "spread": jnp.sqrt(jnp.diagonal(found.covariance[-1, 3:, 3:])),
        "nees_each": error[-1, 3:] ** 2 / jnp.diagonal(found.covariance[-1, 3:, 3:]),
        "nees_all": jnp.sum(jnp.where(later, every, 0.0)) / _count(later),
        "sideslip": sideslip[seen],
        "v_x": found.v_x[seen],
        "v_y": found.v_y[seen],
        "parameters": found.parameters[seen],
    }


def _count(rows: Any) -> Any:
    return jnp.sum(jnp.where(rows, 1.0, 0.0))


def _squared_distance(error: Any, covariance: Any) -> Any:
    """e^T P^-1 e; infinite if a variance is zero."""
    std = jnp.sqrt(jnp.diagonal(covariance))
    factor = numerics.cholesky(covariance / (std[:, None] * std[None, :]))
    value = numerics.mahalanobis(factor, error / std)
    return jnp.where(jnp.isfinite(value), value, jnp.inf)
