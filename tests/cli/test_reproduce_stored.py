"""`jaxveh reproduce --store`: interrupted, it goes on; other settings in the same folder are refused in one line."""

import contextlib
import sys
from types import SimpleNamespace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import pytest
from programs import error_line, run

from jaxveh.cli import all_papers, reproduce
from jaxveh.cli.family import Family
from jaxveh.experiments.report import spread
from jaxveh.sweeps import IN_MEMORY, Design, Swept, Table, study_stores


class Found(NamedTuple):
    seeds: int
    swept: Swept


@pytest.fixture
def computed(monkeypatch):
    """A paper of one sweep, and the seeds and settings that it was run with; its chunks have two runs."""
    asked = []

    def sweep(seeds=6, seed=0, progress=None, stores=IN_MEMORY):
        asked.append((seeds, seed, stores))
        run = lambda point, key: {"total": jnp.sum(jax.random.normal(key, (3,)))}
        return Found(seeds, stores.sweep("totals", run, Design(), seeds, jax.random.key(seed), progress=progress))

    tables = lambda found: [Table("Totals", ("total",), [(spread(found.swept["total"], 9),)])]
    paper = SimpleNamespace(
        run=sweep, tables=tables, check=lambda found: [], settings=lambda found: {},
        as_printed=lambda **options: tables(sweep(**options)),
    )  # fmt: skip
    monkeypatch.setattr(study_stores, "RUNS", 2)
    monkeypatch.setattr(reproduce, "PAPERS", {"first": "a paper", "second": "another"})
    monkeypatch.setattr(reproduce, "_experiment", lambda name: paper)
    monkeypatch.setattr(reproduce, "_every_core", lambda: None)
    return asked


def test_a_paper_that_was_interrupted_goes_on(tmp_path, computed, monkeypatch):
    def stop(done, total, stage):
        if done == 2:
            raise KeyboardInterrupt

    asked = ("reproduce", "first", "--store", tmp_path / "here")
    with monkeypatch.context() as patch:
        patch.setattr(reproduce, "progress", lambda what: contextlib.nullcontext(stop))
        assert run(*asked).exit_code == 130
    seen = []
    with monkeypatch.context() as patch:
        told = lambda done, total, stage: seen.append((done, total))
        patch.setattr(reproduce, "progress", lambda what: contextlib.nullcontext(told))
        found = run(*asked)
    # Two of three chunks were there.
    assert found.exit_code == 0 and seen == [(2, 3), (3, 3)]
    assert found.stdout == run("reproduce", "first").stdout and "Totals" in found.stdout
    assert [where.folder for *_, where in computed] == [tmp_path / "here"] * 2 + [None]
    assert run(*asked, "--as-printed").exit_code == 0 and computed[-1][2].folder == tmp_path / "here"


@pytest.mark.parametrize(("option", "value", "what"), [("--seed", 1, "key"), ("--seeds", 7, "seeds")])
def test_other_settings_in_the_same_folder_are_refused(tmp_path, computed, option, value, what):
    assert run("reproduce", "first", "--store", tmp_path).exit_code == 0
    line = error_line(run("reproduce", "first", "--store", tmp_path, option, value))
    assert "totals.zarr" in line and f"begun with {what} = " in line


def test_workers_need_a_folder(tmp_path, computed):
    assert "--processes" in error_line(run("reproduce", "first", "--processes", 2))
    assert "--scheduler" in error_line(run("reproduce", "first", "--scheduler", "tcp://here:8786"))
    both = ("--processes", 2, "--scheduler", "tcp://here:8786")
    assert "--processes and --scheduler" in error_line(run("reproduce", "first", "--store", tmp_path, *both))
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        assert "a file; name a folder" in error_line(run("reproduce", "first", "--store", folder))
    assert run("reproduce", "first", "--store", tmp_path, "--processes", 0).exit_code == 2
    assert not computed


def test_a_missing_library_is_named_before_any_work(tmp_path, computed, monkeypatch):
    monkeypatch.setitem(sys.modules, "loky", None)
    line = error_line(run("reproduce", "first", "--store", tmp_path, "--processes", 2))
    assert "loky" in line and "sweep" in line and not computed


def test_of_all_papers_each_has_a_folder_of_its_own(tmp_path, computed, monkeypatch):
    """And where processes are asked for, one paper at a time has them."""
    begun, pools = [], []

    @contextlib.contextmanager
    def child(self, command, stdout, **variables):
        begun.append(command[3:])
        yield SimpleNamespace(stderr=[], returncode=0)

    monkeypatch.setattr(Family, "child", child)
    pool = all_papers.ThreadPoolExecutor
    monkeypatch.setattr(all_papers, "ThreadPoolExecutor", lambda count: (pools.append(count), pool(count))[1])
    assert run("reproduce", "all", "--store", tmp_path, "--processes", 3).exit_code == 0
    assert sorted(words[1] for words in begun) == ["first", "second"] and pools == [1]
    for words in begun:
        given = dict(zip(words[2::2], words[3::2], strict=True))
        assert given["--store"] == str(tmp_path / words[1]) and given["--processes"] == "3"
    assert run("reproduce", "all", "--store", tmp_path, "--scheduler", "tcp://here:8786").exit_code == 0
    assert pools[1:] == [min(all_papers.os.cpu_count(), 2)] and "tcp://here:8786" in begun[-1]
