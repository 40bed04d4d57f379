"""`python -m benchmarks.mutations [--count 200] [--seed 0] [--minutes 60] [--workers N] [--only PATH] [--tests PATH]
[--own] [--thorough]`.

Changes one random expression of filters, vehicles, tyres or sensors, in a copy, and runs the test files that execute its line
until one fails. Prints the functions that none of the tests executes, the surviving mutations and the share of killed ones.
Results are kept, so that the same call continues after an interruption; the coverage of the files is measured first, once. Both
hold only for these sources, whose tests must pass.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from .choosing import SETTINGS, choose, lines_beside, measured, never_executed, on_import, test_files
from .mutate import SWAPS, Mutation, mutations

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("jaxveh/filters", "jaxveh/vehicles", "jaxveh/tyres", "jaxveh/sensors")
COPIED = (
    "jaxveh",
    "tests",
    "benchmarks",
    "notebooks",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "mkdocs.yml",
    "noxfile.py",
)
EXIT_NO_TESTS = 5
WITH_LONG_CASES = ("-m", "not full and not seldom and not peers and not studies and not site")

SLOWER = 4.0
"""A mutation counts as noticed if a test file takes this many times its usual time."""

LONGEST = 3600.0
"""Longest time of a test file under coverage, s."""


def main(arguments: list[str] | None = None) -> int:
    """Mutate and report; the exit code is 0 if all judged mutations were killed, otherwise 1."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutations", description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="mutations in all (default 200)")
    parser.add_argument("--seed", type=int, default=0, help="of their choice (default 0)")
    parser.add_argument("--minutes", type=float, default=60.0, help="no further one is begun after these (default 60)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="at once (default: one a core)")
    parser.add_argument(
        "--patience",
        type=float,
        default=120.0,
        help=f"seconds a test file may take beyond {SLOWER:g} times its own (120)",
    )
    parser.add_argument("--only", default="", help="part of the path of the files that are changed")
    parser.add_argument("--tests", default="", help="part of the path of the test files that are asked")
    parser.add_argument(
        "--own", action="store_true", help="tests of the changed file's own room alone: quicker, the share no larger"
    )
    parser.add_argument("--thorough", action="store_true", help="also the single cases that take long, as .ci/run does")
    parser.add_argument("--kept", type=Path, default=ROOT / ".mutations", help="folder of what has been found")
    options = parser.parse_args(arguments)
    options.kept.mkdir(parents=True, exist_ok=True)
    (options.kept / ".gitignore").write_text("*\n")
    # Results for other sources do not apply to these.
    options.kept = options.kept / (digest() + "-thorough" * options.thorough)
    options.kept.mkdir(exist_ok=True)
    options.selected = WITH_LONG_CASES if options.thorough else ()
    end = time.monotonic() + 60.0 * options.minutes
    chosen = draw(options.count, options.seed, options.only)
    with concurrent.futures.ThreadPoolExecutor(options.workers) as pool:
        env = environment(ROOT, options.kept)
        look = lambda file: measured(ROOT, options.kept, file, env, LONGEST, options.selected)
        rooms = {Path(room).name for room in ROOMS}
        near = lambda file: not options.own or Path(file).parts[1] in rooms
        asked = [file for file in test_files(ROOT) if (options.tests in file and near(file)) or file == SETTINGS]
        measurements = dict(zip(asked, pool.map(look, asked), strict=True))
    for file, names in never_executed(ROOT, measurements, [p for p in sources() if options.only in p]).items():
        print(f"{'not executed':>12}  {file}: {', '.join(names)}", flush=True)
    results = judge(chosen, measurements, options, end)
    return report(chosen, results, options.kept / f"results-{options.seed}-{options.count}.json")


def digest() -> str:
    """Return a name for the present sources of the package and its tests."""
    paths = [path for folder in ("jaxveh", "tests") for path in sorted((ROOT / folder).rglob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:12]


def environment(root: Path, kept: Path) -> dict[str, str]:
    """Return the environment for tests of the package in `root`, with kept programs: most are those of the unchanged package."""
    shared = os.environ.get("JAXVEH_SHARED", str(ROOT.parent / "shared"))
    more = {
        "PYTHONPATH": str(root),
        "PYTHONDONTWRITEBYTECODE": "1",
        "JAXVEH_SHARED": shared,
        "JAX_COMPILATION_CACHE_DIR": str(kept.parent / "programs"),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.3",
    }
    return os.environ | more


def draw(count: int, seed: int, only: str = "") -> list[Mutation]:
    """Draw random mutations, at most one per line, with equal probability for all lines.

    At most one in ten swaps arguments, because these mostly fail at once.
    """
    found = [m for name in sources() if only in name for m in mutations(name, (ROOT / name).read_text())]
    rng = random.Random(seed)
    swaps = _one_a_line(rng, [m for m in found if m.kind == SWAPS], count // 10)
    taken = {(m.file, m.line) for m in swaps}
    others = [m for m in found if m.kind != SWAPS and (m.file, m.line) not in taken]
    chosen = swaps + _one_a_line(rng, others, count - len(swaps))
    rng.shuffle(chosen)
    return chosen


def sources() -> list[str]:
    """Return the files that are changed, relative to the root."""
    return [str(path.relative_to(ROOT)) for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]


def _one_a_line(rng: random.Random, found: list[Mutation], count: int) -> list[Mutation]:
    by_line: dict[tuple[str, int], list[Mutation]] = {}
    for mutation in found:
        by_line.setdefault((mutation.file, mutation.line), []).append(mutation)
    lines = rng.sample(sorted(by_line), min(count, len(by_line)))
    return [rng.choice(by_line[line]) for line in lines]


def judge(chosen: list[Mutation], measurements: dict, options, end: float) -> dict[str, str]:
    """Return the verdict on each mutation by its name; mutations with a known verdict are not run again."""
    log = options.kept / "verdicts.jsonl"
    known = dict(json.loads(line) for line in log.read_text().splitlines()) if log.exists() else {}
    lock, copies = threading.Lock(), threading.local()
    with tempfile.TemporaryDirectory() as scratch:

        def one(mutation: Mutation) -> None:
            if mutation.name in known or time.monotonic() > end:
                return
            if not hasattr(copies, "root"):
                copies.root = copied(Path(scratch) / str(threading.get_ident()))
            verdict = tried(mutation, measurements, copies.root, options)
            with lock:
                known[mutation.name] = verdict
                with log.open("a") as file:
                    file.write(json.dumps([mutation.name, verdict]) + "\n")
                print(f"{verdict:>12}  {mutation.name}", flush=True)

        with concurrent.futures.ThreadPoolExecutor(options.workers) as pool:
            list(pool.map(one, chosen))
    return known


def copied(root: Path) -> Path:
    """Make a copy of the files that tests need."""
    root.mkdir()
    for name in COPIED:
        source = ROOT / name
        ignored = shutil.ignore_patterns("__pycache__", ".*")
        if source.is_dir():
            shutil.copytree(source, root / name, ignore=ignored)
        elif source.exists():
            shutil.copy(source, root / name)
    return root


def tried(mutation: Mutation, measurements: dict, root: Path, options) -> str:
    """Return the verdict on one mutation in a copy: `killed`, `survived`, `time-out` or `not covered`.

    A `time-out`, a test file that is `SLOWER` times as slow as before, counts as killed.
    """
    path = root / mutation.file
    source = path.read_text()
    lines, imported = lines_beside(source, mutation.line), on_import(source, mutation.line)
    files = choose(measurements, mutation.file, lines, options.own, imported)
    if not files:
        return "not covered"
    path.write_text(mutation.applied(source))
    try:
        for file in files:
            verdict = passes(root, file, options, options.patience + SLOWER * measurements[file]["seconds"])
            if verdict != "survived":
                return verdict
    finally:
        path.write_text(source)
    return "survived"


def passes(root: Path, file: str, options, limit: float) -> str:
    """Return the result of one test file for a copy: `survived`, `killed` or `time-out`."""
    command = [sys.executable, "-m", "pytest", "-n", "0", "-x", "-q", "-p", "no:cacheprovider", *options.selected, file]
    process = subprocess.Popen(
        command, cwd=root, env=environment(root, options.kept), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    try:
        code = process.wait(limit)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return "time-out"
    return "survived" if code in (0, EXIT_NO_TESTS) else "killed"


def report(chosen: list[Mutation], verdicts: dict[str, str], file: Path) -> int:
    """Print and write the results; return 1 if a mutation survived."""
    judged = [(m, verdicts[m.name]) for m in chosen if m.name in verdicts]
    survivors = [(m, verdict) for m, verdict in judged if verdict in ("survived", "not covered")]
    for mutation, verdict in survivors:
        print(f"\n{verdict}: {mutation.file}:{mutation.line} ({mutation.kind})")
        print(mutation.diff((ROOT / mutation.file).read_text()))
    killed = len(judged) - len(survivors)
    share = killed / len(judged) if judged else float("nan")
    print(f"\nkilled {killed} of {len(judged)} ({100 * share:.1f} %); {len(chosen) - len(judged)} not reached in time")
    numbers = {
        "killed": killed, "judged": len(judged), "chosen": len(chosen), "share": share,
        "verdicts": [{**m._asdict(), "verdict": verdict} for m, verdict in judged],
    }  # fmt: skip
    file.write_text(json.dumps(numbers, indent=1))
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
