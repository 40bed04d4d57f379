"""Every tyre equals its copies and what a pickle of it gives back, alone and in a lag."""

import pytest
from copies import check_copies, unset_fields
from families import is_made_inside_jit, keeps_copies, left_out, made_again, refuses_arrays_as_settings
from test_every_dynamic_tyre import TYRES as DYNAMIC
from test_every_tyre import LAWS

from jaxveh import tyres

ALL = {**{name: law.make for name, law in LAWS.items()}, **{f"{name}, dynamic": make for name, make in DYNAMIC.items()}}
ALL |= {f"{name}, relaxed": lambda make=law.make: tyres.Relaxed(make(), None, 0.4) for name, law in LAWS.items()}


def test_every_tyre_is_here():
    assert not left_out("tyres", tyres.AbstractTyre, [make() for make in ALL.values()], {})


@pytest.mark.parametrize("name", ALL)
def test_it_equals_its_copies(name):
    value = ALL[name]()
    check_copies(value)
    assert not unset_fields(value)


SEEN = set()


@pytest.mark.whole
@pytest.mark.filterwarnings("ignore:A JAX array is being set as static:UserWarning")
@pytest.mark.parametrize("name", ALL)
def test_it_can_be_made_inside_jit_and_its_numbers_are_copied(name):
    """With each class of law, curve, ... in it that no tyre before had."""
    for made, given in made_again(ALL[name](), SEEN):
        is_made_inside_jit(made, given)
        keeps_copies(made, given)
        refuses_arrays_as_settings(made, given)
