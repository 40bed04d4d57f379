"""Logs of a VBOX, drawn from a seed in the forms that receivers of several ages write, against the drive that they hold."""

import random

import numpy as np
import pytest

from jaxveh import InputError, JaxvehWarning, io

ROWS = 60
MINUTES = 60.0 * 180.0 / np.pi
A, E2 = 6_378_137.0, 6.69437999014e-3
"""WGS 84: semi-major axis, m; first eccentricity squared."""

KINDS = {"kmh": 3.6, "km/h": 3.6, "(kmh)": 3.6, "knots": 3600.0 / 1852.0, "mph": 1.0 / 0.44704, "m/s": 1.0}
MORE = {
    "YawRate": ("deg/s", 180.0 / np.pi),
    "yaw_rate": ("°/s", 180.0 / np.pi),
    "LatAcc": ("g", 1 / 9.80665),
    "Gear": ("", 1.0),
}


def ecef(latitude, longitude):
    """Places at height 0 in axes fixed in the earth, m."""
    radius = A / np.sqrt(1 - E2 * np.sin(latitude) ** 2)
    along = radius * np.cos(latitude)
    return np.stack([along * np.cos(longitude), along * np.sin(longitude), radius * (1 - E2) * np.sin(latitude)])


def drive_of(draw):
    """Places, speeds, ... of a drive of 0.6 s somewhere on earth, and a gap of the receiver."""
    dt = draw.choice([0.01, 0.05, 0.1])
    t = draw.choice([36_000.0, 86_399.8, 0.0]) + dt * np.arange(ROWS)
    speed = 20.0 + np.sin(np.arange(ROWS) / 9)
    course = draw.uniform(-3, 3) + 0.12 * np.arange(ROWS)
    latitude0, longitude0 = np.radians([draw.uniform(-70, 70), draw.choice([-180.0, 0.0, draw.uniform(-180, 180)])])
    east, north = np.cumsum(dt * speed * np.cos(course)), np.cumsum(dt * speed * np.sin(course))
    latitude = latitude0 + north / 6.37e6
    longitude = longitude0 + east / (6.37e6 * np.cos(latitude0))
    longitude = np.remainder(longitude + np.pi, 2 * np.pi) - np.pi
    lost = np.zeros(ROWS, bool)
    if draw.random() < 0.5:
        lost[draw.randrange(5, 20) : draw.randrange(20, 50)] = True
    return {"t": t, "speed": speed, "course": course, "latitude": latitude, "longitude": longitude, "lost": lost, "east": east,
            "height": 100.0 + np.arange(ROWS) / 7, "climb_rate": 0.3 * np.cos(np.arange(ROWS))}  # fmt: skip


def text_of(draw, drive):
    """The drive as a file, and its further columns by name."""
    velocity, climb = draw.choice(list(KINDS)), draw.choice(["kmh", "m/s"])
    more = draw.sample(list(MORE), draw.randrange(len(MORE) + 1))
    capital = draw.choice([str, str.upper])
    long_name, rate_name = (
        draw.choice(["long", "lon", "longitude", "lng"]),
        draw.choice(["vertvel", "vert-vel", "vertical_velocity"]),
    )
    clock = np.round(drive["t"] % 86_400.0, 3)
    hours, minutes, seconds = clock // 3600, clock % 3600 // 60, clock % 60
    sats = np.where(drive["lost"], 0, 9) + draw.choice([0, 64, 128, 192])
    values = np.sin(np.arange(ROWS))
    columns = {
        "sats": [f"{one:03d}" for one in sats],
        "time": [f"{h:02.0f}{m:02.0f}{s:06.3f}" for h, m, s in zip(hours, minutes, seconds, strict=True)],
        "lat": [f"{one:+015.8f}" for one in MINUTES * drive["latitude"]],
        long_name: [f"{one:+015.8f}" for one in -MINUTES * drive["longitude"]],
        "velocity": [f"{one:010.6f}" for one in KINDS[velocity] * drive["speed"]],
        "heading": [f"{one:010.6f}" for one in np.degrees(0.5 * np.pi - drive["course"]) % 360.0],
        "height": [f"{one:+09.4f}" for one in drive["height"]],
        rate_name: [f"{one:+010.6f}" for one in KINDS[climb] * drive["climb_rate"]],
        **{name: [f"{one:+.9E}" for one in MORE[name][1] * values] for name in more},
    }
    titles = ["satellites", "time", "latitude", "longitude", f"velocity {velocity}", "heading", "height"]
    titles += [f"vertical velocity {climb}", *more]
    lines = ["File created on 07/12/2014 at 09:02:23", "", "[header]", *titles, "", "[channel units]"]
    lines += [*(MORE[name][0] for name in more), "", "[comments]", "(c) 2014 Racelogic", "Log Rate (Hz) : 100.00", ""]
    lines += draw.choice([[], ["[laptiming]", "Start +5773.4 +1832.2 +5773.4 +1832.2 ¬ start", ""]])
    lines += ["[column names]", capital(" ".join(columns)), "", "[data]"]
    lines += [" ".join(row) for row in zip(*columns.values(), strict=True)]
    return draw.choice(["\r\n", "\n"]).join([*lines, ""]), {capital(name): (name, values) for name in more}


def read(folder, text, channels=None, encoding="utf-8"):
    (folder / "drive.vbo").write_bytes(text.encode(encoding))
    return io.read_recording(folder / "drive.vbo", channels)


@pytest.mark.parametrize("seed", range(40))
def test_a_log_of_a_vbox_is_the_drive(seed, tmp_path):
    draw = random.Random(seed)
    drive = drive_of(draw)
    text, more = text_of(draw, drive)
    found = read(tmp_path, text, encoding=draw.choice(["utf-8", "cp1252"]))
    np.testing.assert_allclose(
        found.time, np.round(drive["t"] % 86_400.0 + 86_400.0 * (drive["t"] >= 86_400.0), 3), atol=1e-9
    )
    kept = ~drive["lost"]
    for name, true in (("speed", "speed"), ("z", "height"), ("climb_rate", "climb_rate")):
        np.testing.assert_allclose(np.asarray(found[name])[kept], drive[true][kept], rtol=1e-4, atol=1e-5)
        assert np.isnan(np.asarray(found[name])[~kept]).all()
    course = np.asarray(found["course"])[kept]
    assert (np.abs(np.diff(course)) <= np.pi).all()
    np.testing.assert_allclose(np.exp(1j * course), np.exp(1j * drive["course"][kept]), atol=1e-7)
    places = ecef(drive["latitude"][kept], drive["longitude"][kept])
    apart = np.linalg.norm(places - places[:, :1], axis=0)
    x, y = np.asarray(found["x"])[kept], np.asarray(found["y"])[kept]
    np.testing.assert_allclose(np.hypot(x, y), apart, atol=2e-3)
    east = drive["east"][kept] - drive["east"][kept][0]
    np.testing.assert_allclose(x, east, atol=0.01 * np.abs(east).max() + 0.01)
    north = places[2] - places[2, 0]
    np.testing.assert_allclose(y * np.cos(drive["latitude"][kept][0]), north, atol=0.02 + 1e-3 * np.abs(north).max())
    for column, (name, values) in more.items():
        factor = 1.0 if column == "yaw_rate" else MORE[name][1]
        np.testing.assert_allclose(found[column], factor * values, rtol=1e-8)
        assert found.unit(column) == ("rad/s" if column == "yaw_rate" else MORE[name][0] or "-")
    assert {"velocity", "heading", "lat", "height"}.isdisjoint(map(str.casefold, found.names))


def test_a_channel_map_may_name_the_file_s_own_columns_and_ours(tmp_path):
    draw = random.Random(3)
    drive = drive_of(draw)
    text, _ = text_of(draw, drive)
    own = next(line for line in text.splitlines() if line.casefold().startswith("sats ")).split()
    mapped = {"v_x": own[4], "yaw": io.Channel(own[5], sign=-1.0), "course": "course", "speed": "speed"}
    found = read(tmp_path, text, io.ChannelMap(mapped))
    whole = read(tmp_path, text)
    kept = ~drive["lost"]
    np.testing.assert_allclose(np.asarray(found["v_x"])[kept], np.asarray(whole["speed"])[kept], rtol=1e-12)
    np.testing.assert_array_equal(found["course"], whole["course"])
    turned = np.exp(1j * (np.asarray(found["yaw"]) + 0.5 * np.pi))[kept]
    np.testing.assert_allclose(turned, np.exp(1j * drive["course"][kept]), atol=1e-7)
    assert found.unit("v_x") == "m/s"


def test_a_heading_is_never_that_of_two_antennas(tmp_path):
    own = PLAIN.replace("time velocity", "time velocity heading course").replace(".0\n", ".0 090.00 0.5\n")
    found = read(tmp_path, own)
    assert found.names == ("sats", "course", "speed")
    np.testing.assert_allclose(found["course"], 0.5)


PLAIN = "[header]\nsatellites\ntime\nvelocity kmh\n\n[column names]\nsats time velocity\n\n[data]\n"
PLAIN += "009 000001.00 036.0\n009 000002.00 072.0\n"

WRONG = {
    "no data": (PLAIN.partition("[data]")[0], r"has no line \[data\] among the first"),
    "no names": (PLAIN.replace("[column names]", "[columns]"), r"has no line \[column names\]"),
    "names without a name": (PLAIN.replace("sats time velocity", ""), r"\[column names\]: none"),
    "a name twice": (PLAIN.replace("sats time", "time time"), "must be names that differ"),
    "no row": (PLAIN.partition("009")[0], "the log is empty"),
    "a row too long": (PLAIN.replace("036.0", "036.0 1 2"), "rows have more cells|Expected 3 fields"),
    "no time": (PLAIN.replace("sats time", "sats clock"), "no time column"),
    "a word": (PLAIN.replace("036.0", "fast"), "data row 1: 'fast' is not a number"),
    "time that steps back": (PLAIN.replace("000002", "000000"), "strictly increasing"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_log_of_a_vbox_is_told(case, tmp_path):
    text, words = WRONG[case]
    with pytest.raises(InputError, match=words):
        read(tmp_path, text)


def test_satellites_that_are_never_counted_are_not_lost(tmp_path):
    with pytest.warns(JaxvehWarning, match="`sats` is 0 in all rows: it is not used"):
        found = read(tmp_path, PLAIN.replace("009", "128"))
    np.testing.assert_allclose(found["speed"], [10.0, 20.0])


def test_units_of_other_columns_are_not_guessed(tmp_path):
    """[channel units] has a line for each column that is not standard; a file with more of them does not tell whose they are."""
    odd = PLAIN.replace("[column names]", "[channel units]\nm/s\nNm\nkm/h\n\n[column names]")
    with pytest.warns(JaxvehWarning, match=r"\[channel units\] has 3 lines, which are not those of the last columns"):
        found = read(tmp_path, odd)
    np.testing.assert_allclose(found["speed"], [10.0, 20.0])
    assert found.names == ("sats", "speed")
