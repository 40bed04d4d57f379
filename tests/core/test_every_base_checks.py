"""A part of one's own that declares a parameter has it checked by its base, whatever it is derived from."""

import re

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxveh import InputError, manoeuvres, roads, tyres
from jaxveh.kit import positive

# A manoeuvre is a function of time made by functions, which check what they are given.
UNCHECKED = {"AbstractManoeuvre"}
BASES = {
    name: getattr(room, name)
    for room in (manoeuvres, roads, tyres)
    for name in room.__all__
    if name.startswith("Abstract") and name not in UNCHECKED
}


def own(base, size):
    """A subclass of `base` with a positive parameter, everything else left empty."""
    body = {name: lambda self, *_: None for name in base.__abstractmethods__}
    told = {"duration": eqx.field(static=True, default=1.0), "state_names": eqx.field(static=True, default=())}
    body |= told | {"size": positive("m", default=1.0), "__module__": __name__}
    body["__annotations__"] = {"duration": float, "state_names": tuple, "size": jax.Array}
    return type(base)("Own", (base,), body)(size=size)


@pytest.mark.parametrize("name", BASES)
@pytest.mark.parametrize("size", [-1.0, 0.0, np.nan, np.inf])
def test_a_parameter_of_one_s_own_is_checked(name, size):
    assert own(BASES[name], 2.0).size == 2.0
    with pytest.raises(InputError, match=re.escape(f"Own.size = {size}: must be positive")):
        own(BASES[name], size)
