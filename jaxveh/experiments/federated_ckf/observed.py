"""The information about the parameters in a slalom, for any estimator."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh.diagnostics import Observability, observability_at
from jaxveh.experiments.federated_ckf.drives import Drive
from jaxveh.experiments.federated_ckf.model import MOVE, State, noise_levels, planar, rows_of, sensor_outputs
from jaxveh.experiments.federated_ckf.settings import PARAMETERS, Start, Study
from jaxveh.statespace import LinearInput

START_SPREAD = (0.1, 0.1, 0.05)
"""Standard deviations of the first state: m/s, m/s, rad/s."""

RESISTANCE = {"known": 1e-6, "unknown": 0.3}
"""Standard deviations of the logarithm of the rolling resistance; filters take it as known."""


def sensitivities(study: Study, true: Start, drive: Drive) -> jax.Array:
    """(R, 8): the sensitivity of every measurement of a drive, divided by its noise, to the logarithms of the four
    parameters, to the first state and to the logarithm of the rolling resistance, at the truth and without process noise; a
    pure function, for `vmap`."""
    rows, car = rows_of(study, drive), planar(study, true)
    levels = jnp.asarray(list(noise_levels(study).values()))
    logs = jnp.log(jnp.stack([jnp.asarray(getattr(true, name)) for name in PARAMETERS]))
    start = jnp.stack([drive.true_v_x[0], drive.true_v_y[0], drive.true_yaw_rate[0]])

    def predict(z):
        resistance = car.rolling_resistance * jnp.exp(z[7])
        where = lambda c: [*[getattr(c, name) for name in PARAMETERS], c.rolling_resistance]
        own = eqx.tree_at(where, car, [*jnp.exp(z[:4]), resistance])

        def step(x, given):
            before, after = given
            x = MOVE(own, before.t, after.t, x, LinearInput(before.t, after.t, before.u, after.u))
            return x, jnp.stack(sensor_outputs(own, after.t, x, after.u)) / levels

        before, after = jax.tree.map(lambda leaf: leaf[:-1], rows), jax.tree.map(lambda leaf: leaf[1:], rows)
        return jax.lax.scan(step, State(*z[4:7]), (before, after))[1].ravel()

    return jax.jacfwd(predict)(jnp.concatenate([logs, start, jnp.zeros(1)]))


def observability_of_drives(study: Study, true: Start, drives: Drive) -> dict[str, list[list[Observability]]]:
    """The observability in each of the drives, (n, m, T), with the rolling resistance `known` and `unknown`: lists (n, m).

    Sensitivities are those at the truth. If wheels barely slide, a filter whose estimate of the friction is larger has no
    sliding wheel and no sensitivity at all: its estimate does not move, whatever the bound.
    """
    shape = drives.a_x.shape[:2]
    flat = jax.tree.map(lambda leaf: jnp.asarray(leaf.reshape(-1, *leaf.shape[2:])), drives)
    every = np.asarray(jax.jit(jax.vmap(lambda drive: sensitivities(study, true, drive)))(flat))
    every = every.reshape(*shape, *every.shape[1:])
    own = (study.friction_spread, study.mass_spread, study.inertia_spread, study.cg_spread)

    def one(J, resistance):
        spread = np.array([*own, *START_SPREAD, resistance])
        return observability_at(lambda z: jnp.asarray(J) @ z, jnp.zeros(8), PARAMETERS, spread, nuisance=4)

    return {name: [[one(J, value) for J in row] for row in every] for name, value in RESISTANCE.items()}
