"""The three federated cubature filters with the paper's printed numbers."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters
from jaxveh._core.names import record_type
from jaxveh.experiments.federated_ckf.contestants import Found
from jaxveh.experiments.federated_ckf.drives import WHEELS, Drive
from jaxveh.experiments.federated_ckf.interleaved import Told, stays, vector_and_covariance
from jaxveh.experiments.federated_ckf.model import INPUTS, State, planar, rows_of
from jaxveh.experiments.federated_ckf.settings import PARAMETERS, Study
from jaxveh.statespace import Discrete, Gaussian, Prior, Row, StateSpace
from jaxveh.vehicles import kit

FIRST, SECOND = ("a_x_1", "a_y_1", "yaw_rate_1"), ("a_y_2", "yaw_rate_2")
"""Z_1 and Z_2: the same sensors under two names, because the two local filters have different noises."""

ALL_INPUTS = (*INPUTS, *WHEELS)

EXACT = 1e-8
"""Replaces the printed variances of zero."""

STATE = ("v_x", "v_y", "a_x", "a_y", "yaw_rate", "moment")
BODY = ("mass", "yaw_inertia", "front_axle_to_cg")
MUS = kit.wheel_names("friction")

STATE_R = dict(zip((*FIRST, *SECOND), (EXACT, 0.1, 1.5, EXACT, 0.01), strict=True))
"""0.1 diag(0.0, 1, 15) and 0.01 diag(0.0, 1)."""

FRICTION_R = {**dict.fromkeys(FIRST, 1000.0), **dict.fromkeys(SECOND, 100.0)}
BODY_R = {**dict.fromkeys(FIRST, 1000.0), **dict.fromkeys(SECOND, 10.0)}
"""Printed as 1000 I(2), which is too small for three channels."""

STATE_P, STATE_Q = 0.5, 0.5
FRICTION_P, FRICTION_Q = 1.0, 0.5
BODY_P, BODY_Q = 1.0 / (1.0 / 100.0 + 1.0 / 10.0), 1.0 / (1.0 / 0.001 + 1.0 / 0.1)
"""Variances of the master per step: the printed ones belong to the two local filters, whose information adds up."""

LEAST_FRICTION, LEAST_MASS = 1e-3, 1.0
"""Least values in the model, where a point has less, even zero or a negative number."""


def as_printed(study: Study, start: Any, drive: Drive) -> Found:
    """The paper's estimators: fusion-reset, shares by traces (1/2 at first: the printed zeros would divide by zero),
    singular values, additive parameters, four frictions."""
    car = eqx.tree_at(lambda c: c.friction, planar(study, start, measured_slip=True), kit.Wheels(*[start.friction] * 4))
    rows = _printed_rows(study, drive)
    filter_ = filters.Federated(filters.Cubature(form=filters.SingularValues()), (FIRST, SECOND), by_trace=True)
    turns = {"state": _states(filter_, study), "friction": _friction(filter_, start), "body": _body(filter_, start)}
    zero = jnp.zeros_like(rows.t[0])
    state = State(zero + study.speed, zero, zero)
    told = Told(rows.t[0], jax.tree.map(lambda leaf: leaf[0], rows.u), car, state)
    kept = filters.interleave(turns, rows, told, keep=vector_and_covariance).kept
    (x, P), (mu, P_mu), (body, P_body) = (kept[name] for name in turns)
    mu_mean = jnp.mean(mu, axis=1, keepdims=True)
    parameters = jnp.concatenate([mu_mean, body], axis=1)
    # Relative errors take the place of logarithms.
    vector = jnp.concatenate([x[:, jnp.array([0, 1, 4])], jnp.log(jnp.maximum(parameters, 1e-3))], axis=1)
    scale = jnp.maximum(parameters, 1e-3)
    covariance = jnp.zeros((x.shape[0], 7, 7)).at[:, :3, :3].set(P[:, jnp.array([0, 1, 4])][:, :, jnp.array([0, 1, 4])])
    covariance = covariance.at[:, 3, 3].set(jnp.mean(P_mu, axis=(1, 2)) / scale[:, 0] ** 2)
    relative = P_body / (scale[:, 1:, None] * scale[:, None, 1:])
    covariance = covariance.at[:, 4:, 4:].set(relative)
    return Found(x[:, 0], x[:, 1], x[:, 4], parameters, vector, covariance)


def _printed_rows(study: Study, drive: Drive) -> Row:
    rows = rows_of(study, drive)
    u = record_type("Inputs", (*rows.u._fields, *WHEELS))(*rows.u, *drive.omega.T)
    said = {"a_x": drive.a_x, "a_y": drive.a_y, "yaw_rate": drive.yaw_rate}
    channels = (*FIRST, *SECOND)
    return Row(rows.t, u, record_type("Measurements", channels)(*[said[name[:-2]] for name in channels]))


def _model(names, mean, P, Q, R, transition, observation, inputs) -> StateSpace:
    kind = record_type("State", names)
    std = lambda variance: dict.fromkeys(names, float(np.sqrt(variance)))
    return StateSpace(
        transition=transition, observation=observation, process_noise=Discrete(Gaussian(std(Q))),
        measurement_noise=Gaussian({name: float(np.sqrt(variance)) for name, variance in R.items()}),
        prior=Prior(kind(*mean), std(P)), inputs=inputs,
    )  # fmt: skip


def _twice(a_x, a_y, yaw_rate) -> Any:
    said = {"a_x": a_x, "a_y": a_y, "yaw_rate": yaw_rate}
    return record_type("Measurements", (*FIRST, *SECOND))(*[said[name[:-2]] for name in (*FIRST, *SECOND)])


def _states(filter_, study: Study) -> filters.Turn:
    start = (study.speed, 0.0, 0.0, 0.0, 0.0, 0.0)
    model = _model(STATE, start, STATE_P, STATE_Q, STATE_R, _six_states, _three_of_six, ALL_INPUTS)

    def tell(belief, row, told):
        mean = belief.mean
        return told._replace(t=row.t, u=row.u, state=State(mean.v_x, mean.v_y, mean.yaw_rate))

    return filters.Turn(filter_, model, lambda told: told.car, tell)


def _six_states(car, t0, t1, x, u) -> Any:
    """Euler's step; accelerations and yaw moment are those of the forces."""
    dt = t1 - t0
    push = car.push(State(x.v_x, x.v_y, x.yaw_rate), u)
    return type(x)(
        x.v_x + dt * (x.a_x + x.v_y * x.yaw_rate),
        x.v_y + dt * (x.a_y - x.v_x * x.yaw_rate),
        push.a_x,
        push.a_y,
        x.yaw_rate + dt * x.moment / car.yaw_inertia,
        push.moment,
    )


def _three_of_six(car, t, x, u) -> Any:
    del car, t, u
    return _twice(x.a_x, x.a_y, x.yaw_rate)


def _through(put):
    """The measurements of a car with the estimated parameters, from the state in `told`."""

    def observe(told: Told, t, x, u):
        car = put(told.car, x)
        push = car.push(jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, jnp.shape(x[0])), told.state), u)
        return _twice(push.a_x, push.a_y, told.state.yaw_rate + (t - told.t) * push.moment / car.yaw_inertia)

    return observe


def _put_friction(car, x):
    mus = kit.Wheels(*[jnp.maximum(mu, LEAST_FRICTION) for mu in x])
    return eqx.tree_at(lambda c: c.friction, car, mus)


def _put_body(car, x):
    where = lambda c: [getattr(c, name) for name in BODY]
    values = [jnp.maximum(x.mass, LEAST_MASS), jnp.maximum(x.yaw_inertia, LEAST_MASS), x.front_axle_to_cg]
    return eqx.tree_at(where, car, values)


SEE_FRICTION, SEE_BODY = _through(_put_friction), _through(_put_body)


def _friction(filter_, start) -> filters.Turn:
    mean = [start.friction] * 4
    model = _model(MUS, mean, FRICTION_P, FRICTION_Q, FRICTION_R, stays, SEE_FRICTION, ALL_INPUTS)
    tell = lambda belief, row, told: told._replace(car=_put_friction(told.car, belief.mean))
    return filters.Turn(filter_, model, lambda told: told, tell)


def _body(filter_, start) -> filters.Turn:
    mean = [getattr(start, name) for name in PARAMETERS[1:]]
    model = _model(BODY, mean, BODY_P, BODY_Q, BODY_R, stays, SEE_BODY, ALL_INPUTS)
    tell = lambda belief, row, told: told._replace(car=_put_body(told.car, belief.mean))
    return filters.Turn(filter_, model, lambda told: told, tell)
