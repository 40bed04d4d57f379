"""An error of a log's check stops what reads the channel, and is a note to what does not; `--anyway` goes on."""

import sys
from pathlib import Path

import numpy as np
import pytest
from programs import columns, run, write_log

from jaxveh import InputError, Recording, estimators, io
from jaxveh.cli.drives import Drive, _check_one_car
from jaxveh.cli.log_errors import check_trusted, read_by
from jaxveh.cli.quantity_options import QUANTITIES
from jaxveh.cli.several_logs import LACKS, SeveralLogs
from jaxveh.diagnostics import LogFinding, check_log

sys.path.insert(0, str(Path(__file__).parents[1] / "estimators"))
import method_logs

METHODS = [(quantity, name) for quantity, module in QUANTITIES.items() for name in module.METHODS]


def whole_log():
    made = method_logs.channels()
    time = made.pop("time")
    return Recording(time, made, {name: io.canonical_unit(name) or "" for name in made})


LOG = whole_log()


@pytest.mark.parametrize(("quantity", "name"), METHODS, ids=["-".join(one) for one in METHODS])
def test_a_method_is_stopped_by_an_error_in_each_channel_that_it_reads_and_by_no_other(quantity, name):
    module, car = QUANTITIES[quantity], estimators.kit.FULL_CAR
    needs = {need.channel for need in module.METHODS[name].of_centre(car).needs}
    read = read_by(module, name, car, LOG)
    assert read == needs & set(LOG.names) and read
    for channel in (*LOG.names, "nobody's", "time"):
        errors = [LogFinding("warning", channel, "w", {}), LogFinding("error", channel, "is dead.", {})]
        if channel in needs or channel == "time":
            with pytest.raises(InputError, match=f"log.csv: {channel} is dead. `jaxveh check` .* --anyway"):
                check_trusted(Path("log.csv"), errors, read)
        else:
            check_trusted(Path("log.csv"), errors, read)
    for need in module.METHODS[name].of_centre(car).needs:
        if need.optional and need.channel in LOG:
            empty = LOG.replace(**{need.channel: np.full(len(LOG), np.nan)})
            assert need.channel not in read_by(module, name, car, empty), need


def test_a_speed_that_the_log_lacks_is_as_good_as_what_it_is_found_from():
    car = estimators.kit.FULL_CAR
    wheels, satellites = (
        LOG.without("v_x", "speed"),
        LOG.without("v_x", *[name for name in LOG.names if name.startswith("wheel_speed")]),
    )
    for quantity, name in METHODS:
        module = QUANTITIES[quantity]
        if "v_x" in {need.channel for need in module.METHODS[name].of_centre(car).needs}:
            assert {"wheel_speed_fl", "a_x"} <= read_by(module, name, car, wheels), name
            assert "speed" in read_by(module, name, car, satellites), name


DEAD = {"yaw_rate": np.zeros(200), "steer": -columns()["steer"]}
READS = {
    ("--what", "friction"): {"yaw_rate", "steer"},
    ("--what", "stiffness"): {"yaw_rate", "steer"},
    ("--what", "sideslip", "--methods", "rear_axle"): {"yaw_rate"},
    ("--what", "sideslip", "--methods", "open_loop"): {"steer"},
    ("--what", "roll", "--methods", "steady"): set(),
    ("--as-told",): {"yaw_rate"},
    ("--as-told", "--truth", "v_y"): {"yaw_rate", "steer"},
}


@pytest.mark.parametrize("channel", DEAD)
@pytest.mark.parametrize("asked", READS, ids=" ".join)
def test_the_program_stops_where_the_error_reaches_the_answer(asked, channel, tmp_path):
    io.write_car(method_logs.CAR, tmp_path / "car.toml")
    log = write_log(tmp_path, columns() | {channel: DEAD[channel]})
    call = lambda *more: run(
        "estimate", log, "--vehicle", tmp_path / "car.toml", "-o", tmp_path / "out.csv", *asked, *more
    )
    result = call()
    if channel in READS[asked]:
        line = result.stderr.strip().splitlines()[-1]
        assert result.exit_code == 2 and channel in line and "--anyway" in line, result.output
        assert f"error drive.csv: {channel}" in result.stdout and not (tmp_path / "out.csv").exists()
        assert "--as-told" not in asked or call("--anyway").exit_code == 0
    else:
        assert result.exit_code == 0, result.output
        assert f"note drive.csv: {channel}" in result.stdout and "nothing here reads it" in result.stdout


def test_of_several_quantities_those_that_read_it_are_not_taken(tmp_path):
    log, car = write_log(tmp_path, columns() | {"yaw_rate": np.zeros(200)}), tmp_path / "car.toml"
    io.write_car(method_logs.CAR, car)
    result = run(
        "estimate", log, "--vehicle", car, "-o", tmp_path / "out.csv", "--what", "sideslip", "--methods", "all"
    )
    assert result.exit_code == 0, result.output
    words = " ".join(result.stdout.split())
    assert "sideslip, rear_axle: not taken." in words and "yaw_rate is constant at 0 while a_y shows turns" in words
    assert "sideslip, open_loop: not taken" not in words


@pytest.mark.parametrize(("wrong", "suspects"), [("steer", {"steer", "yaw_rate"}), ("a_y", {"a_y", "yaw_rate"})])
def test_a_sign_that_two_channels_disagree_about_suspects_both(wrong, suspects):
    table = columns(6000)
    time = table.pop("time")
    kept = ("steer", "yaw_rate", "v_x") if wrong == "steer" else ("a_y", "yaw_rate", "v_x")
    log = Recording(time, {name: table[name] * (-1 if name == wrong else 1) for name in kept}, {})
    errors = [one for one in check_log(log) if one.severity == "error"]
    assert [one.suspects for one in errors] == [suspects]


@pytest.mark.parametrize("seed", range(5))
def test_logs_of_two_cars_are_told_apart(seed):
    """The message names the logs of each car: within one the steer scales differ by at most 1.2, between them by 1.5."""
    rng = np.random.default_rng(seed)
    cars = [[Path(f"{car}{k}.csv") for k in range(rng.integers(1, 4))] for car in "ab"]
    scales = {log: size * rng.uniform(1.0, 1.2) for size, logs in zip((0.8, 1.5), cars, strict=True) for log in logs}
    finding = lambda scale: LogFinding("ok", "steer", "", {"scale": scale, "correlation": 0.99})
    drives = [Drive(log, LOG, [finding(scale)]) for log, scale in scales.items()]
    order = [drives[k] for k in rng.permutation(len(drives))]
    with pytest.raises(InputError, match=r"Run the program once for each car, with its own --vehicle") as told:
        _check_one_car(order)
    groups = str(told.value).split("Alike are ")[1].split(". Run")[0].split(" and ")
    assert [set(group.split(", ")) for group in groups] == [{log.name for log in logs} for logs in cars]
    _check_one_car([drive for drive in order if drive.log in cars[0]])


def test_logs_that_may_be_the_messages_of_one_drive_are_told_so(tmp_path):
    """Each lacks what the other has; one alone, or two that lack nothing, are told nothing."""
    logs = tmp_path / "esp.csv", tmp_path / "wheels.csv"
    several, single = SeveralLogs(logs), SeveralLogs(logs[:1])
    for one, log in ((several, logs[0]), (several, logs[1]), (single, logs[0])):
        one.refused[log] = InputError(f"{log}: {LACKS}v_x; it must have v_x.")
    for one, told in ((several, True), (single, False)):
        with pytest.raises(InputError) as raised:
            one.check_some()
        assert ("give the folder that holds them" in str(raised.value)) == told
    several.refused[logs[0]] = InputError("esp.csv: is broken.")
    with pytest.raises(InputError) as raised:
        several.check_some()
    assert "folder" not in str(raised.value)
