"""What holds for every tyre without states, each in turn: a new one is a line in `LAWS` that says what it can do.

Left to `full`: MF-Tyre's reverse gradients in float32 (in float64 they are here and, of every file, in `test_mf_tyre.py`).
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import families
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import left_out, members
from hypothesis import given, settings
from hypothesis import strategies as st
from shared_data import shared

from jaxveh import statespace, tyres
from jaxveh._core.bijectors import Positive
from jaxveh._core.errors import InputError
from jaxveh.tyres import Contact, Forces

pytestmark = pytest.mark.product

LOAD = 4000.0


def mf_tyre():
    return tyres.from_property_file(shared("tyres") / "mfeval__PacejkaBook_Defaults.tir")


def tmeasy(twice=True):
    curve = tyres.TMeasyCurve
    one = curve(90000.0, 0.11, 3300.0, 0.40, 3200.0), curve(75000.0, 0.16, 3100.0, 0.60, 3000.0)
    two = curve(160000.0, 0.12, 6000.0, 0.45, 5700.0), curve(120000.0, 0.18, 5500.0, 0.70, 5400.0)
    return tyres.TMeasy(*one, 3000.0, *(two if twice else ()), trail=tyres.TMeasyTrail(0.035, 0.20, 0.45))


def across():
    return tyres.MagicFormula(10.0, 1.4, 0.9 * LOAD, -0.8, nominal_load=LOAD)


def along():
    return tyres.LongitudinalLaw(tyres.MagicFormula(12.0, 1.6, 1.1 * LOAD, 0.3, nominal_load=LOAD))


class Law(NamedTuple):
    """A tyre and what it can do.

    `bound` is the most force over load (None: no bound), `combined` whether it has longitudinal forces, `lateral` whether it has
    lateral ones, `symmetric` whether a mirror turns it, `load` whether it needs a load, `friction` whether the road's friction
    counts.
    """

    make: Callable[[], tyres.AbstractTyre]
    bound: float | None = 0.9
    combined: bool = True
    lateral: bool = True
    symmetric: bool = True
    load: bool = True
    friction: bool = True


LAWS = {
    "Arctangent": Law(lambda: tyres.Arctangent(20000.0, 12.0, 0.9), bound=0.9 * np.pi / 2, combined=False),
    "Brush": Law(lambda: tyres.Brush(80000.0, 60000.0, 0.9)),
    "Dugoff": Law(lambda: tyres.Dugoff(80000.0, 60000.0, 0.9)),
    "Dugoff, fading": Law(lambda: tyres.Dugoff(80000.0, 60000.0, 0.9, 0.01)),
    "Exponential": Law(lambda: tyres.Exponential(15.0, 0.9, 20.0)),
    "Exponential, lateral": Law(lambda: tyres.Exponential(15.0, 0.9), combined=False),
    # What Fiala leaves sideways at full braking.
    "Fiala": Law(lambda: tyres.Fiala(80000.0, 60000.0, 0.9), bound=0.9 * np.sqrt(1.01)),
    "FialaADAMS": Law(lambda: tyres.FialaADAMS(80000.0, 60000.0, 0.9, 0.7), bound=0.9 * np.sqrt(2)),
    "FialaPolynomial": Law(lambda: tyres.FialaPolynomial(80000.0, 60000.0, 0.9), bound=0.9 * np.hypot(1, 1.00631)),
    "HSRI": Law(lambda: tyres.HSRI(80000.0, 60000.0, 0.9)),
    "FrictionEllipse": Law(lambda: tyres.FrictionEllipse(along(), across()), bound=np.hypot(1.1, 0.9)),
    "IsotropicMagicFormula": Law(lambda: tyres.IsotropicMagicFormula(10.0, 1.4, 0.9, 0.2)),
    "Linear": Law(lambda: tyres.Linear(60000.0, 80000.0), bound=None, load=False, friction=False),
    "LinearWithLoad": Law(lambda: tyres.LinearWithLoad(60000.0, 5000.0, 20.0), bound=None, friction=False),
    "LongitudinalLaw": Law(along, bound=1.1, lateral=False),
    "MF-Tyre": Law(mf_tyre, bound=None, symmetric=False),
    "MagicFormula": Law(lambda: tyres.MagicFormula(10.0, 1.4, 3600.0, -0.8, nominal_load=LOAD), combined=False),
    "Mirrored": Law(lambda: tyres.Mirrored(tyres.Brush(80000.0, 60000.0, 0.9))),
    "OnRoad": Law(lambda: tyres.OnRoad(tyres.Brush(80000.0, 60000.0, 0.9), 0.5), bound=0.45),
    "Parabolic": Law(lambda: tyres.Parabolic(60000.0, 0.9, 80000.0)),
    "Parabolic, lateral": Law(lambda: tyres.Parabolic(60000.0, 0.9), combined=False),
    "Similarity": Law(lambda: tyres.Similarity(across(), LOAD, slip_stiffness_ratio=1.3)),
    # Its friction is greatest without load.
    "TMeasy": Law(tmeasy, bound=(2 * 3300 - 6000 / 2) / 3000),
    "TMeasy, one load": Law(lambda: tmeasy(twice=False), bound=3300 / 3000),
    "UniTire": Law(lambda: tyres.UniTire(80000.0, 60000.0, 0.9, 0.4)),
}


def test_every_law_of_the_package_is_here():
    dynamic = dict.fromkeys(members("tyres", tyres.AbstractDynamicTyre), "has states: test_every_dynamic_tyre")
    assert not left_out("tyres", tyres.AbstractTyre, [law.make() for law in LAWS.values()], dynamic)


def those(**able):
    """The names of the tyres that can do all of this."""
    return [name for name, law in LAWS.items() if all(getattr(law, what) == value for what, value in able.items())]


BOUNDED = [name for name, law in LAWS.items() if law.bound is not None]


@pytest.fixture(params=LAWS)
def law(request):
    return LAWS[request.param]


@pytest.fixture
def tyre(law):
    return law.make()


def contact(slip_angle=0.0, slip_ratio=0.0, load=LOAD, dtype=jnp.float64, friction=1.0):
    number = lambda value: value if isinstance(value, jax.Array) else np.asarray(value, dtype)
    return Contact(number(slip_angle), number(slip_ratio), number(load), number(0.0), number(friction), number(20.0))


@jax.jit
def force_vector(tyre, at):
    forces = tyre.forces(at)
    return jnp.stack([jnp.asarray(value, at.load.dtype) for value in forces])


@jax.jit
def forward(tyre, at):
    """The forces, and their change when every coefficient and every input changes by one."""
    ones = jax.tree.map(jnp.ones_like, (tyre, at))
    return jax.jvp(force_vector, (tyre, at), ones)


@jax.jit
def with_slopes(tyre, at):
    """What `forward` gives, and whether all reverse gradients are finite: looked at inside, a program without hundreds of results
    compiles faster."""
    value, along = jax.linearize(force_vector, tyre, at)
    gradients = jax.linear_transpose(along, tyre, at)(jnp.ones_like(value))
    finite = jnp.all(jnp.stack([jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(gradients)]))
    return value, along(*jax.tree.map(jnp.ones_like, (tyre, at))), finite


slopes = jax.jit(jax.jacfwd(lambda x, tyre: force_vector(tyre, contact(*x))))


def vector(tyre, at):
    return np.asarray(force_vector(tyre, at))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
@pytest.mark.parametrize("point", [(0.0, 0.0), (0.1, 0.0), (0.0, 0.1), (0.0, -1.0), (0.2, -1.0), (1.2, 2.0)])
@pytest.mark.parametrize("load", [LOAD, 0.0, -100.0])
def test_values_and_gradients_are_finite(tyre, point, load, dtype):
    tyre = statespace.cast(tyre, dtype)
    at = contact(*point, load, dtype)
    forward_alone = isinstance(tyre, tyres.MFTyre) and dtype == jnp.float32
    value, change, finite = (*forward(tyre, at), True) if forward_alone else with_slopes(tyre, at)
    assert value.dtype == dtype and np.isfinite(value).all()
    assert change.dtype == dtype and np.isfinite(change).all()
    assert finite


@pytest.mark.full
@pytest.mark.parametrize("point", [(0.0, 0.0), (0.2, -1.0)])
@pytest.mark.parametrize("load", [LOAD, 0.0, -100.0])
def test_mf_tyre_s_reverse_gradients_are_finite_in_float32(point, load):
    assert with_slopes(statespace.cast(mf_tyre(), jnp.float32), contact(*point, load, jnp.float32))[2]


@pytest.mark.parametrize("name", those(load=True))
def test_forces_vanish_with_the_load(name):
    tyre = LAWS[name].make()
    for slips in ((0.2, 0.1), (1e-5, -1e-5)):
        for none in (0.0, -100.0):
            assert np.all(np.abs(vector(tyre, contact(*slips, none))) == 0.0)
    small, whole = vector(tyre, contact(0.2, 0.1, 1.0)), vector(tyre, contact(0.2, 0.1))
    assert np.hypot(*small[:2]) < 1e-3 * np.hypot(*whole[:2])


@pytest.mark.parametrize("name", those(load=True))
def test_a_load_that_is_needed_and_not_given_raises(name):
    with pytest.raises(InputError, match=r"contact\.load = None"):
        LAWS[name].make().forces(Contact(slip_angle=0.1, slip_ratio=0.1, speed=20.0))


def test_signs_are_those_of_the_package(law, tyre):
    forces = lambda *slips: Forces(*vector(tyre, contact(*slips)))
    if law.lateral:
        assert forces(0.03).F_y > 0 > forces(-0.03).F_y
    # The trail turns the wheel towards its course; outside of any program, too.
    assert float(tyre.forces(contact(0.03)).M_z) <= 0
    if law.combined:
        assert forces(0.0, 0.03).F_x > 0 > forces(0.0, -0.03).F_x
    else:
        assert forces(0.1, 0.2) == forces(0.1, 0.0)


ANGLES, RATIOS, LOADS = st.floats(-1.2, 1.2), st.floats(-1.0, 1.0), st.floats(0.0, 9000.0)


@pytest.mark.parametrize("name", BOUNDED)
@settings(max_examples=40, deadline=None, derandomize=True)
@given(ANGLES, RATIOS, LOADS, st.floats(0.0, 1.0))
def test_friction_bounds_the_force(name, angle, ratio, load, friction):
    F_x, F_y, *_ = vector(LAWS[name].make(), contact(angle, ratio, load, friction=friction))
    # Forces and slips whose squares underflow have no direction.
    assert np.hypot(F_x, F_y) <= LAWS[name].bound * friction * load * (1 + 1e-12) + 1e-100


@pytest.mark.whole
@pytest.mark.parametrize("name", BOUNDED)
def test_no_force_jumps_where_a_tyre_begins_to_slide_nor_exceeds_its_friction(name):
    """Turned, braked, and both: between slips a quarter as far apart a force changes a quarter as much, but for a jump."""
    slips, zeros = np.linspace(0.0, 1.2, 4001), np.zeros(4001)
    angles, ratios = np.stack([slips, zeros, slips]), np.stack([zeros, slips, slips])
    forces = LAWS[name].make().forces(contact(angles, ratios, np.full(angles.shape, LOAD)))
    assert np.max(np.hypot(forces.F_x, forces.F_y)) <= LAWS[name].bound * LOAD * (1 + 1e-12)
    for part in forces:
        along = np.broadcast_to(part, angles.shape)
        near, far = (np.abs(np.diff(along[:, ::step])).max(axis=1) for step in (1, 4))
        assert np.all(near <= 0.6 * far)


@pytest.mark.parametrize("name", those(symmetric=True))
@settings(max_examples=40, deadline=None, derandomize=True)
@given(ANGLES, RATIOS, LOADS)
def test_a_mirror_turns_the_force(name, angle, ratio, load):
    tyre = LAWS[name].make()
    F_x, F_y, M_x, M_y, M_z = vector(tyre, contact(angle, ratio, load))
    mirrored = vector(tyre, contact(-angle, ratio, load))
    np.testing.assert_allclose(mirrored, [F_x, -F_y, -M_x, M_y, -M_z], atol=1e-9)


def test_friction_counts_where_it_should(law, tyre):
    far, icy = vector(tyre, contact(0.3, 0.2)), vector(tyre, contact(0.3, 0.2, friction=0.4))
    share = np.hypot(*icy[:2]) / np.hypot(*far[:2])
    if law.friction:
        assert 0.3 < share < 0.7
    else:
        assert share == 1.0


@pytest.mark.parametrize("name", those(friction=True))
def test_without_friction_there_is_no_force_and_gradients_are_finite(name):
    tyre, at = LAWS[name].make(), contact(0.3, 0.2, friction=0.0)
    # Rolling resistance (M_y) is the tyre's, not the road's.
    value, _, finite = with_slopes(tyre, at)
    assert np.all(np.delete(value, 3) == 0.0)
    assert finite


# Zero, or far from it for the step of a difference: slopes may turn within that step of zero slip (they are one-sided there).
SLIPS = st.floats(-0.5, 0.5).filter(lambda slip: slip == 0 or abs(slip) > 1e-4)


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=25, deadline=None, derandomize=True)
@given(SLIPS, SLIPS, st.floats(500.0, 9000.0))
def test_gradients_equal_differences(name, angle, ratio, load):
    tyre = LAWS[name].make()
    x, steps, scale = np.array([angle, ratio, load]), np.array([1e-7, 1e-7, 1e-3]), np.array([1e5, 1e5, 1.0])
    here = vector(tyre, contact(*x))
    ahead = np.stack([vector(tyre, contact(*(x + h))) for h in np.diag(steps)], axis=1)
    behind = np.stack([vector(tyre, contact(*(x - h))) for h in np.diag(steps)], axis=1)
    sides = [(ahead - here[:, None]) / steps, (here[:, None] - behind) / steps, (ahead - behind) / (2 * steps)]
    exact = slopes(jnp.asarray(x), tyre)
    # At a kink (the limit of friction) the derivative is that of one side.
    error = np.min([np.abs(exact - side) / scale for side in sides], axis=0)
    assert np.max(error) < 2e-5


def positive_parameters(name):
    """The fields of its own that must be positive: none of MF-Tyre, nor of what is made of other laws."""
    fields = dataclasses.fields(LAWS[name].make())
    return [field for field in fields if isinstance(field.metadata.get("domain"), Positive)]


MADE_OF_OTHERS = ("FrictionEllipse", "LongitudinalLaw", "MF-Tyre", "Mirrored")


@pytest.mark.parametrize("name", LAWS)
def test_every_law_but_those_made_of_others_has_a_positive_parameter(name):
    assert bool(positive_parameters(name)) == (name not in MADE_OF_OTHERS)


@pytest.mark.parametrize("name", [name for name in LAWS if name not in MADE_OF_OTHERS])
def test_bad_parameters_are_named(name):
    tyre = LAWS[name].make()
    for field in positive_parameters(name):
        for bad in (-1.0, 0.0, np.inf):
            if getattr(tyre, field.name) is None:
                continue
            with pytest.raises(InputError, match=rf"{type(tyre).__name__}\.{field.name} = {bad}: must be positive"):
                dataclasses.replace(tyre, **{field.name: bad})


@pytest.mark.parametrize(
    "name", ["Brush", "Dugoff", "Fiala", "FialaADAMS", "FialaPolynomial", "HSRI", "Linear", "Parabolic", "UniTire"]
)
def test_stiffnesses_are_the_slopes_at_zero(name):
    tyre = LAWS[name].make()
    along = lambda ratio, tyre: tyre.forces(contact(0.0, ratio)).F_x
    both = jax.jit(lambda tyre, at: (tyres.cornering_stiffness(tyre, at), jax.grad(along)(at.slip_ratio, tyre)))
    np.testing.assert_allclose(both(tyre, contact()), [60000.0, 80000.0])


def test_fiala_without_longitudinal_force_is_the_brush():
    brush, fiala = LAWS["Brush"].make(), LAWS["Fiala"].make()
    for angle in (0.01, 0.1, 0.17, 0.3):
        np.testing.assert_allclose(vector(fiala, contact(angle)), vector(brush, contact(angle)), rtol=1e-12)


def test_fading_lowers_the_friction_and_needs_a_speed():
    steady, fading = LAWS["Dugoff"].make(), LAWS["Dugoff, fading"].make()
    # 20 m/s times tan(0.5) of sliding, a hundredth a m/s.
    share = vector(fading, contact(0.5))[1] / vector(steady, contact(0.5))[1]
    assert 1 - 0.01 * 20 * np.tan(0.5) < share < 0.92
    with pytest.raises(InputError, match="contact.speed = None"):
        fading.forces(Contact(slip_angle=0.1, load=LOAD))


def test_what_is_wrong_for_an_argument_is_named():
    """Of every law, and of the coefficients in it: one of each class."""
    seen = set()
    for line in LAWS.values():
        families.refuses_everywhere(line.law if hasattr(line, "law") else line.make(), seen)
    assert {"MagicFormula", "MFTyre", "TMeasy", "Scaling"} <= {kind.__name__ for kind in seen}
