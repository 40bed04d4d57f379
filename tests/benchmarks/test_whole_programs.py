"""Starts of whole programs, and sweeps at scale: they run, and what they count is counted once."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import starts


def test_spans_that_overlap_count_once():
    rng = np.random.default_rng(0)
    for _ in range(100):
        ends = np.sort(rng.integers(0, 50, (rng.integers(0, 12), 2)), axis=1)
        seconds = {int(t) for a, b in ends for t in range(a, b)}
        assert starts.covered([(float(a), float(b)) for a, b in ends]) == len(seconds)


@pytest.mark.studies
@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("starts", "--only", "simulate", "--rounds", "1"), ("simulate, cold", "simulate, warm", "reading back")),
        pytest.param(
            ("million_runs", "--runs", "40", "--cars", "20", "--processes", "1"),
            ("40 runs", "7-DOF car, 20 runs", "a store in"),
            marks=pytest.mark.full,
        ),
    ],
)
def test_it_runs(command, said):
    words = [sys.executable, "-m", f"benchmarks.{command[0]}", *command[1:]]
    done = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parents[2], check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert all(one in done.stdout for one in said)
