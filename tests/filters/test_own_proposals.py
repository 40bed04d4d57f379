"""A proposal of one's own: its ratio weights the particles, beside the equations in NumPy. The package's own have none."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_smoothers_of_one_state import KEY, MODEL, TIME, R

from jaxveh import Recording
from jaxveh.filters import kit

MOVES = np.array([-1.0, -0.4, 0.1, 0.7, 1.6])
RATIOS = np.array([0.3, -0.2, 0.8, 0.0, -1.1])
RECORDING = Recording(TIME[:3], {"flow": np.array([1.5, -0.8, 4.0])})


class Fixed(kit.AbstractProposalFilter):
    """Particles that move by given amounts, with given ratios."""

    def propose(self, model, particles, row, dt, key):
        return type(particles)(particles.level + MOVES), jnp.asarray(RATIOS) if self.gradient == "score" else None


def densities(y, x):
    return np.exp(-0.5 * (y - x) ** 2 / R) / np.sqrt(2.0 * np.pi * R)


@pytest.mark.parametrize("threshold", [1.0, 1e-9], ids=["resampled", "never resampled"])
@pytest.mark.parametrize("gradient", ["score", "held"], ids=["ratios", "none"])
def test_particles_are_weighted_by_the_proposal_s_ratio(threshold, gradient):
    filter_ = Fixed(5, threshold=threshold, gradient=gradient)
    rows = MODEL.rows(RECORDING)
    row = lambda k: jax.tree.map(lambda leaf: leaf[k], rows)
    belief, _ = filter_.init(MODEL, row(0), KEY)
    for k in (1, 2):
        before = np.asarray(belief.particles.level), np.asarray(belief.weights)
        belief, info = filter_.step(MODEL, belief, row(k))
        chosen = np.asarray(belief.ancestors)
        kept = np.full(5, 0.2) if threshold == 1.0 else before[1]
        x = (1.0 - 0.2 * (TIME[k] - TIME[k - 1])) * before[0][chosen] + MOVES
        ratios = np.exp(RATIOS) if gradient == "score" else 1.0
        weights = kept * ratios * densities(RECORDING["flow"][k], x)
        np.testing.assert_allclose(belief.particles.level, x, rtol=1e-12)
        np.testing.assert_allclose(belief.weights, weights / weights.sum(), rtol=1e-10)
        np.testing.assert_allclose(info.log_likelihood, np.log(weights.sum()), rtol=1e-10)
        np.testing.assert_allclose(info.ess, weights.sum() ** 2 / (weights**2).sum(), rtol=1e-10)
