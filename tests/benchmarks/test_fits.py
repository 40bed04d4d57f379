"""The contestants of the fit solve the same problem, and end at the same loss."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks import fits
from benchmarks.mf_tyre_problem import COEFFICIENTS, contacts
from benchmarks.peers import numpy_mf_tyre
from jaxveh.fitting import rig_problem


@pytest.fixture(scope="module", autouse=True)
def double_precision():
    with jax.enable_x64(True):
        yield


def test_slip_forces_are_those_of_the_whole_formula():
    given = contacts(101)
    c = numpy_mf_tyre.of_type(np.dtype(float), COEFFICIENTS)
    found = numpy_mf_tyre.slip_forces(c, numpy_mf_tyre.operating(c, given))
    for ours, theirs in zip(found, numpy_mf_tyre.forces(COEFFICIENTS, given)[:2], strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.full
def test_both_fits_end_at_the_same_loss():
    pytest.importorskip("scipy")
    rig = fits.make_rig(400)
    problem, fit = fits.ours_compiled(rig)
    solved, theirs = fit(), fits.by_scipy(rig, problem, fits.METHODS[0])()
    found = float(rig_problem.loss(solved.z, problem))
    assert bool(solved.converged) and theirs.success
    assert found == pytest.approx(theirs.cost, rel=1e-3)
    # The start is far off, and the end as near as noise allows: half of the 800 residuals less what 68 coefficients take.
    assert float(rig_problem.loss(jnp.zeros_like(solved.z), problem)) > 20 * found
    assert 300 < found < 440
    # What scipy minimised is the library's own loss.
    assert float(rig_problem.loss(jnp.asarray(theirs.x), problem)) == pytest.approx(theirs.cost, rel=1e-9)
