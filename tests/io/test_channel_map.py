"""Channel maps: names, units, signs; each mistake is one clear error."""

import re

import numpy as np
import pytest

from jaxveh import InputError, io
from jaxveh.io.channel_map import CHANNEL_MAP_SCHEMA
from jaxveh.io.units import convert


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("Zeit;Gierrate;Speed;Druck\n0;90,0;36;1,5\n500;-180,0;72;2,5\n")
    return path


@pytest.fixture
def toml(tmp_path):
    def write(text):
        (tmp_path / "map.toml").write_text(text)
        return tmp_path / "map.toml"

    return write


GOOD = """
time = { column = "Zeit", unit = "ms" }
[channels]
v_x = { column = "Speed", unit = "km/h" }
pressure = { column = "Druck", unit = "bar" }
[channels.yaw_rate]
column = "Gierrate"
unit = "deg/s"
sign = -1
scale = 0.5
offset = 45.0
[csv]
decimal = ","
"""


def test_names_units_and_signs(log, toml):
    recording = io.read_recording(log, toml(GOOD))
    np.testing.assert_allclose(recording.time, [0.0, 0.5], rtol=1e-15)
    np.testing.assert_allclose(recording["yaw_rate"], np.deg2rad([-90.0, 45.0]), rtol=1e-15)
    np.testing.assert_allclose(recording["v_x"], [10.0, 20.0], rtol=1e-15)
    np.testing.assert_array_equal(recording["pressure"], [1.5, 2.5])
    assert dict(recording.units) == {"yaw_rate": "rad/s", "v_x": "m/s", "pressure": "bar"}


def test_short_form_takes_si(log, toml):
    recording = io.read_recording(log, toml('time = "Zeit"\n[channels]\nv_x = "Speed"\n[csv]\nseparator = ";"'))
    np.testing.assert_array_equal(recording["v_x"], [36.0, 72.0])
    np.testing.assert_array_equal(recording.time, [0.0, 500.0])
    assert recording.unit("v_x") == "m/s"


def test_the_map_goes_before_the_file(tmp_path):
    (tmp_path / "log.csv").write_text("time,Speed [m/s]\n0,36\n")
    for column in ("Speed", "Speed [m/s]"):
        by_map = io.read_recording(tmp_path / "log.csv", io.ChannelMap({"v_x": io.Channel(column, unit="km/h")}))
        assert float(by_map["v_x"][0]) == pytest.approx(10.0, rel=1e-15)
        by_file = io.read_recording(tmp_path / "log.csv", io.ChannelMap({"v_x": column}))
        assert float(by_file["v_x"][0]) == 36.0


def test_columns_out_of_the_map_may_hold_words(tmp_path):
    (tmp_path / "log.csv").write_text("time,v_x,remark\n0,36,wet\n")
    assert io.read_recording(tmp_path / "log.csv", io.ChannelMap({"v_x": "v_x"})).names == ("v_x",)


def test_the_schema_is_a_map(toml):
    channels = io.read_channel_map(toml(CHANNEL_MAP_SCHEMA))
    assert channels.channels["yaw_rate"] == io.Channel("Gierrate", "deg/s", -1, 1.0, 0.0, 3, io.Channel("Time_2"))
    assert channels.channels["v_x"] == io.Channel("Speed")
    assert channels.time == io.Channel("Time")
    assert (channels.separator, channels.decimal) == (";", ",")
    assert (channels.names_line, channels.encoding) == (15, "utf-8")


BROKEN = {
    "broken TOML": ("time = \n", r"map.toml: broken TOML: .*line 1"),
    "key unknown": ('[chanels.v_x]\ncolumn = "Speed"', r"no key 'chanels' \(did you mean 'channels'\?\)"),
    "entry key unknown": (
        '[channels.v_x]\ncolum = "Speed"',
        r"\[channels.v_x\]: no key 'colum' \(did you mean 'column'",
    ),
    "csv key unknown": ('[csv]\ndezimal = ","', r"\[csv\]: no key 'dezimal' \(did you mean 'decimal'"),
    "no column": ('[channels.v_x]\nunit = "m/s"', r"\[channels.v_x\]: has no `column`"),
    "no channels": ("[channels]", r"has no channel"),
    "channels no table": ("channels = 3", r"channels = 3: must be tables"),
    "entry a number": ("[channels]\nv_x = 3", r"\[channels.v_x\] = 3: must be a table"),
    "unit a number": ("[channels.v_x]\ncolumn = 'Speed'\nunit = 3", r"\[channels.v_x\]: unit = 3: must be a string"),
    "sign 2": ("[channels.v_x]\ncolumn = 'Speed'\nsign = 2", r"\[channels.v_x\]: sign = 2.0: must be one of 1, -1"),
    "sign 1.5": ("[channels.v_x]\ncolumn = 'Speed'\nsign = 1.5", r"sign = 1.5: must be one of 1, -1"),
    "scale 0": ("[channels.v_x]\ncolumn = 'Speed'\nscale = 0", r"scale = 0.0: must be finite and not zero"),
    "scale true": ("[channels.v_x]\ncolumn = 'Speed'\nscale = true", r"scale = True: must be a finite number"),
    "offset inf": ("[channels.v_x]\ncolumn = 'Speed'\noffset = inf", r"offset = inf: must be a finite number"),
    "group half": ("[channels.v_x]\ncolumn = 'Speed'\ngroup = 0.5", r"group = 0.5: must be a whole number"),
    "decimal": ("[channels]\nv_x = 'Speed'\n[csv]\ndecimal = ';'", r"decimal = ';': must be one of '.', ','"),
    "separator": ("[channels]\nv_x = 'Speed'\n[csv]\nseparator = ';;'", r"separator = ';;': must be one character"),
    "separator and decimal": ("[csv]\nseparator = ','\ndecimal = ','", r"separator and decimal are both ','"),
    "line 0": ("[csv]\nnames_line = 0", r"names_line = 0: must be a whole number from 1"),
    "line half": ("[csv]\nnames_line = 1.5", r"names_line = 1.5: must be a whole number"),
    "line below the end": ("[csv]\nnames_line = 99", r"names_line = 99: must be at most"),
    "encoding": ("[csv]\nencoding = 'utf-9'", r"encoding = 'utf-9': is not known"),
    "time a number": ("[channels.v_x]\ncolumn = 'Speed'\ntime = 3", r"\[channels.v_x\]: time = 3: must be a table"),
    "column unknown": (
        "time='Zeit'\n[channels]\nv_x = 'Sped'",
        r"no column 'Sped' \(did you mean 'Speed'\?\); there are: S",
    ),
    "time unknown": ("time='Zei'\n[channels]\nv_x = 'Speed'", r"no column 'Zei' \(did you mean 'Zeit'\?\)"),
    "time not named": ("[channels]\nv_x = 'Speed'", r"no time column"),
    "unit of another thing": (
        "time='Zeit'\n[channels.yaw_rate]\ncolumn = 'Speed'\nunit = 'km/h'",
        r"yaw_rate \(column 'Speed'\): unit 'km/h' is of another quantity; it must be convertible to 'rad/s'",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_maps(log, toml, case):
    text, message = BROKEN[case]
    with pytest.raises(InputError, match=message):
        io.read_recording(log, toml(text))


def test_missing_map(log, tmp_path):
    with pytest.raises(InputError, match=r"no\.toml: cannot be read"):
        io.read_recording(log, tmp_path / "no.toml")
    (tmp_path / "latin.toml").write_bytes(b'time = "\xe4"')
    with pytest.raises(InputError, match="broken TOML: not UTF-8"):
        io.read_recording(log, tmp_path / "latin.toml")


@pytest.mark.parametrize(
    ("value", "unit", "target", "expected"),
    [
        (1.0, "g", "m/s^2", 9.80665),
        (1.0, "m/s2", "m/s^2", 1.0),
        (1.0, "m/s²", "m/s^2", 1.0),
        (180.0, "°/s", "rad/s", np.pi),
        (60.0, "rpm", "rad/s", 2 * np.pi),
        (60.0, "1/min", "rad/s", 2 * np.pi),
        (2.0, "1/s", "rad/s", 2.0),
        (3.6, "km/h", "m/s", 1.0),
        (2.0, "Nm", "N*m", 2.0),
        (50.0, "%", "1", 0.5),
        (1.0, "bar", "Pa", 1e5),
        (7.0, " rad ", "rad", 7.0),
    ],
)
def test_units(value, unit, target, expected):
    np.testing.assert_allclose(convert(np.array([value]), unit, target, "channel"), [expected], rtol=1e-14)


@pytest.mark.parametrize(("unit", "target"), [("Hz", "rad/s"), ("%", "rad"), ("m", "m/s"), ("kg", "m/s^2"), ("g", "N")])
def test_units_of_another_thing(unit, target):
    with pytest.raises(InputError, match="is of another quantity"):
        convert(np.array([1.0]), unit, target, "channel")


SPELLINGS = {
    ("km/h", "m/s"): ["KM/H", "Km/h", "kph", "KPH", "kmph", "kmh", "km h-1", "km/hr"],
    ("deg", "rad"): ["Deg", "DEG", "degrees", "°", "º"],
    ("deg/s", "rad/s"): ["Deg/s", "DEG/S", "dps", "degps", "deg/sec", "º/s", "deg s-1", "deg.s-1", "deg·s⁻¹"],
    ("rpm", "rad/s"): ["RPM", "U/min", "1/min", "min-1", "rev/min"],
    ("m/s^2", "m/s^2"): ["m/s²", "m/s2", "mps2", "m/s/s", "m s-2", "m.s-2", "m\xa0s-2", "m·s-2", "m⋅s^-2", "m . s**-2"],
    ("bar", "Pa"): ["Bar", "BAR"],
    ("kPa", "Pa"): ["KPA", "kpa"],
    ("percent", "1"): ["%", "Percent", "pct"],
    ("N*m", "N*m"): ["Nm", "N m", "N·m", "N-m", "N.m", "N × m"],
    ("kg*m^2", "kg*m^2"): ["kg.m2", "kg m2", "kg·m²", "kg*m**2"],
    ("0.001 g", "m/s^2"): ["mg"],
}


@pytest.mark.parametrize(("unit", "target"), SPELLINGS)
def test_spellings_of_loggers(unit, target):
    number, plain = unit.split() if " " in unit else (1.0, unit)
    expected = float(number) * convert(1.0, plain, target, "channel")
    for spelling in SPELLINGS[unit, target]:
        np.testing.assert_allclose(convert(1.0, spelling, target, "channel"), expected, rtol=1e-14, err_msg=spelling)


IN_USE = """
    km/h kph m/s cm/s mm/s km/s um/s dm/s kmph mm/h cm/h um/h dm/h km/min cm/min mm/min um/min dm/min
    rad mrad urad mdeg mdegree rad/s mrad/s urad/s mdeg/s kPa hPa MPa Pa mbar bar N kN MN daN
"""
"""What a prefix (or none) before one of the units of the next test may give."""


@pytest.mark.parametrize("prefix", [*"YZEPTGMkhdcmunpazy", "da"])
def test_a_prefix_that_nobody_uses_is_no_unit(prefix):
    units = {
        "m/s": ("mph", "kph", "fps", "knot", "m/s", "m/h", "m/min"),
        "rad": ("rad", "deg", "degree", "turn", "arcmin"),
        "rad/s": ("rpm", "rad/s", "deg/s"),
        "Pa": ("psi", "bar", "Pa"),
        "N": ("N", "lbf", "kgf"),
        "1": ("percent",),
    }
    for target, some in units.items():
        for unit in (prefix + one for one in some):
            if unit in IN_USE.split():
                convert(1.0, unit, target, "channel")
            else:
                with pytest.raises(InputError, match=r"is not known|of another quantity|may be"):
                    convert(1.0, unit, target, "channel")


POWERS = ("{}^400", "{}^-400", "({})^1e3", "{}/e^400", "m/{}^{}".format("{}", "9" * 30))


@pytest.mark.parametrize("power", POWERS)
@pytest.mark.parametrize("unit", ["km", "ms", "mm", "deg", "kN", "km/h"])
def test_a_power_that_no_number_holds_is_no_unit(unit, power):
    with pytest.raises(InputError, match=r"is not known|of another quantity"):
        convert(1.0, power.format(unit), "m/s", "channel")


@pytest.mark.parametrize("unit", ["grad", "Grad", "GRAD", "grad/s", "Grad/s", "Grad/sec"])
def test_gradians_or_degrees_is_asked(unit):
    with pytest.raises(InputError, match=r"channel: unit '.*' may be degrees or gradians. Write `deg`"):
        convert(1.0, unit, "rad/s" if "/" in unit else "rad", "channel")


def test_missing_pint(log, toml, monkeypatch):
    from jaxveh.io import units

    units._registry.cache_clear()
    units._parse.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "pint", None)
    with pytest.raises(
        InputError, match=r'pint is not installed, and converting units needs it: run `pip install "jaxveh'
    ):
        io.read_recording(log, toml(GOOD))


@pytest.mark.parametrize("unit", ["rpm", "rad/s", "deg/s", "1/min", "rev/min", "U/min", "rps"])
@pytest.mark.parametrize("corner", ["fl", "rr"])
def test_a_wheels_rotation_in_place_of_its_speed_says_how_to_map_it(tmp_path, toml, unit, corner):
    """What the message says to write gives the speed."""
    name, radius = f"wheel_speed_{corner}", 0.31
    path = tmp_path / "wheels.csv"
    path.write_text(f"time,{name} [{unit}]\n0,100\n1,200\n")
    with pytest.raises(InputError, match="is of another quantity.*omega_") as told:
        io.read_recording(path)
    scale = float(re.search(r"scale = (\S+) times the radius", str(told.value))[1]) * radius
    mapped = io.read_recording(
        path, channels=toml(f'[channels.{name}]\ncolumn = "{name}"\nscale = {scale}\nunit = "m/s"\n')
    )
    turning = convert(np.array([100.0, 200.0]), unit, "rad/s", name)
    np.testing.assert_allclose(mapped[name], radius * turning, rtol=1e-6)
