"""Each program once from end to end, at smoke size: what it prints, what it writes, that the numbers agree."""

import dataclasses
import importlib
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from programs import CAR, columns, error_line, run, write_car, write_log

from jaxveh import InputError, Recording, __version__, estimators, io


def read_json(path):
    content = json.loads(path.read_text())
    assert content["manifest"]["command"][0] == "jaxveh"
    return content


def test_version_and_help():
    assert run("--version").stdout.startswith("jaxveh 0.")
    text = run("estimate", "--help").stdout
    for word in ("--calibrate", "--truth", "car.toml", "rad/s"):
        assert word in text


def test_schemas_can_be_read_as_they_are(tmp_path):
    car = tmp_path / "car.toml"
    car.write_text(run("schema", "car").stdout)
    assert io.read_car(car).mass == 1500.0
    channels = tmp_path / "map.toml"
    channels.write_text(run("schema", "channels").stdout)
    assert io.read_channel_map(channels).channels["yaw_rate"].unit == "deg/s"


def test_simulate_then_check(tmp_path):
    drive, numbers = tmp_path / "drive.parquet", tmp_path / "simulate.json"
    settings = ("--manoeuvre", "step-steer", "--steer-deg", "2", "--duration", "4", "--rate", "50")
    result = run("simulate", *settings, "-o", drive, "--json", numbers, "--out", tmp_path / "figures")
    assert result.exit_code == 0, result.output
    recording = io.read_recording(drive)
    assert len(recording) == 201
    assert recording.unit("yaw_rate") == "rad/s"
    np.testing.assert_allclose(float(recording["steer"][-1]), np.radians(2.0), rtol=1e-9)
    noise = np.asarray(recording["yaw_rate"]) - np.asarray(recording["true.yaw_rate"])
    assert 0.004 < np.std(noise) < 0.006
    assert (tmp_path / "figures" / "channels.png").read_bytes().startswith(b"\x89PNG")
    content = read_json(numbers)
    assert content["manifest"]["configuration"]["steer_deg"] == 2.0
    assert content["rows"] == 201

    numbers = tmp_path / "check.json"
    result = run("check", drive, "--vehicle", write_car(tmp_path), "--json", numbers)
    assert result.exit_code == 0, result.output
    content = read_json(numbers)
    assert content["log"]["rows"] == 201
    for finding in content["findings"]:
        assert finding["severity"] in ("ok", "note", "warning", "error")
        assert finding["channel"] in result.stdout
    assert any(finding["channel"] == "steer" for finding in content["findings"])


def test_the_same_seed_simulates_the_same_drive(tmp_path):
    settings = ("--manoeuvre", "step-steer", "--duration", "4", "--rate", "50")  # the program of the test above
    files = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        files.append(tmp_path / f"{name}.csv")
        assert run("simulate", *settings, "--seed", seed, "-o", files[-1]).exit_code == 0
    first, second, third = (file.read_bytes() for file in files)
    assert first == second
    assert first != third


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Four seconds of a sine of steer, as a simulation of the car's own file would have them, with v_y."""
    return columns(400)


def estimate(folder, table, *more):
    product = folder / "estimate.csv"
    arguments = ("estimate", write_log(folder, table), "--vehicle", write_car(folder), "-o", product, *more)
    return run(*arguments), product


def test_estimate_without_calibration(tmp_path, drive):
    numbers = tmp_path / "numbers.json"
    result, product = estimate(tmp_path, drive, "--truth", "v_y", "--json", numbers, "--out", tmp_path / "figures")
    assert result.exit_code == 0, result.output
    found = io.read_recording(product)
    np.testing.assert_array_equal(np.asarray(found.time), drive["time"])
    assert (np.asarray(found["sideslip_std"]) > 0).all()
    content = read_json(numbers)
    error = np.asarray(found["sideslip"]) - np.arctan2(drive["v_y"], drive["v_x"])
    np.testing.assert_allclose(content["sideslip_rmse_deg"], np.degrees(np.sqrt(np.mean(error**2))), rtol=1e-6)
    assert content["open_loop_sideslip_rmse_deg"] > 0
    assert 0 <= content["sideslip_coverage_95"] <= 1
    drawn = ["channels", "estimate", "v_y", "worst", "innovations", "rear_axle"]
    assert content["figures"] == [str(tmp_path / "figures" / f"{name}.png") for name in drawn]
    assert all((tmp_path / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG") for name in drawn)


def test_the_truth_of_a_simulation_is_scored_as_a_measured_one_is(tmp_path, drive):
    """`true.v_y` as `simulate` writes it."""
    table, numbers = dict(drive), []
    table["true.v_y"] = table.pop("v_y")
    for name, log, truth in (("measured", drive, "v_y"), ("simulated", table, "true.v_y")):
        (folder := tmp_path / name).mkdir()
        result, _ = estimate(folder, log, "--as-told", "--truth", truth, "--json", folder / "numbers.json")
        assert result.exit_code == 0, result.output
        numbers.append(read_json(folder / "numbers.json"))
    assert numbers[0]["sideslip_rmse_deg"] == numbers[1]["sideslip_rmse_deg"] > 0
    both = {**drive, "true.v_y": drive["v_y"]}
    result, _ = estimate(tmp_path, both, "--calibrate", "0:2", "--calibrate-on", "v_y", "--truth", "true.v_y")
    assert result.exit_code == 2 and "--calibrate-on uses v_y" in error_line(result)


def test_devices_with_clocks_of_their_own(tmp_path):
    """a_y 3 ms beside the others, so that no row has both: the library says so, the program takes one clock and says that."""
    drive = {name: values for name, values in columns(800).items() if name != "v_y"}
    count = len(drive["time"])
    late = {name: np.where(name == "a_y", np.nan, values) for name, values in drive.items() if name != "time"}
    other = {name: np.full(count, np.nan) for name in late} | {"a_y": drive["a_y"]}
    order = np.argsort(time := np.append(drive["time"], drive["time"] + 0.003))
    apart = {"time": time[order]} | {name: np.append(late[name], other[name])[order] for name in late}
    (log := tmp_path / "apart").mkdir()
    result, _ = estimate(log, apart, "--as-told", "--fill", "0.05")
    assert result.exit_code == 0, result.output
    assert "have separate clocks: all channels are interpolated linearly at the rows of yaw_rate" in result.output
    (together := tmp_path / "together").mkdir()
    assert estimate(together, drive, "--as-told")[0].exit_code == 0
    found, there = (io.read_recording(folder / "estimate.csv") for folder in (log, together))
    spread = lambda one: float(np.median(np.asarray(one["sideslip_std"])))
    assert spread(found) < 2.0 * spread(there)
    car = io.read_car(write_car(tmp_path))
    log = Recording(apart["time"], {name: values for name, values in apart.items() if name != "time"})
    for name in ("v_x", "a_x", "steer"):
        log = log.fill(name)
    for call in (estimators.sideslip.estimate, estimators.sideslip.calibrate):
        with pytest.raises(InputError, match=r'clocks of their own.*io.resample\(recording, "yaw_rate"'):
            call(car, log)


def test_estimate_never_sees_the_truth(tmp_path, drive):
    files = []
    for name, table in (("with", drive), ("other", {**drive, "v_y": 9 + drive["v_y"]})):
        folder = tmp_path / name
        folder.mkdir()
        result, product = estimate(folder, table, "--truth", "v_y")
        assert result.exit_code == 0, result.output
        files.append(product.read_bytes())
    assert files[0] == files[1]


def test_gaps_of_an_input_are_filled_on_request_only(tmp_path, drive):
    table = {**drive, "v_x": drive["v_x"].copy()}
    table["v_x"][100:104] = np.nan
    result, product = estimate(tmp_path, table)
    line = error_line(result)
    assert "v_x is NaN in 4 rows, first at t = 1 s" in line
    assert "add --fill 0.051 to fill them" in line
    assert not product.exists()
    result, _ = estimate(tmp_path, table, "--fill", "0.02")
    assert "raise --fill to 0.051" in error_line(result)
    result, product = estimate(tmp_path, table, "--fill", "0.051")
    assert result.exit_code == 0, result.output
    assert product.exists()


def test_a_span_too_short_to_calibrate_on(tmp_path, drive):
    result, product = estimate(tmp_path, drive, "--calibrate", "0:2")
    assert "must be at least 5 s" in error_line(result)
    assert not product.exists()


def test_a_log_without_a_channel(tmp_path, drive):
    without = lambda missing: {name: values for name, values in drive.items() if name != missing}
    result, product = estimate(tmp_path, without("yaw_rate"))
    assert "the log has no yaw_rate" in error_line(result)
    assert not product.exists()
    # What can be done without is done without.
    for missing in ("a_x", "a_y"):
        folder = tmp_path / missing
        folder.mkdir()
        result, product = estimate(folder, without(missing))
        assert result.exit_code == 0, result.output
        assert "Nothing was calibrated" in result.output


@pytest.mark.studies
def test_a_log_calibrates_itself_unless_told_otherwise(tmp_path, drive):
    result, _ = estimate(tmp_path, drive, "--as-told", "--calibrate", "0:2")
    assert "--as-told fits nothing" in error_line(result)
    result, _ = estimate(tmp_path, drive, "--as-told")
    assert "the values of the car file are used: --as-told." in result.output
    folder = tmp_path / "long"
    folder.mkdir()
    often = {name: np.tile(values, 6) for name, values in drive.items()} | {"time": 0.01 * np.arange(2400)}
    result, product = estimate(folder, often)
    assert result.exit_code == 0, result.output
    assert "The log calibrated itself" in result.output
    assert product.exists()


def test_truth_that_says_nothing_of_sideslip(tmp_path, drive):
    result, product = estimate(tmp_path, drive, "--truth", "a_y")
    assert "--truth = 'a_y': must be one of 'v_y', 'sideslip', 'true.v_y', 'true.sideslip'." in error_line(result)
    assert not product.exists()


def with_steer(seconds=30.0):
    """Weaving at 15 to 20 m/s of the car of `CAR` with the steer that its linear tyres ask for, so that both axles show."""
    time = np.arange(0.0, seconds, 0.02)
    v_x = 17.5 + 2.5 * np.sin(0.3 * time)
    yaw_rate = 0.15 * np.sin(0.9 * time) + 0.1 * np.sin(2.1 * time)
    m, I_z, a, b, C_f, C_r = 1420.0, 2124.0, 0.96, 1.59, 88e3, 127e3
    turn = np.gradient(yaw_rate, time)
    v_y, a_y = np.zeros_like(time), np.zeros_like(time)
    for k in range(time.size):
        # Moments about the front axle: L F_r = a m a_y - I dr/dt, and F_r = -C_r (v_y - b r) / v_x.
        F_r = -C_r * (v_y[k] - b * yaw_rate[k]) / v_x[k]
        a_y[k] = ((a + b) * F_r + I_z * turn[k]) / (a * m)
        if k + 1 < time.size:
            v_y[k + 1] = v_y[k] + 0.02 * (a_y[k] - v_x[k] * yaw_rate[k])
    F_f = m * a_y - F_r_of(v_y, yaw_rate, v_x, b, C_r)
    steer = F_f / C_f + (v_y + a * yaw_rate) / v_x
    return {
        "time": time, "steer": steer, "v_x": v_x, "a_x": np.gradient(v_x, time) - v_y * yaw_rate, "a_y": a_y,
        "yaw_rate": yaw_rate, "v_y": v_y,
    }  # fmt: skip


def F_r_of(v_y, yaw_rate, v_x, b, C_r):
    return -C_r * (v_y - b * yaw_rate) / v_x


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A calibration of a log, the car beside it, its numbers and figures, made by one call of `fit`, which takes long: whoever
    asks for it is one of the studies."""
    folder = tmp_path_factory.mktemp("kept")
    log, car = write_log(folder, with_steer()), write_car(folder)
    more = ("--car-file", folder / "fitted.toml", "--json", folder / "fit.json", "--out", folder / "figures")
    result = run("fit", log, "--vehicle", car, "-o", folder / "calibration.toml", *more)
    assert result.exit_code == 0, result.output
    # The sentence names what the table names.
    assert "contain little information about" in result.output and "process_noise" not in result.output
    return folder


@pytest.mark.studies
def test_fit_writes_the_calibration_the_car_and_its_curves(kept):
    found = estimators.read_calibration(kept / "calibration.toml")
    assert found.spans == (estimators.Span(0.0, 29.98, "drive.csv"),)
    assert read_json(kept / "fit.json")["calibrated_on"] == [{"start": 0.0, "end": 29.98, "log": "drive.csv"}]
    told = read_json(kept / "fit.json")["little_told"]
    assert "grip" in told and "stiffness" not in told
    fitted = io.read_car(kept / "fitted.toml")
    assert fitted.mass == 1420.0
    # The drive is the linear car's own.
    np.testing.assert_allclose(fitted.rear_cornering_stiffness, 127e3, rtol=0.15)
    np.testing.assert_allclose(fitted.front_cornering_stiffness, 88e3, rtol=0.15)
    assert abs(fitted.steer_offset) < 1e-3
    assert (kept / "figures" / "force_curves.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.studies
def test_a_calibration_that_was_kept_estimates_as_the_process_that_fitted_it(kept):
    log, car = kept / "drive.csv", kept / "car.toml"
    outputs = []
    for name, more in (("a", ("--vehicle", car)), ("b", ("--calibration", kept / "calibration.toml"))):
        outputs.append(kept / f"{name}.csv")
        result = run("estimate", log, "-o", outputs[-1], "--truth", "v_y", *more)
        assert result.exit_code == 0, result.output
    assert "on drive.csv 0 to 29.98 s" in result.stdout
    assert outputs[0].read_bytes() == outputs[1].read_bytes()


@pytest.mark.full
@pytest.mark.studies
def test_several_logs_go_into_a_folder_with_one_calibration(kept):
    logs = [kept / "drive.csv", kept / "again.csv"]
    logs[1].write_text(logs[0].read_text())
    out = kept / "estimates"
    result = run(
        "estimate",
        *logs,
        "--calibration",
        kept / "calibration.toml",
        "-o",
        out,
        "--span",
        "5:20",
        "--json",
        kept / "all.json",
    )
    assert result.exit_code == 0, result.output
    first, second = (io.read_recording(out / name) for name in ("drive.parquet", "again.parquet"))
    np.testing.assert_array_equal(first["sideslip"], second["sideslip"])
    assert (float(first.time[0]), float(first.time[-1])) == (5.0, 19.98)
    assert set(read_json(kept / "all.json")["logs"]) == {"drive.csv", "again.csv"}
    again = run("estimate", *logs, "--calibration", kept / "calibration.toml", "-o", out)
    assert "exists already" in error_line(again)
    twice = run("estimate", logs[0], logs[0], "--calibration", kept / "calibration.toml", "-o", kept / "twice")
    assert "two logs would be written to drive.parquet" in error_line(twice)


@pytest.mark.studies
def test_logs_of_different_cars_are_refused(kept, tmp_path):
    """The other one steers more for the same turn, as a longer car does; less than a check of one log would call an error."""
    table = with_steer()
    for factor, refused in ((1.15, False), (1.4, True)):
        other = tmp_path / f"other_{factor}"
        other.mkdir()
        log = write_log(other, {**table, "steer": factor * table["steer"]})
        log = log.rename(log.with_name("longer.csv"))
        logs, calibration, out = (kept / "drive.csv", log), kept / "calibration.toml", other / "estimates"
        result = run("estimate", *logs, "--calibration", calibration, "-o", out)
        if not refused:
            assert result.exit_code == 0, result.output
            continue
        line = error_line(result)
        assert "longer.csv: looks like a log of another car than" in line and "drive.csv" in line and "--anyway" in line
        assert not any(out.iterdir())
        fitted = run("fit", *logs, "--vehicle", kept / "car.toml", "-o", tmp_path / "both.toml")
        assert "looks like a log of another car" in error_line(fitted) and not (tmp_path / "both.toml").exists()
        assert run("estimate", *logs, "--calibration", calibration, "-o", out, "--anyway").exit_code == 0


def test_a_steering_wheel_steers_by_the_cars_ratio(tmp_path):
    table = with_steer()
    table["steering_wheel"] = 16.0 * table.pop("steer")
    log, told = write_log(tmp_path, table), write_car(tmp_path)
    ratio = tmp_path / "ratio.toml"
    io.write_car(dataclasses.replace(io.read_car(told), steering_ratio=16.0), ratio)
    scores = {}
    for car in (told, ratio):
        numbers = tmp_path / "numbers.json"
        start = ("estimate", log, "--vehicle", car, "-o", tmp_path / "e.csv", "--force", "--as-told")
        result = run(*start, "--truth", "v_y", "--json", numbers)
        assert result.exit_code == 0, result.output
        assert ("steering_wheel is not used" in result.stdout) == (car == told)
        scores[car] = read_json(numbers)
        numbers.unlink()
    assert "open_loop_sideslip_rmse_deg" not in scores[told] and scores[ratio]["open_loop_sideslip_rmse_deg"] > 0


@pytest.mark.full
@pytest.mark.studies
def test_a_report_of_one_log_and_of_several(kept):
    pytest.importorskip("bokeh")
    start = ("--calibration", kept / "calibration.toml", "--span", "5:20", "--truth", "v_y")
    page, numbers = kept / "one.html", kept / "one.json"
    result = run("estimate", kept / "drive.csv", *start, "-o", kept / "one.csv", "--report", page, "--json", numbers)
    assert result.exit_code == 0, result.output
    assert f"report: {page}" in result.stdout
    text, content = page.read_text(), read_json(numbers)
    text = text[text.index("<h1>") :]
    words = ["drive.csv (750 rows, 5 to 19.98 s)", "1420 kg", "Calibrated by", "truth", "command", "Check of drive.csv"]
    words += [
        "Fitted parameters",
        "standard error",
        "Score against the truth",
        "open-loop linear model",
        "Estimate and channels",
    ]
    places = [text.index(one) for one in [*words, "Rear axle: ", "Innovations: whether"]]
    assert places == sorted(places)
    stiffness = content["fitted"]["stiffness"]
    # As many decimals as the standard error has in two figures.
    value, std = stiffness["value"], stiffness["std"]
    places = max(0, 1 - int(np.floor(np.log10(std))))
    assert re.search(rf">stiffness</td><td[^>]*>{value:.{places}f}.*</td><td[^>]*>{std:.{places}f}", text)
    for name in ("sideslip_rmse_deg", "open_loop_sideslip_rmse_deg"):
        assert f">{content[name]:.4g}</td>" in text
    assert f">{100 * content['sideslip_coverage_95']:.1f} %</td>" in text
    assert f'sideslip: largest error [°]</td><td class="number">{content["sideslip_worst_deg"]:.4g}</td>' in text

    (kept / "tuesday.csv").write_text((kept / "drive.csv").read_text())
    both, page = (kept / "drive.csv", kept / "tuesday.csv"), kept / "both.html"
    result = run("estimate", *both, *start, "-o", kept / "with_report", "--report", page)
    assert result.exit_code == 0, result.output
    text = page.read_text()
    assert 'href="#log-1">tuesday.csv<' in text and text.count("Score against the truth") == 2


@pytest.mark.studies
def test_a_report_is_refused_before_any_work(kept, tmp_path):
    pytest.importorskip("bokeh")
    start = ("estimate", kept / "drive.csv", "--calibration", kept / "calibration.toml", "-o", tmp_path / "e.csv")
    assert "it must end in one of .html" in error_line(run(*start, "--report", tmp_path / "report.pdf"))
    there = tmp_path / "there.html"
    there.write_text("mine")
    assert "pass --force to replace it" in error_line(run(*start, "--report", there))
    assert "there is no folder" in error_line(run(*start, "--report", tmp_path / "none" / "report.html"))
    assert there.read_text() == "mine" and not (tmp_path / "e.csv").exists()
    assert run(*start, "--report", there, "--as-told").exit_code == 2
    result = run(*start[:2], "--vehicle", kept / "car.toml", *start[4:], "--as-told", "--report", there, "--force")
    assert result.exit_code == 0, result.output
    assert "Nothing was fitted: the values of the car file are used." in there.read_text()


def topics_of(path):
    """Messages by topic, (stamp in ns, numbers) each, of an MCAP file."""
    reader = pytest.importorskip("mcap.reader")
    found = {}
    with path.open("rb") as stream:
        for _, channel, message in reader.make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
    return found


@pytest.mark.studies
def test_an_estimate_as_topics_is_that_of_the_table_with_the_log_beside_it(kept):
    pytest.importorskip("mcap")
    start = (
        "estimate",
        kept / "drive.csv",
        "--calibration",
        kept / "calibration.toml",
        "--span",
        "5:20",
        "--truth",
        "v_y",
    )
    for name in ("topics.mcap", "topics.csv"):
        result = run(*start, "-o", kept / name)
        assert result.exit_code == 0, result.output
    found, table, log = (
        topics_of(kept / "topics.mcap"),
        *(io.read_recording(kept / f"{n}.csv") for n in ("topics", "drive")),
    )
    log = log.between(5.0, 20.0)
    assert set(found) == {"/estimate", "/log", "/truth"}
    truth = {"v_y": np.asarray(log["v_y"]), "sideslip": np.arctan2(log["v_y"], log["v_x"])}
    for topic, told in (("/estimate", table.channels), ("/log", log.channels), ("/truth", truth)):
        stamps, rows = zip(*found[topic], strict=True)
        np.testing.assert_array_equal(stamps, np.round(1e9 * np.asarray(log.time)).astype(int))
        assert set(rows[0]) == set(told)
        for name, values in told.items():
            np.testing.assert_allclose([row[name] for row in rows], values, rtol=1e-12)
    without = run(*start[:-2], "-o", kept / "blind.mcap")
    assert without.exit_code == 0 and set(topics_of(kept / "blind.mcap")) == {"/estimate", "/log"}


@pytest.mark.studies
def test_topics_have_no_stamps_below_zero(kept, tmp_path):
    pytest.importorskip("mcap")
    table = with_steer()
    log = write_log(tmp_path, table | {"time": table["time"] - 1.0})
    start = ("estimate", log, "--calibration", kept / "calibration.toml", "-o")
    assert "stamps must be at least zero, but the log begins at -1 s" in error_line(run(*start, tmp_path / "e.mcap"))
    assert not (tmp_path / "e.mcap").exists()


def broken(kept, change):
    path = kept / "broken.toml"
    path.write_text(change((kept / "calibration.toml").read_text()))
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda text: re.sub('(?m)^version = ".*"', 'version = "77.2.0"', text),
            f"not written by version {__version__}",
        ),
        (lambda text: text[: len(text) // 2], "broken.toml"),
        (lambda text: text[: text.index("[covariance]")], "no covariance"),
        (lambda text: text.replace('"sideslip"', '"mass_and_grade"', 1), "broken.toml"),
        (lambda text: text.replace("grip", "gripp"), "broken.toml"),
        (lambda text: text.replace("value = ", "value = 'x' #", 1), "must be a number"),
    ],
)
@pytest.mark.studies
def test_a_calibration_file_that_is_none_is_refused(kept, change, words):
    result = run("estimate", kept / "drive.csv", "--calibration", broken(kept, change), "-o", kept / "never.csv")
    assert words in error_line(result)
    assert not (kept / "never.csv").exists()


@pytest.mark.studies
def test_a_calibration_of_another_car_and_options_that_contradict_it(kept, tmp_path):
    other = write_car(tmp_path, CAR.replace("mass = 1420.0", "mass = 1421.0"))
    start = ("estimate", kept / "drive.csv", "--calibration", kept / "calibration.toml", "-o", tmp_path / "e.csv")
    line = error_line(run(*start, "--vehicle", other))
    assert "is of another car: its mass is 1420.0, but that of --vehicle is 1421.0" in line
    assert "leave out --as-told" in error_line(run(*start, "--as-told"))
    assert "leave out --calibrate" in error_line(run(*start, "--calibrate", "0:25"))
    both = (
        "estimate",
        kept / "drive.csv",
        kept / "calibration.toml",
        "--vehicle",
        kept / "car.toml",
        "-o",
        tmp_path / "both",
    )
    assert "--calibrate takes one log" in error_line(run(*both, "--calibrate", "0:25"))
    assert "--vehicle is missing" in error_line(run("estimate", kept / "drive.csv", "-o", tmp_path / "e.csv"))
    assert "lies outside the log" in error_line(run(*start, "--span", "100:200"))


@pytest.mark.studies
def test_a_log_that_check_finds_wrong_is_refused_unless_one_goes_on_anyway(kept, tmp_path):
    table = with_steer()
    table["a_y"] = -table["a_y"]
    log = write_log(tmp_path, table)
    start = ("estimate", log, "--calibration", kept / "calibration.toml", "-o", tmp_path / "e.csv")
    result = run(*start)
    line = error_line(result)
    assert "wrong sign" in line and "--anyway" in line
    assert not (tmp_path / "e.csv").exists()
    assert run(*start, "--anyway").exit_code == 0


@pytest.mark.studies
def test_demo(tmp_path):
    out, numbers = tmp_path / "demo", tmp_path / "demo.json"
    result = run("demo", "--particles", "20", "--out", out, "--json", numbers)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in out.iterdir()) == ["force_curves.png", "parameters.png", "states.png"]
    content = read_json(numbers)
    assert content["manifest"]["configuration"]["study"]["particles"] == 20
    assert set(content["estimators"]) == {"prior", "PF", "APF", "UKF", "MAP"}
    curve = {name: one["curve_rmse_share_of_D"] for name, one in content["estimators"].items()}
    for name in ("UKF", "MAP"):
        for axle in ("front", "rear"):
            assert max(curve[name][axle]) < 0.02
            assert len(curve[name][axle]) == 1
    assert content["observability"]["condition_number"] > 1e9
    assert "unobservable" in result.stdout
    assert set(content["seconds"]) == {"simulation", "MAP", "PF", "APF", "UKF", "errors and step steers"}


@pytest.fixture
def papers(monkeypatch):
    """Two papers of which only the report is real; what they were asked. The studies have tests of their own."""
    from jaxveh.cli import reproduce
    from jaxveh.experiments.report import Check
    from jaxveh.sweeps import Table

    asked = []

    def paper(name):
        class Found:
            seeds = 7

        def run(**options):
            options.pop("progress")(1, 1, "done")
            asked.append((name, options))
            return Found()

        honest, printed = (
            Table(f"honest {name}", ("what", "value"), [("UKF", "0.5")]),
            Table("printed", ("a",), [("x",)]),
        )
        checks = [
            Check("UKF front", 0.5, 0.8, "met", "told the noise"), Check("PF front", float("nan"), 0.8, "failed"),
            Check("PF front, redesigned", 0.7, 0.8, "met", "made later", "PF front"),
        ]  # fmt: skip
        return SimpleNamespace(
            run=run, tables=lambda found: [honest, printed], check=lambda found: checks,
            as_printed=lambda **options: [printed], settings=lambda found: {"study": {"particles": 20}},
        )  # fmt: skip

    every = {name: paper(name) for name in ("first", "second")}
    monkeypatch.setattr(reproduce, "PAPERS", dict.fromkeys(every, "a paper"))
    monkeypatch.setattr(reproduce, "_experiment", every.__getitem__)
    # Devices are made once in a process; other tests count on one.
    monkeypatch.setattr(reproduce, "_every_core", lambda: None)
    return asked


def test_reproduce_prints_tables_and_writes_checks(tmp_path, papers):
    numbers = tmp_path / "numbers.json"
    result = run("reproduce", "first", "--seeds", "7", "--seed", "3", "--json", numbers)
    assert result.exit_code == 0, result.output
    assert papers == [("first", {"seeds": 7, "seed": 3})]
    assert "honest first" in result.stdout
    # What stands beside a criterion is shown, and not counted.
    assert (
        "original criteria that hold: 1 of 2 (1 failed)" in result.stdout
        and "beside it: PF front, redesigned" in result.stdout
    )
    assert "told the noise" in result.stdout and "made later" in result.stdout
    content = read_json(numbers)
    assert content["checks"][0] == {
        "name": "UKF front", "value": 0.5, "bound": 0.8, "status": "met", "condition": "told the noise", "original": "",
    }  # fmt: skip
    assert content["checks"][1]["value"] is None
    assert content["tally"] == {"met": 1, "failed": 1, "open": 0}
    assert content["tables"][1]["rows"] == [["x"]]
    assert content["manifest"]["configuration"] == {"seeds": 7, "study": {"particles": 20}}


def test_reproduce_as_printed_shows_that_alone(papers):
    shown = run("reproduce", "first", "--as-printed").stdout
    assert "printed" in shown and "honest" not in shown and not papers


def test_reproduce_all_goes_through_every_paper(tmp_path, papers, monkeypatch):
    """Each by a program of its own, which stands here for what it writes."""
    from jaxveh.cli import all_papers

    asked = {}

    def program(name, options, folder, tell, family):
        asked[name] = {option: value for option, value in options.items() if value is not None}
        tell("done")
        checks = [{"name": "UKF", "value": 0.5, "bound": 0.8, "status": "met"}, {"name": "PF", "status": "open"}]
        found = {"met": 2, "failed": 0, "open": 0} if name == "first" else {"met": 1, "failed": 0, "open": 1}
        return all_papers.Done(int(name == "failing"), f"tables of {name}\n", {"checks": checks, "tally": found}, 61.4)

    monkeypatch.setattr(all_papers, "run_program", program)
    numbers = tmp_path / "numbers.json"
    result = run("reproduce", "all", "--seed", "3", "--json", numbers)
    assert result.exit_code == 0, result.output
    assert asked == {"first": {"--seed": 3}, "second": {"--seed": 3}}
    assert result.stdout.index("tables of first") < result.stdout.index("tables of second")
    assert "2 of 2" in result.stdout and "1 of 2 (1 open)" in result.stdout and "61" in result.stdout
    assert json.loads(numbers.read_text())["second"]["checks"][0]["status"] == "met"
    monkeypatch.setattr("jaxveh.cli.reproduce.PAPERS", {"failing": "a paper"})
    result = run("reproduce", "all")
    assert result.exit_code == 1 and "failing failed" in result.stderr


def test_a_paper_by_a_program_of_its_own(tmp_path):
    """A program that refuses its input: the line it says is told, its code kept."""
    from jaxveh.cli.all_papers import run_program
    from jaxveh.cli.family import Family

    told, asked = [], {"--seed": 1, "--as-printed": True, "--out": None}
    done = run_program("no-paper", asked, tmp_path, told.append, Family())
    assert done.code == 2 and done.numbers == {} and done.took > 0
    assert any("must be one of" in line for line in told)


def test_a_log_is_for_the_review_alone(tmp_path, papers):
    assert "belong together" in error_line(run("reproduce", "first", "--log", tmp_path / "log.csv"))
    both = ("--log", tmp_path / "log.csv", "--vehicle", tmp_path / "car.toml")
    assert "only sideslip-review uses a log" in error_line(run("reproduce", "first", *both))


def test_reproduce_names_its_papers():
    from jaxveh.cli.reproduce import PAPERS, _experiment

    result = run("reproduce", "third")
    assert result.exit_code == 2
    for name in (*PAPERS, "all"):
        assert name in result.stderr
    for name in PAPERS:
        experiment = _experiment(name)
        for needed in ("CITATION", "CRITERIA", "Study", "as_printed", "check", "run", "settings", "tables"):
            assert hasattr(experiment, needed), f"{name} has no {needed}"
        assert callable(importlib.import_module(f"{experiment.__name__}.figures").figures)
