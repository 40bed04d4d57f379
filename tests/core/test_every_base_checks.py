"""A part of one's own that declares a parameter has it checked by its base, whatever it is derived from."""

import dataclasses
import inspect
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, estimators, filters, manoeuvres, observers, roads, sensors, statespace, tyres, vehicles
from jaxveh._core import errors
from jaxveh.kit import positive

NUMBERS = ("duration", "rate", "delay", "phase")
"""Fields of some bases, which a class of one's own gives a default."""


def asked_of(base):
    """The fields that a class of one's own has to declare, or to be given."""
    fields = dataclasses.fields(base) if dataclasses.is_dataclass(base) else ()
    asked = {one.name for one in fields if one.default is one.default_factory is dataclasses.MISSING}
    return asked | set(base.__abstractvars__)


LISTED = {
    name: getattr(room, name)
    for room in (estimators, estimators.kit, manoeuvres, roads, tyres, vehicles, sensors, filters, observers)
    for name in room.__all__
    if name.startswith("Abstract")
}
# Their numbers are those of the filter, or of the car, that they are a part of.
PARTS = {
    "AbstractBelief", "AbstractForm", "AbstractLookahead", "AbstractPathSmoother", "AbstractResampling", "AbstractDrive",
    "AbstractLoadTransfer",
}  # fmt: skip
BASES = {name: base for name, base in LISTED.items() if name not in PARTS and asked_of(base) <= set(NUMBERS)}


def test_the_bases_of_every_room_are_here():
    wanted = {
        "AbstractTyre",
        "AbstractVehicle",
        "AbstractManoeuvre",
        "AbstractDevice",
        "AbstractFilter",
        "AbstractMethod",
    }
    assert wanted <= set(BASES)


def own(base, size):
    """A subclass of `base` with a positive parameter, everything else left empty."""
    nothing = lambda self, *_, **__: None
    body = {
        name: property(nothing) if isinstance(inspect.getattr_static(base, name), property) else nothing
        for name in base.__abstractmethods__
    }
    numbers = asked_of(base)
    body |= {name: eqx.field(static=True, default=1.0) for name in numbers}
    body |= {"size": positive("m", default=1.0), "__module__": __name__}
    body["__annotations__"] = {**dict.fromkeys(numbers, float), "size": jax.Array}
    return type(base)("Own", (base,), body)(size=size)


@pytest.mark.parametrize("name", BASES)
@pytest.mark.parametrize("size", [-1.0, 0.0, np.nan, np.inf])
def test_a_parameter_of_one_s_own_is_checked(name, size):
    assert own(BASES[name], 2.0).size == 2.0
    with pytest.raises(InputError, match=re.escape(f"Own.size = {size}: must be positive")):
        own(BASES[name], size)


NO_NUMBERS = {
    "none": None,
    "text": "8.0",
    "complex": 8j,
    "an array of text": np.array("8.0"),
    "a complex array": jnp.asarray(np.array(8j)),
    "numbers and text": [8.0, "8.0"],
    "lists of several lengths": [[8.0], [8.0, 8.0]],
    "a mapping": {"size": 8.0},
    "a class": float,
    "a date": np.datetime64("2024-01-01"),
}


@pytest.mark.parametrize("kind", NO_NUMBERS)
@pytest.mark.parametrize("name", BASES)
def test_what_is_no_real_number_is_none_for_any_part(name, kind):
    with pytest.raises(InputError, match=r"Own\.size = .*: must be a real number, positive and finite \(m\)"):
        own(BASES[name], NO_NUMBERS[kind])


CHECKS = {
    name: function for name, function in vars(errors).items()
    if name.startswith("check") and list(inspect.signature(function).parameters)[:2] == ["name", "value"]
}  # fmt: skip
MORE = {
    "check": (lambda v: v > 0, "positive"), "check_at_least": (1,), "check_one_of": ((1, 2),), "check_kind": (int,),
    "check_has": (("mass",),),
}  # fmt: skip


@pytest.mark.parametrize("kind", NO_NUMBERS)
@pytest.mark.parametrize("name", CHECKS)
def test_every_check_names_what_is_no_real_number(name, kind):
    assert {"check", "check_positive", "check_finite", "check_at_least", "check_whole"} <= set(CHECKS)
    with pytest.raises(InputError, match=r"the size = .*: must be"):
        CHECKS[name]("the size", NO_NUMBERS[kind], *MORE.get(name, ()))


LAWS = {
    "Gaussian": lambda value: statespace.Gaussian({"a": value}),
    "StudentT": lambda value: statespace.StudentT(value, {"a": 1.0}),
    "CauchyGaussianMixture": lambda value: statespace.CauchyGaussianMixture(value, {"a": 1.0}, {"a": 1.0}),
    "MultivariateGaussian": lambda value: statespace.MultivariateGaussian(("a",), [[value]]),
}


@pytest.mark.parametrize("value", ["0.5", 0.5j])
@pytest.mark.parametrize("name", LAWS)
def test_every_noise_law_takes_real_numbers(name, value):
    assert LAWS[name](0.5).names == ("a",)
    with pytest.raises(InputError, match=r"= .*: must be a real number, "):
        LAWS[name](value)
