"""Sweeps by other processes, which are killed at random: the store is that of an undisturbed sweep, to the last byte."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import distributed
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import stored_study
from test_stored import files

from jaxveh import InputError, JaxvehWarning, sweeps

KILLS = [pytest.param(3, marks=pytest.mark.studies), pytest.param(20, marks=pytest.mark.full)]
"""How many workers are killed: three in `.ci/run`, twenty in the full run."""

LIMIT = 60.0
"""s: a chunk that takes longer is given out again."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What `slowly` gives where nobody disturbs it."""
    path = tmp_path_factory.mktemp("whole") / "sweep.zarr"
    stored_study.sweep(path, stored_study.slowly)
    return path


def same_store(path, whole):
    assert files(path) == files(whole)


def children(of, command):
    """Processes below this one whose command line has a word in it."""
    found = []
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            if entry.name.isdigit() and command in (entry / "cmdline").read_text():
                parents, pid = set(), int(entry.name)
                while pid > 1:
                    pid = int((Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[1])
                    parents.add(pid)
                if of in parents:
                    found.append(int(entry.name))
    return found


@contextlib.contextmanager
def killer(times, victims):
    """Kill one of `victims()` at random, so many times, while the block runs; gives how often it did."""
    done, rng, ended = [], random.Random(times), threading.Event()

    def kill():
        while len(done) < times and not ended.wait(rng.uniform(0.2, 1.0)):
            alive = victims()
            if alive:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(rng.choice(alive), signal.SIGKILL)
                    done.append(time.monotonic())

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    try:
        yield done
    finally:
        ended.set()
        thread.join()


def until_done(folder, sweep, whole, victims, times):
    """Sweep while workers are killed, as often as it takes to kill so many; each store is as if nobody had been."""
    killed = 0
    for i in range(times):
        path = folder / f"{i}.zarr"
        with killer(times - killed, victims) as done:
            sweep(path)
        same_store(path, whole)
        killed += len(done)
        if killed >= times:
            return
    raise AssertionError(f"killed {killed} of {times}")


@pytest.mark.parametrize("times", KILLS)
def test_processes_that_are_killed(times, tmp_path, whole):
    sweep = lambda path: stored_study.sweep(path, stored_study.slowly, processes=2, patience=LIMIT)
    until_done(tmp_path, sweep, whole, lambda: children(os.getpid(), "loky"), times)


# On a loaded machine the killed ones come back so late that the sweep says that there is none.
@pytest.mark.filterwarnings("ignore:sweep. the cluster has no worker:jaxveh.JaxvehWarning")
@pytest.mark.parametrize("times", KILLS)
def test_workers_of_a_cluster_that_are_killed(times, tmp_path, whole):
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        workers = lambda: [one.process.pid for one in cluster.workers.values() if one.process and one.process.pid]
        sweep = lambda path: stored_study.sweep(path, stored_study.slowly, client=client, patience=LIMIT)
        until_done(tmp_path, sweep, whole, workers, times)


@pytest.mark.studies
def test_a_cluster_whose_workers_come_late(tmp_path):
    with (
        distributed.LocalCluster(n_workers=0, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        late = threading.Timer(8.0, cluster.scale, [1])
        late.start()
        with pytest.warns(JaxvehWarning, match="the cluster has no worker"):
            stored_study.sweep(tmp_path / "s.zarr", client=client, patience=30.0)
        late.join()
    stored_study.sweep(tmp_path / "alone.zarr")
    same_store(tmp_path / "s.zarr", tmp_path / "alone.zarr")


@pytest.mark.studies
def test_a_chunk_that_hangs_is_given_out_again(tmp_path):
    mark = tmp_path / "has hung"

    def hang(word):
        if not os.path.exists(mark):
            open(mark, "w").close()
            time.sleep(600)
        return word

    def run(point, key):
        like = jax.ShapeDtypeStruct((), jnp.float64)
        return {"y": point.x + jax.pure_callback(hang, like, 0.0 * point.x, vmap_method="broadcast_all")}

    design = sweeps.Design(x=np.arange(6.0))
    found = sweeps.sweep(
        run, design, 1, stored_study.KEY, store=tmp_path / "s.zarr", batch=2, processes=1, patience=4.0
    )
    np.testing.assert_array_equal(found["y"][:, 0], np.arange(6.0))
    assert os.path.exists(mark)


def begin(path, *how):
    """The study as a program of its own."""
    here = Path(stored_study.__file__)
    return subprocess.Popen(
        [sys.executable, str(here), str(path), *how], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in (str(here.parent), *sys.path) if p)},
    )  # fmt: skip


def wait_for_chunks(program, count):
    """Until a program has told of so many chunks, or more: what was out when another was killed may still be done."""
    for line in program.stdout:
        if line[:1].isdigit() and int(line.split()[0]) >= count:
            return
    raise AssertionError(f"the program ended with {program.wait()}")


@pytest.mark.full
def test_a_client_that_is_killed_and_begun_again(tmp_path, whole):
    path = tmp_path / "sweep.zarr"
    for count in (3, 11):
        program = begin(path, "processes", "2")
        wait_for_chunks(program, count)
        with pytest.raises(InputError, match="another sweep"):
            stored_study.sweep(path, stored_study.slowly)
        crew = children(program.pid, "loky.backend.popen")
        assert len(crew) == 2
        program.kill()
        program.wait()
        end = time.monotonic() + 20
        while any(lives(one) for one in crew):
            assert time.monotonic() < end, "its processes go on"
            time.sleep(0.2)
    stored_study.sweep(path, stored_study.slowly, processes=2)
    same_store(path, whole)


def lives(pid):
    """Whether a process is there, and no zombie."""
    try:
        return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def scheduler(port):
    """A scheduler as a process, and its worker."""
    address = f"tcp://127.0.0.1:{port}"
    run = lambda *words: subprocess.Popen(
        [sys.executable, "-m", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    kept = run("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
    one = ("--nworkers", "1", "--nthreads", "1", "--no-dashboard", "--death-timeout", "20")
    worker = run("distributed.cli.dask_worker", address, *one)
    return address, kept, worker


@pytest.mark.full
def test_a_scheduler_that_is_killed(tmp_path, whole):
    path = tmp_path / "sweep.zarr"
    address, first, worker = scheduler(18786)
    try:
        killed = []

        def progress(done, total, stage):
            if done >= 4 and not killed:
                killed.append(done)
                first.kill()

        with distributed.Client(address, timeout=30) as client:
            client.wait_for_workers(1, timeout=60)
            with pytest.raises(InputError, match="the scheduler does not answer"):
                stored_study.sweep(path, stored_study.slowly, client=client, patience=LIMIT, progress=progress)
    finally:
        first.kill()
        worker.kill()
    with pytest.warns(JaxvehWarning, match="of 42 chunks are not done"):
        sweeps.read_sweep(path)
    address, second, worker = scheduler(18787)
    try:
        stored_study.sweep(path, stored_study.slowly, client=address, patience=LIMIT)
    finally:
        second.kill()
        worker.kill()
    same_store(path, whole)
