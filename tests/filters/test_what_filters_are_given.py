"""What every filter of the package is given: numbers that are none, classes for objects, words for forms and schemes."""

import inspect

import families
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


BY_THE_MODEL = (
    "names",
    "linear",
    "groups",
    "bins",
    "extra",
    "most",
    "delays",
    "scales",
    "variants",
    "characteristic",
    "points",
)
"""Names of states and channels, which a model has or has not, and functions of it: looked at where there is one."""


def test_what_is_wrong_for_an_argument_is_named():
    """Of every filter, wrapper, look-ahead and form: one of each class."""
    seen = set()
    for line in FILTERS.values():
        families.refuses_everywhere(line.make(), seen, BY_THE_MODEL)
    assert {"Unscented", "Huber", "InteractingModels"} <= {kind.__name__ for kind in seen}


MAPPINGS = {
    "extra": lambda wrong: filters.ShrinkingProcess(filters.Extended(), wrong),
    "most": lambda wrong: filters.MatchedProcess(filters.Extended(), wrong),
    "delays": lambda wrong: filters.Delayed(filters.Extended(), wrong),
    "scales": lambda wrong: filters.HInfinity(filters.Extended(), 1.0, wrong),
    "bins": lambda wrong: filters.AdaptiveNumber(filters.ParticleFilter(100), wrong),
    "widen": lambda wrong: filters.Paused(filters.Extended(), "still", wrong),
    "variants": lambda wrong: filters.InteractingModels(filters.Extended(), wrong, [[0.9, 0.1], [0.1, 0.9]]),
    "groups": lambda wrong: filters.Federated(filters.Extended(), wrong),
}


@pytest.mark.parametrize("name", MAPPINGS)
@pytest.mark.parametrize("wrong", ["eight", object(), 8.0, float])
def test_what_is_given_by_name_is_a_mapping_or_several(name, wrong):
    with pytest.raises(InputError, match=name):
        MAPPINGS[name](wrong)


def test_what_cannot_be_kept_is_named():
    with pytest.raises(InputError, match="keep = 'means': must be one of 'mean', 'std', 'info', "):
        run(filters.Extended(), linear(), recordings("linear")[0], keep=("means",))
