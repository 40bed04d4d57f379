"""A sweep with a store: the numbers of one without, in Zarr arrays; resumed, shared and refused as it says."""

import errno
import itertools
import json
import os
import random
import re
import shutil
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import stored_study
import xarray
import zarr
from stored_study import BATCH, DESIGN, KEY, SEEDS

from jaxveh import InputError, JaxvehWarning, sweeps
from jaxveh.sweeps import chunks, identity
from jaxveh.sweeps import plan as plans
from jaxveh.sweeps import store as stores


@pytest.fixture(scope="module")
def plain():
    """The same without a store."""
    return sweeps.sweep(stored_study.run, DESIGN, SEEDS, KEY, batch=BATCH, devices=jax.devices()[:1])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A store that nobody has disturbed."""
    path = tmp_path_factory.mktemp("whole") / "sweep.zarr"
    stored_study.sweep(path)
    return path


def files(path):
    """Every file of a store, locks and scraps apart, by its name."""
    return {str(f.relative_to(path)): f.read_bytes() for f in path.rglob("*") if f.is_file() and f.suffix != ".partial"}


def same_store(a, b):
    assert files(a) == files(b)


def test_it_is_the_sweep_without_a_store(plain, whole):
    found = sweeps.read_sweep(whole)
    assert set(found.values) == set(plain.values) and len(found.values) == 4
    for name in plain.values:
        assert found.values[name].dtype == plain.values[name].dtype
        np.testing.assert_array_equal(found[name], plain[name])
    np.testing.assert_array_equal(found.at("total", law="sine"), plain.at("total", law="sine"))
    np.testing.assert_array_equal(found.median("deep")["corner"], plain.median("deep")["corner"])
    np.testing.assert_array_equal(
        found.compare("count", "law", "tanh", "sine").wins, plain.compare("count", "law", "tanh", "sine").wins
    )
    with pytest.raises(InputError, match="value"):
        found["none"]


@pytest.mark.parametrize("seed", range(8))
def test_a_store_with_a_damaged_file_is_told(tmp_path, whole, seed):
    """Any file of a store cut anywhere, or with another content: it is read as it was, or its damage is named."""
    draw, names = random.Random(seed), set(sweeps.read_sweep(whole).values)
    path = tmp_path / "copy.zarr"
    shutil.copytree(whole, path)
    for file in draw.sample(sorted(f for f in path.rglob("*") if f.is_file()), 6):
        sound = file.read_bytes()
        for broken in (sound[: draw.randrange(len(sound))], b"", draw.randbytes(len(sound))):
            file.write_bytes(broken)
            told = None
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", JaxvehWarning)
                    found = sweeps.read_sweep(path)
                    read = {name: found[name] for name in found.values}
                assert set(read) == names
            except InputError as error:
                told = str(error)
            assert told is None or re.search(r"copy\.zarr: .* is damaged \(.*the same sweep computes it again", told)
        file.write_bytes(sound)
    same_store(path, whole)


def test_xarray_opens_it_with_names_and_coordinates(whole, plain, recwarn):
    data = xarray.open_zarr(whole)
    assert data["total"].dims == ("decay", "law", "seed")
    assert data["law"].values.tolist() == ["tanh", "sine"] and data["decay"].values.tolist() == [0.1, 0.5, 0.9]
    np.testing.assert_array_equal(data["total"].sel(law="sine", decay=0.5), plain.at("total", law="sine", decay=0.5))
    assert data["chunk_status"].values.tolist() == [1] * 42
    told = json.loads(data.attrs["jaxveh_sweep"])
    assert told["seeds"] == SEEDS and told["jax"] == jax.__version__ and told["processor"]
    assert not [str(one.message) for one in recwarn if "onsolidated" in str(one.message)]


def test_interrupted_again_and_again_it_is_the_same_to_the_last_bit(tmp_path, whole):
    path, done = tmp_path / "sweep.zarr", []

    def interrupt(after):
        def progress(count, total, stage):
            done.append(count)
            if count >= after:
                raise KeyboardInterrupt

        return progress

    for after in (3, 4, 17):
        with pytest.raises(KeyboardInterrupt):
            stored_study.sweep(path, progress=interrupt(after))
        with pytest.warns(JaxvehWarning, match=f"{42 - after} of 42 chunks are not done. The same sweep again goes on"):
            sweeps.read_sweep(path)
    stored_study.sweep(path, progress=interrupt(1000))
    # Each call begins where the last one ended: nothing was computed twice.
    assert done == [0, 1, 2, 3, 3, 4, *range(4, 18), *range(17, 43)]
    same_store(path, whole)


def test_what_is_marked_is_whole_wherever_writing_is_cut_off(tmp_path, whole, monkeypatch):
    path, written, marked = tmp_path / "sweep.zarr", zarr.storage._local._put, []
    for cut in (1, 3, 5, 6, 7, 8, 9, 14):
        count = itertools.count(1)

        def put(place, value, exclusive=False, count=count, cut=cut):
            if "/c/" in str(place) and next(count) == cut:
                raise OSError(errno.EIO, "unplugged")
            return written(place, value, exclusive)

        monkeypatch.setattr(zarr.storage._local, "_put", put)
        with pytest.raises(OSError, match="unplugged"):
            stored_study.sweep(path)
        monkeypatch.undo()
        if not path.exists():
            continue  # cut off while it was made: it is there as a whole, or not at all
        with pytest.warns(JaxvehWarning):
            found = sweeps.read_sweep(path)
        status = stores.Store(path).status()
        for i in np.flatnonzero(status):
            chunk = stores.Store(path).plan.chunk(int(i))
            where = stores.Store(path)._region(chunk)
            for name in found.values:
                np.testing.assert_array_equal(found.values[name][where], sweeps.read_sweep(whole).values[name][where])
        marked.append(int(status.sum()))
    assert min(marked) == 0 and max(marked) > 2
    stored_study.sweep(path)
    same_store(path, whole)


def test_shares_of_an_array_job_make_the_whole(tmp_path, whole):
    path = tmp_path / "sweep.zarr"
    for i in (2, 0, 1):
        counts = []
        options = {"part": (i, 3), "progress": lambda done, total, stage, counts=counts: counts.append((done, total))}
        # Its own chunks are done: that others are not is nothing that it need tell.
        stored_study.sweep(path, **options)
        assert counts == [(k, 14) for k in range(15)]
        if i != 1:
            with pytest.warns(JaxvehWarning, match=f"{28 if i == 2 else 14} of 42 chunks are not done"):
                sweeps.read_sweep(path)
    same_store(path, whole)


def key_sum(key):
    return jnp.sum(jax.random.normal(key, (3,)))


def changed_axis():
    return sweeps.Design(decay=[0.1, 0.5, 0.8], law={"tanh": jnp.tanh, "sine": jnp.sin})


OTHER = {
    "key": (lambda: {"key": jax.random.key(4)}, r"key = .* \[0, 3\], here it is .* \[0, 4\]"),
    "seeds": (lambda: {"seeds": 51}, "seeds = 50, here it is 51"),
    "axis": (lambda: {"design": changed_axis()}, r"axis decay = \[0.1, 0.5, 0.9\], here it is \[0.1, 0.5, 0.8\]"),
    "batch": (lambda: {"batch": 9}, r"batch = \[1, 8\], here it is \[1, 9\]"),
    "program": (
        lambda: {"run": lambda point, key: {**stored_study.run(point, key), "total": key_sum(key)}},
        "the hash of the program of law tanh = ",
    ),
}


@pytest.mark.parametrize("other", OTHER)
def test_another_sweep_in_the_same_store_is_refused_by_name(other, whole):
    made, message = OTHER[other]
    given = {"run": stored_study.run, "design": DESIGN, "seeds": SEEDS, "key": KEY, "batch": BATCH, **made()}
    before = files(whole)
    with pytest.raises(InputError, match=f"sweep.zarr: it was begun with {message}"):
        sweeps.sweep(given.pop("run"), given.pop("design"), store=whole, **given)
    assert files(whole) == before


@pytest.mark.parametrize("kind", ["one number", "floats", "integers", "flags", "large"])
def test_numbers_that_a_run_has_closed_over_are_part_of_its_program(kind):
    first = {
        "one number": np.float64(0.25), "floats": np.linspace(0, 1, 50), "integers": np.arange(1, 10),
        "flags": np.arange(20) < 7, "large": 10**12 + np.arange(3),
    }[kind]  # fmt: skip

    def hashed(held):
        run = lambda point, key: {"y": jnp.sum(jnp.asarray(held).astype(float) * jax.random.normal(key))}
        return identity.of_program(chunks.lower(run, sweeps.Design(), {}, ({}, jax.random.split(KEY, 3))))

    other = np.array(first)
    other.flat[-1] = not other.flat[-1] if kind == "flags" else other.flat[-1] + 1
    assert hashed(first) == hashed(np.array(first)) != hashed(other)


@pytest.mark.parametrize("name", ["jaxveh", "jax", "jaxlib", "XLA_FLAGS", "jax_enable_x64", "processor"])
def test_another_process_is_refused_by_name(name, whole, monkeypatch):
    usual = identity.of_process()
    monkeypatch.setattr(identity, "of_process", lambda: {**usual, name: "another"})
    with pytest.raises(InputError, match=f"begun with {name} = .*, here it is another"):
        stored_study.sweep(whole)


def test_other_data_are_refused(tmp_path):
    drives = {"speed": np.arange(6.0).reshape(2, 3)}
    run = lambda point, drive: {"twice": point.gain * drive["speed"]}
    once = lambda data: sweeps.sweep(run, sweeps.Design(gain=[1.0, 2.0]), data=data, store=tmp_path / "s.zarr", batch=2)
    np.testing.assert_array_equal(once(drives)["twice"], [[0.0, 1.0, 2.0], [6.0, 8.0, 10.0]])
    with pytest.raises(InputError, match="begun with data speed = "):
        once({"speed": drives["speed"] + 1})


def test_a_second_sweep_at_the_same_time_is_refused(tmp_path, whole):
    path = tmp_path / "sweep.zarr"
    begun, go_on = threading.Event(), threading.Event()

    def wait(count, total, stage):
        begun.set()
        go_on.wait(60)

    def first(**options):
        begun.clear()
        go_on.clear()
        thread = threading.Thread(target=lambda: stored_study.sweep(path, progress=wait, **options))
        thread.start()
        begun.wait(60)
        return thread

    thread = first()
    for options in ({}, {"part": (0, 2)}):
        with pytest.raises(InputError, match="another sweep"):
            stored_study.sweep(path, **options)
    go_on.set()
    thread.join()
    same_store(path, whole)
    thread = first(part=(0, 2))
    for options in ({}, {"part": (0, 2)}, {"part": (1, 3)}):
        with pytest.raises(InputError, match="another sweep"):
            stored_study.sweep(path, **options)
    stored_study.sweep(path, part=(1, 2))
    go_on.set()
    thread.join()


def test_a_full_disk_ends_it_and_nothing_is_lost(tmp_path, whole, monkeypatch):
    path, usual, left = tmp_path / "sweep.zarr", stores.Store.write, itertools.count()

    def write(store, chunk, values):
        if next(left) == 5:
            raise OSError(errno.ENOSPC, "No space left on device", "c/0/1")
        usual(store, chunk, values)

    monkeypatch.setattr(stores.Store, "write", write)
    with pytest.raises(OSError, match="No space left"):
        stored_study.sweep(path)
    monkeypatch.undo()
    assert stores.Store(path).status().sum() == 5
    stored_study.sweep(path)
    same_store(path, whole)


def test_a_chunk_that_fails_three_times_is_told_and_the_others_go_on(tmp_path):
    tries = []

    def bad(x):
        tries.append(x.tolist())
        if 5.0 in x:
            raise ValueError("five is right out")
        return x

    def run(point, key):
        like = jax.ShapeDtypeStruct((), jnp.float64)
        return {
            "y": jax.pure_callback(bad, like, point.x, vmap_method="broadcast_all"),
            "n": jnp.int32(1),
            "ok": point.x > 0,
        }

    once = lambda: sweeps.sweep(run, sweeps.Design(x=np.arange(1.0, 9.0)), 1, KEY, store=tmp_path / "s.zarr", batch=2)
    with pytest.warns(JaxvehWarning, match="1 of 4 chunks are not done; 1 of them failed: .*five is right out"):
        found = once()
    assert tries == [[1.0, 2.0], [3.0, 4.0], *3 * [[5.0, 6.0]], [7.0, 8.0]]
    np.testing.assert_array_equal(found["y"][:, 0], [1, 2, 3, 4, np.nan, np.nan, 7, 8])
    assert found["n"][:, 0].tolist() == [1, 1, 1, 1, *2 * [np.iinfo(np.int32).min], 1, 1]
    assert found["ok"][:, 0].tolist() == [True] * 4 + [False] * 2 + [True] * 2
    tries.clear()
    with pytest.warns(JaxvehWarning, match="failed"):
        once()
    assert tries == 3 * [[5.0, 6.0]]


MISTAKES = {
    "parts": ({"part": (3, 3)}, r"part = \(3, 3\): must be \(i, n\) with 0 <= i < n"),
    "both": ({"client": "tcp://here:1", "processes": 2}, "client= or processes=, not both"),
    "memory": ({"memory": 1e9}, "memory= and devices= are for sweeps without"),
    "client": ({"client": 3}, "client = 3: must be a dask.distributed Client, or a scheduler's address"),
    "none": ({"processes": 0}, "processes = 0"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(mistake, tmp_path):
    options, message = MISTAKES[mistake]
    with pytest.raises(InputError, match=message):
        stored_study.sweep(tmp_path / "sweep.zarr", **options)


def test_without_a_store_there_is_no_client():
    with pytest.raises(InputError, match="client=, processes= and part= need a store="):
        sweeps.sweep(stored_study.run, DESIGN, SEEDS, KEY, processes=2)


@pytest.mark.parametrize("options", [{}, {"part": (0, 2)}, {"processes": 2}], ids=str)
def test_a_place_where_nothing_can_be_written_is_named(options, tmp_path, monkeypatch):
    """Before, the lock that could not be made looked like that of another sweep."""
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="nothing can be written in .*file"):
        stored_study.sweep(tmp_path / "file" / "sweep.zarr", **options)

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", refuse)
    with pytest.raises(
        InputError, match=r"sweep.zarr: nothing can be written in .* \(Permission denied\); take another"
    ):
        stored_study.sweep(tmp_path / "sweep.zarr", **options)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["file"]


def test_a_folder_of_somebody_elses_is_left_alone(tmp_path):
    (tmp_path / "mine").mkdir()
    with pytest.raises(InputError, match="a folder without zarr.json, and no sweep's store; take another name"):
        stored_study.sweep(tmp_path / "mine")
    zarr.open_group(tmp_path / "other.zarr", mode="w")
    with pytest.raises(InputError, match="but no sweep's"):
        stored_study.sweep(tmp_path / "other.zarr")
    with pytest.raises(InputError, match="has the name of an axis"):
        sweeps.sweep(lambda point, key: {"x": point.x}, sweeps.Design(x=[1.0]), 1, KEY, store=tmp_path / "s.zarr")


def test_a_worker_that_would_compute_something_else_says_so(whole, monkeypatch):
    before, job = files(whole), chunks.Job(stored_study.run, DESIGN, str(whole))
    usual = identity.of_process()
    monkeypatch.setattr(identity, "of_process", lambda: {**usual, "XLA_FLAGS": "others"})
    with pytest.raises(chunks.Unfit, match="XLA_FLAGS is 'others' here"):
        chunks.Computing(job)
    monkeypatch.undo()
    other = chunks.Computing(
        job._replace(run=lambda point, key: {**stored_study.run(point, key), "total": key_sum(key)})
    )
    monkeypatch.setattr(other.store, "is_done", lambda number: False)
    arguments = ({"decay": jnp.full(BATCH, 0.1)}, jax.random.split(KEY, BATCH))
    with pytest.raises(chunks.Unfit, match="run computes something else here"):
        other.do(0, arguments)
    assert files(whole) == before


def test_what_is_done_is_not_done_again_by_whoever_is_asked(whole):
    chunks.Computing(chunks.Job(stored_study.run, DESIGN, str(whole))).do(0, ("no arguments of runs",))


def test_old_scraps_are_removed(tmp_path, whole):
    path = tmp_path / "sweep.zarr"
    shutil.copytree(whole, path)
    old, new = path / "total" / "c" / "0.abc.partial", path / "total" / "0.def.partial"
    for one in (old, new):
        one.write_text("half")
    os.utime(old, (1.0, 1.0))
    stored_study.sweep(path)
    assert not old.exists() and new.exists()
    same_store(path, whole)


def test_blocks_hold_each_run_once():
    rng = np.random.default_rng(0)
    for _ in range(200):
        shape = tuple(int(n) for n in rng.integers(1, 9, rng.integers(1, 4)))
        plan = plans.plan_for(int(rng.integers(1, 4)), shape, int(rng.integers(1, 40)))
        seen = np.zeros((plan.choices, *shape), int)
        for chunk in map(plan.chunk, range(plan.chunks)):
            runs = plan.runs(chunk)
            assert len(runs) == plan.batch
            inside = plan.inside(chunk, runs)
            np.add.at(seen[chunk.choice].reshape(-1), inside.ravel(), 1)
            assert inside.shape == chunk.size
        assert (seen == 1).all()


def test_units_are_kept_and_others_are_refused(tmp_path):
    units, path = {"total": "m", "decay": "1/s"}, tmp_path / "s.zarr"
    found = stored_study.sweep(path, units=units, note="what it is")
    assert found.unit("total") == "m" and found.unit("count") == "-" and found.note == "what it is"
    again = sweeps.read_sweep(path)
    assert dict(again.units) == units and again.note == "what it is"
    import xarray

    data = xarray.open_zarr(path)
    assert data["total"].attrs["units"] == "m" and data["decay"].attrs["units"] == "1/s"
    with pytest.raises(InputError, match="it was begun with units = .*'m'.* here they are .*'km'"):
        stored_study.sweep(path, units={"total": "km", "decay": "1/s"})
    with pytest.raises(InputError, match="units: weight is neither a value nor an axis; there are: .*count"):
        stored_study.sweep(tmp_path / "t.zarr", units={"weight": "kg"})


def test_a_full_disk_ends_a_sweep_that_goes_on_when_there_is_room(tmp_path):
    program = Path(__file__).with_name("full_disk.py")
    mount = f"mount -t tmpfs -o size=3m tmpfs {tmp_path} && exec {sys.executable} {program} {tmp_path}"
    if shutil.which("unshare") is None or subprocess.run(["unshare", "-rm", "true"], capture_output=True).returncode:
        pytest.skip("no disk of one's own can be mounted here")
    done = subprocess.run(["unshare", "-rm", "sh", "-c", mount], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    # With little room some chunks are done, with none not one: each time it went on to the same bytes.
    assert done.stdout.split()[0] == "full" and done.stdout.split().count("full") >= 3
