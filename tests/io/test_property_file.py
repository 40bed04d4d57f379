"""Property files: every file of the world, its quirks, and back without loss."""

import random

import equinox as eqx
import jax
import jax.numpy as jnp
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
    with pytest.raises(InputError, match="not a tyre property file"):
        read_property_file(other)
    with pytest.raises(InputError, match="cannot be read"):
        read_property_file(tmp_path / "absent.tir")
    file = parse_property_file(SMALL)
    with pytest.raises(InputError, match="PXX9 is not in the file"):
        file.replace({"PXX9": 1.0})
    with pytest.raises(InputError, match="exists already"):
        write_property_file(file, other)


# Shapes that files of the world have, in lines of which the tyre has no need.
ODD = {
    "no value": "ROAD_INCREMENT =",
    "no value, and a comment": "ROAD_DIRECTION =        $ not set",
    "a unit": "MASS = kg",
    "a text": "CONSTRUCTION = R20 16 x 7.5",
    "two numbers": "FREQ_LAT = 1.2 1.2",
    "not finite": "DAMP_LAT = NaN",
    "too large": "BELT_MASS = 1e400",
    "digits that are none": "BELT_IXX = 1_000",
    "an open quote": "VENDOR = 'open",
}


@pytest.mark.parametrize("odd", ODD)
def test_a_line_that_nobody_reads_is_kept_and_told_of(odd, tmp_path):
    line, key = ODD[odd], ODD[odd].split()[0]
    text = SMALL.replace("[SHAPE]", f"[INERTIA]\n{line}\n[SHAPE]")
    path = tmp_path / "odd.tir"
    path.write_bytes(text.encode())
    file = read_property_file(path)
    expected, found = tyres.from_property_file(parse_property_file(SMALL)), tyres.from_property_file(file)
    assert jax.tree.leaves(found) == jax.tree.leaves(expected)
    assert isinstance(file.sections["INERTIA"][key], str)
    assert [finding for finding in tyres.check_property_file(file) if key in finding.about]
    # Through the writer too, also where other numbers change.
    write_property_file(
        tyres.to_property_file(tyres.from_property_file(file.replace({"PDY1": 0.9})), file), path, overwrite=True
    )
    assert line in path.read_text().splitlines() and "PDY1 = 0.9" in path.read_text()


@pytest.mark.parametrize(
    "value", ["NaN", "inf", "-inf", "1e400", "1_000", "1.2 1.2", "１２", "٣", "fast", "1,5", "0x10", "1.5 kg", "1e"]
)
@pytest.mark.parametrize("key", ["PKY1", "PEY1", "FITTYP", "LMUX"])
def test_what_the_tyre_reads_must_be_one_finite_number(key, value):
    old = {"PKY1": "PKY1 = -15 !", "FITTYP": "FITTYP = 61   $"}.get(key, "[NOBODY_KNOWS]")
    text = SMALL.replace(old, f"{key} = {value} $\n" if old[0] != "[" else f"[X]\n{key} = {value}\n{old}")
    with pytest.raises(InputError, match=rf"{key} = .*: must be one finite number"):
        tyres.from_property_file(parse_property_file(text))


def test_silence_in_other_words():
    """An empty entry, and a zero for what was not measured, are as if the line were not there."""
    text = SMALL.replace("[VERTICAL]", "WIDTH = 0\nRIM_RADIUS =\n[VERTICAL]\nVERTICAL_STIFFNESS = 0.0\nQ_RE0 = 0")
    odd, plain = (
        tyres.from_property_file(parse_property_file(text)),
        tyres.from_property_file(parse_property_file(SMALL)),
    )
    assert jax.tree.leaves(odd) == jax.tree.leaves(plain)
    about = " ".join(finding.about for finding in tyres.check_property_file(parse_property_file(text)))
    assert all(key in about for key in ("WIDTH", "RIM_RADIUS", "VERTICAL_STIFFNESS", "Q_RE0"))
    with pytest.raises(InputError, match="FNOMIN has no value"):
        tyres.from_property_file(parse_property_file(SMALL.replace("FNOMIN = 4.0d3", "FNOMIN =")))
    with pytest.raises(InputError, match=r"property file: Scaling\.LFZO = 0\.0: must be positive"):
        tyres.from_property_file(parse_property_file(SMALL + "LFZO = 0\n"))


def test_a_value_that_was_missing_is_written_in_its_line():
    file = parse_property_file(SMALL.replace("[VERTICAL]", "WIDTH =     $ not told\n[VERTICAL]"))
    assert "WIDTH = 0.2 $ not told\n" in file.replace({"WIDTH": 0.2}).lines
    tyre = eqx.tree_at(lambda t: t.structure.WIDTH, tyres.from_property_file(file), jnp.asarray(0.25))
    lines = tyres.to_property_file(tyre, file).lines
    assert [line for line in lines if "WIDTH" in line] == ["WIDTH = 250.0 $ not told\n"]


def test_a_byte_order_mark_does_not_hide_the_units(tmp_path):
    path = tmp_path / "marked.tir"
    text = SMALL.removeprefix("$ a comment = 1\n")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert float(tyres.from_property_file(path).structure.UNLOADED_RADIUS) == pytest.approx(0.3)
    path.write_bytes(text.encode("utf-16"))
    with pytest.raises(InputError, match="contains zero bytes"):
        tyres.from_property_file(path)


def test_entries_that_contradict_each_other():
    with pytest.raises(InputError, match=r"LENGTH has several values: 'mm' in \[UNITS\], line 3, 'inch'"):
        tyres.from_property_file(parse_property_file(SMALL.replace("FORCE", "LENGTH = 'inch'\nFORCE")))
    twice = SMALL.replace("PCY1 = 1.3", "PCY1 = 1.3\nPCY1 = 1.3")
    assert float(tyres.from_property_file(parse_property_file(twice)).lateral.PCY1) == 1.3
    file = parse_property_file(SMALL + "X = 'other'\n[INERTIA]\nMASS = 7\nTYRESIDE = 'LEFT'\n[Y]\nTYRESIDE = 'RIGHT'\n")
    about = [finding.about for finding in tyres.check_property_file(file)]
    assert "X" in about and "TYRESIDE" in about


def in_other_letters(seed):
    """The small file with its keys, sections and words in letters drawn from a seed, and its units in the plural or not."""
    draw = random.Random(seed)
    recase = lambda text: draw.choice([str.lower, str.upper, str.capitalize])(text)
    lines = []
    for line in SMALL.splitlines():
        key, equals, rest = line.partition("=")
        if line.startswith("["):
            line = recase(line)
        elif equals and not line.startswith("$"):
            line = recase(key) + equals + rest
        lines.append(line)
    text = "\n".join(lines) + "\n"
    for word in ("'newton'", "'mm'", "'second'", "'meter'"):
        plural = word[:-1] + "s'" if draw.random() < 0.5 and len(word) > 5 else word
        text = text.replace(word, recase(plural))
    return text


@pytest.mark.parametrize("seed", range(8))
def test_small_letters_are_the_same_tyre(seed):
    text = in_other_letters(seed)
    plain, other = parse_property_file(SMALL), parse_property_file(text)
    assert text != SMALL
    expected, found = tyres.from_property_file(plain), tyres.from_property_file(other)
    assert jax.tree.leaves(found) == jax.tree.leaves(expected)
    assert tyres.check_property_file(other) == tyres.check_property_file(plain)
    assert other.find("pdy1") == other.find("PDY1") and other.holds("pDy1")
    assert other.replace({"pdy1": 0.9}).number("PDY1") == 0.9
    with pytest.raises(InputError, match="PCY1 has several values"):
        tyres.from_property_file(parse_property_file(text + "[X]\npcy1 = 1.31\n"))
