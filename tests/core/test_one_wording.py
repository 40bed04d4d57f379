"""A thing of a wrong kind is shown in the same words, `word_for`, wherever a message names it."""

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
