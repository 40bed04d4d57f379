"""Every paper's sweeps go into stores of their own, go on there, and give what they give without one."""

import ast
import inspect
import itertools
import json
import re
from pathlib import Path

import jax
import numpy as np
import pytest

from jaxveh import InputError
from jaxveh.cli.output import plain
from jaxveh.cli.reproduce import PAPERS, _experiment
from jaxveh.experiments import mass_grade_aukf
from jaxveh.experiments.mass_grade_aukf.report import _printed_table
from jaxveh.sweeps import IN_MEMORY, Stores, study_stores
from jaxveh.sweeps.store import DONE, Store

SMALL = mass_grade_aukf.truck(duration=20.0, dt=0.1, max_step=0.01, guesses=(4000.0, 6000.0))
OWN = ("first guess", "RLS")
SEEDS = 5


GIVEN = "'the object that was given them'"


class Where(ast.NodeVisitor):
    """Of one function: each sweep's place under its `stores`, as the words that lead there, and each call that hands them on.

    `takers`: the functions by name that take `stores`.
    """

    def __init__(self, function, takers):
        # What an object was given has its places where that was called.
        self.takers, self.known, self.loops = takers, {"stores": (), "self.stores": (GIVEN,)}, 0
        self.sweeps, self.handed, self.wrong = [], [], []
        self.generic_visit(function)

    def place(self, node):
        """The words of `stores.under(a).under(b)`; None where it is something else."""
        if isinstance(node, ast.Name | ast.Attribute):
            return self.known.get(ast.unparse(node))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "under":
            before = self.place(node.func.value)
            return None if before is None else (*before, ast.unparse(node.args[0]))
        return None

    def visit_Assign(self, node):
        self.visit(node.value)
        pairs = [(node.targets[0], node.value)]
        if isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple):
            pairs = zip(node.targets[0].elts, node.value.elts, strict=True)
        for target, value in pairs:
            if isinstance(target, ast.Name) and self.place(value) is not None:
                self.known[target.id] = self.place(value)

    def looped(self, node):
        self.loops += 1
        self.generic_visit(node)
        self.loops -= 1

    visit_For = visit_ListComp = visit_DictComp = visit_GeneratorExp = looped

    def visit_Call(self, node):
        self.generic_visit(node)
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if isinstance(node.func, ast.Attribute) and node.func.attr in ("sweep", "each"):
            place = self.place(node.func.value)
            if place is None or not isinstance(node.args[0], ast.Constant):
                self.wrong.append(f"{ast.unparse(node.func)} goes around the stores, or has no name of its own")
            else:
                self.keep(self.sweeps, place, ast.unparse(node.args[0]))
        elif name in self.takers:
            words = {word.arg: word.value for word in node.keywords}
            names = [one.arg for one in self.takers[name].args.args if one.arg != "self"]
            place = self.place(words.get("stores") or dict(zip(names, node.args, strict=False)).get("stores"))
            if place is None:
                self.wrong.append(f"{name} is called without the stores")
            else:
                self.keep(self.handed, place, name)

    def keep(self, kept, place, what):
        constant = [isinstance(ast.parse(word, mode="eval").body, ast.Constant) for word in place]
        if self.loops and all(constant):
            self.wrong.append(f"{what}: the same place each time that a loop comes by")
        if place[:1] != (GIVEN,):
            kept.append((place, what))


def functions(paper):
    """By module: its functions by name."""
    found = {}
    for file in sorted(Path(paper.__file__).parent.rglob("*.py")):
        every = list(ast.walk(ast.parse(file.read_text())))
        found[file.stem] = {one.name: one for one in every if isinstance(one, ast.FunctionDef)}
        for kind in (one for one in every if isinstance(one, ast.ClassDef)):
            # Whoever makes one calls this.
            begins = [one for one in kind.body if getattr(one, "name", "") == "__init__"]
            found[file.stem] |= dict(zip([kind.name], begins, strict=False))
    return found


def takers(paper, stem):
    """The functions by name that take `stores`, as a module sees them, and the module of each."""
    takes = lambda one: "stores" in [argument.arg for argument in (*one.args.args, *one.args.kwonlyargs)]
    every = functions(paper)
    found = {name: (one, place) for place, own in every.items() for name, one in own.items() if takes(one)}
    found |= {name: (one, stem) for name, one in every[stem].items()}
    there = {name: one for name, (one, _) in found.items() if takes(one)}
    return there, {name: found[name][1] for name in there}


def places(paper, stem, name):
    """Where every sweep that a function leads to is stored."""
    there, stems = takers(paper, stem)
    seen = Where(there[name], there)
    assert not seen.wrong, f"{paper.__name__}.{stems[name]}.{name}: {seen.wrong}"
    found = [(*place, what) for place, what in seen.sweeps]
    return found + [(*place, *rest) for place, other in seen.handed for rest in places(paper, stems[other], other)]


@pytest.fixture(params=PAPERS, scope="module")
def paper(request):
    return _experiment(request.param)


SWEEPLESS = {("sideslip_review", "as_printed")}
"""Programs that compute nothing over seeds."""


@pytest.mark.parametrize("program", ["run", "as_printed"])
def test_programs_take_stores_and_each_of_their_sweeps_has_a_place_of_its_own(paper, program):
    function = getattr(paper, program)
    given = inspect.signature(function).parameters["stores"]
    assert given.kind is inspect.Parameter.KEYWORD_ONLY and given.default is IN_MEMORY
    found = places(paper, function.__module__.rsplit(".", 1)[-1], program)
    assert len(found) == len(set(found)), sorted(found)
    assert bool(found) == ((paper.__name__.rsplit(".", 1)[-1], program) not in SWEEPLESS)


def test_nothing_sweeps_around_the_stores(paper):
    """Programs of their own, `main`, choose settings and store nothing."""
    for stem, own in functions(paper).items():
        there, _ = takers(paper, stem)
        for name, one in own.items():
            if name == "main":
                continue
            seen = Where(one, there)
            taking = bool(seen.sweeps or seen.handed)
            assert not seen.wrong and (not taking or name in there), f"{stem}.{name}: {seen.wrong}"


def tell(found):
    """A table, as text."""
    return json.dumps(plain(found))


def small(stores=IN_MEMORY, seed=0, progress=lambda *told: None):
    """A paper in small: drives, then estimators on them; its table."""
    drives = mass_grade_aukf.drives_of(SMALL, (0.1,), SEEDS, jax.random.key(seed), progress=progress, stores=stores)
    raced = mass_grade_aukf.race(SMALL, (0.1,), drives, only=OWN, progress=progress, stores=stores)
    return tell(_printed_table(raced, OWN))


def stop_after(count):
    """A progress that interrupts when so many chunks of a sweep are done."""

    def told(done, total, stage):
        if done >= count and done < total:
            raise KeyboardInterrupt

    return told


@pytest.fixture(scope="module")
def unstored():
    """The table without stores."""
    return small()


@pytest.fixture
def written(monkeypatch):
    """Each chunk that is written, as (store, number)."""
    seen, write = [], Store.write
    monkeypatch.setattr(
        Store, "write", lambda self, chunk, values: (seen.append((self.path, chunk.number)), write(self, chunk, values))
    )
    return seen


@pytest.mark.full
def test_a_paper_goes_on_and_computes_nothing_twice(tmp_path, monkeypatch, written, unstored):
    monkeypatch.setattr(study_stores, "RUNS", 3)
    stores = Stores(tmp_path / "stores")
    for count in (1, 4):
        with pytest.raises(KeyboardInterrupt):
            small(stores, progress=stop_after(count))
    assert small(stores) == unstored
    # Drives of 5 seeds in 2 chunks; 2 estimators from 2 guesses in 2 each.
    assert sorted((path.name, number) for path, number in written) == [
        *(("drives.zarr", i) for i in range(2)), *(("race.zarr", i) for i in range(8)),
    ]  # fmt: skip
    del written[:]
    assert small(stores) == unstored and not written
    with pytest.raises(InputError, match="drives.zarr: it was begun with key = "):
        small(stores, seed=1)


def test_chunks_that_failed_end_the_paper(tmp_path, monkeypatch, unstored):
    """Tables without them would be of other drives; and what follows would be stored as of those."""
    monkeypatch.setattr(study_stores, "RUNS", 3)
    write = Store.write

    def failing(self, chunk, values):
        if chunk.number == 1:
            raise RuntimeError("no luck")
        write(self, chunk, values)

    monkeypatch.setattr(Store, "write", failing)
    stores = Stores(tmp_path)
    with pytest.warns(match="no luck"), pytest.raises(InputError, match="needs the 1 chunks that are not done"):
        small(stores)
    assert not (tmp_path / "race.zarr").exists()
    monkeypatch.undo()
    monkeypatch.setattr(study_stores, "RUNS", 3)
    assert small(stores) == unstored


def test_stores_refuse_what_cannot_be(tmp_path):
    with pytest.raises(InputError, match="need a folder"):
        Stores(processes=2)
    with pytest.raises(InputError, match="not both"):
        Stores(tmp_path, processes=2, client="tcp://here:1")
    with pytest.raises(InputError, match="processes = 0"):
        Stores(tmp_path, processes=0)
    assert IN_MEMORY.under("part") is IN_MEMORY and Stores(tmp_path).under("part") == Stores(tmp_path / "part")


NUMBER = re.compile(r"-?\d+\.?\d*(?:e[+-]?\d+)?")


CHAOTIC = "strong tracking"
"""A filter that loses the car within the first rows of wild noise, and tips over: in memory, too, another size of batch, which
rounds otherwise, makes its error 0.3 to 1 times as large, where all others agree but for rounding."""


def assert_alike(found, plain):
    """Tables whose words are the same, and whose numbers differ by no more than the rounding of what is shown."""
    for one, other in zip(found, plain, strict=True):
        assert (one.title, one.columns) == (other.title, other.columns)
        for cells, others in zip(one.rows, other.rows, strict=True):
            assert cells[0] == others[0]
            if cells[0] == CHAOTIC:
                continue
            for cell, there in zip(map(str, cells), map(str, others), strict=True):
                assert NUMBER.sub("#", cell) == NUMBER.sub("#", there), (one.title, cells[0])
                numbers = [[float(x) for x in NUMBER.findall(text)] for text in (cell, there)]
                np.testing.assert_allclose(*numbers, rtol=0.011, atol=1e-9, err_msg=f"{one.title}: {cells}")


@pytest.mark.full
def test_every_paper_is_the_same_with_stores(paper, tmp_path, monkeypatch, written):
    """Begun in two processes, interrupted, and ended in this one, in small chunks: whose batches round otherwise."""
    monkeypatch.setattr(study_stores, "RUNS", 5)
    plain = paper.run(seeds=2)
    calls = itertools.count(1)

    def stop(done, total, stage):
        if next(calls) == 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        paper.run(seeds=2, stores=Stores(tmp_path, processes=2), progress=stop)
    done = {path: Store(path).status() == DONE for path in tmp_path.rglob("*.zarr")}
    assert not written and any(one.any() for one in done.values())
    found = paper.run(seeds=2, stores=Stores(tmp_path))
    assert len(set(written)) == len(written)
    assert not [number for path, number in written if path in done and done[path][number]]
    assert_alike(paper.tables(found), paper.tables(plain))
    for one, other in zip(paper.check(found), paper.check(plain), strict=True):
        assert one._replace(value=0.0) == other._replace(value=0.0)
        np.testing.assert_allclose(one.value, other.value, rtol=1e-6, err_msg=one.name)
    del written[:]
    paper.run(seeds=2, stores=Stores(tmp_path))
    assert not written
