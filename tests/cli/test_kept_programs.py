"""What programs keep compiled: where, for whom, what a second start compiles, and what a damaged folder does."""

import os
import re
import stat
import sys
import time

import pytest
from programs import run
from test_start import python

from jaxveh.cli import kept_programs

SIMULATE = ("simulate", "--rate", "20", "--force")

COUNT = """
import sys, jax, jaxveh.cli
found = []
jax.monitoring.register_event_listener(lambda event, **more: found.append(event.rpartition("/")[2]))
jaxveh.cli.prepare()
from jaxveh.cli.app import app
try:
    app(args=sys.argv[1:]) if sys.argv[1:] else jax.numpy.arange(3.0) + 1.0
finally:
    print({name: found.count(name) for name in ("compile_requests_use_cache", "cache_hits", "cache_misses")}, file=sys.stderr)
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A folder of kept programs, for this process and those it starts."""
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    monkeypatch.setenv("JAXVEH_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


def simulated(tmp_path):
    """How many programs a simulation asked for, read back and wrote; and what was said."""
    return counted(*SIMULATE, "-o", str(tmp_path / "drive.csv"))


def counted(*arguments):
    """The same of any program, or of a few operations."""
    done = python("-c", COUNT, *arguments)
    assert done.returncode == 0, done.stderr
    *said, counts = done.stderr.splitlines()
    return [int(number) for number in re.findall(r"\d+", counts)], "\n".join(said)


def test_a_second_start_compiles_nothing_and_after_damage_all_is_compiled_anew(own, tmp_path):
    (asked, read, written), _ = simulated(tmp_path)
    assert asked > 5 and read < asked and written > 5
    (asked, read, written), _ = simulated(tmp_path)
    assert (read, written) == (asked, 0)
    (folder,) = own.iterdir()
    assert folder == kept_programs.folder()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700 or sys.platform == "win32"
    largest = max(folder.glob("*-cache"), key=lambda file: file.stat().st_size)
    largest.write_bytes(largest.read_bytes()[:500])
    (asked, read, _), said = simulated(tmp_path)
    assert read == asked - 1
    assert "note: a cached program from an earlier start is damaged" in said and "UserWarning" not in said
    (asked, read, written), said = simulated(tmp_path)
    assert written > 5 and "damaged" not in said
    # As jax names its files today.
    programs = list(folder.glob(f"*{kept_programs.PROGRAM}"))
    assert len(programs) > 5 and (folder / kept_programs.LOCK).exists()
    used = [program.with_name(program.name.replace("-cache", kept_programs.LAST_USE)) for program in programs]
    assert all(len(file.read_bytes()) == 8 for file in used)


def test_a_program_whose_last_use_was_not_written_is_damage_too(own, tmp_path):
    """A start that was killed between the two files of a program: jax would keep nothing from then on, and say so each time."""
    counted()
    (folder,) = own.iterdir()
    next(folder.glob("*-atime")).unlink()
    (_, _, written), said = simulated(tmp_path)
    assert said.count("note: a cached program from an earlier start is damaged") == 1 and "UserWarning" not in said
    (_, _, written), said = simulated(tmp_path)
    assert written > 5 and "damaged" not in said


def test_where_it_is_off_or_jax_is_told_nothing_is_ours(own, tmp_path, monkeypatch):
    monkeypatch.setenv("JAXVEH_CACHE", "OFF")
    assert counted()[0][1:] == [0, 0]
    assert kept_programs.folder() is None
    monkeypatch.setenv("JAXVEH_CACHE", str(own))
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "theirs"))
    counted()
    assert not own.exists() and (tmp_path / "theirs").exists()


def test_a_folder_that_cannot_be_made_is_a_note(own, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("JAXVEH_CACHE", str(tmp_path / "file"))
    counts, said = counted()
    assert counts[1:] == [0, 0] and said.count("note: compiled programs are not kept") == 1
    assert "Set JAXVEH_CACHE to a folder that can be written" in said


def test_without_a_word_it_is_the_users_cache_folder(monkeypatch):
    monkeypatch.delenv("JAXVEH_CACHE", raising=False)
    assert kept_programs.root().parts[-2:] == ("jaxveh", "programs")
    monkeypatch.setenv("JAXVEH_CACHE", "~/elsewhere")
    assert kept_programs.root() == kept_programs.Path.home() / "elsewhere"


def test_other_processors_have_folders_of_their_own(own, monkeypatch):
    here = kept_programs.folder()
    assert here == kept_programs.folder()
    monkeypatch.setattr("platform.machine", lambda: "another")
    assert kept_programs.folder() != here


def test_what_nobody_has_used_for_long_is_dropped(own):
    old, used, other = own / "jaxveh-0.0.1-jaxlib-0.10.0-abc", own / "jaxveh-0.0.2-jaxlib-0.10.0-abc", own / "holiday"
    for one in (old, used, other):
        one.mkdir(parents=True)
    long_ago = time.time() - 2 * kept_programs.FORGOTTEN_AFTER
    for one in (old, other):
        os.utime(one, (long_ago, long_ago))
    kept_programs.drop_old(own)
    assert sorted(own.iterdir()) == [other, used]


def test_of_too_many_programs_those_used_last_stay(own, monkeypatch):
    """The order of their last uses is not that of their names or files."""
    monkeypatch.setattr(kept_programs, "MOST_PROGRAMS", 8)
    monkeypatch.setattr(kept_programs, "LEFT", 3)
    own.mkdir()
    (own / "other").write_text("")

    def keep(number, used):
        (own / f"jit_f-{number}-cache").write_bytes(b"program")
        (own / f"jit_f-{number}-atime").write_bytes((10**18 + used).to_bytes(8, "little"))

    for number in range(8):
        keep(number, (3 * number) % 8)
    everything = sorted(file.name for file in own.iterdir())
    kept_programs.drop_unused(own)
    assert sorted(file.name for file in own.iterdir()) == everything
    (own / "jit_f-9-cache").write_bytes(b"of a start that was killed")
    kept_programs.drop_unused(own)
    left = {file.name for file in own.iterdir()} - {"other", ".lockfile"}
    # 3 k modulo 8 is 5, 6 and 7 for k = 7, 2 and 5.
    assert left == {f"jit_f-{number}-{what}" for number in (2, 5, 7) for what in ("cache", "atime")}


def test_while_another_start_writes_none_is_deleted(own, monkeypatch):
    import filelock

    monkeypatch.setattr(kept_programs, "MOST_PROGRAMS", 0)
    monkeypatch.setattr(kept_programs, "LEFT", 0)
    own.mkdir()
    (own / "jit_f-1-cache").write_bytes(b"program")
    with filelock.FileLock(own / ".lockfile"):
        kept_programs.drop_unused(own)
    assert (own / "jit_f-1-cache").exists()


def test_a_program_that_cannot_be_deleted_stays_and_the_others_go(own, monkeypatch):
    monkeypatch.setattr(kept_programs, "MOST_PROGRAMS", 1)
    monkeypatch.setattr(kept_programs, "LEFT", 0)
    own.mkdir()
    for number in range(3):
        (own / f"jit_f-{number}-cache").write_bytes(b"program")
    unlink = kept_programs.Path.unlink

    def held(self, **more):
        if self.name == "jit_f-1-cache":
            raise PermissionError("held by another program")
        unlink(self, **more)

    monkeypatch.setattr(kept_programs.Path, "unlink", held)
    kept_programs.drop_unused(own)
    assert [file.name for file in own.glob("*-cache")] == ["jit_f-1-cache"]


def test_show_and_clear(own):
    assert run("cache", "show").stdout == f"{own}: nothing is kept yet\n"
    folder = own / "jaxveh-0.1.0-jaxlib-0.10.0-abc"
    folder.mkdir(parents=True)
    (own / "mine.txt").write_text("kept")
    (folder / "jit_f-123-cache").write_bytes(bytes(3_000_000))
    (folder / "jit_f-123-atime").write_bytes(bytes(8))
    assert run("cache", "show").stdout == f"{folder}: 1 programs, 3 MB\n"
    assert run("cache", "clear").stdout == f"deleted {folder}: 1 programs, 3 MB\n"
    assert [one.name for one in own.iterdir()] == ["mine.txt"]


def test_show_says_that_it_is_off(monkeypatch):
    monkeypatch.setenv("JAXVEH_CACHE", "off")
    assert run("cache", "show").stdout == "JAXVEH_CACHE is off: nothing is kept\n"
