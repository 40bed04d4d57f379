"""The harness counts and compares rightly, and runs from end to end."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import measure as measuring
from benchmarks import report
from benchmarks.measure import Bound, Case, Contestant, Samples, Skipped, Spread

ROOT = Path(__file__).parents[2]


def samples(name, times):
    return Samples(Contestant(name, lambda index: None, 1.0), 1, list(times), list(times))


def case(**changes):
    settings = {
        "name": "room/case",
        "title": "A case",
        "unit": "us a step",
        "build": list,
        "base": "slow",
        "bounds": (Bound("ours", ("slow", "fast"), 0.8),),
    }
    return Case(**{**settings, **changes})


def test_every_round_runs_every_contestant_in_rotating_order():
    calls = []
    contestants = [Contestant(name, lambda index, name=name: calls.append((index, name)), 2.0) for name in "abc"]
    done = measuring.measure(contestants, rounds=3, seconds=0.0, cpu_time=False)
    assert [len(s.times) for s in done] == [3, 3, 3]
    timed = calls[6:]  # two calls each for warming up and for choosing the number of repeats
    assert timed == [(0, n) for n in "abc"] + [(1, n) for n in "bca"] + [(2, n) for n in "cab"]


def test_times_are_per_unit_of_work(monkeypatch):
    clock = iter(range(1000))
    monkeypatch.setattr(measuring.time, "perf_counter", lambda: float(next(clock)))
    [done] = measuring.measure([Contestant("a", lambda index: None, 4.0)], rounds=2, seconds=0.0, cpu_time=False)
    # Between the two readings of the chosen clock one second passes; the wall clock's readings enclose them.
    assert done.times == [0.25e9, 0.25e9]
    assert done.wall == [0.75e9, 0.75e9]


def test_spread_of_known_numbers():
    assert Spread.of([4.0, 1.0, 2.0, 3.0, 5.0]) == Spread(3.0, 2.0, 4.0, 1.0, 5.0)
    assert Spread.of([7.0]) == Spread(7.0, 7.0, 7.0, 7.0, 7.0)


def test_ratios_are_taken_within_rounds():
    # A machine that slows down five-fold in the last round changes times, not ratios.
    done = [samples("ours", [1000.0, 2000.0, 10000.0]), samples("slow", [2000.0, 4000.0, 20000.0])]
    made = report.case_report(case(), done, [])
    ours = made["contestants"][0]
    assert ours["ratio"]["median"] == ours["ratio"]["lower"] == ours["ratio"]["most"] == 0.5
    assert ours["time"]["median"] == 2.0  # microseconds


def test_bounds_hold_against_the_fastest_reference():
    done = [samples("ours", [900.0]), samples("slow", [2000.0]), samples("fast", [1000.0])]
    [check] = report.case_report(case(), done, [])["checks"]
    assert check["name"] == "room/case: ours over fast"
    assert check["value"] == 0.9
    assert check["holds"] is False
    assert report.case_report(case(), done[:2], [])["checks"][0]["holds"] is True
    assert report.case_report(case(), done[:1], [])["checks"] == []
    assert report.case_report(case(), done, [], smoke=True)["checks"] == []


@pytest.mark.parametrize("rich", [True, False])
def test_table_names_all_contestants_and_reasons(rich, capsys, monkeypatch):
    if not rich:
        monkeypatch.setattr(report.importlib.util, "find_spec", lambda name: None)
    done = [samples("ours", [900.0]), samples("slow", [2000.0])]
    report.render(report.case_report(case(), done, [Skipped("absent", "not installed")]))
    shown = capsys.readouterr().out
    for word in ("A case", "ours", "0.45", "absent", "not installed", "holds"):
        assert word in shown


def run(*arguments, folder=ROOT):
    command = [sys.executable, "-m", "benchmarks", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.full
def test_smoke_run_writes_numbers_and_manifest(tmp_path):
    done = run("--smoke", "--only", "unscented/float64-3", "--json", str(tmp_path / "a.json"), "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    document = json.loads((tmp_path / "a.json").read_text())
    assert document == json.loads((tmp_path / "benchmarks.json").read_text())
    [made] = document["cases"]
    measured = {c["name"]: c["time"]["median"] for c in made["contestants"]}
    assert {"jaxveh", "NumPy"} <= set(measured)
    assert min(measured.values()) > 0
    assert "jax" in document["manifest"]["versions"]
    assert "512" in document["manifest"]["xla_flags"]
    assert "jaxveh" in (tmp_path / "benchmarks.txt").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "nonsense"), "no case has that in its name"),
        (("--rounds", "0", "--list"), "it must be at least 1"),
        (("--core", "99999", "--list"), "core is 99999"),
    ],
)
def test_bad_arguments_are_named(arguments, message):
    done = run("--smoke", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
