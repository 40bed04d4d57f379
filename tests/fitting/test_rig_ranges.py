"""Ranges of fitted tyres: as far as the data go, and never short of them."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxveh import tyres
from jaxveh.fitting.rig_ranges import Widened, measured_ranges, widened_ranges
from jaxveh.io import RigTable

ROWS = 50
TYRE = tyres.typical_mf_tyre(4000.0)


def rig(**changes):
    columns = {
        "slip_angle": np.linspace(-0.1, 0.2, ROWS),
        "slip_ratio": np.zeros(ROWS),
        "load": np.linspace(1000.0, 8000.0, ROWS),
        "pressure": np.linspace(2e5, 2.5e5, ROWS),
        "F_y": np.ones(ROWS),
    }
    return RigTable(**(columns | changes))


def test_new_ranges_are_those_of_the_data():
    r, before = measured_ranges(TYRE, rig()).ranges, TYRE.ranges
    assert [float(x) for x in (r.ALPMIN, r.ALPMAX)] == [-0.2, 0.2]
    assert [float(x) for x in (r.FZMIN, r.FZMAX, r.PRESMIN, r.PRESMAX)] == [0.0, 8000.0, 2e5, 2.5e5]
    # No camber was told, and the slip ratio does not vary: nothing is known of them.
    assert r.KPUMAX == before.KPUMAX and r.CAMMIN == before.CAMMIN and r.FZMAX.dtype == before.FZMAX.dtype


def test_forces_at_the_data_stay_what_they_were():
    data = rig()
    contact = tyres.Contact(*map(jnp.asarray, (data.slip_angle, data.slip_ratio, data.load)))
    force = eqx.filter_jit(lambda tyre: tyre.forces(contact).F_y)
    found, expected = (force(tyre) for tyre in (measured_ranges(TYRE, data), TYRE))
    np.testing.assert_array_equal(found, expected)


def test_narrow_ranges_are_widened_and_told():
    narrow = dataclasses.replace(
        TYRE, ranges=dataclasses.replace(TYRE.ranges, ALPMAX=jnp.asarray(0.05), FZMAX=jnp.asarray(5000.0))
    )
    # A slip angle of -0.1 is one of +0.1 in a property file.
    tyre, told = widened_ranges(narrow, rig())
    assert told == (Widened("ALPMAX", 0.05, 0.1), Widened("FZMAX", 5000.0, 8000.0))
    assert float(tyre.ranges.ALPMAX) == 0.1 and tyre.ranges.ALPMIN == narrow.ranges.ALPMIN
    again, nothing = widened_ranges(tyre, rig())
    assert nothing == () and float(again.ranges.FZMAX) == 8000.0
