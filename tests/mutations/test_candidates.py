"""The mutations themselves: each changes one line, and what it computes."""

import ast
from pathlib import Path

import pytest

from tests.mutations.candidates import mutants
from tests.mutations.trials import chosen

ROOT = Path(__file__).parents[2]
ROOMS = ("filters", "vehicles", "tyres", "sensors")

EXAMPLE = '''
def force(slip, load: float = -1.0) -> float | None:
    """Minus one plus two."""
    check_positive("load", load + 1)
    if load < 0:
        raise ValueError(f"load = {load - 1}")
    return -slip * 2.0 + blend(front.B, load)
'''


def test_mutations_of_an_example():
    found = {mutant.after.strip() for mutant in mutants("force.py", EXAMPLE)}
    assert "if (load > 0):" in found
    assert "return (-slip * 2.0 - blend(front.B, load))" in found
    assert "return (blend(front.B, load))" in found
    assert "return -slip * 2.2 + blend(front.B, load)" in found
    assert "return -slip * 2.0 + (blend(load, front.B))" in found
    assert "return -slip * 2.0 + blend(rear.B, load)" not in found  # a name that is read, not a field
    assert {mutant.line for mutant in mutants("force.py", EXAMPLE)} == {2, 5, 7}


@pytest.mark.parametrize("room", ROOMS)
def test_every_mutation_changes_one_line_of_the_tree(room):
    for mutant in chosen(ROOT, (room,), 25, seed=3):
        lines = (ROOT / mutant.path).read_text().splitlines()
        assert lines[mutant.line - 1] == mutant.before
        before = ast.dump(ast.parse("\n".join(lines)))
        lines[mutant.line - 1] = mutant.after
        assert ast.dump(ast.parse("\n".join(lines))) != before


def test_a_seed_chooses_the_same_mutations():
    assert chosen(ROOT, ROOMS, 10, seed=1) == chosen(ROOT, ROOMS, 10, seed=1)
    assert chosen(ROOT, ROOMS, 10, seed=1) != chosen(ROOT, ROOMS, 10, seed=2)
