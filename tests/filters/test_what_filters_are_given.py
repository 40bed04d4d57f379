"""What every filter of the package is given: numbers that are none, classes for objects, words for forms and schemes."""

import inspect

import pytest
from test_every_filter import FILTERS, linear, recordings

from jaxveh import InputError, filters, numerics, run

NUMBERS = (int, float)


def settings():
    """A filter of each kind and settings, with what its class is called with, and the name of each argument."""
    for name, line in FILTERS.items():
        made = line.make()
        given = {one: getattr(made, one) for one in inspect.signature(type(made)).parameters}
        for one, value in given.items():
            yield name, type(made), given, one, value


def is_number(value):
    return isinstance(value, NUMBERS) and not isinstance(value, bool)


CASES = [pytest.param(*rest, id=f"{name}-{rest[2]}") for name, *rest in settings()]
KINDS = (filters.AbstractFilter, filters.AbstractForm, filters.AbstractResampling, filters.AbstractLookahead)


@pytest.mark.parametrize(("kind", "given", "name", "value"), [c for c in CASES if is_number(c.values[3])])
def test_no_number_is_text_or_complex(kind, given, name, value):
    kind(**given)
    for wrong in ("8", 8j, [[8.0], [8.0, 8.0]]):
        with pytest.raises(InputError, match=name):
            kind(**given | {name: wrong}).check(linear())


@pytest.mark.parametrize(("kind", "given", "name", "value"), [c for c in CASES if isinstance(c.values[3], KINDS)])
def test_an_object_is_neither_its_class_nor_its_name(kind, given, name, value):
    for wrong in (type(value).__name__, 3, object()):
        with pytest.raises(InputError, match=r"must be|inside"):
            kind(**given | {name: wrong})
    with pytest.raises(InputError, match=f"the class {type(value).__name__}"):
        kind(**given | {name: type(value)})


@pytest.mark.parametrize(("kind", "given", "name", "value"), [c for c in CASES if c.values[2] == "resampling"])
def test_a_scheme_is_a_function_or_an_object(kind, given, name, value):
    for wrong in ("systematic", 3, filters.Soft, numerics):
        with pytest.raises(InputError, match=r"resampling = .*: must be a function .* such as numerics\.systematic"):
            kind(**given | {name: wrong})


@pytest.mark.parametrize("keep", ["mean", "std", "info", "info.nis"])
def test_one_name_to_keep_is_one_name(keep):
    model, recording = linear(), recordings("linear")[0]
    kept, same = (run(filters.Cubature(), model, recording, keep=one) for one in (keep, (keep,)))
    for name in ("mean", "std", "info"):
        assert (getattr(kept, name) is None) == (getattr(same, name) is None)
    with pytest.raises(InputError, match=r"keep = 'means': must be one of 'mean', "):
        run(filters.Cubature(), model, recording, keep="means")
