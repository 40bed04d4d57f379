"""Property files spoilt at random: each ends in a finite tyre or in an `InputError`, never in a traceback."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mutations import mutations
from property_files import FILES, own_files

from jaxveh import io, tyres
from jaxveh._core.errors import InputError
from jaxveh.tyres import Contact

COUNT, MANY = 1000, 12_000
"""Mutations of the project's own files, and as many of the shared ones: in the default run, and in the full one, which has
those of the default run among its own (its seeds begin with the same one)."""

SEEDS = range(1, 7)

LARGE = 1e9
"""Coefficients of a tyre are smaller, stiffnesses of trucks included."""


def contacts():
    """An ordinary contact, one at the limits, and none: no load, standstill."""
    rows = np.array([[0.02, 0.01, 3000.0, 0.02, 16.0], [1.2, -1.0, 8000.0, -0.1, 40.0], [0.0, 0.0, 0.0, 0.0, 0.0]])
    angle, ratio, load, camber, speed = rows.T
    return Contact(slip_angle=angle, slip_ratio=ratio, load=load, camber=camber, speed=speed)


@jax.jit
def outputs(tyre, at):
    return jnp.stack([jnp.broadcast_to(value, at.load.shape) for value in tyre.outputs(at)])


def ordinary(tyre):
    """Whether no coefficient is so large that forces overflow by right."""
    exponents = tyre.longitudinal.PKX3, tyre.longitudinal.PTX3, tyre.rolling.QSY7, tyre.rolling.QSY8
    coefficients = numbers([getattr(tyre, one.name) for one in dataclasses.fields(tyre) if one.name != "ranges"])
    return (np.abs(coefficients) < LARGE).all() and (np.abs(numbers(exponents)) < 10).all()


def numbers(tree):
    return np.array([np.asarray(leaf) for leaf in jax.tree.leaves(tree)])


def check_outcomes(files, count, seed, folder):
    """How many mutations gave a tyre; asserts that it is finite, and so is what it gives."""
    path, at, found, seen = folder / "odd.tir", contacts(), 0, set()
    for k, data in enumerate(mutations(seed, files, count)):
        path.write_bytes(data)
        try:
            file = io.read_property_file(path)
            said = tuple((entry.section, entry.key, entry.value) for entry in file.entries)
            # Half of the time goes into making tyres: those of which comments alone were changed are made once.
            tyre = None if said in seen else tyres.from_property_file(file)
        except InputError:
            continue
        found += 1
        seen.add(said)
        if tyre is not None:
            assert np.isfinite(numbers(tyre)).all(), k
            if ordinary(tyre):
                assert np.isfinite(outputs(tyre, at)).all(), k
    return found


@pytest.mark.parametrize("files", FILES)
def test_a_finite_tyre_or_an_error(files, tmp_path):
    found = check_outcomes(FILES[files](tmp_path), COUNT, SEEDS[0], tmp_path)
    # Neither is what nearly always happens: the mutations are of both kinds.
    assert 0.1 * COUNT < found < 0.9 * COUNT


@pytest.mark.full
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("files", FILES)
def test_a_finite_tyre_or_an_error_many_times(files, seed, tmp_path):
    assert check_outcomes(FILES[files](tmp_path), MANY // len(SEEDS), seed, tmp_path)


def test_what_is_read_is_written_byte_for_byte(tmp_path):
    """Whatever can be read, odd lines included, comes out of the writer as it was."""
    odd, out = tmp_path / "odd.tir", tmp_path / "out.tir"
    written = 0
    for data in mutations(21, own_files(tmp_path), 300):
        odd.write_bytes(data)
        try:
            file = io.read_property_file(odd)
        except InputError:
            continue
        io.write_property_file(file, out, overwrite=True)
        assert out.read_bytes() == data
        written += 1
    assert written > 100
