"""Tyres made of tyres: combined slip, other loads and other roads from laws of pure slip."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxveh import estimators, sensors, statespace, tyres, vehicles
from jaxveh._core.errors import InputError
from jaxveh.tyres import Contact

pytestmark = pytest.mark.product

LOAD = 4000.0
PEAK_X, PEAK_Y = 1.1, 0.9


def lateral(S_h=0.0, S_v=0.0):
    return tyres.MagicFormula(10.0, 1.4, PEAK_Y * LOAD, -0.8, S_h, S_v, nominal_load=LOAD)


def longitudinal():
    return tyres.LongitudinalLaw(tyres.MagicFormula(12.0, 1.6, PEAK_X * LOAD, 0.3, nominal_load=LOAD))


def brush():
    return tyres.Brush(80000.0, 60000.0, 0.9)


TYRES = {
    "ellipse": lambda: tyres.FrictionEllipse(longitudinal(), lateral()),
    "ellipse of shifted laws": lambda: tyres.FrictionEllipse(longitudinal(), lateral(0.004, 60.0)),
    "similarity": lambda: tyres.Similarity(lateral(), LOAD, slip_stiffness_ratio=1.3),
    "similarity, degressive": lambda: tyres.Similarity(lateral(), LOAD, 5000.0, 1.3),
    "similarity, lateral": lambda: tyres.Similarity(lateral(), LOAD, 5000.0),
    "on a road": lambda: tyres.OnRoad(brush(), 0.5),
}
SYMMETRIC = [name for name in TYRES if "shifted" not in name]
SIMILAR = [name for name in TYRES if "similarity" in name]
LIMITS = {"ellipse": (PEAK_X, PEAK_Y), "on a road": (0.45, 0.45), **dict.fromkeys(SIMILAR, (PEAK_Y, PEAK_Y))}


@pytest.fixture(params=TYRES)
def tyre(request):
    return TYRES[request.param]()


def contact(slip_angle=0.0, slip_ratio=0.0, load=LOAD, friction=1.0, dtype=jnp.float64):
    number = lambda value: value if isinstance(value, jax.Array) else np.asarray(value, dtype)
    return Contact(number(slip_angle), number(slip_ratio), number(load), number(0.0), number(friction), number(20.0))


@jax.jit
def force_vector(tyre, at):
    return jnp.stack([jnp.asarray(value, at.load.dtype) for value in tyre.forces(at)])


def vector(tyre, at):
    return np.asarray(force_vector(tyre, at))


@jax.jit
def with_slopes(tyre, at):
    """The forces, their change when every coefficient and every input changes by one, and whether all reverse gradients of their
    sum are finite."""
    value, along = jax.linearize(force_vector, tyre, at)
    gradients = jax.linear_transpose(along, tyre, at)(jnp.ones_like(value))
    finite = jnp.all(jnp.stack([jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(gradients)]))
    return value, along(*jax.tree.map(jnp.ones_like, (tyre, at))), finite


slopes = jax.jit(jax.jacfwd(lambda x, tyre: force_vector(tyre, contact(*x))))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
@pytest.mark.parametrize("point", [(0.0, 0.0), (0.1, 0.0), (0.0, 0.1), (0.0, -1.0), (0.2, -1.0), (1.2, 2.0)])
@pytest.mark.parametrize(("load", "friction"), [(LOAD, 1.0), (0.0, 1.0), (-100.0, 1.0), (LOAD, 0.0)])
def test_values_and_gradients_are_finite(tyre, point, load, friction, dtype):
    tyre, at = statespace.cast(tyre, dtype), contact(*point, load, friction, dtype)
    value, change, finite = with_slopes(tyre, at)
    assert value.dtype == dtype and np.isfinite(value).all()
    assert (load == LOAD and friction > 0) or np.all(np.asarray(value) == 0.0)
    assert np.isfinite(change).all()
    assert finite


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_zero_slip_is_smooth(tyre, dtype):
    """The slopes at zero slip are those a small way from it, in every direction."""
    tyre, small = statespace.cast(tyre, dtype), 1e-3
    of_slips = jax.jit(
        jax.vmap(jax.jacfwd(lambda x, tyre: force_vector(tyre, contact(*x, dtype=dtype))[:2]), (0, None))
    )
    slips = [(0.0, 0.0), (small, 0.0), (-small, 0.0), (0.0, small), (0.0, -small), (small, -small)]
    here, *around = np.asarray(of_slips(np.asarray(slips, dtype), tyre))
    for there in around:
        np.testing.assert_allclose(there, here, rtol=0.03, atol=0.03 * np.max(np.abs(here)))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.floats(-1.2, 1.2), st.floats(-1.0, 2.0), st.floats(1.0, 9000.0), st.floats(0.0, 1.0), st.sampled_from(SYMMETRIC)
)
def test_friction_bounds_the_force_and_a_mirror_turns_it(angle, ratio, load, friction, name):
    tyre = TYRES[name]()
    F_x, F_y, _, _, M_z = vector(tyre, contact(angle, ratio, load, friction))
    along, across = LIMITS[name]
    assert np.hypot(F_x / along, F_y / across) <= friction * load * (1 + 1e-9)
    mirrored = vector(tyre, contact(-angle, ratio, load, friction))
    np.testing.assert_allclose(mirrored, [F_x, -F_y, 0, 0, -M_z], atol=1e-8)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.floats(-1.2, 1.2), st.floats(-1.0, 2.0), st.floats(0.0, 9000.0))
def test_pure_slip_is_the_wrapped_law(angle, ratio, load):
    for name in ("ellipse", "ellipse of shifted laws"):
        tyre, zero = TYRES[name](), contact(0.0, 0.0, load)
        across, along = contact(angle, 0.0, load), contact(0.0, ratio, load)
        offset = float(vector(tyre.across, zero)[1])
        np.testing.assert_allclose(vector(tyre, across), vector(tyre.across, across), rtol=1e-7, atol=1e-5)
        np.testing.assert_allclose(vector(tyre, along)[0], vector(tyre.along, along)[0], rtol=1e-7, atol=1e-5)
        np.testing.assert_allclose(vector(tyre, along)[1], offset, rtol=1e-12)
    for name in SIMILAR:
        at = contact(angle)
        np.testing.assert_allclose(vector(TYRES[name](), at), vector(lateral(), at), rtol=1e-7, atol=1e-5)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
    st.floats(500.0, 9000.0),
    st.floats(0.1, 1.0),
    st.sampled_from(sorted(TYRES)),
)
def test_gradients_equal_differences(angle, ratio, load, friction, name):
    tyre = TYRES[name]()
    x, steps = np.array([angle, ratio, load, friction]), np.array([2e-8, 2e-8, 1e-3, 1e-6])
    scale = np.array([1e5, 1e5, 1.0, 1e4])
    here = vector(tyre, contact(*x))
    ahead = np.stack([vector(tyre, contact(*(x + h))) for h in np.diag(steps)], axis=1)
    behind = np.stack([vector(tyre, contact(*(x - h))) for h in np.diag(steps)], axis=1)
    sides = [(ahead - here[:, None]) / steps, (here[:, None] - behind) / steps, (ahead - behind) / (2 * steps)]
    exact = slopes(jnp.asarray(x), tyre)
    # At a kink (the limit of friction, the turn from one side of a shifted law to the other) the derivative is one side's.
    error = np.min([np.abs(exact - side) / scale for side in sides], axis=0)
    assert np.max(error) < 2e-5


def test_the_ellipse_is_one():
    """With the laws at the whole slip as axes; a locked wheel is pushed against its sliding."""
    tyre = TYRES["ellipse"]()
    for angle, ratio in ((0.1, 0.05), (-0.3, -0.2), (0.2, -1.0)):
        s = np.hypot(ratio, np.tan(angle))
        axis_x = vector(tyre.along, contact(0.0, np.copysign(s, ratio)))[0]
        axis_y = vector(tyre.across, contact(np.arctan(s)))[1]
        F_x, F_y = vector(tyre, contact(angle, ratio))[:2]
        np.testing.assert_allclose((F_x / axis_x) ** 2 + (F_y / axis_y) ** 2, 1.0, rtol=1e-7)
        np.testing.assert_allclose((F_y / axis_y) / (F_x / axis_x), np.tan(angle) / ratio * np.sign(ratio), rtol=1e-7)


def test_similarity_keeps_the_stiffness_and_shrinks_the_peak():
    tyre, angles = TYRES["similarity, lateral"](), np.linspace(0.0, 1.5, 4000)
    stiffness = jax.jit(tyres.cornering_stiffness)
    reference = float(lateral().cornering_stiffness)
    for load, friction in ((LOAD, 1.0), (LOAD, 0.3), (2000.0, 1.0), (7000.0, 0.5)):
        at = contact(0.0, 0.0, load, friction)
        sine = lambda F_z: np.sin(2 * np.arctan(F_z / 5000.0))
        expected = reference * sine(load) / sine(LOAD)
        np.testing.assert_allclose(stiffness(tyre, at), expected, rtol=1e-9)
        peak = np.max(vector_of_angles(tyre, at, angles))
        np.testing.assert_allclose(peak, friction * load * PEAK_Y, rtol=1e-4)
        np.testing.assert_allclose(vector(tyre, at._replace(slip_ratio=np.asarray(0.3)))[:2], 0.0, atol=1e-12)


@jax.jit
def vector_of_angles(tyre, at, angles):
    return tyre.forces(at._replace(slip_angle=angles)).F_y


def test_similarity_of_a_brush_is_the_brush():
    """A brush is similar to itself, so that one curve of it gives every load, road and combined slip."""
    curve = tyres.Similarity(brush(), LOAD, slip_stiffness_ratio=80.0 / 60.0)
    for angle, ratio, load, friction in ((0.1, 0.02, LOAD, 1.0), (0.05, -0.1, 6000.0, 0.5), (0.2, 0.1, 1500.0, 0.8)):
        scaled = eqx.tree_at(
            lambda b: (b.slip_stiffness, b.cornering_stiffness), brush(),
            (jnp.asarray(80000.0 * load / LOAD), jnp.asarray(60000.0 * load / LOAD)),
        )  # fmt: skip
        at = contact(angle, ratio, load, friction)
        np.testing.assert_allclose(vector(curve, at)[:2], vector(scaled, at)[:2], rtol=1e-6)


def test_longitudinal_turns_a_law():
    law, tyre = lateral(), tyres.LongitudinalLaw(lateral())
    turned = vector(tyre, contact(0.3, 0.05))
    np.testing.assert_allclose(turned, [vector(law, contact(0.05))[1], 0, 0, 0, 0], rtol=1e-14)


class Told(tyres.AbstractTyre):
    """A law that keeps the contacts that it is handed."""

    handed: list = eqx.field(static=True)

    def forces(self, contact, state=None):
        self.handed.append(contact)
        return tyres.Forces(F_x=contact.slip_ratio * contact.load, F_y=contact.slip_angle * contact.load)


AT = Contact(0.03, 0.05, LOAD, 0.02, 0.8, 15.0, 2.4e5, 0.001, np.tan(0.03), 16.0, -1.0)
"""A contact of which every field tells."""


@pytest.mark.parametrize(
    ("wrap", "changed"),
    [
        (tyres.LongitudinalLaw, {"slip_angle": 0.05, "lateral_slip": None, "slip_ratio": 0.0, "camber": 0.0}),
        (
            lambda law: tyres.FrictionEllipse(law, lateral()),
            {"slip_angle": 0.0, "lateral_slip": None, "slip_ratio": ...},
        ),
        (
            lambda law: tyres.FrictionEllipse(lateral(), law),
            {"slip_ratio": 0.0, "slip_angle": ..., "lateral_slip": ...},
        ),
        (lambda law: tyres.OnRoad(law, 0.5), {"friction": 0.4}),
    ],
    ids=["LongitudinalLaw", "FrictionEllipse, along", "FrictionEllipse, across", "OnRoad"],
)
def test_a_law_inside_is_handed_the_contact_but_for_what_is_its_wrapper_s(wrap, changed):
    """`...`: the slips of pure slip, which `test_ordinary_points.py` and the ellipse's own tests look at."""
    law = Told([])
    wrap(law).forces(jax.tree.map(jnp.asarray, AT))
    assert law.handed
    expected = {name: value for name, value in (AT._asdict() | changed).items() if value is not ...}
    for at in law.handed:
        for name, value in expected.items():
            given = getattr(at, name)
            assert (given is None) == (value is None), name
            if value is not None:
                np.testing.assert_allclose(given, value, rtol=1e-14, err_msg=name)


@pytest.mark.parametrize("law", [tyres.Linear(60000.0), lateral(), brush(), tyres.Dugoff(80000.0, 60000.0)])
def test_a_road_multiplies_the_contacts_friction(law):
    for friction in (1.0, 0.6):
        on_road = vector(tyres.OnRoad(law, 0.5), contact(0.2, 0.1, LOAD, friction))
        np.testing.assert_allclose(on_road, vector(law, contact(0.2, 0.1, LOAD, 0.5 * friction)), rtol=1e-14)
    slippery = vector(tyres.OnRoad(law, 0.5), contact(0.2))[1] / vector(law, contact(0.2))[1]
    assert slippery == 1.0 if isinstance(law, tyres.Linear) else slippery < 0.6


def test_the_roads_friction_can_be_estimated():
    car = vehicles.passenger_car()
    car = eqx.tree_at(lambda c: c.front, car, tyres.OnRoad(car.front, 0.7))
    model = estimators.state_space(car, sensors.esc(), estimate=lambda car: car.front.friction)
    assert model.chosen.parameters[0].name == "front.friction"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tyres.FrictionEllipse(lateral(), 3.0), "FrictionEllipse.across = [0-9.]+: must be a tyre"),
        (lambda: tyres.FrictionEllipse(None, lateral()), "FrictionEllipse.along = None: must be a tyre"),
        (lambda: tyres.LongitudinalLaw(80e3), "LongitudinalLaw.law = [0-9.]+: must be a tyre"),
        (lambda: tyres.OnRoad(lateral(), -0.5), "OnRoad.friction = -0.5: must be positive"),
        (
            lambda: tyres.OnRoad(tyres.Relaxed(lateral(), 0.1), 0.5),
            "OnRoad.tyre = Relaxed: must be a tyre without states",
        ),
        (lambda: tyres.Similarity(lateral(), 0.0), "Similarity.reference_load = 0.0: must be positive"),
        (lambda: tyres.Similarity(lateral(), LOAD, -1.0), "Similarity.stiffness_load = -1.0"),
        (lambda: tyres.Similarity("law", LOAD), "Similarity.tyre = 'law': must be a tyre"),
        (lambda: tyres.Similarity(lateral(), LOAD).forces(Contact(0.1)), "contact.load = None: Similarity"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_similar_forces_scale_with_friction_down_to_a_thousandth():
    """F(s; m) = m F(s / m; 1); below, where slips are divided by no less, the forces alone."""
    tyre = tyres.Similarity(lateral(), LOAD, 5000.0)
    force = lambda slip, friction: float(tyre.forces(contact(np.arctan(slip), friction=friction)).F_y)
    for friction in (0.4, 1.1e-3):
        np.testing.assert_allclose(force(0.05 * friction, friction), friction * force(0.05, 1.0), rtol=1e-9)
    np.testing.assert_allclose(force(0.05e-3, 1e-4), 1e-4 * force(0.05, 1.0), rtol=1e-9)
