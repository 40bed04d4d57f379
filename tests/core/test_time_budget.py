"""Which cases of a test function run by default."""

import json
from types import SimpleNamespace

import pytest
import time_budget
from time_budget import BUDGET, LONG_BUDGET, function_of, number_kept, record_seconds, spread_evenly


@pytest.mark.parametrize("most", [1, 2, 7, 67])
def test_what_fits_runs_whole_and_of_what_does_not_at_least_one_case(most):
    assert number_kept(0.0, most) == most
    assert number_kept(BUDGET / most, most) == most
    assert number_kept(1000.0 * BUDGET, most) == 1
    kept = [number_kept(seconds, most) for seconds in (0.01, 0.1, 1.0, 10.0)]
    assert sorted(kept, reverse=True) == kept


def test_the_time_of_many_cases_grows_with_its_root():
    assert number_kept(BUDGET, 64) == 8
    assert number_kept(BUDGET / 4.0, 64) == 16


@pytest.mark.parametrize("first", [0, 3, 700])
def test_cases_are_spread_evenly_and_begin_anywhere(first):
    for many in range(1, 20):
        for few in range(1, many + 1):
            places = spread_evenly(many, few, first)
            assert len(places) == few and places <= set(range(many))
            gaps = [b - a for a, b in zip(sorted(places), [*sorted(places)[1:], min(places) + many], strict=True)]
            assert max(gaps) - min(gaps) <= 1


class Item:
    """A case that pytest has collected."""

    def __init__(self, nodeid):
        self.nodeid, self.marks = nodeid, []

    def get_closest_marker(self, name):
        return None

    def add_marker(self, mark):
        self.marks.append(mark.name)


class Long(Item):
    """One that is marked as long, by one of the marks."""

    def __init__(self, nodeid, mark):
        super().__init__(nodeid)
        self.mark = mark

    def get_closest_marker(self, name):
        return name == self.mark or None


@pytest.mark.parametrize(("mark", "count"), time_budget.PARTS.items())
def test_all_parts_are_all_long_tests_and_share_only_what_a_user_meets_first(mark, count):
    names = [f"tests/a.py::f{k}[{case}]" for k in range(60) for case in range(3)]
    names += [f"tests/site/test_pages_run.py::page[{k}.md]" for k in range(60)]
    first = "tests/site/test_pages_run.py::test_a_page_runs_from_top_to_bottom[README.md]"
    parts = []
    for part in range(20):
        items = [Long(name, mark) for name in (*names, first)] + [Item("tests/a.py::quick")]
        time_budget.keep_part(items, part)
        assert items[-1].marks == items[-2].marks == []
        parts.append({item.nodeid for item in items[:-2] if not item.marks})
    assert parts == parts[:count] * (20 // count)
    parts = parts[:count]
    assert set().union(*parts) == set(names) and sum(map(len, parts)) == len(names)
    # Names that differ in a number are spread less evenly over twenty parts.
    assert all(30 < len(part) < 70 for part in parts) if count == 5 else max(map(len, parts)) < 4 * len(names) / count
    # All cases of a function are of one part.
    functions = [{function_of(name) for name in part if "/site/" not in name} for part in parts]
    assert sum(map(len, functions)) == 60


def test_each_function_that_is_marked_by_hand_has_a_case_in_one_part_of_a_hundred():
    by_hand = lambda: [Long(f"tests/a.py::f{k}[{case}]", "full") for k in range(60) for case in range(3)]
    plain = [Item("tests/a.py::quick"), Long("tests/a.py::page", "site"), Long("tests/a.py::slow", "thorough")]
    time_budget.mark_rare(plain)
    assert not any(item.marks for item in plain)
    every = by_hand()
    time_budget.mark_rare(every)
    rare = lambda items: {item.nodeid for item in items if item.marks == ["rare"]}
    assert sorted(function_of(name) for name in rare(every)) == sorted(f"a.py::f{k}" for k in range(60))
    assert len({name.partition("[")[2] for name in rare(every)}) == 3
    parts = []
    for part in range(100):
        items = by_hand()
        time_budget.mark_rare(items, part)
        parts.append(rare(items))
    assert set().union(*parts) == rare(every) and sum(map(len, parts)) == 60
    # Three cases a function: the hundreds of three parts reach them all.
    reached = []
    for part in range(300):
        items = by_hand()
        time_budget.mark_rare(items, part)
        reached.extend(rare(items))
    assert sorted(reached) == sorted(item.nodeid for item in by_hand())


def test_a_file_alone_runs_the_cases_that_it_runs_among_all(tmp_path, monkeypatch):
    monkeypatch.setattr(time_budget, "RECORD", tmp_path / "seconds.json")
    monkeypatch.setattr(time_budget, "LONG_BUDGET", 100.0)
    time_budget.RECORD.write_text(json.dumps({"a.py::slow": 0.5, "b.py::slow": 0.5, "b.py::long": 3.0}))
    files = {file: [Item(f"tests/{file}.py::{f}[{k}]") for f in ("slow", "long") for k in range(40)] for file in "ab"}
    time_budget.keep_to_budget([*files["a"], *files["b"]])
    alone = [Item(item.nodeid) for item in files["b"]]
    time_budget.keep_to_budget(alone)
    assert [item.marks for item in alone] == [item.marks for item in files["b"]]
    marks = [tuple(item.marks) for item in alone]
    assert marks[:40].count(()) == number_kept(0.5, 40) and marks[40:].count(("thorough",)) == number_kept(3.0, 40)
    assert not any(item.marks for item in files["a"][40:])


def test_what_is_marked_whole_runs_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(time_budget, "RECORD", tmp_path / "seconds.json")
    time_budget.RECORD.write_text(json.dumps({"a.py::slow": 3.0}))
    items = [Item(f"tests/a.py::slow[{k}]") for k in range(40)]
    for item in items:
        item.get_closest_marker = lambda name: name == "whole" or None
    time_budget.keep_to_budget(items)
    assert not any(item.marks for item in items)


def of_a_product(function, k, **indices):
    item = Item(f"tests/a.py::f{function}[{k}]")
    item.callspec = SimpleNamespace(indices=indices or {"x": k})
    item.get_closest_marker = lambda name: name == "product"
    return item


@pytest.fixture
def beyond_budget(tmp_path, monkeypatch):
    """A record of products that take longer than a budget."""
    monkeypatch.setattr(time_budget, "RECORD", tmp_path / "seconds.json")
    time_budget.RECORD.write_text(json.dumps({f"a.py::f{k}": 1.01 * BUDGET for k in range(13)}))


@pytest.mark.parametrize("many", [1, 2, 5, 6, 7, 30])
def test_every_test_of_a_product_has_a_case(many, beyond_budget):
    """Whatever its number of cases, and whichever tests stand before it."""
    items = []
    for function in range(13):
        for k in range(many):
            items.append(of_a_product(function, k))
    time_budget.keep_one_colour(items)
    for function in range(13):
        members = items[many * function : many * (function + 1)]
        kept = [k for k, item in enumerate(members) if not item.marks]
        assert 1 <= len(kept) <= -(-many // time_budget.COLOURS)
        # Without the others the same cases run.
        alone = [of_a_product(function, k) for k in range(many)]
        time_budget.keep_one_colour(alone)
        assert kept == [k for k, item in enumerate(alone) if not item.marks]


@pytest.mark.parametrize("function", range(6))
def test_each_value_of_a_product_meets_a_sixth_of_the_others(function, beyond_budget):
    items = [of_a_product(function, f"{i}-{j}", a=i, b=j, with_b=j) for i in range(12) for j in range(18)]
    time_budget.keep_one_colour(items)
    kept = [item.callspec.indices for item in items if not item.marks]
    assert len(kept) == 36
    assert [sum(one["a"] == i for one in kept) for i in range(12)] == [3] * 12
    assert [sum(one["b"] == j for one in kept) for j in range(18)] == [2] * 18


@pytest.mark.parametrize(("seconds", "kept"), [(None, 40), (0.95, 40), (1.05, 7)])
def test_a_product_within_its_budget_runs_whole(seconds, kept, tmp_path, monkeypatch):
    """What takes little, or is not on record because it takes less, runs as if it were no product."""
    monkeypatch.setattr(time_budget, "RECORD", tmp_path / "seconds.json")
    record = {} if seconds is None else {"a.py::f0": seconds * BUDGET / 40}
    time_budget.RECORD.write_text(json.dumps(record))
    items = [of_a_product(0, k) for k in range(40)]
    time_budget.keep_one_colour(items)
    assert abs(sum(not item.marks for item in items) - kept) <= (kept < 40)


def test_of_a_files_long_cases_the_quickest_run():
    share = LONG_BUDGET / 10
    takes = {"c": 4 * share, "a": 3 * share, "b": 5 * share, "d": 20 * share}
    cases = {name: Item(name) for name in takes}
    time_budget.mark_long([(took, name, [cases[name]]) for name, took in takes.items()])
    marks = {name: item.marks for name, item in cases.items()}
    assert marks == {"a": ["thorough"], "c": ["thorough"], "b": ["seldom"], "d": ["seldom"]}


@pytest.mark.parametrize("each", [0.01, 0.06, 0.3, 2.0])
def test_a_function_of_which_few_cases_ran_stays_on_record(each, tmp_path, monkeypatch):
    """Those that ran take less than the budget: all of them, which would run without the record, do not."""
    monkeypatch.setattr(time_budget, "RECORD", tmp_path / "seconds.json")
    for many in (1, 2, 9, 100):
        kept = number_kept(each, many)
        assert many <= time_budget.number_in_all(each, kept) or kept == many
        time_budget.RECORD.write_text(json.dumps({"a.py::f": each}))
        record_seconds({f"tests/a.py::f[{k}]": each for k in range(kept)})
        assert ("a.py::f" in json.loads(time_budget.RECORD.read_text())) == (each * many > BUDGET)


def test_what_did_not_run_keeps_its_seconds(tmp_path, monkeypatch):
    monkeypatch.setattr(time_budget, "RECORD", tmp_path / "seconds.json")
    record_seconds({"tests/a.py::slow[1]": 2.0, "tests/a.py::slow[2]": 4.0, "tests/a.py::quick": 0.1})
    record_seconds({"tests/b.py::slow": 5.0})
    assert json.loads(time_budget.RECORD.read_text()) == {"a.py::slow": 3.0, "b.py::slow": 5.0}
    record_seconds({"tests/a.py::slow[1]": 0.05})
    assert json.loads(time_budget.RECORD.read_text()) == {"b.py::slow": 5.0}


def test_a_case_that_takes_long_alone_is_on_record_alone(tmp_path, monkeypatch):
    """Its function's others run as if it were not there."""
    monkeypatch.setattr(time_budget, "RECORD", tmp_path / "seconds.json")
    record_seconds({f"tests/a.py::f[{k}]": 0.01 for k in range(9)} | {"tests/a.py::f[slow]": LONG_BUDGET})
    record_seconds({f"tests/a.py::g[{k}]": 0.2 for k in range(9)} | {"tests/a.py::g[slow]": 2 * LONG_BUDGET})
    on_record = {"a.py::f[slow]": LONG_BUDGET, "a.py::g": 0.2, "a.py::g[slow]": 2 * LONG_BUDGET}
    assert json.loads(time_budget.RECORD.read_text()) == on_record
    items = {name: Item(f"tests/a.py::{name}") for name in ("f[1]", "f[2]", "f[slow]", "g[1]", "g[slow]")}
    time_budget.keep_to_budget(list(items.values()))
    assert {name: item.marks for name, item in items.items()} == {
        "f[1]": [], "f[2]": [], "f[slow]": ["thorough"], "g[1]": [], "g[slow]": ["seldom"]
    }  # fmt: skip
    record_seconds({"tests/a.py::f[slow]": 0.1})
    assert "a.py::f[slow]" not in json.loads(time_budget.RECORD.read_text())


def test_every_function_on_record_is_a_test_that_there_is():
    """A test that was renamed would run whole."""
    tests = time_budget.RECORD.parents[1]
    for name in json.loads(time_budget.RECORD.read_text()):
        file, _, function = function_of(name).partition("::")
        assert f"def {function.rpartition('::')[2]}(" in (tests / file).read_text("utf-8"), name
    assert function_of("tests/a.py::slow[a[b]]") == "a.py::slow"
