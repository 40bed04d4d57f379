"""A flag is True or False: to Python every text is true, `overwrite="no"` as well.

The functions are those that rooms list in `__all__`, their flags those that are True or False by default. Those of classes are
looked at where every class is made.
"""

import importlib
import inspect
import pkgutil

import numpy as np
import pytest
from families import arguments_of

import jaxveh
from jaxveh import InputError

OTHERS = {"jaxveh._core", "jaxveh.cli", "jaxveh.numerics"}
"""Tools of the rooms, programs, and formulas of arrays."""
ROOMS = {room.name for room in pkgutil.iter_modules(jaxveh.__path__, "jaxveh.") if room.ispkg} - OTHERS


def flags_of(made):
    return [argument.name for argument in arguments_of(made) if isinstance(argument.default, bool)]


FUNCTIONS = {
    f"{room.removeprefix('jaxveh.')}.{name}": one
    for room in sorted(ROOMS)
    for name in importlib.import_module(room).__all__
    if inspect.isfunction(one := getattr(importlib.import_module(room), name)) and flags_of(one)
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_flag_is_true_or_false(name):
    made = FUNCTIONS[name]
    required = {one.name: None for one in arguments_of(made) if one.default is one.empty}
    for flag in flags_of(made):
        for wrong in ("no", None, 1, np.asarray([True, False])):
            with pytest.raises(InputError, match=f"{flag} = .*: must be True or False"):
                # A context manager looks at what it is given when it is entered.
                made(**required, **{flag: wrong}).__enter__()
