"""An estimator is one program in all parts of a paper's report: as many runs at a time, and what differs is data."""

import dataclasses
import importlib

import jax
import numpy as np
import pytest

from jaxveh import sweeps
from jaxveh.sweeps import Design, running


class LoweredError(Exception):
    """The text of the first program of a sweep, in place of its runs."""


@pytest.fixture
def text_of(monkeypatch):
    def lower(one, given, batch, memory, devices):
        raise LoweredError(running._split_over(one, devices).lower(*given.chunk(0, batch)).as_text())

    def of(call):
        with monkeypatch.context() as patched:
            patched.setattr(running, "_program", lower)
            with pytest.raises(LoweredError) as found:
                call()
        return str(found.value)

    return of


def parts_of(paper):
    """The modules of a paper by name."""
    return lambda name: importlib.import_module(f"jaxveh.experiments.{paper}.{name}")


def drives_like(run, lead):
    """Drives of zeros with the shapes of `run(key)` behind the axes `lead`."""
    shapes = jax.eval_shape(run, jax.random.key(0))
    return jax.tree.map(lambda one: np.zeros((*lead, *one.shape)), shapes)


def federated():
    of = parts_of("federated_ckf")
    study, printed = of("study"), of("printed_tables")
    own = dataclasses.replace(of("settings").Study(), duration=1.0)
    like = lambda *lead: drives_like(lambda key: of("drives").drive_once(own, 0.1, 0.3, key), lead)
    return {
        "race": lambda: study.race(own, like(2, 20), ("printed start", "fault"), only=("joint",)),
        "race over": lambda: study.race_over(own, like(2, 3, 20), (0.1, 0.2), (0.0, 0.1, 0.3)),
        "other cases": lambda: study.race(own, like(1, 30), ("other tyres",), only=("joint",)),
        "as printed": lambda: printed._race(own, like(20), lambda *told: None, sweeps.IN_MEMORY),
    }


def model_adaptive():
    of = parts_of("model_adaptive_pf")
    cases, settings = of("settings").CASES, of("settings")
    own = settings.Study()
    like = lambda *lead: drives_like(lambda key: of("drives").drive_once(own, cases["both"], key), lead)
    race = lambda named, seeds: of("study").race(own, named, like(len(named), seeds), jax.random.key(1), only=("CKF",))
    groups = {
        "own": settings.CASES,
        "process": settings.PROCESS,
        "lengths": settings.WRONG_LENGTHS,
        "slow": settings.SLOW,
    }
    return {
        name: (lambda named=named, name=name: race(named, 10 if name == "slow" else 20))
        for name, named in groups.items()
    }


def mass_grade():
    of = parts_of("mass_grade_aukf")
    own = dataclasses.replace(of("settings").truck(), duration=5.0)
    like = lambda *lead: drives_like(lambda key: of("drives").drive_once(own, 0.1, key), lead)
    race = lambda pedals: of("study").race(own, pedals, like(len(pedals), 20), only=("UKF",))
    return {"lively": lambda: race((0.1,)), "gentle": lambda: race((0.0, 0.03))}


@pytest.mark.parametrize("paper", [federated, model_adaptive, mass_grade])
def test_an_estimator_is_one_program(paper, text_of, monkeypatch):
    contestants = parts_of("federated_ckf")("printed_tables")
    monkeypatch.setattr(contestants, "SHOWN", ("joint", "first guess"))
    every = contestants._runs
    monkeypatch.setattr(contestants, "_runs", lambda study: {"joint": every(study)["joint"]})
    texts = {name: text_of(call) for name, call in paper().items()}
    first, *others = texts
    assert len(texts[first]) > 10_000
    for name in others:
        assert texts[name] == texts[first], (first, name)


@pytest.mark.parametrize("folder", [False, True])
def test_runs_at_a_time_do_not_change_what_is_found(folder, tmp_path, text_of):
    stores = sweeps.Stores(tmp_path) if folder else sweeps.IN_MEMORY
    run = lambda point, key: {"found": point.share * jax.random.normal(key)}
    few, many = Design(share=[1.0, 2.0]), Design(share=np.arange(7.0))
    key = jax.random.key(3)
    told = {name: stores.sweep(name, run, one, 5, key, alike=4) for name, one in (("few", few), ("many", many))}
    for name, one in (("few", few), ("many", many)):
        whole = sweeps.sweep(run, one, 5, key)
        np.testing.assert_allclose(told[name]["found"], whole["found"], rtol=1e-15)
    if not folder:
        texts = [text_of(lambda one=one: stores.sweep("x", run, one, 5, key, alike=4)) for one in (few, many)]
        assert texts[0] == texts[1]
        assert text_of(lambda: stores.sweep("x", run, few, 5, key)) != texts[0]
