"""What is worth a look in a property file: each finding once, and no alarm for good files."""

import re

import numpy as np
import pytest
from shared_data import shared, shared_names

from jaxveh import InputError, tyres
from jaxveh.io.property_file import parse_property_file
from jaxveh.tyres import Contact, property_check, property_file

GOOD = """\
[UNITS]
LENGTH = 'meter'
FORCE = 'newton'
ANGLE = 'radians'
[MODEL]
FITTYP = 61
TYRESIDE = 'LEFT'
USE_MODE = 124
LONGVL = 16.7
[DIMENSION]
UNLOADED_RADIUS = 0.3135
WIDTH = 0.205
RIM_RADIUS = 0.1905
[OPERATING_CONDITIONS]
INFLPRES = 220000
NOMPRES = 220000
[VERTICAL]
FNOMIN = 4000
VERTICAL_STIFFNESS = 200000
[STRUCTURAL]
LONGITUDINAL_STIFFNESS = 400000
LATERAL_STIFFNESS = 100000
[INFLATION_PRESSURE_RANGE]
PRESMIN = 150000
PRESMAX = 350000
[VERTICAL_FORCE_RANGE]
FZMIN = 100
FZMAX = 10000
[LONG_SLIP_RANGE]
KPUMIN = -1
KPUMAX = 1
[SLIP_ANGLE_RANGE]
ALPMIN = -0.6
ALPMAX = 0.6
[INCLINATION_ANGLE_RANGE]
CAMMIN = -0.1
CAMMAX = 0.1
[SCALING_COEFFICIENTS]
LMUX = 1
LMUV = 0
[LONGITUDINAL_COEFFICIENTS]
PCX1 = 1.6
PDX1 = 1.1
PDX2 = -0.1
PDX3 = 0
PEX1 = -0.5
PKX1 = 20
RBX1 = 9
RBX2 = 5
RCX1 = 0.9
REX1 = -1
[OVERTURNING_COEFFICIENTS]
QSX3 = 0.05
QSX13 = 0
[LATERAL_COEFFICIENTS]
PCY1 = 1.3
PDY1 = 1.0
PDY2 = -0.1
PEY1 = -0.5
PHY1 = 0
PKY1 = -20
PKY2 = 2
RBY1 = 9
RBY2 = 5
RCY1 = 1
REY1 = -1
[ROLLING_COEFFICIENTS]
QSY1 = 0.01
[ALIGNING_COEFFICIENTS]
QBZ1 = 10
QBZ2 = -1
QCZ1 = 1.1
QDZ1 = 0.1
QEZ1 = -1
"""

OLD = GOOD.replace("FITTYP = 61", "PROPERTY_FILE_FORMAT = 'PAC2002'").replace(
    "[ROLLING", "PTY1 = 2\nPTY2 = 2\n[ROLLING"
).replace("[OVERTURNING", "PTX1 = 2\n[OVERTURNING")  # fmt: skip


def found(text):
    return [f"{finding.about} {finding.says}" for finding in tyres.check_property_file(parse_property_file(text))]


@pytest.mark.parametrize("text", [GOOD, OLD, GOOD.replace("QSX3 = 0.05", "qsx3 = 0.05")])
def test_a_good_file_gives_no_alarm(text):
    """Nor do keys in small letters, which are read."""
    assert found(text) == []


@pytest.mark.whole
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("TYRESIDE = 'LEFT'\n", "", "TYRESIDE is missing"),
        ("'LEFT'", "'UNKNOWN'", "TYRESIDE is 'UNKNOWN', neither LEFT nor RIGHT"),
        ("FITTYP = 61", "PROPERTY_FILE_FORMAT = 'MF-TYRE'\nPTX1 = 2\nPTY1 = 2", "FITTYP is missing: 5.2 is used"),
        ("FITTYP = 61", "FITTYP = 60", "FITTYP is 60: the equations of 6.1"),
        ("USE_MODE = 124", "USE_MODE = -14", "USE_MODE is -14: asks for a mirrored tyre"),
        ("USE_MODE = 124", "USE_MODE = 13", "USE_MODE is 13: fitted without combined slip"),
        (GOOD[: GOOD.index("[MODEL]")], "", "[UNITS] is missing"),
        ("'radians'", "'degrees'", "ANGLE is 'degrees'"),
        ("LONGVL = 16.7\n", "", "LONGVL is missing: 16.7 is used"),
        ("LONGVL = 16.7", "LONGVL = 60", "LONGVL is 60 m/s: tyres are measured at 5 to 50 m/s"),
        ("VERTICAL_STIFFNESS = 200000\n", "", "VERTICAL_STIFFNESS is missing: 200000 is used"),
        ("NOMPRES = 220000\n", "", "NOMPRES is missing: 220000 is used"),
        ("LATERAL_STIFFNESS = 100000\n", "", "LATERAL_STIFFNESS is missing: 100000 is used"),
        ("LONGITUDINAL_STIFFNESS = 400000\n", "", "LONGITUDINAL_STIFFNESS is missing: 300000 is used"),
        ("ALPMIN = -0.6", "ALPMIN = 0.7", "ALPMIN, ALPMAX are 0.7 and 0.6: the range is empty"),
        ("FZMIN = 100\n", "FZMIN = 10000\n", "FZMIN, FZMAX are 10000 and 10000: the range is empty"),
        ("KPUMAX = 1", "KPUMAX = 0", "KPUMIN, KPUMAX are -1 and 0: only one side"),
        ("ALPMAX = 0.6", "ALPMAX = 15", "ALPMAX is 15: must be in radians"),
        ("CAMMIN = -0.1", "CAMMIN = -5", "CAMMIN is -5: must be in radians"),
        ("KPUMIN = -1", "KPUMIN = -100", "KPUMIN is -100: a slip ratio of 1 is 100 %"),
        ("FZMAX = 10000", "FZMAX = 3000", "FNOMIN times LFZO is 4000 N, outside FZMIN to FZMAX, 100 to 3000 N"),
        ("NOMPRES = 220000", "NOMPRES = 2.2", "NOMPRES is 2.2 Pa: tyres have 20 to 2000 kPa"),
        ("INFLPRES = 220000", "INFLPRES = 400000", "INFLPRES is 400000 Pa, outside PRESMIN to PRESMAX"),
        ("LMUX = 1", "LMUX = 0.8", "scaling LMUX = 0.8: not 1"),
        ("UNLOADED_RADIUS = 0.3135", "UNLOADED_RADIUS = 313.5", "UNLOADED_RADIUS is 313.5 m: wheels have"),
        ("RIM_RADIUS = 0.1905", "RIM_RADIUS = 0.3135", "RIM_RADIUS is 0.3135 m, not less than UNLOADED_RADIUS"),
        ("RIM_RADIUS = 0.1905", "RIM_RADIUS = 0.381", "RIM_RADIUS is 0.381 m, not less than UNLOADED_RADIUS"),
        ("FNOMIN = 4000", "FNOMIN = 4", "FNOMIN is 4 N: wheels carry"),
        ("PCX1 = 1.6", "PCX1 = -1.6", "PCX1 gives a shape factor C of -1.6: must be positive"),
        (
            "PCY1 = 1.3",
            "PCY1 = 2.3",
            "PCY1 gives a shape factor C of 2.3: usual values are 1 to 2; the force reverses its sign",
        ),
        (
            "PCY1 = 1.3",
            "PCY1 = 0.9",
            "PCY1 gives a shape factor C of 0.9: usual values are 1 to 2; the force never peaks",
        ),
        ("PDX1 = 1.1", "PDX1 = 11", "longitudinal friction is 11 at nominal load; usual values are 0.2 to 3"),
        ("PDY1 = 1.0", "PDY1 = -0.7", "lateral friction is -0.7 at nominal load"),
        ("PKX1 = 20", "PKX1 = 2", "slip stiffness over load is 2 at nominal load; usual values are 5 to 80"),
        (
            "PKY1 = -20",
            "PKY1 = 20",
            "cornering stiffness over load is -16 1/rad at nominal load; usual values are 3 to 60; is PKY1",
        ),
        ("VERTICAL_STIFFNESS = 200000", "VERTICAL_STIFFNESS = 2e6", "deflection over radius is 0.00638"),
        ("QDZ1 = 0.1", "QDZ1 = -0.1", "pneumatic trail over radius is -0.1 at nominal load"),
        ("PHY1 = 0", "PHY1 = 0.02", "lateral force without slip angle over load is -0.311"),
        ("PHY1 = 0", "PHY1 = 0.007", "lateral force without slip angle over load is -0.1"),
        ("PHY1 = 0", "PHY1 = -0.007", "lateral force without slip angle over load is 0.1"),
        ("PDX2 = -0.1", "PDX2 = -1.1", "longitudinal friction is -0.55 at 10000 N, camber -5.73 degrees, 1.5 bar"),
        ("PDX3 = 0", "PDX3 = 150", "longitudinal friction is -0.595 at 400 N, camber -5.73 degrees"),
        ("PDY2 = -0.1", "PDY2 = -1", "lateral friction is -0.5 at 10000 N"),
        ("PEX1 = -0.5", "PEX1 = 1.2", "PEX1 to PEX4 give a curvature factor E of 1.2 at"),
        ("PEY1 = -0.5", "PEY1 = -0.5\nPEY2 = 2", "PEY1 to PEY3 give a curvature factor E of 2.5 at 10000 N"),
        ("QEZ1 = -1", "QEZ1 = 0.8\nQEZ4 = 0.5", "QEZ1 to QEZ4 give a curvature factor E of 1.2 at"),
        ("REX1 = -1", "REX1 = 1.1", "REX1, REX2 give a curvature factor E of 1.1 at"),
        ("REY1 = -1", "REY1 = 1.1", "REY1, REY2 give a curvature factor E of 1.1 at"),
        ("QCZ1 = 1.1", "QCZ1 = 0", "QCZ1 is 0: the shape factor of the trail must be positive"),
        ("QBZ2 = -1", "QBZ2 = -8", "QBZ1 to QBZ3 give a slope of the trail of -2 at 10000 N"),
        ("QBZ1 = 10\nQBZ2 = -1", "QBZ1 = 0", "QBZ1 to QBZ3 give a slope of the trail of 0 at 400 N"),
        ("RCX1 = 0.9", "RCX1 = 1.6", "RBX1 to RHX1 reverse F_x: "),
        ("RCY1 = 1\n", "RCY1 = 1.6\n", "RBY1 to RHY2 reverse F_y: "),
        ("QSX13 = 0", "QSX13 = 0.1", "QSX13 are not 0, nor are QSX1 to QSX11"),
        ("QSY1 = 0.01", "QSY1 = 0.1", "QSY1 is 0.1: rolling resistance over load is usually 0 to 0.05"),
        ("PKX1 = 20", "PKX1 = 20\nPXX9 = 0.3", "[LONGITUDINAL_COEFFICIENTS] PXX9: not read, and not neutral"),
        ("LMUX = 1", "LMUX = 1\nLGAY = 0.5", "[SCALING_COEFFICIENTS] LGAY: not read, and not neutral"),
        ("LMUV = 0", "LMUV = 1", "[SCALING_COEFFICIENTS] LMUV: not read"),
        ("[STRUCTURAL]", "[DEFLECTION_LOAD_CURVE]\n{pen fz}\n[STRUCTURAL]", "[DEFLECTION_LOAD_CURVE] is not read"),
    ],
)
def test_each_finding(old, new, expected):
    assert old in GOOD
    assert any(line.startswith(expected) for line in found(GOOD.replace(old, new, 1))), found(GOOD.replace(old, new, 1))


STIFF = "VERTICAL_STIFFNESS = 200000"


@pytest.mark.parametrize(
    ("old", "within", "beyond", "says"),
    [
        ("PDX1 = 1.1", "PDX1 = 2.95", "PDX1 = 3.05", "longitudinal friction"),
        ("PDX1 = 1.1", "PDX1 = 0.36", "PDX1 = 0.19", "longitudinal friction"),
        ("PDY1 = 1.0", "PDY1 = 2.95", "PDY1 = 3.05", "lateral friction"),
        ("PKX1 = 20", "PKX1 = 79", "PKX1 = 81", "slip stiffness over load"),
        ("PKX1 = 20", "PKX1 = 5.1", "PKX1 = 4.9", "slip stiffness over load"),
        ("PKY1 = -20", "PKY1 = -73", "PKY1 = -77", "cornering stiffness over load"),
        ("PKY1 = -20", "PKY1 = -3.9", "PKY1 = -3.6", "cornering stiffness over load"),
        ("QCZ1 = 1.1", "QCZ1 = 0.1", "QCZ1 = 0", "QCZ1 is 0"),
        ("QBZ1 = 10\nQBZ2 = -1", "QBZ1 = 0.1", "QBZ1 = -0.1", "QBZ1 to QBZ3"),
        (STIFF, "VERTICAL_STIFFNESS = 65000", "VERTICAL_STIFFNESS = 62000", "deflection over radius"),
        (STIFF, "VERTICAL_STIFFNESS = 1250000", "VERTICAL_STIFFNESS = 1300000", "deflection over radius"),
        ("QDZ1 = 0.1", "QDZ1 = 0.29", "QDZ1 = 0.31", "pneumatic trail over radius"),
        ("QDZ1 = 0.1", "QDZ1 = 0\nQDZ2 = 0\nQCZ1 = 0", "QDZ1 = 0.01\nQDZ2 = 0\nQCZ1 = 0", "QCZ1 is 0"),
        ("QDZ1 = 0.1", "QDZ1 = 0\nQDZ2 = 0\nQCZ1 = 0", "QDZ1 = 0\nQDZ2 = 0.01\nQCZ1 = 0", "QCZ1 is 0"),
    ],
)
def test_a_finding_begins_at_its_limit(old, within, beyond, says):
    assert old in GOOD
    # A key that the replacement has, too, would stand twice.
    good = GOOD.replace("QCZ1 = 1.1\n", "") if "\nQCZ1" in within else GOOD
    told = lambda new: [line for line in found(good.replace(old, new, 1)) if line.startswith(says)]
    assert not told(within) and told(beyond)


LIMITS = {
    "LONGVL": (5, 50, "tyres are measured at 5 to 50 m/s"),
    "ALPMIN": (-3.2, None, "must be in radians"),
    "ALPMAX": (None, 3.2, "must be in radians"),
    "CAMMIN": (-3.2, None, "must be in radians"),
    "CAMMAX": (None, 3.2, "must be in radians"),
    "KPUMIN": (-5, None, "a slip ratio of 1 is 100 %"),
    "KPUMAX": (None, 5, "a slip ratio of 1 is 100 %"),
    "NOMPRES": (2e4, 2e6, "tyres have 20 to 2000 kPa"),
    "INFLPRES": (2e4, 2e6, "tyres have 20 to 2000 kPa"),
    "UNLOADED_RADIUS": (0.05, 1.5, "wheels have 0.05 to 1.5 m"),
    "FNOMIN": (100, 1e5, "wheels carry 100 to 100000 N"),
    "PCX1": (1, 2, "usual values are 1 to 2"),
    "PCY1": (1, 2, "usual values are 1 to 2"),
    "QSY1": (0, 0.05, "usually 0 to 0.05"),
}
"""The least and the greatest number without a finding, and what the finding says: the numbers of its text are the limits."""


@pytest.mark.whole
@pytest.mark.parametrize(
    ("key", "limit", "beyond"),
    [
        (key, limit, way * 0.02)
        for key, limits in LIMITS.items()
        for limit, way in zip(limits[:2], (-1, 1), strict=True)
        if limit is not None
    ],
)
def test_a_number_at_its_limit_is_within(key, limit, beyond):
    with_number = lambda number: re.sub(rf"(?m)^{key} = .*$", f"{key} = {number:.8g}", GOOD)
    told = lambda number: [line for line in found(with_number(number)) if f"{key} " in line and LIMITS[key][2] in line]
    assert not told(limit) and told(limit + beyond * max(abs(limit), 0.01))


@pytest.mark.parametrize("size", ["C", "D"])
@pytest.mark.parametrize("axis", ["X", "Y"])
def test_no_force_is_no_reversed_one(axis, size):
    """A share of rounding was told as -inf."""
    shifted = f"P{size}{axis}1 = 0\nPV{axis}1 = 0.3\nRB{axis}3 = -0.2\nRBY4 = 0.48"
    told = found(re.sub(rf"(?m)^P{size}{axis}1 = .*$", shifted, GOOD))
    assert told and not [line for line in told if "inf of it" in line]


def test_pressures_are_looked_at_from_half_to_twice_that_of_the_file():
    wide = GOOD.replace("PRESMIN = 150000", "PRESMIN = 20000").replace("PRESMAX = 350000", "PRESMAX = 2000000")
    looked_at = lambda text: set(property_check._freely(tyres.from_property_file(parse_property_file(text))).pressure)
    assert looked_at(wide) == {110000.0, 220000.0, 440000.0}
    assert looked_at(GOOD) == {150000.0, 220000.0, 350000.0}


def test_the_nominal_load_is_the_scaled_one():
    scaled = GOOD.replace("LMUX = 1", "LMUX = 1\nLFZO = 0.4")
    remark, *others = found(scaled)
    assert remark.startswith("scaling LFZO = 0.4: not 1") and not others
    soft = found(scaled.replace("PKX1 = 20", "PKX1 = 3"))
    assert any(line.startswith("slip stiffness over load is 3 at nominal load") for line in soft)


@pytest.mark.parametrize("name", ["F_x", "F_y"])
def test_what_is_left_of_a_force_is_the_share_of_it_alone(name):
    """The number of a finding, computed anew: the least over the other slip, at the load and the slip that it names."""
    about, text = ("RCX1 = 0.9", "slip angle of") if name == "F_x" else ("RCY1 = 1\n", "slip ratio of")
    text = GOOD.replace(about, f"{about.split()[0]} = 1.6\n")
    [line] = [line for line in found(text) if f"reverse {name}" in line]
    share, load, slip = map(
        float, re.search(r": (\S+) of it remains at (\S+) N and a slip \w+ of ([-\d.]+)", line).groups()
    )
    tyre = tyres.from_property_file(parse_property_file(text))
    steps = np.linspace(0.05, 1.0, 400)
    angle, ratio = (np.radians(slip), -0.5 * steps) if name == "F_x" else (0.5 * steps, slip)
    forces = lambda a, k: tyre.forces(Contact(*np.broadcast_arrays(a, k), load * np.ones(400), speed=16.7))
    if name == "F_x":
        left = forces(angle, ratio).F_x / forces(0.0, ratio).F_x
    else:
        between = lambda k: forces(angle, k).F_y - forces(-angle, k).F_y
        left = between(ratio) / between(0.0)
    np.testing.assert_allclose(np.min(left), share, rtol=0.02)


@pytest.mark.parametrize(("key", "numbers"), [("KPUMIN", (0, 0.2)), ("ALPMAX", (0, -0.2))])
def test_a_range_without_braking_or_turning_has_no_combined_slip_to_judge(key, numbers):
    """Its weights would reverse both forces, and both have shifts, so that they are forces at no slip, too."""
    spoilt = GOOD.replace("RCX1 = 0.9", "RCX1 = 1.6\nPHX1 = 0.01\nPVX1 = 0.02")
    spoilt = spoilt.replace("RCY1 = 1\n", "RCY1 = 1.6\nPVY1 = 0.02\n").replace("PHY1 = 0\n", "PHY1 = 0.004\n")
    told = lambda text: [line.partition(":")[0] for line in found(text) if " reverse F_" in line]
    assert told(spoilt) == ["RBX1 to RHX1 reverse F_x", "RBY1 to RHY2 reverse F_y"]
    for number in numbers:
        assert told(re.sub(rf"(?m)^{key} = .*$", f"{key} = {number}", spoilt)) == []


def test_loads_are_looked_at_from_a_tenth_to_three_times_the_nominal_one():
    wide = tyres.from_property_file(parse_property_file(GOOD.replace("FZMAX = 10000", "FZMAX = 1e5")))
    loads = property_check._loads(wide)
    np.testing.assert_allclose([loads[0], loads[-1]], [400.0, 12000.0])
    narrow = property_check._loads(
        tyres.from_property_file(parse_property_file(GOOD.replace("FZMIN = 100\n", "FZMIN = 900\n")))
    )
    np.testing.assert_allclose([narrow[0], narrow[-1]], [900.0, 10000.0])


def test_neutral_coefficients_that_are_not_read_are_no_alarm():
    assert found(GOOD.replace("LMUX = 1", "LMUX = 1\nLGAY = 1").replace("QSX13 = 0", "QSX13 = 0\nQTZ1 = 0.2")) == []


def test_relaxation_of_the_old_version():
    assert [
        line.partition(" at")[0] for line in found(OLD.replace("PTX1 = 2", "PTX1 = 0").replace("PTY1 = 2", "PTY1 = 0"))
    ] == [
        "longitudinal relaxation length is 0 m",
        "lateral relaxation length is 0 m",
    ]


def test_many_coefficients_are_not_listed_in_full():
    many = "".join(f"PXX{k} = 1\n" for k in range(1, 10))
    assert "[ROLLING_COEFFICIENTS] PXX1, PXX2, PXX3 and 6 more: not read, and not neutral" in found(
        GOOD.replace("QSY1 = 0.01\n", f"QSY1 = 0.01\n{many}")
    )
    few = "".join(f"PXX{k} = 1\n" for k in range(1, 7))
    listed = "[ROLLING_COEFFICIENTS] PXX1, PXX2, PXX3, PXX4, PXX5, PXX6: not read, and not neutral"
    assert listed in found(GOOD.replace("QSY1 = 0.01\n", f"QSY1 = 0.01\n{few}"))


@pytest.mark.parametrize("name", shared_names("tyres", "*.tir"))
def test_real_files_do_not_drown_in_alarms(name):
    findings = tyres.check_property_file(shared("tyres") / name)
    assert len(findings) <= 6, findings
    odd = {
        "chrono__feda__tires__335_65R22_5_G275MSA_40psi.tir": {"TYRESIDE", "lateral friction", "KPUMIN, KPUMAX"},
        "chrono__hmmwv__tire__HMMWV_pacejka.tir": {"deflection over radius"},
        "chrono__Polaris__Polaris_Pac02Tire.tir": {"scaling", "REX1, REX2"},
    }
    assert odd.get(name, set()) <= {finding.about for finding in findings}


@pytest.mark.parametrize("version", ["", "FITTYP = 61"])
@pytest.mark.parametrize("written", ["{}", "{}_", "{} "])
def test_a_file_of_another_law_is_refused_by_its_name(version, written):
    """Whatever it lacks, and even if it has all coefficients of MF-Tyre: those of a motorcycle have the same names."""
    for name, law in property_file.OTHER_LAWS.items():
        told = f"{version}\nPROPERTY_FILE_FORMAT = '{written.format(name[:3])}{name[3:].lower()}'"
        for text in (GOOD.replace("FITTYP = 61", told), f"[MODEL]\n{told}\n"):
            with pytest.raises(
                InputError, match=f"PROPERTY_FILE_FORMAT = .*: a tyre of the {re.escape(law)} law; only"
            ):
                tyres.from_property_file(parse_property_file(text))


@pytest.mark.parametrize("name", [*property_file.OLD_FORMATS, "USER", "MF-SWIFT", "PAC2002"])
def test_the_names_of_mf_tyre_are_those_of_no_other_law(name):
    told = GOOD.replace("FITTYP = 61", f"FITTYP = 61\nPROPERTY_FILE_FORMAT = '{name}'")
    assert tyres.from_property_file(parse_property_file(told)).version == 61
