"""CONTRIBUTING's recipes: who adds a member of a family is told of each place that it names, by a test that fails until then."""

import importlib.util
import inspect
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
from recorded_numbers import COMMAND, TO_RECORD

import jaxveh

ROOT = Path(jaxveh.__file__).parents[1]
RECIPES = dict(re.findall(r"^\| an? ([\w ]+?) \| (.*) \|$", (ROOT / "CONTRIBUTING.md").read_text(), re.M))


def calibrating(module):
    module.calibrate = None
    return module


NEW = {
    "tyre law": ("tyres", lambda: type("Newcomer", (jaxveh.tyres.Brush,), {})),
    "filter or wrapper": ("filters", lambda: type("Newcomer", (jaxveh.filters.ParticleFilter,), {})),
    "vehicle": ("vehicles", lambda: type("Newcomer", (jaxveh.vehicles.SingleTrack,), {})),
    "estimator": ("estimators", lambda: calibrating(ModuleType("Newcomer"))),
    "paper": ("experiments", lambda: SimpleNamespace(run=None)),
}


def places(recipe):
    return re.findall(r"`([\w/.<>]+/[\w/.<>]*)`", RECIPES[recipe])


def lookers(place, monkeypatch):
    """The tests of a file that take their members from what a room lists."""
    path = ROOT / place
    monkeypatch.syspath_prepend(str(path.parent))
    name = f"recipe_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    tests = [one for name, one in vars(module).items() if name.startswith("test_") and inspect.isfunction(one)]
    found = [one for one in tests if not inspect.signature(one).parameters]
    return [one for one in found if re.search(r"left_out|members\(|__all__|no_particle", inspect.getsource(one))]


def test_there_are_five_and_their_places_exist():
    assert list(RECIPES) == ["tyre law", "filter or wrapper", "vehicle", "estimator", "paper"]
    for recipe in RECIPES:
        print(f"to add a {recipe}: {', '.join(places(recipe))}")
        assert len(places(recipe)) >= 3
        for place in places(recipe):
            path = ROOT / place
            assert path.parent.is_dir() if "<" in path.name else ("<" in place or path.exists()), place


def test_the_commands_that_record_take_the_cases_of_the_full_run_too():
    told = re.findall(r"`(JAXVEH_RECORD=1 [^`]*)`", (ROOT / "CONTRIBUTING.md").read_text())
    assert len(told) >= 2 and set(told) == {COMMAND}
    assert '-m "full or not full"' in COMMAND and COMMAND in TO_RECORD


@pytest.mark.parametrize("recipe", NEW)
def test_a_new_member_is_missed_where_the_recipe_says(recipe, monkeypatch):
    room, newcomer = NEW[recipe]
    tables = [place for place in places(recipe) if place.startswith("tests/") and "<" not in place]
    looking = {place: lookers(place, monkeypatch) for place in tables}
    assert all(looking.values()), looking
    for tests in looking.values():
        for test in tests:
            test()
    module = getattr(jaxveh, room)
    monkeypatch.setattr(module, "Newcomer", newcomer(), raising=False)
    monkeypatch.setattr(module, "__all__", [*module.__all__, "Newcomer"])
    for place, tests in looking.items():
        missed = 0
        for test in tests:
            try:
                test()
            except AssertionError:
                missed += 1
        assert missed, place
        print(f"{recipe}: {place} misses it")
