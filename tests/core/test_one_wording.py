"""A thing of a wrong kind is shown in the same words, `word_for`, wherever a message names it."""

import ast
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxveh
from jaxveh import InputError, manoeuvres, statespace, vehicles
from jaxveh._core.errors import word_for
from jaxveh.kit import record_type

X = record_type("X", ("p", "v"))
THINGS = {
    "None": None, "a truth value": True, "a number": 2.5, "text": "text", "a list": [1.0], "a class": X,
    "a key": jax.random.key(0),
    "a record": X(1.0, 2.0),
    "an array": np.ones(3), "an array of jax": jnp.ones((2, 1)), "a function": np.linalg.norm, "a mapping": {"p": 1.0},
}  # fmt: skip
WORDS = {
    "None": "None", "a truth value": "True", "a number": "2.5", "text": "'text'", "a list": "list", "a class": "the class X",
    "a key": "a key of jax.random",
    "a record": "X(p, v)", "an array": "an array of float64 of shape (3,)",
    "an array of jax": "an array of float64 of shape (2, 1)",    "a function": "the function norm", "a mapping": "dict",
}  # fmt: skip


def state_space(transition):
    y, prior = statespace.Gaussian({"p": 1.0}), statespace.Prior(X(0.0, 0.0), {"p": 1.0, "v": 1.0})
    return statespace.StateSpace(
        transition=transition, observation=lambda s, t, x, u: x, process_noise=None, measurement_noise=y, prior=prior
    )


PLACES = {
    "an argument": lambda thing: vehicles.build(thing, vehicles.SevenDOF),
    "a function": lambda thing: state_space(thing if not callable(thing) or isinstance(thing, type) else None),
    "a transition's result": lambda thing: state_space(lambda s, t0, t1, x, u: thing).transition(
        0.0, 1.0, record_type("Z", ("q",))(0.0), ()
    ),
    "sensors": lambda thing: jaxveh.simulate(
        vehicles.passenger_car(), manoeuvres.step_steer(20.0, 0.1), 0 if thing is None else thing
    ),
}


@pytest.mark.parametrize("thing", THINGS)
def test_the_words_are_these(thing):
    assert word_for(THINGS[thing]) == WORDS[thing]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("thing", THINGS)
def test_they_are_the_same_everywhere(thing, place):
    unlike = {("a function", "a function"): "None", ("sensors", "None"): "0"}
    with pytest.raises(InputError) as raised:
        PLACES[place](THINGS[thing])
    assert unlike.get((place, thing), WORDS[thing]) in str(raised.value)


ROOT = Path(jaxveh.__file__).parent


def is_name_of_a_type(node):
    """Whether an expression is `type(...).__name__`."""
    return (
        isinstance(node, ast.Attribute)
        and node.attr == "__name__"
        and isinstance(node.value, ast.Call)
        and getattr(node.value.func, "id", "") == "type"
    )


def shown_by_their_type(tree):
    """Lines of messages that show a thing of a wrong kind, `name = thing: must be`, by the name of its type, in place of
    `word_for`: of the None that is given for a filter it says `NoneType`, of an array not its shape."""
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        names = {
            target.id
            for node in ast.walk(function)
            if isinstance(node, ast.Assign) and is_name_of_a_type(node.value)
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        for text in (node for node in ast.walk(function) if isinstance(node, ast.JoinedStr)):
            for before, part, after in zip([None, *text.values], text.values, [*text.values[1:], None], strict=False):
                said = isinstance(part, ast.FormattedValue) and (
                    is_name_of_a_type(part.value) or getattr(part.value, "id", "") in names
                )
                words = [one.value if isinstance(one, ast.Constant) else "" for one in (before, after)]
                if said and (words[0].endswith((" = ", "returned ")) or (words[0] and words[1].startswith(": must"))):
                    yield part.lineno


def test_no_message_shows_a_thing_by_the_name_of_its_type():
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in sorted(ROOT.rglob("*.py"))
        for line in shown_by_their_type(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert not found
