"""Property files: every file of the world, its quirks, and back without loss."""

import pytest
from shared_data import shared, shared_names

from jaxveh import tyres
from jaxveh._core.errors import InputError
from jaxveh.io.property_file import parse_property_file, read_property_file, write_property_file

SMALL = """\
$ a comment = 1
[UNITS]
LENGTH = 'mm'
FORCE = 'newton'
[MODEL]
FITTYP = 61   $ version
LONGVL = 16700
[DIMENSION]
UNLOADED_RADIUS = 300   $ free radius
[VERTICAL]
FNOMIN = 4.0d3
[SHAPE]
{radial width}
1.0 0.0
[LONGITUDINAL_COEFFICIENTS]
PCX1 = 1.6
PDX1 = 1.1
PKX1 = 22
[LATERAL_COEFFICIENTS]
PCY1 = 1.3
PDY1 = 1.0
PKY1 = -15 ! stiffness
PKY2 = 1.7
[NOBODY_KNOWS]
X = 'kept'
"""
NAMES = shared_names("tyres", "*.tir")


@pytest.mark.parametrize("name", NAMES)
def test_round_trip_is_byte_for_byte(name, tmp_path):
    path = shared("tyres") / name
    write_property_file(read_property_file(path), tmp_path / name)
    assert (tmp_path / name).read_bytes() == path.read_bytes()


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_number_changes_its_line_alone(name):
    file = read_property_file(shared("tyres") / name)
    changed = file.replace({"PDY1": 0.875})
    assert changed.number("PDY1") == 0.875
    different = [(a, b) for a, b in zip(file.lines, changed.lines, strict=True) if a != b]
    assert len(different) == 1
    before, after = different[0]
    assert before.partition("$")[2] == after.partition("$")[2]
    assert changed.replace({"PDY1": file.number("PDY1")}).sections == file.sections


@pytest.mark.parametrize("name", NAMES)
def test_versions_of_the_files(name):
    expected = {"chrono": 52, "mfeval": 61, "tumftm": 52}
    assert tyres.from_property_file(shared("tyres") / name).version == expected[name.partition("__")[0]]


def test_units_comments_tables_and_unknown_sections():
    file = parse_property_file(SMALL)
    tyre = tyres.from_property_file(file)
    assert float(tyre.structure.UNLOADED_RADIUS) == pytest.approx(0.3)
    assert float(tyre.structure.LONGVL) == pytest.approx(16.7)
    assert float(tyre.structure.FNOMIN) == 4000.0
    assert float(tyre.lateral.PKY1) == -15.0
    assert file.sections["NOBODY_KNOWS"] == {"X": "kept"}
    assert "SHAPE" not in file.sections and "1.0 0.0\n" in file.lines
    assert float(tyre.scaling.LMUX) == 1.0 and float(tyre.lateral.PEY1) == 0.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("PCY1 = 1.3\n", "", "PCY1 is missing"),
        ("PCY1 = 1.3", "PCY1 = fast", r"line 20: PCY1 = 'fast': must be one finite number"),
        ("PCY1 = 1.3", "PCY1 = 'fast'", r"line 20: PCY1 = 'fast': must be one finite number"),
        (
            "PCY1 = 1.3",
            "PCY1 = 1.3\nPCY1 = 1.4",
            r"PCY1 has several values: 1.3 in \[LATERAL_COEFFICIENTS\], line 20, 1.4 ",
        ),
        ("[NOBODY_KNOWS]", "[NOBODY_KNOWS]\nFNOMIN = 3", "FNOMIN has several values"),
        ("'mm'", "'furlong'", "LENGTH = 'furlong': must be one of meter"),
        ("FNOMIN = 4.0d3", "FNOMIN = -4", "Structure.FNOMIN = -4"),
        ("FITTYP = 61", "FITTYP = 63", "FITTYP = 63: must be one of 5, 6"),
        ("FITTYP = 61", "", "neither FITTYP nor a PROPERTY_FILE_FORMAT"),
    ],
)
def test_bad_files_are_named(old, new, message):
    assert old in SMALL
    with pytest.raises(InputError, match=message):
        tyres.from_property_file(parse_property_file(SMALL.replace(old, new)))


def test_what_is_no_property_file(tmp_path):
    other = tmp_path / "notes.tir"
    other.write_text("a line\nb = 3\n")
    with pytest.raises(InputError, match="no tyre property file"):
        read_property_file(other)
    with pytest.raises(InputError, match="cannot be read"):
        read_property_file(tmp_path / "absent.tir")
    file = parse_property_file(SMALL)
    with pytest.raises(InputError, match="PXX9 is not in the file"):
        file.replace({"PXX9": 1.0})
    with pytest.raises(InputError, match="exists already"):
        write_property_file(file, other)
