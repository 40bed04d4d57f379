"""Every system that a paper has is somewhere here, or the reason stands beside it.

`python tests/experiments/test_systems.py` writes the page anew.
"""

import importlib
import importlib.util
from pathlib import Path

import pytest
from families import wanting

from jaxveh import estimators, experiments
from jaxveh.experiments.systems import resolve_name, systems_page

PAGE = Path(__file__).parents[2] / "notebooks" / "catalogues" / "papers.md"
HEAD = """# The papers' systems

The models, methods, tables, figures and claims of the five papers, and the names in `jaxveh` that have them. If nothing is named,
the last column says why. This page is generated from the declarations of the experiments.

"""
TITLES = {
    "tyre_apf": "Tyre parameters by an auxiliary particle filter (Bao, Sabbioni et al. 2015)",
    "model_adaptive_pf": "A model-adaptive particle filter (Qin et al. 2014)",
    "federated_ckf": "Federated cubature filters (Ji, Li, Fan)",
    "sideslip_review": "A review of sideslip estimation (Chen, Gao & Xu 2013)",
    "mass_grade_aukf": "Mass and grade by an adaptive unscented filter",
}
SYSTEMS = {
    name: importlib.import_module(f"jaxveh.experiments.{name}.systems").SYSTEMS
    for name in experiments.__all__
    if name != "report" and importlib.util.find_spec(f"jaxveh.experiments.{name}.systems")
}


def page():
    return HEAD + systems_page({TITLES[name]: SYSTEMS[name] for name in TITLES})


def test_every_paper_says_where_its_systems_are():
    papers = {name for name in experiments.__all__ if hasattr(getattr(experiments, name), "run")}
    assert not [f"{name}: has no `systems.py`: write it (CONTRIBUTING, Five recipes)" for name in papers - set(SYSTEMS)]
    assert not wanting(papers, set(TITLES), {})


@pytest.mark.parametrize("paper", SYSTEMS)
def test_what_has_a_system_exists_and_what_has_none_says_why(paper):
    for one in SYSTEMS[paper]:
        assert one.found or one.lacks, one.what
        for name in one.found:
            assert resolve_name(name) is not None
    whats = [(one.what, one.where) for one in SYSTEMS[paper]]
    assert len(set(whats)) == len(whats)


def test_every_method_of_the_library_belongs_to_a_system():
    named = {name for systems in SYSTEMS.values() for one in systems for name in one.found}
    for quantity in estimators.__all__:
        methods = getattr(getattr(estimators, quantity), "METHODS", {})
        for method in methods:
            name = f"estimators.{quantity}.METHODS[{method}]"
            assert name in named | OURS, f"{name}: is in no paper's `systems.py`: put it there, or among OURS"


OURS = {
    "estimators.sideslip.METHODS[rear_axle]", "estimators.sideslip.METHODS[open_loop]", "estimators.speed.METHODS[slip_aware]",
    "estimators.bank.METHODS[filter]",
}  # fmt: skip
"""No paper's: ours, and a baseline."""


def test_a_name_that_is_nothing_is_said():
    with pytest.raises(LookupError, match="there is no jaxveh.filters.Magic"):
        resolve_name("filters.Magic")
    with pytest.raises(LookupError, match="METHODS has no magic"):
        resolve_name("estimators.speed.METHODS[magic]")


def test_the_page_is_what_the_papers_declare():
    """`python tests/experiments/test_systems.py` writes it anew."""
    assert PAGE.read_text() == page()


if __name__ == "__main__":
    PAGE.write_text(page())
