"""The tyre in a mirror: against the tyre whose odd coefficients are reversed in sign by hand."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shared_data import shared

from jaxveh import tyres
from jaxveh._core.errors import InputError
from jaxveh.io.property_file import parse_property_file, read_property_file
from jaxveh.tyres import AbstractDynamicTyre, Contact
from jaxveh.tyres.mirrored import ODD_INPUTS

pytestmark = pytest.mark.product

FILE = "mfeval__MagicFormula61_Parameters.tir"

ODD = {
    "longitudinal": ("RHX1",),
    "lateral": ("PEY3", "PHY1", "PHY2", "PVY1", "PVY2", "RBY3", "RVY1", "RVY2"),
    "aligning": ("QBZ4", "QDZ3", "QDZ6", "QDZ7", "QEZ4", "QHZ1", "QHZ2", "SSZ1"),
    "overturning": ("QSX1",),
}
"""Coefficients that change sign in the mirror, read off the equations (4.E9 to 4.E78)."""

EVEN_INPUTS = {"slip_ratio", "load", "friction", "speed", "pressure", "slip_speed", "direction"}


def in_full(version, angles):
    """A tyre none of whose coefficients is zero, with ranges that are not symmetric."""
    tyre = tyres.from_property_file(shared("tyres") / FILE, angles=angles)
    key = np.random.default_rng(20)
    for part in ("longitudinal", "lateral", "aligning", "overturning", "rolling"):
        section = getattr(tyre, part)
        full = {
            field.name: jnp.asarray(value if value != 0 else key.uniform(0.05, 0.2))
            for field in dataclasses.fields(section)
            if (value := float(getattr(section, field.name))) is not None
        }
        tyre = dataclasses.replace(tyre, **{part: dataclasses.replace(section, **full)})
    limits = {"ALPMIN": -0.3, "ALPMAX": 0.2, "CAMMIN": -0.06, "CAMMAX": 0.09}
    ranges = dataclasses.replace(tyre.ranges, **{name: jnp.asarray(value) for name, value in limits.items()})
    return dataclasses.replace(tyre, ranges=ranges, version=version)


def by_hand(tyre):
    for part, names in ODD.items():
        section = getattr(tyre, part)
        turned = {name: -getattr(section, name) for name in names}
        tyre = dataclasses.replace(tyre, **{part: dataclasses.replace(section, **turned)})
    r = tyre.ranges
    turned = {"ALPMIN": -r.ALPMAX, "ALPMAX": -r.ALPMIN, "CAMMIN": -r.CAMMAX, "CAMMAX": -r.CAMMIN}
    return dataclasses.replace(tyre, ranges=dataclasses.replace(r, **turned))


def contacts(n=400):
    key = np.random.default_rng(7)
    draw = lambda low, high: key.uniform(low, high, n)
    return Contact(
        draw(-0.4, 0.4), draw(-0.5, 0.5), draw(500.0, 12000.0), draw(-0.12, 0.12), draw(0.5, 1.1), draw(0.3, 40.0),
        draw(2e5, 3.5e5),
    )  # fmt: skip


of_program = eqx.filter_jit(lambda tyre, at: jnp.stack(tyre.forces(at)))


def forces(tyre, at):
    return np.asarray(of_program(tyre, at))


@pytest.mark.parametrize("version", [52, 61])
@pytest.mark.parametrize("angles", [True, False])
def test_odd_coefficients_turned_by_hand_give_the_same_tyre(version, angles):
    tyre, at = in_full(version, angles), contacts()
    expected, found = forces(by_hand(tyre), at), forces(tyres.Mirrored(tyre), at)
    scale = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_array_less(np.abs(found - expected) / scale, 1e-12)
    # The tyre is not its own mirror image, so that the test could fail.
    for row in (1, 2, 4):
        assert np.abs(forces(tyre, at) - expected)[row].max() > 0.01 * scale[row]


def test_forces_of_a_mirrored_contact_are_mirrored():
    tyre, at = in_full(61, True), contacts()
    turned = at._replace(slip_angle=-at.slip_angle, camber=-at.camber)
    F_x, F_y, M_x, M_y, M_z = forces(tyres.Mirrored(tyre), turned)
    np.testing.assert_array_equal([F_x, -F_y, -M_x, M_y, -M_z], forces(tyre, at))
    np.testing.assert_array_equal(forces(tyres.Mirrored(tyres.Mirrored(tyre)), at), forces(tyre, at))


def test_every_input_is_odd_or_even():
    assert set(ODD_INPUTS) | EVEN_INPUTS == set(Contact._fields)
    assert not set(ODD_INPUTS) & EVEN_INPUTS


def test_parameters_stay_one_set_and_gradients_reach_them():
    tyre = tyres.Mirrored(in_full(61, True))
    at = Contact(slip_angle=np.asarray(0.02), load=np.asarray(5000.0), slip_ratio=np.asarray(0.0))
    slope = jax.jit(jax.grad(lambda tyre, at: tyre.forces(at).F_y))(tyre, at)
    assert float(slope.tyre.lateral.PVY1) < 0 < -float(slope.tyre.lateral.PKY1)


def test_a_tyre_with_states_is_mirrored_within():
    class Lagging(AbstractDynamicTyre):
        state_names: tuple[str, ...] = ("F_y",)
        forces = start = derivatives = lambda self, *_: None

    with pytest.raises(InputError, match="Mirrored.tyre = Lagging: must be a tyre without states"):
        tyres.Mirrored(Lagging())


@pytest.mark.parametrize(("side", "mirrored"), [(None, False), ("right", False), ("left", True)])
def test_a_file_is_mounted_on_the_side_asked_for(side, mirrored):
    tyre = tyres.from_property_file(shared("tyres") / FILE, side=side)  # TYRESIDE = 'RIGHT'
    assert isinstance(tyre, tyres.Mirrored) == mirrored
    left = tyres.from_property_file(shared("tyres") / "mfeval__PacejkaBook_Defaults.tir", side="left")
    assert isinstance(left, tyres.MFTyre)  # TYRESIDE = 'Left'


def test_a_side_that_is_not_told_is_asked_for():
    file = read_property_file(shared("tyres") / FILE)
    for said in ("UNKNOWN", ""):
        text = "".join(file.lines).replace("'RIGHT'", f"'{said}'")
        with pytest.raises(InputError, match=f"TYRESIDE = {said!r}: must be 'LEFT' or 'RIGHT'"):
            tyres.from_property_file(parse_property_file(text), side="left")
        assert isinstance(tyres.from_property_file(parse_property_file(text)), tyres.MFTyre)
    with pytest.raises(InputError, match="side = 'front': must be one of"):
        tyres.from_property_file(file, side="front")
