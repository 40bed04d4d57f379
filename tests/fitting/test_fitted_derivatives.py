"""Second derivatives that fits are made of: standard errors from a curvature, and the slope of an optimum.

Through functions of `numerics` whose derivative rules jax before 0.12 drops from the values that a scan's backward pass keeps.
"""

from collections import namedtuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import Recording, filters, numerics
from jaxveh import statespace as ss
from jaxveh._core.parameter import positive
from jaxveh.fitting import cut, maximum_likelihood, pose_shooting, solve

State = namedtuple("State", "slip")
Steer = namedtuple("Steer", "steer")
Seen = namedtuple("Seen", "force")


class Saturating(eqx.Module):
    """A force that saturates over the slip, which follows the steer."""

    k: jax.Array = positive("1/s")
    b: jax.Array = positive("1")


def slips(system, t, x, u):
    return State(u.steer - system.k * numerics.arctan(system.b * x.slip))


def see(system, t, x, u):
    return Seen(numerics.sin(1.3 * numerics.arctan(system.b * x.slip)))


def model(noise=0.05):
    return ss.StateSpace(
        system=Saturating(1.0, 2.0),
        transition=ss.Propagate(slips),
        observation=see,
        process_noise=ss.Continuous(ss.Gaussian({"slip": 0.05})),
        measurement_noise=ss.Gaussian({"force": noise}),
        prior=ss.Prior(State(0.1), {"slip": 0.1}),
        inputs=("steer",),
    )


def drive(rows=25):
    time = 0.1 * np.arange(rows)
    steer = 1.5 * np.sin(2.0 * time)
    slip = np.zeros(rows)
    for k in range(rows - 1):
        slip[k + 1] = slip[k] + 0.1 * (steer[k] - 1.2 * np.arctan(2.5 * slip[k]))
    force = np.sin(1.3 * np.arctan(2.5 * slip)) + 0.05 * np.random.default_rng(0).normal(size=rows)
    return Recording(time, {"steer": steer, "force": force})


def test_standard_errors_of_the_likelihood_are_those_of_differences():
    recording, where = drive(), lambda m: (m.system.k, m.system.b)
    fit = maximum_likelihood(filters.Unscented(), model(), recording, where, tolerance=1e-8)
    values = np.array([float(value) for value in fit.parameters.values()])

    @jax.jit
    def gradient(logs):
        def lost(logs):
            at = eqx.tree_at(where, model(), [jnp.exp(log) for log in logs])
            return -filters.run(filters.Unscented(), at, recording).log_likelihood

        return jax.grad(lost)(logs)

    step = 1e-4
    moved = [[gradient(jnp.log(values) + sign * step * side) for sign in (1, -1)] for side in np.eye(2)]
    information = np.array([(plus - minus) / (2 * step) for plus, minus in moved])
    expected = np.sqrt(np.diagonal(np.linalg.inv(information)))
    np.testing.assert_allclose(np.array([float(s) for s in fit.parameters_std.values()]) / values, expected, rtol=1e-4)


def test_the_slope_of_a_shot_optimum_is_a_difference():
    recording = drive()

    def stiffness(noise):
        chosen = ss.with_parameters(model(), lambda m: (m.system.k, m.system.b), prior=0.3)
        chosen = eqx.tree_at(lambda m: m.measurement_noise.std.force, chosen, noise)
        return solve(pose_shooting(chosen, cut(chosen, recording, 0.8)), tolerance=1e-12).parameters.k

    at, step = jnp.asarray(0.05, jnp.float64), 1e-4
    both = jax.jit(jax.value_and_grad(stiffness))
    difference = (both(at + step)[0] - both(at - step)[0]) / (2 * step)
    np.testing.assert_allclose(both(at)[1], difference, rtol=1e-4)
