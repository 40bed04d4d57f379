"""Signs of rig data: axes that are told wrongly are noticed, whichever they are, and right ones are not."""

import dataclasses
import itertools

import numpy as np
import pytest
from rig_sweeps import measured_of, table

from jaxveh import InputError, tyres
from jaxveh.fitting import starting_tyre, wrong_signs
from jaxveh.fitting.rig_signs import EXPECTED
from jaxveh.io import RigTable
from jaxveh.io.rig_axes import AXES, FLIPS, to_ours

CHANNELS = ("F_x", "F_y", "M_z")
FIELDS = ("slip_angle", "slip_ratio", "load", "camber", "F_x", "F_y", "M_z")


def rig(noise=0.02, seed=1, camber=(-0.06, 0.0, 0.06)):
    """Sweeps of both slips at two loads and some cambers, of an ordinary tyre."""
    angle, ratio = np.linspace(-0.2, 0.2, 41), np.linspace(-0.15, 0.15, 41)
    sweeps = [
        sweep for load in (2500.0, 5000.0) for lean in camber
        for sweep in ((angle, 0.0, load, lean), (0.0, ratio, load, lean))
    ]  # fmt: skip
    columns = [np.concatenate([np.broadcast_to(sweep[i], 41) for sweep in sweeps]) for i in range(4)]
    columns = np.stack([*columns, np.full(columns[0].size, 16.7), np.full(columns[0].size, 2.2e5)])
    return table(measured_of(tyres.typical_mf_tyre(4000.0), columns, CHANNELS), columns, None, noise, seed)


@pytest.fixture(scope="module")
def data():
    return rig()


def test_right_signs_are_left_alone(data):
    assert wrong_signs(data) == ()
    for seed in range(3):
        assert wrong_signs(dataclasses.replace(rig(noise=0.1, seed=seed))) == ()


@pytest.mark.parametrize("pair", EXPECTED)
def test_each_turned_column_is_named(data, pair):
    channel, name = pair.split(", ")
    turned = name if name == "camber" else channel
    found = wrong_signs(dataclasses.replace(data, **{turned: -getattr(data, turned)}))
    assert pair in {one.pair for one in found}
    words = next(one.words for one in found if one.pair == pair)
    assert channel in words and name in words and "--axes sae, adapted-sae, iso-w or ours" in words


@pytest.mark.parametrize(("true", "told"), list(itertools.permutations(AXES, 2)))
def test_axes_told_wrongly_are_noticed(data, true, told):
    """What a rig wrote in one convention and somebody reads as another: adapted SAE as ours shows by its camber alone."""
    ours = {name: getattr(data, name) for name in FIELDS}
    written = {name: -values if name in FLIPS[true] else values for name, values in ours.items()}
    columns = to_ours(written, told)
    if "load" in {*FLIPS[true]} ^ {*FLIPS[told]}:
        with pytest.raises(InputError, match="load is -.*--axes sae"):
            RigTable(**columns)
        return
    found = wrong_signs(RigTable(**columns))
    assert found
    with pytest.raises(InputError, match="do the data have the axes that were given"):
        starting_tyre("brush", RigTable(**columns))


def test_what_is_not_swept_says_nothing(data):
    upright = rig(camber=(0.03,))
    assert wrong_signs(dataclasses.replace(upright, camber=-upright.camber)) == ()
    few = data.take(np.arange(0, 123, 20))
    assert wrong_signs(dataclasses.replace(few, F_y=-few.F_y, F_x=None, M_z=None)) == ()


STEPS = {"0, -2, -5": (0.0, -2.05, -4.9), "0, 2.5, 5": (0.0, 2.5, 5.0), "both sides": (-3.5, 0.0, 3.5)}


def drive_brake(steps, seed):
    """Sweeps of the slip ratio at steps of the slip angle, of a rig that yields a little to the force along."""
    rng = np.random.default_rng(seed)
    ratio = np.linspace(-0.15, 0.15, 61)
    sweeps = [(np.radians(step), ratio, load, 0.0) for load in (1500.0, 3000.0) for step in steps]
    columns = [np.concatenate([np.broadcast_to(sweep[i], ratio.size) for sweep in sweeps]) for i in range(4)]
    columns = np.stack([*columns, np.full(columns[0].size, 11.2), np.full(columns[0].size, 0.8e5)])
    rig = table(measured_of(tyres.typical_mf_tyre(4000.0), columns, CHANNELS), columns, None, 0.02, seed)
    # The wheel turns by a hundredth of a degree a kilonewton, and the force has a lever of a few millimetres.
    yielding = rig.slip_angle + 2e-7 * rig.F_x + 1e-4 * rng.normal(size=rig.load.size)
    return dataclasses.replace(rig, slip_angle=yielding, M_z=rig.M_z + 0.006 * rig.F_x)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("seed", range(4))
def test_steps_of_the_slip_angle_are_compared_with_each_other(steps, seed):
    """Not the noise about one of them, which follows the forces, not they it."""
    rig = drive_brake(STEPS[steps], seed)
    assert wrong_signs(rig) == ()
    turned = {one.pair for one in wrong_signs(dataclasses.replace(rig, M_z=-rig.M_z, F_y=-rig.F_y))}
    assert turned == {"M_z, slip_angle", "F_y, slip_angle"}


@pytest.mark.parametrize("seed", range(4))
def test_one_step_of_the_slip_angle_and_far_ones_say_nothing(seed):
    rig = drive_brake((0.0, 9.0), seed)
    assert wrong_signs(rig) == ()
    assert wrong_signs(dataclasses.replace(rig, M_z=-rig.M_z, F_y=-rig.F_y)) == ()
