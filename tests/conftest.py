"""Tests run in float64 and strict dtype promotion; float32 tests ask for their dtype, or switch x64 off themselves.

The default run compiles without XLA's optimisations, on jax 0.10 with its older code generator for the CPU, in less than half of
the time: compiling is nearly all that the tests do. `-m full` compiles as users do.
"""

import gc
import os
import shutil
from importlib.metadata import version
from pathlib import Path

import hypothesis
import jax
import pytest
from hypothesis import strategies
from time_budget import keep_one_colour, keep_part, keep_to_budget, mark_rare, record_seconds

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")

UNOPTIMISED = "--xla_llvm_disable_expensive_passes=true --xla_backend_optimization_level=0"
OLDER_GENERATOR = "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"
QUICKLY_COMPILED = {"0.10.": f"{UNOPTIMISED} {OLDER_GENERATOR}", "0.11.": UNOPTIMISED, "0.12.": UNOPTIMISED}
"""Flags that a version of jaxlib is known to have, by how its number begins: an unknown flag ends the process."""

QUICK_RUNS = ("not full", "peers", "studies", "thorough", "seldom", "rare")
"""How the expressions of `-m` begin whose runs are compiled quickly; the first is the default's (`addopts`)."""

KEPT_AT_MOST = 2e9
"""Bytes of compiled programs in pytest's cache folder, beyond which they are all forgotten."""

MOST_MAPPINGS = 45000
"""Of 65530; forgetting them takes a quarter of a minute each time, so it is done seldom."""

LOOKED_AFTER = 25
"""Programs compiled: a filter's takes up to 500 mappings."""

# Traces and programs are many objects that live long; looking through them for cycles after every few hundred new ones took 8 %
# of the tests' time.
gc.set_threshold(200_000, 20, 50)


def pytest_configure(config):
    """XLA reads its flags when it starts."""
    if config.getoption("markexpr").startswith(QUICK_RUNS):
        flags = next((flags for start, flags in QUICKLY_COMPILED.items() if version("jaxlib").startswith(start)), "")
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {flags}".strip()
    keep_programs(config)


def keep_programs(config):
    """What one process has compiled is there for the others, for the programs that tests start, and for the next run."""
    if "JAX_COMPILATION_CACHE_DIR" in os.environ or not hasattr(config, "cache"):
        return
    folder = config.cache.mkdir("programs")
    if sum(file.stat().st_size for file in folder.iterdir()) > KEPT_AT_MOST:
        shutil.rmtree(folder)
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(folder)
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.2"
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    part = int(os.environ["JAXVEH_PART"]) if "JAXVEH_PART" in os.environ else None
    mark_rare(items, part)
    keep_one_colour(items)
    keep_to_budget(items)
    if part is not None:
        keep_part(items, part)


def pytest_collection_finish():
    """What has been imported and collected stays: looking through it for cycles takes seconds each time.

    Hypothesis goes through all objects that do not stay, when it runs for the first time: now there are none, later it takes up
    to ten seconds.
    """
    gc.collect()
    gc.freeze()
    hypothesis.settings(max_examples=1, database=None)(hypothesis.given(strategies.none())(lambda nothing: None))()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Tests that share compiled programs go to one worker: a file's, or a filter's where a file goes through all of them.

    That is what `--dist loadgroup` is for; with pytest 9.2 it ignores the groups (pytest-xdist, issue 1386).
    """
    from xdist.scheduler import LoadScopeScheduling

    class LoadPrograms(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            file, _, case = nodeid.partition("::")
            return nodeid.replace(case, program_of(case)) if file.endswith("test_every_filter.py") else file

    return LoadPrograms(config, log) if config.getvalue("dist") == "loadfile" else None


took: dict = {}


def pytest_runtest_logreport(report):
    """How long each test took; `JAXVEH_SECONDS=1` puts it on record."""
    if report.when == "call" and report.passed:
        took[report.nodeid] = report.duration


def pytest_sessionfinish(session):
    """Only the process that has all reports writes."""
    if "JAXVEH_SECONDS" in os.environ and not hasattr(session.config, "workerinput"):
        record_seconds(took)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """A worker that has told its results ends at once: taking its programs apart one by one would take many seconds more."""
    if hasattr(config, "workerinput"):
        os._exit(0)


def program_of(case):
    """`Kalman` of `test_some_property[Kalman-straight]`."""
    return case.partition("[")[2].rstrip("]").removesuffix("-straight").removesuffix("-swinging")


def pytest_sessionstart():
    """Count what is compiled, which says when to count mappings: they take a twentieth of a second, too long after each test."""
    jax.monitoring.register_event_duration_secs_listener(count_programs)


compiled = 0


def count_programs(event, duration, **more):
    del duration, more
    global compiled
    compiled += event.endswith("backend_compile_duration")


@pytest.fixture(autouse=True)
def room_for_programs():
    """Compiled programs are forgotten before they are too many: each takes four to 500 memory mappings, of which Linux gives a
    process 65530, and one more ends it. Some files of the full run take more than half of them alone."""
    yield
    global compiled
    if compiled < LOOKED_AFTER:
        return
    compiled = 0
    mappings = Path("/proc/self/maps")
    if mappings.exists() and mappings.read_bytes().count(b"\n") > MOST_MAPPINGS:
        jax.clear_caches()
        gc.collect()


@pytest.fixture
def float32():
    """Run one test as a user without x64 would."""
    with jax.enable_x64(False) if hasattr(jax, "enable_x64") else jax.experimental.disable_x64():
        yield
