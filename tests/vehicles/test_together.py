"""Whether one call serves several tyres, and what it gives."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh.tyres import Contact, MagicFormula, Relaxed, typical_mf_tyre
from jaxveh.vehicles import wheels
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


LONG, SHORT = typical_mf_tyre(4000.0), magic(jnp.asarray(4000.0))
OTHER = typical_mf_tyre(4000.0, version=52)
SLIPS = [Contact(slip_angle=0.01 * i, load=4000.0, speed=20.0, slip_speed=20.0) for i in (1.0, 2.0, 3.0, 4.0)]
UNLIKE = [*SLIPS[:2], *(at._replace(speed=None) for at in SLIPS[2:])]


@pytest.mark.parametrize(
    "law", [lambda tyre: tyre, lambda tyre: Relaxed(tyre, sigma_y=0.3)], ids=["steady", "with states"]
)
@pytest.mark.parametrize(
    ("axles", "contacts", "served"),
    [
        ((LONG, LONG), SLIPS, [4]),
        ((LONG, OTHER), SLIPS, [2, 2]),
        ((LONG, LONG), UNLIKE, [2, 2]),
        ((LONG, SHORT), SLIPS, [2]),
        ((SHORT, SHORT), SLIPS, []),
    ],
    ids=["alike", "of two versions", "told of other things", "one long", "short"],
)
def test_a_long_law_is_called_once_where_one_call_can_serve_and_a_short_one_for_each_wheel(
    axles, contacts, served, law, monkeypatch
):
    calls, set_of = [], wheels.Tyres(*map(law, axles), False)

    def counted(function, tyres, *values):
        calls.append(len(tyres))
        return together(function, tyres, *values)

    monkeypatch.setattr(wheels, "together", counted)
    contacts = wheels.Wheels(*contacts)
    start = set_of.start(contacts)
    states = set_of.states(SimpleNamespace(**dict(zip(set_of.state_names, start, strict=True))))
    calls.clear()
    found = set_of.forces(contacts, states)
    assert calls == served
    for tyre, at, state, forces in zip(set_of.wheels, contacts, states, found, strict=True):
        alone = tyre.forces(at) if state is None else tyre.forces(at, state)
        np.testing.assert_allclose(forces.F_y, alone.F_y, rtol=1e-12)
