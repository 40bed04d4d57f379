"""Property files that are written: read again they are the same tyre."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shared_data import shared, shared_names

from jaxveh import InputError, io, tyres
from jaxveh.io.property_file import parse_property_file
from jaxveh.tyres import property_writer
from jaxveh.tyres.property_file import side_of

FILES = shared_names("tyres", "*.tir")


def same(found, expected):
    assert found.version == expected.version
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        assert one.dtype == other.dtype and one == other


def made_up(version=61):
    """Every coefficient another number, with all its digits, ranges and scaling factors included."""
    tyre = tyres.typical_mf_tyre(4321.0, version=version)
    leaves, tree = jax.tree.flatten(tyre)
    random = np.random.default_rng(7)
    return jax.tree.unflatten(tree, [jnp.asarray(random.uniform(0.1, 3.0)) for _ in leaves])


@pytest.mark.parametrize("name", FILES)
def test_shared_files_come_back(name):
    file = io.read_property_file(shared("tyres") / name)
    tyre = tyres.from_property_file(file)
    same(tyres.from_property_file(tyres.to_property_file(tyre)), tyre)
    assert tyres.to_property_file(tyre, like=file).lines == file.lines


@pytest.mark.parametrize("name", FILES)
def test_a_shared_file_takes_another_tyre(name, tmp_path):
    file, tyre = io.read_property_file(shared("tyres") / name), made_up(62)
    io.write_property_file(tyres.to_property_file(tyre, like=file), tmp_path / "new.tir")
    written = io.read_property_file(tmp_path / "new.tir")
    same(tyres.from_property_file(written), tyre)
    assert written.sections["UNITS"] == file.sections["UNITS"]
    comments = [line for line in file.lines if line.lstrip().startswith(("$", "!"))]
    assert comments == [line for line in written.lines if line.lstrip().startswith(("$", "!"))]


@pytest.mark.parametrize("version", [52, 61, 62])
def test_a_new_file_holds_every_coefficient(version):
    tyre = made_up(version)
    file = tyres.to_property_file(tyre, side="left")
    same(tyres.from_property_file(file), tyre)
    assert file.number("FITTYP") == {52: 6, 61: 61, 62: 62}[version]
    assert side_of(file) == "left" and file.unit("LENGTH") == 1.0
    assert len(file.entries) == len({entry.key for entry in file.entries})


def test_nothing_is_odd_about_a_typical_tyre():
    assert tyres.check_property_file(tyres.to_property_file(tyres.typical_mf_tyre(4000.0), side="left")) == []


def test_units_of_the_file_are_kept():
    tyre = made_up()
    text = "".join(tyres.to_property_file(tyre).lines).replace("'meter'", "'mm'").replace("'newton'", "'kN'")
    file = tyres.to_property_file(tyre, like=parse_property_file(text))
    found = tyres.from_property_file(file)
    assert file.number("FNOMIN") == pytest.approx(1e-3 * float(tyre.structure.FNOMIN), rel=1e-15)
    assert file.number("NOMPRES") == pytest.approx(1e-9 * float(tyre.structure.NOMPRES), rel=1e-15)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(tyre), strict=True):
        np.testing.assert_allclose(one, other, rtol=4e-16)


SHORT = """\
[MODEL]
PROPERTY_FILE_FORMAT = 'PAC2002'
[ODD]
NOTE = 'kept' $ by hand
[VERTICAL]
FNOMIN = 4000 $ N
[DIMENSION]
UNLOADED_RADIUS = 0.3
[LONGITUDINAL_COEFFICIENTS]
PCX1 = 1.6
PDX1 = 1.0
PKX1 = 20
[LATERAL_COEFFICIENTS]
PCY1 = 1.3
PDY1 = 1 $ friction
PKY1 = -15
PKY2 = 1.5"""


def test_what_is_missing_is_added_where_silence_means_something_else():
    like = parse_property_file(SHORT)
    tyre = tyres.from_property_file(like)
    new = eqx.tree_at(
        lambda t: (t.lateral.PDY1, t.lateral.PDY2, t.structure.NOMPRES, t.scaling.LMUY),
        tyre,
        tuple(map(jnp.asarray, (0.9, -0.2, 2e5, 0.5))),
    )
    file = tyres.to_property_file(new, like=like)
    same(tyres.from_property_file(file), new)
    text = "".join(file.lines)
    assert "PDY1 = 0.9 $ friction\n" in text and "NOTE = 'kept' $ by hand\n" in text
    assert file.sections["LATERAL_COEFFICIENTS"]["PDY2"] == -0.2
    assert file.sections["SCALING_COEFFICIENTS"] == {"LMUY": 0.5}
    # NOMPRES alone would have changed the inflation pressure, on which the file is silent.
    assert file.sections["OPERATING_CONDITIONS"] == {"NOMPRES": 2e5, "INFLPRES": 2.2e5}
    assert len(file.lines) == len(like.lines) + 6


def test_notes_stand_under_the_first_heading():
    like = parse_property_file(SHORT)
    tyre = tyres.from_property_file(like)
    file = tyres.to_property_file(tyre, like=like, note="Fitted.\nTwice.")
    assert file.lines[:3] == ("[MODEL]\n", "$ Fitted.\n", "$ Twice.\n") and file.lines[3:] == like.lines[1:]
    new = tyres.to_property_file(tyre, note="Fitted.")
    assert new.lines[:2] == ("[MDI_HEADER]\n", "$ Fitted.\n")
    same(tyres.from_property_file(new), tyre)


def test_versions_change_the_file():
    like = parse_property_file(SHORT)
    tyre = dataclasses.replace(tyres.from_property_file(like), version=61)
    file = tyres.to_property_file(tyre, like=like)
    assert file.sections["MODEL"]["FITTYP"] == 61
    same(tyres.from_property_file(file), tyre)
    back = tyres.to_property_file(dataclasses.replace(tyre, version=52), like=file)
    assert back.sections["MODEL"]["FITTYP"] == 6


def test_single_precision_is_written_with_its_own_digits(float32):
    tyre = tyres.typical_mf_tyre(4000.0)
    file = tyres.to_property_file(tyre)
    assert file.number("DREFF") == 0.27
    same(tyres.from_property_file(file), tyre)


def test_bad_tyres_are_refused():
    tyre = tyres.typical_mf_tyre(4000.0)
    with pytest.raises(InputError, match="Brush: must be an MFTyre"):
        tyres.to_property_file(tyres.Brush(8e4, 6e4))
    worn = type(tyres.MFTyre)("Worn", (tyres.MFTyre,), {"__module__": __name__, "__annotations__": {}})
    with pytest.raises(InputError, match="Worn: must be an MFTyre"):
        tyres.to_property_file(worn(**{one.name: getattr(tyre, one.name) for one in dataclasses.fields(tyre)}))
    with pytest.raises(InputError, match=r"lateral\.PKY1 = nan: must be one finite number"):
        tyres.to_property_file(eqx.tree_at(lambda t: t.lateral.PKY1, tyre, jnp.asarray(jnp.nan)))
    with pytest.raises(InputError, match="has its own side"):
        tyres.to_property_file(tyre, like=tyres.to_property_file(tyre), side="left")
    with pytest.raises(InputError, match="load = -1"):
        tyres.typical_mf_tyre(-1.0)


def test_sections_hold_each_coefficient_once():
    names = [name for section in property_writer.SECTIONS.values() for name in section]
    assert len(names) == len(set(names))


IN_OTHER_UNITS = {
    **dict.fromkeys(("UNLOADED_RADIUS", "WIDTH", "RIM_RADIUS", "BOTTOM_OFFST"), 1e3),  # mm
    **dict.fromkeys(("LONGVL", "VXLOW"), 1.0),  # mm/ms
    **dict.fromkeys(("FNOMIN", "FZMIN", "FZMAX"), 1e-3),  # kN
    **dict.fromkeys(("VERTICAL_STIFFNESS", "LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS"), 1e-6),  # kN/mm
    **dict.fromkeys(("NOMPRES", "INFLPRES", "PRESMIN", "PRESMAX"), 1e-9),  # kN/mm^2
}


@pytest.mark.parametrize("version", [52, 61, 62])
def test_a_file_in_other_units_is_the_same_tyre(version):
    """Every number with a dimension, one at a time where it stands, in millimetres, kilonewtons and milliseconds."""
    tyre = tyres.typical_mf_tyre(4000.0, version=version)
    numbers = {"VERTICAL_STIFFNESS": 2e5, "LONGITUDINAL_STIFFNESS": 4e5, "LATERAL_STIFFNESS": 1e5, "BOTTOM_OFFST": 0.01,
               "RIM_RADIUS": 0.19, "WIDTH": 0.2, "FZMIN": 100.0, "FZMAX": 9e3, "PRESMIN": 1e5, "PRESMAX": 4e5}  # fmt: skip
    had = [part for part in ("structure", "ranges") if hasattr(tyre, part)]
    for name, value in numbers.items():
        part = next(part for part in had if hasattr(getattr(tyre, part), name))
        tyre = eqx.tree_at(lambda t, part=part, name=name: getattr(getattr(t, part), name), tyre, jnp.asarray(value))
    lines, changed = [], set()
    for line in "".join(tyres.to_property_file(tyre).lines).splitlines():
        key = line.partition("=")[0].strip()
        if key in IN_OTHER_UNITS:
            changed.add(key)
            line = f"{key} = {float(line.partition('=')[2].split('$')[0]) * IN_OTHER_UNITS[key]!r}"
        line = {"LENGTH": "LENGTH = 'mm'", "FORCE": "FORCE = 'kN'", "TIME": "TIME = 'millisecond'"}.get(key, line)
        lines.append(line)
    assert changed == set(IN_OTHER_UNITS)
    again = tyres.from_property_file(parse_property_file("\n".join(lines) + "\n"))
    for one, other in zip(jax.tree.leaves(tyre), jax.tree.leaves(again), strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-9)
