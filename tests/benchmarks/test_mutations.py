"""The mutations themselves: one expression each, programs still, none of words and checks; which tests are asked."""

import ast
from textwrap import dedent

from benchmarks.mutations.__main__ import ROOT, draw
from benchmarks.mutations.choosing import SETTINGS, choose, lines_beside, never_executed, on_import
from benchmarks.mutations.mutate import mutations

SOURCE = '''"""A text with 1 + 1 in it."""

SPEED: float = 3.0
drag = parameter("N s^2/m^2", scale=0.4)


def check_speed(v):
    return v > 0


def force(a, b, speed):
    """Another 2 * 3."""
    if speed < 0:
        raise ValueError(f"{speed} - 1")
    turned = -a * b + jnp.minimum(a, b)
    return jnp.where(turned > 0.5, numerics.sin(a), b[0])
'''


def test_what_is_changed_and_what_is_not():
    found = mutations("f.py", SOURCE)
    changed = {(m.line, m.kind, m.applied(SOURCE).split("\n")[m.line - 1].strip()) for m in found}
    assert changed == {
        (3, "constant", "SPEED: float = 4.5"),
        (15, "operator", "turned = -a / b + jnp.minimum(a, b)"),
        (15, "operator", "turned = -a * b - jnp.minimum(a, b)"),
        (15, "dropped term", "turned = -a + jnp.minimum(a, b)"),
        (15, "dropped term", "turned = -a * b"),
        (15, "sign", "turned = a * b + jnp.minimum(a, b)"),
        (15, "function", "turned = -a * b + jnp.maximum(a, b)"),
        (15, "swapped arguments", "turned = -a * b + jnp.minimum(b, a)"),
        (16, "comparison", "return jnp.where(turned <= 0.5, numerics.sin(a), b[0])"),
        (16, "constant", "return jnp.where(turned > 0.75, numerics.sin(a), b[0])"),
        (16, "function", "return jnp.where(turned > 0.5, numerics.cos(a), b[0])"),
    }
    for mutation in found:
        ast.parse(mutation.applied(SOURCE))
        assert f"-{SOURCE.split(chr(10))[mutation.line - 1]}" in mutation.diff(SOURCE)


def test_a_draw_is_the_same_again_and_of_programs():
    chosen = draw(60, 3)
    assert chosen == draw(60, 3) and len(chosen) == len({m.name for m in chosen}) == 60
    assert chosen != draw(60, 4)
    assert sum(m.kind == "swapped arguments" for m in chosen) == 6
    for mutation in chosen:
        source = (ROOT / mutation.file).read_text()
        assert mutation.applied(source) != source
        ast.parse(mutation.applied(source))
    assert {m.file for m in draw(5, 0, only="seven_dof")} == {"jaxveh/vehicles/seven_dof.py"}


def test_tests_of_the_own_room_come_first_and_quick_ones_before_slow_ones():
    at = {"jaxveh/tyres/brush.py": [10, 11]}
    measurements = {
        "tests/vehicles/test_a.py": {"seconds": 1.0, "lines": at},
        "tests/tyres/test_slow.py": {"seconds": 9.0, "lines": at},
        "tests/tyres/test_quick.py": {"seconds": 2.0, "lines": at},
        "tests/tyres/test_other.py": {"seconds": 1.0, "lines": {}},
    }
    found = choose(measurements, "jaxveh/tyres/brush.py", {11})
    assert found == ["tests/tyres/test_quick.py", "tests/tyres/test_slow.py", "tests/vehicles/test_a.py"]
    assert choose(measurements, "jaxveh/tyres/brush.py", {12}) == []


def test_recorded_settings_are_asked_first_of_what_runs_on_import():
    at = {"jaxveh/tyres/brush.py": [10, 11]}
    measurements = {
        "tests/tyres/test_quick.py": {"seconds": 2.0, "lines": at},
        SETTINGS: {"seconds": 5.0, "lines": {}},
    }
    for own in (False, True):
        found = choose(measurements, "jaxveh/tyres/brush.py", {11}, own, imported=True)
        assert found == [SETTINGS, "tests/tyres/test_quick.py"]
        assert choose(measurements, "jaxveh/tyres/brush.py", {11}, own) == ["tests/tyres/test_quick.py"]
    assert (ROOT / SETTINGS).exists()
    lines = SOURCE.split("\n")
    assert [line for line, text in enumerate(lines, 1) if text.strip() and not on_import(SOURCE, line)] == [
        8, 12, 13, 14, 15, 16,
    ]  # fmt: skip


def test_a_line_is_executed_with_its_statement_and_one_of_the_module_with_its_functions():
    source = dedent(
        """\
        SIZE = (
            3)

        def area(a,
                 b):
            c = (a
                 * b)
            if (c
                    > 0):
                return c
            return 0
        """
    )
    assert lines_beside(source, 7) == {6, 7}
    assert lines_beside(source, 9) == {8, 9}
    assert lines_beside(source, 10) == {10}
    assert lines_beside(source, 2) == {6, 7, 8, 9, 10, 11}
    assert lines_beside("SIZE = 3\n", 1) == {1}


def test_a_function_that_no_test_executes_is_named(tmp_path):
    (tmp_path / "f.py").write_text(SOURCE + '\n\ndef stub():\n    """Of a protocol."""\n    ...\n')
    executed = lambda *lines: {"tests/a.py": {"seconds": 1.0, "lines": {"f.py": list(lines)}}}
    # Definitions run on import.
    assert never_executed(tmp_path, executed(3, 4, 7, 11), ["f.py"]) == {"f.py": ["check_speed", "force"]}
    assert never_executed(tmp_path, executed(3, 4, 7, 11, 12), ["f.py"]) == {"f.py": ["check_speed", "force"]}
    assert never_executed(tmp_path, executed(7, 8, 11), ["f.py"]) == {"f.py": ["force"]}
    assert never_executed(tmp_path, executed(8) | {"tests/b.py": executed(16)["tests/a.py"]}, ["f.py"]) == {}
