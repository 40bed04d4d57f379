"""Whether one call serves several tyres, and what it gives."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh.tyres import Contact, MagicFormula
from jaxveh.vehicles.together import alike, together


def magic(D):
    return MagicFormula(B=10.0, C=1.3, D=D, E=0.2)


def test_tyres_of_one_law_with_other_numbers_are_alike():
    assert alike(magic(jnp.asarray(4000.0)), magic(jnp.asarray(5000.0)))
    assert not alike(magic(jnp.asarray(4000.0)), magic(jnp.asarray([4000.0, 5000.0])))


@pytest.mark.parametrize("batch", [(), (5,), (2, 3)])
def test_one_call_gives_each_wheel_its_own(batch):
    tyres = [magic(jnp.asarray(D)) for D in (4000.0, 5000.0)]
    angles = np.random.default_rng(0).uniform(-0.1, 0.1, (2, *batch))
    slips = [Contact(slip_angle=jnp.asarray(a), load=jnp.asarray(4000.0)) for a in angles]
    found = together(lambda tyre, contact: tyre.forces(contact), tuple(tyres), tuple(slips))
    for force, tyre, contact in zip(found, tyres, slips, strict=True):
        np.testing.assert_allclose(force.F_y, tyre.forces(contact).F_y, rtol=1e-14)
