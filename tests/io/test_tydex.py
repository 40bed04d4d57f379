"""TYDEX files: sections, fixed columns, units, and the three axes."""

import numpy as np
import pytest

from jaxveh import io
from jaxveh._core.errors import InputError
from jaxveh.io.tydex import parse_tydex
from jaxveh.io.tydex_axes import contact_patch

MEASURED = ("F_x", "F_y", "M_x", "M_y", "M_z")


def line(name, unit, *values, about="what it is"):
    return f"{name:<10}{about:<30}{unit:<10}" + "".join(f"{value:>10}" for value in values)


def text(channels, rows, constants=()):
    """A TYDEX file: channels are (name, unit, conversion factors), constants (name, unit, value)."""
    return "\n".join([
        "**HEADER", f"{'RELEASE':<10}{'release of TYDEX':<30}1.3", f"{'MEASID':<10}{'measurement':<30}sweep 7",
        "**COMMENTS", "measured on a drum", "**CONSTANTS", *[line(*one) for one in constants],
        "**MEASURCHANNELS", "! name, description, unit, conversion", *[line(*one) for one in channels],
        "**MEASURDATA", "! ten columns each", *rows, "**END", "what follows does not count",
    ])  # fmt: skip


PLAIN = [
    ("SLIPANGL", "deg", 1),
    ("LONGSLIP", "%", 1),
    ("FZW", "kN", 1),
    ("FYW", "N", 1),
    ("MZW", "Nm", 1),
    ("LONGVEL", "km/h", 1),
]
ROWS = ["  2.0  1.5  4.0 -2000.  50.  90.", " -2.0  0.0  4.1  2010. NOTAVAIL  90."]


def patch(channels, rows, constants=(), measured=MEASURED, axes="iso-w"):
    return contact_patch(parse_tydex(text(channels, rows, constants)), measured, axes)


def test_sections_header_and_comments():
    file = parse_tydex(text(PLAIN, ROWS, [("INFLPRES", "bar", 2.5), ("TRCKSURF", "-", "asphalt")]))
    assert file.header["MEASID"] == "sweep 7" and file.comments == ("measured on a drum",)
    assert list(file.channels) == [name for name, *_ in PLAIN]
    assert file.constants["INFLPRES"].values == 2.5 and file.constants["TRCKSURF"].values == "asphalt"
    assert file.channels["FZW"].line == 13
    np.testing.assert_array_equal(file.channels["MZW"].values, [50.0, np.nan])


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("end", ["", "  "])
def test_several_measurements_in_one_file_are_told_with_their_lines(tmp_path, count, end):
    """As CarMaker's generator of tyres writes them: across and along, each with channels and rows of its own."""
    whole = text(PLAIN, ROWS).splitlines()
    more = [*whole[whole.index("**MEASURCHANNELS") : whole.index("**END")]]
    lines = [*whole[: whole.index("**END")], *more * (count - 1), f"{end}**END"]
    begins = [k for k, line in enumerate(lines, start=1) if line == "**MEASURCHANNELS"]
    (tmp_path / "both.tdx").write_text("\n".join(lines))
    with pytest.raises(
        InputError, match=rf"is {count} times there, in lines {begins[0]}, .*{begins[-1]}: .*a file for each"
    ):
        io.read_rig_table(tmp_path / "both.tdx")
    (tmp_path / "one.tdx").write_text("\n".join([*whole, *more]))
    assert len(io.read_rig_table(tmp_path / "one.tdx").load) == len(ROWS)


def test_the_signs_of_the_file_and_the_units_of_the_package():
    found = patch(PLAIN, ROWS, [("INFLPRES", "bar", 2.5), ("INCLANGL", "deg", -1)])
    np.testing.assert_allclose(found["slip_angle"], np.radians([2.0, -2.0]))
    np.testing.assert_allclose(found["slip_ratio"], [0.015, 0.0])
    np.testing.assert_allclose(found["load"], [4000.0, 4100.0])
    np.testing.assert_allclose(found["F_y"], [-2000.0, 2010.0])
    np.testing.assert_allclose(found["M_z"], [50.0, np.nan])
    np.testing.assert_allclose(found["speed"], [25.0, 25.0])
    np.testing.assert_allclose(found["pressure"], [2.5e5, 2.5e5])
    np.testing.assert_allclose(found["camber"], np.radians([-1.0, -1.0]))
    assert found["F_x"] is None and found["M_x"] is None
    # As everywhere in the package: a positive slip angle gives a positive force.
    assert np.all(np.sign(found["F_y"]) == -np.sign(found["slip_angle"]))


@pytest.mark.parametrize(
    ("unit", "kind", "size"),
    [("RAD", "SLIPANGL", 1.0), ("-", "LONGSLIP", 1.0), ("N", "FZW", 1.0), ("KNM", "MZW", 1e3), ("m/s", "LONGVEL", 1.0)],
)
def test_other_units(unit, kind, size):
    channels = [(name, unit if name == kind else old, factor) for name, old, factor in PLAIN]
    found = patch(channels, ["1. 1. 1. 1. 1. 1."])
    field = {"SLIPANGL": "slip_angle", "LONGSLIP": "slip_ratio", "FZW": "load", "MZW": "M_z", "LONGVEL": "speed"}[kind]
    np.testing.assert_allclose(np.abs(found[field]), [size])


def test_factor_and_offsets_make_the_physical_value():
    channels = [("SLIPANGL", "deg", 0.5, 2, -3), ("FZW", "N", 100)]
    file = parse_tydex(text(channels, ["10. 40."]))
    np.testing.assert_allclose(file.channels["SLIPANGL"].values, [0.5 * (10 + 2) - 3])
    np.testing.assert_allclose(file.channels["FZW"].values, [4000.0])


def test_columns_that_touch_each_other():
    file = parse_tydex(text([("SLIPANGL", "deg", 1), ("FZW", "N", 1)], ["-1.2345678-2.3456789"]))
    assert [file.channels[name].values[0] for name in ("SLIPANGL", "FZW")] == [-1.2345678, -2.3456789]


def test_the_speed_along_the_wheel_is_a_part_of_the_trajectory_s():
    found = patch([("SLIPANGL", "deg", 1), ("FZW", "N", 1), ("TRAJVELW", "m/s", 1)], ["60. 4000. 20."])
    np.testing.assert_allclose(found["speed"], [10.0])


def centre(axes, gamma, force, moment, radius=0.3):
    """Force and moment (W axes, at the contact point) as a hub measures them in H or C axes, by rotation matrices."""
    arm = radius * np.array([0.0, -np.sin(gamma), np.cos(gamma)])
    moment = moment - np.cross(arm, force)
    if axes == "C":
        wheel = np.array([[1, 0, 0], [0, np.cos(gamma), -np.sin(gamma)], [0, np.sin(gamma), np.cos(gamma)]])
        force, moment = wheel.T @ force, wheel.T @ moment
    return force, moment


@pytest.mark.parametrize("axes", ["H", "C"])
@pytest.mark.parametrize("radius", ["LOADRAD", "DSTGRWHC"])
def test_forces_and_moments_of_the_wheel_s_centre_come_to_the_contact_patch(axes, radius):
    gamma, force, moment = 0.2, np.array([700.0, -1500.0, 4000.0]), np.array([30.0, -12.0, 45.0])
    hub, turned = centre(axes, gamma, force, moment)
    height = 300.0 if radius == "LOADRAD" else 300.0 * np.cos(gamma)
    names = [f"{kind}{axis}{axes}" for kind in "FM" for axis in "XYZ"]
    channels = [(name, "N" if name[0] == "F" else "Nm", 1) for name in names]
    channels += [("SLIPANGL", "rad", 1), ("INCLANGL", "rad", 1), (radius, "mm", 1)]
    found = patch(channels, [" ".join(repr(float(v)) for v in [*hub, *turned, 0.1, gamma, height])])
    expected = dict(zip(("F_x", "F_y", "load", "M_x", "M_y", "M_z"), [*force, *moment], strict=True))
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], [value], rtol=1e-12, err_msg=name)


def test_without_inclination_the_aligning_moment_needs_no_radius():
    channels = [("SLIPANGL", "rad", 1), ("INCLANGL", "rad", 1), ("FXH", "N", 1), ("FZH", "N", 1), ("MZH", "Nm", 1)]
    np.testing.assert_allclose(patch(channels, ["0.1 0.0 500. 4000. 45."])["M_z"], [45.0])


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        ([("FZC", "N", 1)], "FZC is not in the axes of the contact patch .* INCLANGL is needed"),
        ([("FZC", "N", 1), ("INCLANGL", "deg", 1)], "FZC .* FYC is needed"),
        ([("FZH", "N", 1), ("MZH", "Nm", 1)], "MZH .* INCLANGL is needed"),
        ([("FZH", "N", 1), ("MZH", "Nm", 1), ("INCLANGL", "deg", 1)], "MZH .* LOADRAD is needed"),
        ([("FZH", "N", 1), ("MXH", "Nm", 1), ("INCLANGL", "deg", 1), ("LOADRAD", "m", 1)], "MXH .* FYW is needed"),
        ([("FZH", "N", 1), ("MYH", "Nm", 1), ("INCLANGL", "deg", 1), ("LOADRAD", "m", 1)], "MYH .* FXW is needed"),
        ([("FZW", "lbf", 1)], r"line 10: FZW: unit 'lbf': must be one of n, dan, kn"),
        ([("FYW", "N", 1)], "no load among the channels"),
    ],
)
def test_what_cannot_be_converted_is_said(channels, message):
    channels = [("SLIPANGL", "deg", 1), *channels]
    with pytest.raises(InputError, match=message):
        patch(channels, ["1. " * len(channels)])


def test_what_is_not_asked_for_is_not_converted():
    channels = [("SLIPANGL", "deg", 1), ("FYH", "N", 1), ("FZH", "N", 1), ("MZH", "Nm", 1)]
    found = patch(channels, ["1. 2. 3. 4."], measured=("F_y",))
    assert found["F_y"][0] == 2.0 and "M_z" not in found


def test_a_file_without_slip_is_refused():
    with pytest.raises(InputError, match="neither SLIPANGL nor LONGSLIP"):
        patch([("FZW", "N", 1)], ["1."])
    with pytest.raises(InputError, match="SLIPANGL = 'free': must be a number"):
        patch([("FZW", "N", 1)], ["1."], [("SLIPANGL", "deg", "free")])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("**MEASURDATA", "**MODELDATA", r"no section \*\*MEASURDATA"),
        ("**MEASURCHANNELS", "**MODELCHANNELS", r"no section \*\*MEASURCHANNELS"),
        (ROWS[1], "-2.0 0.0", "line 18: 2 columns, but .* 6 channels"),
        (ROWS[1], ROWS[1] + " 7.", "line 18: 7 columns, but .* 6 channels"),
        ("-2000.", "-2000,", "line 17: '-2000,' is not a number"),
        (line("FZW", "kN", 1), line("FZW", "kN", "one"), "line 11: FZW: conversion 'one': must be a factor"),
        (line("FZW", "kN", 1), line("FZW", "kN", 0), "line 11: FZW: conversion factor 0"),
        (line("FYW", "N", 1), line("FZW", "N", 1), "channel FZW occurs twice, in lines 11 and 12"),
    ],
)
def test_bad_files_are_named(old, new, message):
    whole = text(PLAIN, ROWS)
    assert old in whole
    with pytest.raises(InputError, match=message):
        parse_tydex(whole.replace(old, new, 1))


def test_read_from_disk(tmp_path):
    path = tmp_path / "sweep.tdx"
    path.write_bytes(text(PLAIN, ROWS).replace("measured", "20 °C, measured").encode("latin-1"))
    assert io.read_tydex(path).channels["FYW"].values.tolist() == [-2000.0, 2010.0]
    with pytest.raises(InputError, match="cannot be read"):
        io.read_tydex(tmp_path / "absent.tdx")
