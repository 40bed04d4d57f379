"""A constant stands once: two modules that give the same name to the same value, or the same names to a tuple, mean the same.
And it stands above what uses it, so that a module reads from top to bottom."""

import ast
import re
from collections import defaultdict
from pathlib import Path

import jaxveh

ROOT = Path(jaxveh.__file__).parent

OTHER_MEANINGS = {
    "ALL": "a word of two programs",
    "BEND": "how soon the limits of two different curves of an axle set in",
    "CHANNELS": "what one method measures, and what is drawn below an estimate",
    "FEW": "of members of a family in a message, and of states",
    "KMH": "no choice but a unit, in rooms that cannot import one another",
    "LEAST_FRICTION": "of two tyre laws, of which one divides a slip and the other holds bristles",
    "POINTS": "of two figures with different axes",
    "RECOMMENDED": "each quantity recommends a method of its own",
    "SHOWN": "of a value in a file, and of an error in a store",
    "SLOWEST": "each method and each check has a slowest speed of its own",
    "STEP": "a rule of the derivatives of its own module",
    "WIDEST": "of a list, and of a matrix",
}
"""By the name: why some that are alike are not the same. A paper's numbers are its own."""


def constants():
    """Name, value as text, number of names in it, and place of each constant of the package."""
    for path in sorted(ROOT.rglob("*.py")):
        if "experiments" in path.parts:
            continue
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.Assign) or len(node.targets) != 1 or not isinstance(node.targets[0], ast.Name):
                continue
            name = node.targets[0].id.strip("_")
            if name.isupper() and not isinstance(node.value, ast.Name | ast.Attribute):
                yield name, ast.unparse(node.value), len(getattr(node.value, "elts", ())), str(path.relative_to(ROOT))


def twice():
    """The names of constants that stand in several modules, with the places."""
    by_name, by_value = defaultdict(set), defaultdict(set)
    for name, value, names, place in constants():
        by_name[name, value].add((name, place))
        if names >= 2:
            by_value[value].add((name, place))
    return [found for found in (*by_name.values(), *by_value.values()) if len({place for _, place in found}) > 1]


def test_a_constant_stands_once():
    again = [found for found in twice() if not any(name in OTHER_MEANINGS for name, _ in found)]
    assert not again, again


def test_every_exemption_is_needed():
    assert {name for found in twice() for name, _ in found} >= set(OTHER_MEANINGS)


def names_in(node):
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


LATE = re.compile(r"^(?:def|class) .*^[A-Z_]{2,}\d* *[:=,]", re.MULTILINE | re.DOTALL)
"""A text with a constant below a function or class: few modules have one, and to parse all takes a second."""


def constants_below_their_use(tree):
    """The constants that stand below a function or class of their module with their name in it. One that is made of functions
    or classes of the module, or of such constants, cannot stand above them."""
    used, made = set(), set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            used |= names_in(node)
            made.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            named = {name for target in targets for name in names_in(target) if name.isupper()}
            if node.value is not None and names_in(node.value) & made:
                made |= named
            else:
                yield from named & used


def test_a_constant_stands_above_what_uses_it():
    texts = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in ROOT.rglob("*.py")}
    late = {place: ast.parse(text) for place, text in texts.items() if LATE.search(text)}
    found = {place: names for place, tree in late.items() if (names := sorted(constants_below_their_use(tree)))}
    assert late and not found, found
