"""No law has a force, a length or a time of its own: in units a million times as large every law gives the same. The laws are
those of `tyres.__all__`."""

import re

import jax.numpy as jnp
import numpy as np
import pytest
from test_ordinary_points import LAWS, MORE, contact, points

from jaxveh._core.parameter import every_parameter, pick, put
from jaxveh.tyres import AbstractDynamicTyre

TYRES = {**LAWS, **MORE}
OWN = {
    "MFTyre": "adds a millionth to what it divides by, as the reference evaluator does",
    "Relaxed MFTyre": "likewise",
    "Relaxed truck": "likewise",
}
COLUMNS = ("rad", "-", "N", "m/s", "-", "rad", "m/s")
"""Units of the columns of `points`."""

RESULTS = ("N", "N", "N m", "N m", "N m")


def times(unit, base):
    """By what a number in `unit` is multiplied where the unit `base` is a million times as large."""
    above, _, below = unit.partition("/")
    count = lambda part: sum(int(power or 1) for power in re.findall(rf"\b{base}\b(?:\^(\d))?", part))
    return 1e-6 ** (count(above) - count(below))


def settled(tyre, columns):
    """Forces and moments (5, rows), those of a tyre with states in its steady state."""
    at = contact(columns, True)
    state = (tyre.start(at),) if isinstance(tyre, AbstractDynamicTyre) else ()
    return np.stack([np.broadcast_to(value, at.load.shape) for value in tyre.forces(at, *state)])


@pytest.mark.parametrize("name", [name for name in TYRES if name not in OWN])
def test_forces_are_the_same_in_other_units(name):
    tyre, columns = TYRES[name](), jnp.asarray(points(float)[True])
    found, parameters = settled(tyre, columns), tuple(every_parameter(tyre).values())
    for base in ("N", "m", "s"):
        scale = lambda units, base=base: np.array([[times(unit, base)] for unit in units])
        values = [value * times(p.unit, base) for p, value in zip(parameters, pick(tyre, parameters), strict=True)]
        other = settled(put(tyre, parameters, values), columns * scale(COLUMNS))
        np.testing.assert_allclose(other / scale(RESULTS), found, rtol=1e-9, atol=1e-9, err_msg=base)
