"""`python -m benchmarks.accuracy [--only TEXT] [--no-logs] [--no-fleet] [--no-track] [--runs N] [--seed N] [--json FILE]`.

Estimates sideslip on every shared log in every setting, on a fleet of simulated cars, and on their test-track drives, next to the
open-loop linear model and to the values of the car file. Every estimate is blind except those "with v_y", whose calibration span
has the reference. Rows below 3 m/s are not scored (0.5 for cars shorter than a metre).
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from .. import machine

ITSELF = "itself, blind"
"""Name of the setting in which a log calibrates itself."""

FORGET = 20
"""Number of fleet logs after which compiled programs are dropped: each length has its own, and their number is limited."""


def main(arguments: list[str] | None = None) -> int:
    """Measure and report; return the exit code (2 for bad arguments)."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.accuracy", description=__doc__)
    parser.add_argument("--only", default="", help="part of a line's log and setting, e.g. Genesis or blind")
    parser.add_argument("--no-logs", action="store_true", help="without the shared logs")
    parser.add_argument("--no-fleet", action="store_true", help="without the fleet")
    parser.add_argument("--no-track", action="store_true", help="without the test track")
    parser.add_argument("--runs", type=int, default=200, help="of the fleet (default 200)")
    parser.add_argument("--drives", type=int, default=8, help="of each course of the track (default 8)")
    parser.add_argument("--seed", type=int, default=0, help="of the fleet and the track (default 0)")
    parser.add_argument("--list", action="store_true", help="names of the lines, nothing measured")
    parser.add_argument("--json", type=Path, default=None, help="write every number to this file")
    options = parser.parse_args(arguments)
    for name in ("runs", "drives"):
        if getattr(options, name) < 1:
            parser.error(f"--{name} is {getattr(options, name)}; it must be at least 1")
    import jax

    jax.config.update("jax_enable_x64", True)
    document: dict = {"manifest": machine.describe(None)}
    if not options.no_logs:
        document["logs"] = _logs(options.only, options.list)
    if not options.no_fleet and not options.list:
        document["fleet"] = _fleet(options.only, options.runs, options.seed)
    if not options.no_track and not options.list:
        document["track"] = _track(options.only, options.drives, options.seed)
    if options.json and not options.list:
        options.json.write_text(json.dumps(document, indent=1))
    return 0


def _logs(only: str, names_alone: bool) -> list[dict]:
    from .logs import ELSEWHERE, LOGS, read, settings
    from .measure import measure
    from .report import criteria, show

    found = []
    for name in (*LOGS, *ELSEWHERE):
        log = read(name)
        wanted = [setting for setting in settings(log) if only in f"{name}, {setting.name}"]
        if names_alone:
            print("\n".join(f"{name}, {setting.name}" for setting in wanted))
            continue
        lines = [measure(log, setting) for setting in wanted]
        if lines:
            show(lines, f"{name}: sideslip")
            print("\n".join(criteria(lines)))
        found += [line.numbers() for line in lines]
    return found


def _fleet(only: str, runs: int, seed: int) -> dict:
    from .fleet import fleet
    from .report import fleet_criteria, show, summary

    logs = [one.log for one in fleet(runs, seed)]
    found = {}
    for name in (ITSELF, "as told"):
        if only not in f"fleet, {name}":
            continue
        lines = _measured(logs, name)
        about = summary(lines)
        worst = sorted((line for line in lines if not line.failed), key=lambda line: -line.over_open_loop)[:10]
        show(worst, f"fleet of {runs}, {name}: the ten worst")
        print("\n".join(f"  {key}: {value:.3g}" for key, value in about.items()))
        if name == ITSELF:
            print("\n".join(fleet_criteria(about)))
        found[name] = {"summary": about, "lines": [line.numbers() for line in lines]}
    return found


def _track(only: str, drives: int, seed: int) -> dict:
    from .report import show_courses, summary
    from .track import COURSES, track

    found = {}
    for name in COURSES:
        if only in f"track, {name}":
            lines = _measured(list(track(name, drives, seed)), ITSELF)
            found[name] = {"summary": summary(lines), "lines": [line.numbers() for line in lines]}
    if found:
        show_courses(
            {name: one["summary"] for name, one in found.items()}, f"track, {ITSELF}: {drives} drives of each course"
        )
    return found


def _measured(logs: list, name: str) -> list:
    """The lines of all logs in the setting of this name."""
    import jax

    from .logs import settings
    from .measure import measure

    lines = []
    for log in logs:
        lines.append(measure(log, next(setting for setting in settings(log) if setting.name == name)))
        if len(lines) % FORGET == 0:
            jax.clear_caches()
        print(f"{len(lines)} of {len(logs)}", end="\r", file=sys.stderr, flush=True)
    return lines


if __name__ == "__main__":
    sys.exit(main())
