"""CITATION.cff names the papers as the experiments do."""

import importlib
import re
from pathlib import Path

import pytest
from families import wanting

from jaxveh import __version__, experiments

yaml = pytest.importorskip("yaml")
CITED = yaml.safe_load((Path(__file__).parents[2] / "CITATION.cff").read_text())
PAPERS = [name for name in experiments.__all__ if hasattr(getattr(experiments, name), "CITATION")]


def field(citation, name):
    found = re.search(rf"\b{name}\s*=\s*{{([^}}]*)}}", citation)
    return found.group(1) if found else None


def test_the_version_is_the_package_s():
    assert CITED["version"] == __version__.split(".dev")[0]


def test_every_paper_is_cited_and_nothing_else():
    titles = {field(importlib.import_module(f"jaxveh.experiments.{paper}").CITATION, "title") for paper in PAPERS}
    assert None not in titles, "a CITATION is BibTeX, with a title in braces"
    assert not wanting(titles, {one["title"] for one in CITED["references"]}, {})


@pytest.mark.parametrize("paper", PAPERS)
def test_a_paper_is_cited_as_its_experiment_cites_it(paper):
    citation = importlib.import_module(f"jaxveh.experiments.{paper}").CITATION
    found = [one for one in CITED["references"] if one["title"] == field(citation, "title")]
    assert found, f"{paper}: is not among the references of CITATION.cff by its title: add it"
    one = found[0]
    for ours, theirs in (
        ("doi", "doi"),
        ("journal", "journal"),
        ("volume", "volume"),
        ("number", "issue"),
        ("year", "year"),
    ):
        expected = field(citation, ours)
        assert expected is None or str(one[theirs]) == expected
    authors = field(citation, "author")
    if authors:
        assert [f"{a['family-names']}, {a['given-names']}" for a in one["authors"]] == authors.split(" and ")
