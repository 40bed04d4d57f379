"""One order in every public function: who reads, what is read, `where`, the key, the rest."""

import inspect

import pytest
from families import listed_modules

READERS = {"filter", "model", "law", "car", "source", "estimate", "estimates", "found", "fit", "turns"}
READ = {"recording", "recordings", "schedule", "segments", "rig"}
ORDER = (READERS, READ, {"where"}, {"key"})
"""Names by their place; a function takes any of them in this order, and behind them whatever else it takes."""

MODULES = {
    name: module
    for name, module in listed_modules().items()
    if hasattr(module, "__all__") and name.split(".")[-1] != "kit" and name.split(".")[0] != "experiments"
}
"""All that users call. A kit is for those who add to a room, a paper for its own program."""

KINDS = ("Recording", "RigTable", "Segments")
OTHERWISE = {("plots.estimate", "truth"): "a reference, drawn beside what was estimated"}


def functions():
    for room, module in MODULES.items():
        for name in module.__all__:
            one = getattr(module, name)
            if inspect.isfunction(one) and not name.startswith("_"):
                yield f"{room}.{name}", inspect.signature(one).parameters


def read_by(parameters):
    """What of the parameters is read: recordings, rig data, segments, by annotation or name."""
    return [n for n, p in parameters.items() if n in READ or any(kind in str(p.annotation) for kind in KINDS)]


THAT_READ = {name: parameters for name, parameters in functions() if read_by(parameters)}


def place(name):
    return next((i for i, names in enumerate(ORDER) if name in names), len(ORDER))


def test_there_are_some():
    assert {"filters.run", "fitting.fit_rig", "estimators.sideslip.calibrate"} <= set(THAT_READ)
    assert len(THAT_READ) > 60 and {"estimators.mass_and_grade.estimate", "estimators.roll.do_nothing"} <= set(
        THAT_READ
    )


@pytest.mark.parametrize("name", THAT_READ)
def test_arguments_stand_in_one_order(name):
    given = THAT_READ[name]
    positional = [n for n, p in given.items() if p.kind is not inspect.Parameter.KEYWORD_ONLY]
    assert positional == sorted(positional, key=place), f"{name}({', '.join(given)})"
    called = [n for n in read_by(given) if n not in READ and (name, n) not in OTHERWISE]
    assert not called, f"{name}: {', '.join(called)} is one of {', '.join(sorted(READ))}"


@pytest.mark.parametrize("name", THAT_READ)
def test_who_reads_stands_in_front_unless_it_may_be_left_out(name):
    given = THAT_READ[name]
    late = [n for n, p in given.items() if n in READERS - {"filter"} and p.kind is inspect.Parameter.KEYWORD_ONLY]
    assert all(given[n].default is None for n in late), f"{name}: {', '.join(late)}"
