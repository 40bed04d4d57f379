"""Starts of fits: near enough to the tyre that made the data."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, tyres
from jaxveh.fitting import fit_rig, starting_tyre
from jaxveh.fitting.rig_problem import offered_forces
from jaxveh.fitting.rig_start import GENERIC_RIG, RIG_STARTS, rig_facts
from jaxveh.io import RigTable

TRUTH = tyres.Brush(slip_stiffness=80e3, cornering_stiffness=60e3, friction=0.9)


def rig_of(tyre=TRUTH, noise=20.0, rows=300, sign=1.0, **extra):
    """Slip angles and slip ratios in turn at three loads, with noise."""
    random = np.random.default_rng(3)
    angle, ratio = random.uniform(-0.2, 0.2, rows), random.uniform(-0.15, 0.15, rows)
    turn = np.arange(rows) % 3
    angle, ratio = np.where(turn == 0, 0.0, angle), np.where(turn == 1, 0.0, ratio)
    load = np.repeat([2000.0, 4000.0, 6000.0], rows // 3)
    found = tyre.forces(
        tyres.Contact(slip_angle=jnp.asarray(angle), slip_ratio=jnp.asarray(ratio), load=jnp.asarray(load))
    )
    forces = {
        name: sign * np.asarray(getattr(found, name)) + noise * random.standard_normal(rows) for name in ("F_x", "F_y")
    }
    return RigTable(slip_angle=angle, slip_ratio=ratio, load=load, **(forces | extra))


def test_facts_are_near_the_truth():
    facts = rig_facts(rig_of(pressure=np.full(300, 2.4e5)))
    assert facts.load == 4000.0 and facts.pressure == 2.4e5 and facts.speed == GENERIC_RIG["speed"]
    assert facts.friction == pytest.approx(0.9, rel=0.05)
    assert 0.75 * 80e3 < facts.slip_stiffness < 1.25 * 80e3
    assert 0.75 * 60e3 < facts.cornering_stiffness < 1.25 * 60e3


def test_silent_directions_take_the_other_one_s():
    one = rig_facts(rig_of(F_x=None))
    assert one.slip_stiffness == one.cornering_stiffness
    quiet = rig_facts(rig_of(F_x=None, F_y=None, M_z=np.ones(300)))
    assert (
        quiet.slip_stiffness == tyres.kit.GENERIC_TYRE.stiffness * 4000.0
        and quiet.friction == tyres.kit.GENERIC_TYRE.friction
    )


@pytest.mark.parametrize("name", RIG_STARTS)
def test_every_start_explains_most_of_the_lateral_force(name):
    rig = rig_of()
    law = starting_tyre(name, rig)
    contact = tyres.Contact(*map(jnp.asarray, (rig.slip_angle, rig.slip_ratio, rig.load)), speed=jnp.full(300, 16.7))
    assert "F_y" in offered_forces(law, contact)
    # Small slips alone, at the median load: the linear law has no limit, the plain Magic Formula no slip ratio.
    rows = (np.abs(rig.slip_angle) < 0.04) & (rig.slip_ratio == 0) & (rig.load == 4000)
    missed = np.asarray(law.forces(contact).F_y)[rows] - rig.F_y[rows]
    assert np.sqrt(np.mean(missed**2)) < 0.5 * np.sqrt(np.mean(rig.F_y[rows] ** 2))


def test_mf_tyres_take_the_data_s_nominal_values():
    law = starting_tyre("mf52", rig_of(pressure=np.full(300, 2.4e5), speed=np.full(300, 20.0)))
    s = law.structure
    assert law.version == 52
    assert [float(x) for x in (s.FNOMIN, s.NOMPRES, s.INFLPRES, s.LONGVL)] == [4000.0, 2.4e5, 2.4e5, 20.0]


def test_a_fit_from_the_start_finds_the_truth():
    fit = fit_rig(starting_tyre("brush", rig_of()), rig_of())
    assert float(fit.tyre.cornering_stiffness) == pytest.approx(60e3, rel=0.01)
    assert float(fit.tyre.friction) == pytest.approx(0.9, rel=0.01)


def test_known_parameters_are_not_fitted():
    fit = fit_rig(starting_tyre("mf", rig_of()), rig_of(), measured=("F_y",), throw=False)
    assert set(fit.names) == {"B", "C", "D", "E", "S_h", "S_v"}


def test_a_slip_that_only_trembles_says_nothing():
    """A cornering rig whose wheel is not quite free: F_x and the slip ratio are noise."""
    random = np.random.default_rng(1)
    for seed in range(6):
        rig = rig_of(F_x=20 * np.random.default_rng(seed).standard_normal(300))
        trembling = dataclasses.replace(rig, slip_ratio=1e-3 * random.standard_normal(300))
        facts = rig_facts(trembling)
        assert facts.slip_stiffness == facts.cornering_stiffness > 0


def test_bad_starts_are_named():
    with pytest.raises(InputError, match="model = 'mf99': must be one of .*mf61"):
        starting_tyre("mf99", rig_of())
    with pytest.raises(InputError, match="F_y falls with slip_angle.*iso-w or ours.*--start"):
        starting_tyre("brush", rig_of(sign=-1.0))
