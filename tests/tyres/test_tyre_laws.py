"""Every tyre law: known values, symmetry, smoothness at zero slip, precision, gradients, bad input."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, vehicles
from jaxveh.statespace import cast
from jaxveh.tyres import Contact, Linear, MagicFormula, cornering_stiffness

pytestmark = pytest.mark.product

LAWS = {
    "linear": lambda: Linear(80e3),
    "magic": lambda: MagicFormula(B=10.0, C=1.4, D=5000.0, E=-0.8),
    "magic, E above 1": lambda: MagicFormula(B=14.1636, C=1.6, D=5609.0, E=1.0073),
    "magic, by load": lambda: MagicFormula(B=10.0, C=1.4, D=5000.0, E=-0.8, nominal_load=4000.0),
}


def lateral(tyre, slip, load=3000.0, **more):
    return tyre.forces(Contact(slip_angle=jnp.asarray(slip), load=jnp.asarray(load), **more)).F_y


@pytest.fixture(params=LAWS, ids=str)
def tyre(request):
    return LAWS[request.param]()


def test_positive_slip_gives_positive_force(tyre):
    assert lateral(tyre, 0.05) > 0


def test_mirrored_slip_gives_the_mirrored_force(tyre):
    slips = np.linspace(0.0, 1.5, 40)
    np.testing.assert_allclose(lateral(tyre, -slips), -lateral(tyre, slips), rtol=1e-14)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
def test_zero_slip_is_a_smooth_point(tyre, dtype, derivative):
    tyre = cast(tyre, dtype)
    contact = Contact(slip_angle=jnp.zeros((), dtype), load=jnp.asarray(3000, dtype))
    force = tyre.forces(contact).F_y
    assert force.dtype == dtype
    assert force == 0
    by_both = derivative(lambda t, a: t.forces(contact._replace(slip_angle=a)).F_y, (0, 1))
    by_tyre, by_slip = jax.jit(by_both)(tyre, contact.slip_angle)
    assert by_slip > 0
    for leaf in jax.tree.leaves(by_tyre):
        assert leaf.dtype == dtype
        assert np.isfinite(leaf)


def test_gradients_equal_finite_differences(tyre):
    contact = Contact(slip_angle=jnp.asarray(0.07), load=jnp.asarray(3500.0), friction=jnp.asarray(0.9))
    leaves, tree = jax.tree.flatten((tyre, contact))
    start = np.array([float(leaf) for leaf in leaves])
    steps = 1e-5 * np.maximum(np.abs(start), 0.1)

    def force(values):
        t, c = jax.tree.unflatten(tree, list(values))
        return jnp.asarray(t.forces(c).F_y)

    both = jax.jit(jax.value_and_grad(force))
    gradient = both(start)[1]
    for i, step in enumerate(steps):
        up, down = (float(both(start + sign * step * (np.arange(start.size) == i))[0]) for sign in (1, -1))
        expected = (up - down) / (2 * step)
        np.testing.assert_allclose(gradient[i], expected, rtol=1e-5, atol=1e-5)


def test_a_batch_equals_single_points(tyre):
    slips = jnp.linspace(-0.3, 0.3, 7)
    batch = jax.jit(lambda a: lateral(tyre, a))(slips)
    np.testing.assert_allclose(batch, jax.vmap(lambda a: lateral(tyre, a))(slips), rtol=1e-14)
    np.testing.assert_allclose(batch, [float(lateral(tyre, float(a))) for a in slips], rtol=1e-12)


def test_the_slope_at_zero_slip_is_the_cornering_stiffness(tyre):
    load = 4000.0  # the nominal load of the law that has one
    slope = cornering_stiffness(tyre, Contact(load=jnp.asarray(load)))
    np.testing.assert_allclose(slope, tyre.cornering_stiffness, rtol=1e-12)


def test_magic_formula_equals_the_book():
    B, C, D, E, S_h, S_v = 9.0, 1.5, 6000.0, -0.4, 0.003, 40.0
    tyre = MagicFormula(B, C, D, E, S_h, S_v)
    for slip in (-0.4, -0.02, 0.0, 0.01, 0.12, 0.8):
        x = B * (slip + S_h)
        expected = D * math.sin(C * math.atan(x - E * (x - math.atan(x)))) + S_v
        np.testing.assert_allclose(lateral(tyre, slip), expected, rtol=1e-13)


def test_magic_formula_limit_at_large_slip_is_D_sin_of_C_quarter_turns():
    tyre = MagicFormula(B=10.0, C=1.4, D=5000.0, E=-0.8)
    np.testing.assert_allclose(lateral(tyre, 1e9), 5000 * math.sin(1.4 * math.pi / 2), rtol=1e-8)


@pytest.mark.parametrize(
    "coefficients", [(10.0, 1.4, 5000.0, -0.8), (14.1636, 1.6, 5609.0, 1.0073), (8.0, 0.9, 4e3, 0.5)]
)
def test_peak_is_the_largest_force(coefficients):
    tyre = MagicFormula(*coefficients)
    largest = np.max(lateral(tyre, np.linspace(0.0, 3.0, 30_001)))
    assert largest <= tyre.peak * (1 + 1e-12)
    if coefficients[1] >= 1:
        np.testing.assert_allclose(tyre.peak, largest, rtol=1e-6)
    else:
        np.testing.assert_allclose(tyre.peak, lateral(tyre, 1e12), rtol=1e-9)


def test_force_scales_with_friction_and_vanishes_with_load():
    tyre = MagicFormula(B=10.0, C=1.4, D=5000.0, E=-0.8, S_v=100.0, nominal_load=4000.0)
    full = lateral(tyre, 0.1, load=4000.0)
    np.testing.assert_allclose(lateral(tyre, 0.1, load=2000.0), full / 2, rtol=1e-14)
    np.testing.assert_allclose(lateral(tyre, 0.1, load=4000.0, friction=0.3), 0.3 * full, rtol=1e-14)
    for load in (0.0, -500.0):
        assert lateral(tyre, 0.1, load=load) == 0
    assert np.isfinite(jax.grad(lambda load: lateral(tyre, 0.1, load=load))(-500.0))


def test_a_load_that_is_needed_and_not_given_raises():
    tyre = MagicFormula(B=10.0, C=1.4, D=5000.0, E=0.0, nominal_load=4000.0)
    with pytest.raises(InputError, match=r"contact\.load = None"):
        tyre.forces(Contact(slip_angle=jnp.asarray(0.1)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MagicFormula(B=-1.0, C=1.4, D=5000.0, E=0.0), r"MagicFormula\.B = -1\.0: must be positive"),
        (lambda: MagicFormula(B=10.0, C=0.0, D=5000.0, E=0.0), r"MagicFormula\.C = 0\.0: must be positive"),
        (lambda: MagicFormula(B=10.0, C=1.4, D=math.inf, E=0.0), r"MagicFormula\.D = inf: must be positive and finite"),
        (lambda: MagicFormula(B=10.0, C=1.4, D=5e3, E=math.nan), r"MagicFormula\.E = nan: must be finite"),
        (lambda: MagicFormula(B=10.0, C=1.4, D=5e3, E=0.0, nominal_load=0.0), r"nominal_load = 0\.0: must be positive"),
        (lambda: Linear(-80e3), r"Linear\.cornering_stiffness = -80000\.0"),
    ],
)
def test_bad_coefficients_raise_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_the_papers_cornering_stiffnesses_are_88_and_127_kilonewton_per_radian():
    car = vehicles.passenger_car()
    np.testing.assert_allclose(car.front.cornering_stiffness, 88.15e3, rtol=1e-4)
    np.testing.assert_allclose(car.rear.cornering_stiffness, 127.11e3, rtol=1e-4)
