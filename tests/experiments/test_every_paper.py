"""Every paper alike: one way for a key into a study, from the `seed` of its programs down to what draws."""

import ast
import dataclasses
import importlib
import inspect
import pkgutil
from pathlib import Path

import pytest

from jaxveh.cli.reproduce import PAPERS, _experiment

ALWAYS_THE_SAME = {
    ("tyre_apf", "lane_change_observability"): "what a drive can tell does not look at its measurements",
    ("tyre_apf", "_bounds"): "as above",
    ("tyre_apf", "curves_figure"): "the shade of the prior's draws",
    ("tyre_apf", "main"): "a program that chose what `settings` has, on drives of its own",
    ("sideslip_review", "_run_estimators"): "one real log, judged once",
    ("sideslip_review", "main"): "programs of their own, which no report calls",
}
"""Functions that make a key without being asked for a seed, and why."""


@pytest.fixture(params=PAPERS, scope="module")
def paper(request):
    return _experiment(request.param)


def modules(paper):
    found = [one for one in pkgutil.iter_modules(paper.__path__) if one.name != "figures"]
    return [importlib.import_module(f"{paper.__name__}.{one.name}") for one in found]


def functions(paper):
    """Public functions and their parameters' names."""
    for module in modules(paper):
        for name, one in vars(module).items():
            own = getattr(one, "__module__", None) == module.__name__ and not name.startswith("_")
            if own and callable(one) and not inspect.isclass(one):
                yield name, one, list(inspect.signature(one).parameters)


@pytest.mark.parametrize("program", ["run", "as_printed"])
def test_programs_are_asked_for_seeds_and_a_seed(paper, program):
    given = inspect.signature(getattr(paper, program)).parameters
    for name, default in (("seeds", 20), ("seed", 0)):
        assert given[name].kind is inspect.Parameter.KEYWORD_ONLY and given[name].default == default
    assert "key" not in given


def test_what_draws_takes_a_key_behind_the_seeds_or_the_drives(paper):
    """`(study, ..., seeds, key)` makes new drives, `(study, ..., drives, key)` draws on drives that are there."""
    wrong = []
    for name, one, names in functions(paper):
        if "keys" in names:
            wrong.append(f"{name} takes keys")
        if "key" not in names:
            continue
        given = inspect.signature(one).parameters["key"]
        many = [what for what in ("seeds", "drives") if what in names]
        behind = not many or names[names.index("key") - 1] in many
        if given.default is not inspect.Parameter.empty or not behind:
            wrong.append(f"{name}({', '.join(names)})")
    assert not wrong


def test_no_settings_have_a_key_or_a_seed(paper):
    kinds = {one for module in modules(paper) for one in vars(module).values() if inspect.isclass(one)}
    settings = [one for one in kinds if dataclasses.is_dataclass(one) and one.__module__.startswith(paper.__name__)]
    assert paper.Study in settings
    for one in settings:
        assert not {"key", "keys", "seed", "seeds"} & {field.name for field in dataclasses.fields(one)}, one


def makers(paper):
    """Functions in which a key is made from something else than a seed."""
    for file in Path(paper.__file__).parent.glob("*.py"):
        for function in ast.walk(ast.parse(file.read_text())):
            if not isinstance(function, ast.FunctionDef):
                continue
            for node in ast.walk(function):
                made = isinstance(node, ast.Call) and ast.unparse(node.func) == "jax.random.key"
                if made and "seed" not in ast.unparse(node.args[0]):
                    yield function.name


def test_keys_are_made_from_the_seed_alone(paper):
    short = paper.__name__.rsplit(".", 1)[-1]
    assert set(makers(paper)) == {name for one, name in ALWAYS_THE_SAME if one == short}
