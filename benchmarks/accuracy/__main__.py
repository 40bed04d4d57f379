"""`python -m benchmarks.accuracy [--only TEXT] [--no-fleet | --no-logs] [--runs N] [--seed N] [--json FILE]`.

Estimates sideslip on every shared log in every setting, and on a fleet of simulated cars, next to the open-loop linear model and
to the values of the car file. Every estimate is blind except those "with v_y", whose calibration span has the reference. Rows
below 3 m/s are not scored (0.5 for cars shorter than a metre).
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from .. import machine

FORGET = 20
"""Number of fleet logs after which compiled programs are dropped: each length has its own, and their number is limited."""


def main(arguments: list[str] | None = None) -> int:
    """Measure and report; return the exit code (2 for bad arguments)."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.accuracy", description=__doc__)
    parser.add_argument("--only", default="", help="part of a line's log and setting, e.g. Genesis or blind")
    parser.add_argument("--no-fleet", action="store_true", help="the shared logs alone")
    parser.add_argument("--no-logs", action="store_true", help="the fleet alone")
    parser.add_argument("--runs", type=int, default=200, help="of the fleet (default 200)")
    parser.add_argument("--seed", type=int, default=0, help="of the fleet (default 0)")
    parser.add_argument("--list", action="store_true", help="names of the lines, nothing measured")
    parser.add_argument("--json", type=Path, default=None, help="write every number to this file")
    options = parser.parse_args(arguments)
    if options.runs < 1:
        parser.error(f"--runs is {options.runs}; it must be at least 1")
    import jax

    jax.config.update("jax_enable_x64", True)
    document: dict = {"manifest": machine.describe(None)}
    if not options.no_logs:
        document["logs"] = _logs(options.only, options.list)
    if not options.no_fleet and not options.list:
        document["fleet"] = _fleet(options.only, options.runs, options.seed)
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
    import jax

    from .fleet import fleet
    from .logs import settings
    from .measure import measure
    from .report import fleet_criteria, show, summary

    logs = fleet(runs, seed)
    found = {}
    for name in ("itself, blind", "as told"):
        if only not in f"fleet, {name}":
            continue
        lines = []
        for one in logs:
            setting = next(setting for setting in settings(one.log) if setting.name == name)
            lines.append(measure(one.log, setting))
            if len(lines) % FORGET == 0:
                jax.clear_caches()
            print(f"{len(lines)} of {len(logs)}", end="\r", file=sys.stderr, flush=True)
        about = summary(lines)
        worst = sorted((line for line in lines if not line.failed), key=lambda line: -line.over_open_loop)[:10]
        show(worst, f"fleet of {runs}, {name}: the ten worst")
        print("\n".join(f"  {key}: {value:.3g}" for key, value in about.items()))
        if name == "itself, blind":
            print("\n".join(fleet_criteria(about)))
        found[name] = {"summary": about, "lines": [line.numbers() for line in lines]}
    return found


if __name__ == "__main__":
    sys.exit(main())
