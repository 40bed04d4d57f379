"""Kernels that wait for the workers of all devices: counted, given room, and told when late."""

import ast
import os
import re
import subprocess
import sys
import textwrap
import time
import warnings
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxveh
from jaxveh import InputError, JaxvehWarning, sweeps
from jaxveh.sweeps import workers

A = np.random.default_rng(1).normal(size=(3000, 7, 7))
B = np.ones((3000, 7, 1))
BEFORE = jax.__version_info__[:2] < workers.WHOLE_AGAIN


def solve(A, b=B):
    return jnp.linalg.solve(A, b)


def in_a_scan(A):
    return jax.lax.scan(lambda x, _: (solve(A, x), None), jnp.asarray(B), None, length=3)[0]


@pytest.mark.parametrize(
    ("program", "count"),
    [
        (lambda A: A + 1.0, 0),
        (lambda A: solve(A[:10], B[:10]), 0),  # a small batch
        (lambda A: solve(A[0], B[0]), 0),  # none
        (lambda A: jnp.linalg.cholesky(A[:1000]), 0),  # a third of n^3 each
        (solve, 1),  # three kernels, each of which needs the one before
        (lambda A: (solve(A), solve(A + 1.0)), 2),
        (in_a_scan, 1),
        (lambda A: (in_a_scan(A), in_a_scan(A + 1.0)), 2),
        (lambda A: jnp.linalg.svd(A)[1], 1),
        (lambda A: jnp.linalg.eigh(A)[0], 1),
        (lambda A: jnp.linalg.qr(A)[1], 1),
        (lambda A: jnp.linalg.cholesky(A), 1),
    ],
)
def test_kernels_that_may_wait_at_once_are_counted(program, count):
    text = jax.jit(program).lower(A).compile().as_text()
    assert workers.places_that_wait(text) == (count if BEFORE else 0)


def test_a_fourier_transform_waits_with_every_jax():
    text = jax.jit(lambda A: jnp.fft.rfft(A)).lower(A).compile().as_text()
    assert workers.places_that_wait(text) == 1


class Cpu:
    platform = "cpu"


class Program:
    def as_text(self):
        lines = ("%x = f64[8] parameter(0)", "%a = c128[5] fft(%x)", "%b = c128[5] fft(%x)")
        return "\n".join(["ENTRY %main (x: f64[8]) -> c128[5] {", *lines, "}"])


@pytest.mark.parametrize(("pool", "devices", "fit"), [(16, 4, 4), (9, 4, 4), (8, 4, 3), (4, 4, 1), (2, 1, 1)])
def test_as_many_devices_as_leave_a_worker_free(monkeypatch, pool, devices, fit):
    monkeypatch.setattr(workers, "workers", lambda: pool)
    expected = pytest.warns(JaxvehWarning, match="PJRT_NPROC to 3") if pool == 2 else warnings.catch_warnings()
    with expected:
        assert len(workers.fit_for(Program(), [Cpu()] * devices)) == fit


def run_python(source, *, seconds=300, **environment):
    """The source on two devices in a process of its own, which must end in time."""
    kept = {name: value for name, value in os.environ.items() if name not in ("NPROC", "PJRT_NPROC")}
    head = 'import jax\njax.config.update("jax_num_cpu_devices", 2)\njax.config.update("jax_enable_x64", True)\n'
    command = [sys.executable, "-c", head + textwrap.dedent(source)]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=seconds, check=False, env={**kept, **environment}
    )


# Before, this stood still in each of 5 runs on two cores and jax 0.10.2: two devices, and a solve that blocks a worker on each.
SOLVES = """
    import jax.numpy as jnp
    from jaxveh import sweeps
    def run(point, key):
        matrices, total = jax.lax.scan(
            lambda A, _: (1.01 * jnp.tanh(A), jnp.sum(A)), jax.random.normal(key, (1500, 7, 7)), None, length=3
        )
        return {"x": jnp.sum(jnp.linalg.solve(matrices, jnp.ones((1500, 7, 1)))) + total[0]}
    found = sweeps.sweep(run, sweeps.Design(), 40, jax.random.key(1), batch=4)
    print(found["x"].shape)
"""


@pytest.mark.parametrize("pool", [{}, {"PJRT_NPROC": "16"}], ids=["one worker a core", "workers to spare"])
def test_solves_of_large_batches_on_two_devices_end(pool):
    done = run_python(SOLVES, **pool)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["(40,)"]


# Before, this stood still in each of 7 runs: the first estimator of `jaxveh reproduce federated-ckf`, at its own size.
ESTIMATORS = """
    import numpy as np
    from jaxveh.experiments.federated_ckf.drives import Drive
    from jaxveh.experiments.federated_ckf.settings import Study
    from jaxveh.experiments.federated_ckf.study import race
    study, T = Study(), 1501
    rolling = study.speed / 0.3
    noise = np.random.default_rng(0).normal(size=(1, 4, T, 4))
    still = 0.05 * noise[..., 0]
    drives = Drive(
        still, still, 1e-3 * noise[..., 1], rolling + 0.02 * noise, 0.01 * noise, 0.0 * noise,
        study.speed + still, still, still, 0.01 * still, 0.2 + 0.0 * noise,
    )
    found = race(study, drives, ("printed start",), only=("first guess",)).found
    print(found["sideslip_rmse"].shape)
"""


def test_the_estimators_that_stood_still_end():
    done = run_python(ESTIMATORS)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["(1,", "1,", "4)"]


def test_a_late_chunk_is_named_and_goes_on(monkeypatch):
    def slow(x):
        time.sleep(0.3)
        return x

    def run(point, key):
        return {
            "x": jax.pure_callback(
                slow, jax.ShapeDtypeStruct((), jnp.result_type(float)), point.a, vmap_method="sequential"
            )
        }

    said = []
    monkeypatch.setattr(warnings, "warn", lambda text, *rest, **more: said.append(text))
    found = sweeps.sweep(run, sweeps.Design(law={"slow": 1}, a=[1.0, 2.0]), 1, jax.random.key(0), batch=1, patience=0.1)
    np.testing.assert_array_equal(found["x"], [[[1.0], [2.0]]])
    chunks = [text for text in said if "chunk of runs 2 to 2 of 2 (law slow)" in text]
    assert chunks and re.search(r"has not finished for 0\.1 s\..*devices=jax\.devices\(\)\[:1\]", chunks[0])


def test_without_patience_nothing_is_said(monkeypatch):
    monkeypatch.setattr(warnings, "warn", lambda *rest, **more: pytest.fail("said"))
    run = lambda point, key: {"x": jax.random.normal(key)}
    sweeps.sweep(run, sweeps.Design(), 2, jax.random.key(0), patience=None)
    with pytest.raises(InputError, match="patience = 0"):
        sweeps.sweep(run, sweeps.Design(), 2, jax.random.key(0), patience=0)


def test_nothing_splits_over_devices_beside_sweep():
    """Every experiment goes the road that is guarded. Without a place, `device_put` makes an array on one device."""
    # It puts an array that was made shorter where the whole one is.
    may_place = ("_core/lengths.py", "sweeps/running.py")
    root = Path(jaxveh.__file__).parent
    for file in root.rglob("*.py"):
        place, nodes = file.relative_to(root).as_posix(), list(ast.walk(ast.parse(file.read_text("utf-8"))))
        words = {
            n.attr if isinstance(n, ast.Attribute) else n.id for n in nodes if isinstance(n, ast.Attribute | ast.Name)
        }
        placed = [n for n in nodes if isinstance(n, ast.Call) and getattr(n.func, "attr", "") == "device_put"
                  and len(n.args) + len(n.keywords) > 1]  # fmt: skip
        if place != "sweeps/running.py":
            assert not words & {"shard_map", "pmap", "Mesh", "NamedSharding", "PositionalSharding", "make_mesh"}, file
        assert not placed or place in may_place, file
