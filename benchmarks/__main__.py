"""`python -m benchmarks [--smoke] [--only NAME] [--rounds N] [--core N] [--json FILE] [--out DIR]`."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
from pathlib import Path

from . import machine

EXPERIMENTS = (
    "particle_filters",
    "further_particle_filters",
    "gaussian_filters",
    "unscented",
    "simulation",
    "tyres",
    "fits",
    "gradients",
    "methods",
    "compile_times",
)


def main(arguments: list[str] | None = None) -> int:
    """Measure and report; return the exit code (2 for bad arguments)."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--smoke", action="store_true", help="tiny sizes and one round: does everything run?")
    parser.add_argument("--only", default="", help="experiment or part of a case's name, e.g. unscented or apf-float64")
    parser.add_argument("--rounds", type=int, default=9, help="rounds over all contestants (default 9)")
    parser.add_argument("--core", type=int, default=None, help="core to be pinned to (default: the last)")
    parser.add_argument("--list", action="store_true", help="names of the cases, nothing measured")
    parser.add_argument("--json", type=Path, default=None, help="write every number to this file")
    parser.add_argument(
        "--out", type=Path, default=None, help="write benchmarks.json and benchmarks.txt to this folder"
    )
    options = parser.parse_args(arguments)
    if options.rounds < 1:
        parser.error(f"--rounds is {options.rounds}; it must be at least 1")
    try:
        core = machine.prepare(options.core, options.smoke)
    except ValueError as error:
        parser.error(str(error))
    cases = _cases(options.smoke, options.only)
    if not cases:
        parser.error(f"--only is {options.only!r}; no case has that in its name, see --list")
    if options.list:
        print("\n".join(case.name for case in cases))
        return 0
    document, text = _run(cases, core, rounds=1 if options.smoke else options.rounds, smoke=options.smoke)
    if options.json:
        _write(options.json, json.dumps(document, indent=1))
    if options.out:
        _write(options.out / "benchmarks.json", json.dumps(document, indent=1))
        _write(options.out / "benchmarks.txt", text)
    return 0


def _cases(smoke: bool, only: str) -> list:
    import importlib

    import jax

    jax.config.update("jax_enable_x64", True)
    modules = [importlib.import_module(f".{name}", __package__) for name in EXPERIMENTS]
    return [case for module in modules for case in module.cases(smoke) if only in case.name]


def _run(cases: list, core: int | None, *, rounds: int, smoke: bool) -> tuple[dict, str]:
    from .measure import Skipped, measure
    from .report import case_report, render

    manifest = machine.describe(core)
    reports, pages = [], []
    _echo(_heading(manifest), pages)
    for case in cases:
        entries = case.build()
        runnable = [c for c in entries if not isinstance(c, Skipped)]
        skipped = [c for c in entries if isinstance(c, Skipped)]
        seconds = 0.0 if smoke else 0.1
        samples = measure(runnable, rounds=rounds, seconds=seconds, cpu_time=core is not None, warm=case.warm)
        report = case_report(case, samples, skipped, smoke=smoke)
        reports.append(report)
        page = io.StringIO()
        with contextlib.redirect_stdout(page):
            render(report)
        _echo(page.getvalue(), pages)
    checks = [check for report in reports for check in report["checks"]]
    return {"manifest": manifest, "rounds": rounds, "smoke": smoke, "cases": reports, "checks": checks}, "\n".join(
        pages
    )


def _heading(manifest: dict) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in manifest["versions"].items())
    return f"{manifest['processor']}, core {manifest['core']}, clock: {manifest['clock']}\n{versions}\n"


def _echo(text: str, pages: list[str]) -> None:
    print(text, flush=True)
    pages.append(text)


def _write(path: Path, text: str) -> None:
    """Write a file completely or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_text(text)
    part.replace(path)


if __name__ == "__main__":
    sys.exit(main())
