"""Twins of MF-Tyre: the listed ones are one tyre, and no other one or two coefficients have another sign for nothing."""

import dataclasses
import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import tyres
from jaxveh.fitting.rig_canonical import TWINS, canonical
from jaxveh.fitting.rig_data import leaf_of

VERSIONS = (52, 61, 62)
SECTIONS = ("longitudinal", "lateral", "aligning", "overturning", "rolling")
RELAXATION = ("PTX1", "PTX2", "PTX3", "PTY1", "PTY2")


def ordinary(version, seed=0):
    """A tyre with every coefficient of the size that it usually has, and an ordinary tyre's where it has one."""
    random = np.random.default_rng(seed)
    tyre = tyres.typical_mf_tyre(4000.0, version=version)
    for section in SECTIONS:
        part = getattr(tyre, section)
        values = {}
        for field in dataclasses.fields(part):
            typical = float(getattr(part, field.name))
            size = field.metadata.get("scale") or 1.0
            values[field.name] = typical * random.uniform(0.8, 1.2) or 0.3 * size * random.uniform(0.5, 1.5)
        tyre = dataclasses.replace(tyre, **{section: dataclasses.replace(part, **values)})
    return tyre


def names_of(tyre):
    every = [f"{section}.{field.name}" for section in SECTIONS for field in dataclasses.fields(getattr(tyre, section))]
    return [name for name in every if name.partition(".")[2] not in RELAXATION]


def contact(rows=24):
    random = np.random.default_rng(1)
    draw = lambda low, high: random.uniform(low, high, rows)
    return tyres.Contact(
        slip_angle=draw(-0.25, 0.25), slip_ratio=draw(-0.2, 0.2), load=draw(1500.0, 6500.0), camber=draw(-0.09, 0.09),
        speed=draw(10.0, 30.0), pressure=draw(1.8e5, 2.6e5),
    )  # fmt: skip


def flipped(tyre, names):
    leaves = lambda law: [leaf_of(law, name) for name in names]
    return eqx.tree_at(leaves, tyre, [-leaf for leaf in leaves(tyre)])


@jax.jit
def of_program(tyre, at):
    return jnp.stack([*tyre.forces(at)])


def forces(tyre, at):
    return np.asarray(of_program(tyre, at))


def peaks(found):
    return np.max(np.abs(found), axis=-1, keepdims=True)


@pytest.mark.parametrize("version", VERSIONS)
def test_twins_are_one_tyre(version):
    tyre, at = ordinary(version), contact()
    own = forces(tyre, at)
    for twin in TWINS:
        np.testing.assert_allclose(
            forces(flipped(tyre, twin.members), at) / peaks(own), own / peaks(own), atol=1e-6, err_msg=twin.lead
        )


def products(names):
    """Sets of at most two coefficients that products of the listed twins turn: by elimination over the field of two."""
    rows = {frozenset(twin.members) for twin in TWINS}
    found = set(rows)
    for _ in range(3):
        found |= {one ^ other for one, other in itertools.combinations(found, 2) if len(one ^ other) <= 4}
    return {one for one in found if 0 < len(one) <= 2}


@pytest.mark.parametrize(
    ("version", "most"), [(61, 1), *(pytest.param(version, 2, marks=pytest.mark.full) for version in VERSIONS)]
)
def test_no_other_coefficient_or_pair_turns_for_nothing(version, most):
    tyre, at = ordinary(version, seed=2), contact()
    names = names_of(tyre)
    leaves = lambda law: [leaf_of(law, name) for name in names]
    values = np.array([float(leaf) for leaf in leaves(tyre)])
    own = forces(tyre, at)

    @jax.jit
    def change(signs):
        turned = eqx.tree_at(leaves, tyre, list(values * signs))
        return jnp.max(jnp.abs(jnp.stack([*turned.forces(at)]) - own) / peaks(own))

    at_once = [some for count in range(1, most + 1) for some in itertools.combinations(range(len(names)), count)]
    signs = np.ones((len(at_once), len(names)))
    for row, some in zip(signs, at_once, strict=True):
        row[list(some)] = -1.0
    moved = np.asarray(jax.lax.map(change, signs, batch_size=256))
    alone = {names[i] for i in range(len(names)) if moved[i] < 1e-6}
    same = {frozenset(names[i] for i in some) for some, one in zip(at_once, moved, strict=True) if one < 1e-6}
    # Of coefficients that this version does not have, either sign is the same too, alone or beside any other.
    absent = {name for name in alone if np.isclose(float(sensitivity(tyre, at, name)), 0.0, atol=1e-12)}
    same = {one - absent for one in same} - {frozenset()}
    expected = {one - absent for one in products(names)} - {frozenset()}
    singles = {next(iter(one)) for one in expected if len(one) == 1}
    expected |= {frozenset(pair) for pair in itertools.combinations(singles, 2)}
    assert same == {one for one in expected if len(one) <= most}


def sensitivity(tyre, at, name):
    """How much forces change where a coefficient does, over their peaks."""
    moved = eqx.tree_at(lambda law: leaf_of(law, name), tyre, 1.1 * leaf_of(tyre, name))
    own = forces(tyre, at)
    return np.max(np.abs(forces(moved, at) - own) / np.maximum(peaks(own), 1e-9))


@pytest.mark.parametrize("version", VERSIONS)
def test_every_twin_comes_to_the_same_form(version):
    tyre, at, random = ordinary(version), contact(), np.random.default_rng(3)
    form = canonical(tyre)
    for _ in range(10):
        other = tyre
        for twin in TWINS:
            other = flipped(other, twin.members) if random.random() < 0.5 else other
        again = canonical(other)
        assert [float(leaf_of(again, name)) for name in names_of(tyre)] == [
            float(leaf_of(form, name)) for name in names_of(tyre)
        ]
    assert all(float(leaf_of(form, twin.lead)) > 0 for twin in TWINS)
    np.testing.assert_allclose(forces(form, at), forces(tyre, at), rtol=1e-5, atol=1e-5)


def test_what_is_fixed_stays():
    tyre = flipped(ordinary(61), ["lateral.RBY2", "lateral.PKY4", "lateral.PKY1"])
    assert float(canonical(tyre).lateral.PKY4) > 0 < float(canonical(tyre).lateral.RBY2)
    held = canonical(tyre, fixed=("lateral.PKY1", "lateral.RBY2"))
    assert held.lateral.PKY4 == tyre.lateral.PKY4 and held.lateral.RBY2 == tyre.lateral.RBY2
