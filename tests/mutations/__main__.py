"""`python -m tests.mutations cover | try`: see the package's docstring."""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from pathlib import Path

from tests.mutations.candidates import Mutant
from tests.mutations.coverage_map import Covered, cover
from tests.mutations.trials import Trial, chosen, try_all

ROOT = Path(__file__).parents[2]
ROOMS = ("filters", "vehicles", "tyres", "sensors")


def main() -> None:
    said = _arguments()
    if said.what == "cover":
        cover(ROOT, said.map, said.processes)
        return
    os.environ.setdefault("JAXVEH_SHARED", str(ROOT.parent / "shared"))
    todo = chosen(ROOT, tuple(said.rooms), said.count, said.seed)
    known = _known(said.out)
    left = [mutant for mutant in todo if mutant not in known]
    print(f"{len(todo)} mutations, {len(todo) - len(left)} tried before", flush=True)
    with tempfile.TemporaryDirectory() as work, said.out.open("a") as out:
        # Programs that a mutation does not touch are compiled once for all of them.
        os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", f"{work}/programs")
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.2")
        until = time.time() + 60 * said.minutes
        for trial in try_all(ROOT, Path(work), left, Covered(said.map), said.processes, until):
            known[trial.mutant] = trial
            print(json.dumps([*trial.mutant, trial.outcome, trial.by, round(trial.seconds, 1)]), file=out, flush=True)
            print(
                f"{len(known)}/{len(todo)} {trial.outcome} {trial.mutant.path}:{trial.mutant.line} {trial.by}",
                flush=True,
            )
    _report([known[mutant] for mutant in todo if mutant in known])


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutations", description=__doc__)
    parser.add_argument("what", choices=("cover", "try"))
    parser.add_argument("--map", type=Path, default=Path("mutations-map.json"), help="which tests execute which lines")
    parser.add_argument(
        "--out", type=Path, default=Path("mutations.jsonl"), help="a line a trial; those there are not repeated"
    )
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rooms", nargs="+", default=list(ROOMS))
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--minutes", type=float, default=1e6, help="none begins after as many")
    return parser.parse_args()


def _known(path: Path) -> dict:
    if not path.exists():
        return {}
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    trials = [Trial(Mutant(*row[:5]), *row[5:]) for row in rows]
    return {trial.mutant: trial for trial in trials}


def _report(trials: list[Trial]) -> None:
    for trial in trials:
        if trial.outcome != "killed":
            mutant = trial.mutant
            print(f"\n{trial.outcome}: {mutant.path}:{mutant.line} ({mutant.kind})")
            print(f"- {mutant.before.strip()}\n+ {mutant.after.strip()}")
    killed = sum(trial.outcome == "killed" for trial in trials)
    print(f"\n{killed} of {len(trials)} killed ({100 * killed / max(len(trials), 1):.1f} %)")


if __name__ == "__main__":
    main()
