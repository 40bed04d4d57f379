"""Criteria of every paper: each says what it rests on, what took the place of one stands beside it, the site counts them."""

import re
from pathlib import Path

import numpy as np
import pytest

from jaxveh._core.errors import InputError
from jaxveh.cli.reproduce import PAPERS, _experiment
from jaxveh.experiments.report import (
    FAILED,
    MET,
    OPEN,
    Check,
    Tally,
    Terms,
    above,
    at_least,
    at_most,
    judge_ratio,
    leave_open,
    number_asked,
    tally,
    with_terms,
)
from jaxveh.sweeps import ConfidenceInterval

PAGE = Path(__file__).parents[2] / "notebooks" / "explanations" / "papers.md"
LARGE, NONE = np.float64(3.0), np.float64("nan")


@pytest.mark.parametrize("name", PAPERS)
def test_every_criterion_says_what_it_rests_on(name):
    criteria = _experiment(name).CRITERIA
    assert number_asked(criteria) > 0
    for criterion, terms in criteria.items():
        assert criterion.strip() and len(terms.condition) > 20, criterion


@pytest.mark.parametrize("name", PAPERS)
def test_what_took_the_place_of_another_stands_behind_it(name):
    criteria = _experiment(name).CRITERIA
    last = ""
    for criterion, terms in criteria.items():
        last = last if terms.original else criterion
        assert terms.original in ("", last), f"{criterion} does not stand behind {terms.original}"


@pytest.mark.parametrize("name", PAPERS)
def test_a_check_of_every_criterion_has_its_terms(name):
    """`with_terms` refuses what is left out, and what has no terms."""
    criteria = _experiment(name).CRITERIA
    checks = with_terms([at_most(one, 0.0, 1.0) for one in reversed(criteria)], criteria)
    assert [check.name for check in checks] == list(criteria)
    assert all(Terms(check.condition, check.original) == criteria[check.name] for check in checks)
    assert tally(checks).of == number_asked(criteria)
    with pytest.raises(InputError, match="not checked"):
        with_terms([at_most(one, 0.0, 1.0) for one in list(criteria)[1:]], criteria)
    with pytest.raises(InputError, match="without terms: .'more'"):
        with_terms([*checks, at_most("more", 0.0, 1.0)], criteria)


def row_of(name: str) -> list[str]:
    """The cells of a paper's row in the page's table."""
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith(f"| [`{name}`]")]
    assert len(lines) == 1, f"{PAGE}: must have one row of `{name}` in its table, and has {len(lines)}"
    (line,) = lines
    return [cell.strip() for cell in line.strip("|").split("|")]


def section_of(name: str) -> str:
    """The page's section about a paper, to which its row links."""
    title = re.search(r"\(#([\w-]+)\)", row_of(name)[0])[1]
    sections = PAGE.read_text().split("\n## ")[1:]
    found = [text for text in sections if text.splitlines()[0].lower().replace(" ", "-") == title]
    assert len(found) == 1, f"{PAGE}: must have one section #{title} of `{name}`, and has {len(found)}"
    return found[0]


@pytest.mark.parametrize("name", PAPERS)
def test_the_page_counts_the_criteria_that_the_code_defines(name):
    _, count, finding = row_of(name)
    criteria = _experiment(name).CRITERIA
    held, of, *rest = re.fullmatch(r"(\d+) of (\d+)(?: \((?:(\d+) failed)?(?:, )?(?:(\d+) open)?\))?", count).groups()
    assert int(of) == number_asked(criteria)
    assert int(held) + sum(int(one or 0) for one in rest) == int(of), "held, failed and open are all there are"
    assert str(Tally(int(held), *(int(one or 0) for one in rest))) == count
    assert finding
    assert f"`{name}`" in section_of(name)
    assert re.search(r"\*\*What would change the verdict\*\*: \w", section_of(name))


def test_readme_sums_the_papers_up():
    readme = (PAGE.parents[2] / "README.md").read_text()
    held, of = map(int, re.search(r"(\d+) of (\d+) criteria hold", readme).groups())
    counts = [list(map(int, re.findall(r"\d+", row_of(name)[1])[:2])) for name in PAPERS]
    sums = [sum(column) for column in zip(*counts, strict=True)]
    assert [held, of] == sums, f"README.md: {held} of {of} criteria hold; {PAGE.name} sums to {sums[0]} of {sums[1]}"


@pytest.mark.parametrize(("make", "value", "bound", "status"), [
    (at_most, 1.0, 1.0, MET), (at_most, 1.1, 1.0, FAILED), (at_most, NONE, 1.0, FAILED),
    (above, 1.0, 1.0, FAILED), (above, LARGE, 1.0, MET), (above, NONE, 1.0, FAILED),
    (at_least, 1.0, 1.0, MET), (at_least, 0.9, 1.0, FAILED), (at_least, NONE, 1.0, FAILED),
])  # fmt: skip
def test_a_criterion_holds_by_its_number(make, value, bound, status):
    check = make("a", value, bound)
    assert (check.status, check.holds) == (status, status == MET)
    assert not leave_open(check).holds and leave_open(check).status == OPEN


@pytest.mark.parametrize(("found", "status"), [
    ((0.8, 0.7, 0.9), MET), ((1.1, 1.0, 1.2), FAILED), ((0.9, 0.8, 1.0), OPEN), ((0.3, 0.2, 0.4), FAILED),
    ((0.5, 0.4, 0.6), OPEN), ((np.nan, 0.7, 0.9), FAILED),
])  # fmt: skip
def test_a_ratio_is_judged_by_its_interval(found, status):
    assert judge_ratio(ConfidenceInterval(*found), 0.5, 0.95) == status


def test_what_is_open_and_what_stands_beside_is_not_counted_as_held():
    checks = [
        Check("a", 0.5, 1.0, MET), Check("b", 0.5, 1.0, FAILED), leave_open(Check("c", 0.5, 1.0, MET)),
        Check("b, later", 0.5, 1.0, MET, "later", "b"), Check("d", 0.5, 1.0, MET),
    ]  # fmt: skip
    assert tally(checks) == Tally(met=2, failed=1, open=1)
    assert tally(checks).of == 4
    assert str(tally(checks)) == "2 of 4 (1 failed, 1 open)"
    assert str(tally(checks[:1])) == "1 of 1"
