"""TMeasy: the numbers of its curves are where they say, between loads and directions, and the form is smooth."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError
from jaxveh.tyres import Contact, TMeasy, TMeasyCurve, TMeasyTrail

N = 3000.0
X1, X2 = TMeasyCurve(90e3, 0.11, 3300.0, 0.40, 3200.0), TMeasyCurve(160e3, 0.12, 6000.0, 0.45, 5700.0)
Y1, Y2 = TMeasyCurve(75e3, 0.16, 3100.0, 0.60, 3000.0), TMeasyCurve(120e3, 0.18, 5500.0, 0.70, 5400.0)
TRAIL = TMeasyTrail(0.035, 0.20, 0.45)
TYRE = TMeasy(X1, Y1, N, X2, Y2, TRAIL)


def contact(s_x=0.0, s_y=0.0, load=N, friction=1.0):
    """The contact of theoretical slips."""
    return Contact(
        jnp.arctan(jnp.asarray(s_y / (1 - s_x))), jnp.asarray(s_x / (1 - s_x)), jnp.asarray(load), 0.0, friction
    )


def along(direction, slip, load=N, friction=1.0):
    forces = TYRE.forces(contact(*((slip, 0.0) if direction == "F_x" else (0.0, slip)), load, friction))
    return float(getattr(forces, direction))


@pytest.mark.parametrize(
    ("direction", "load", "curve"), [("F_x", N, X1), ("F_y", N, Y1), ("F_x", 2 * N, X2), ("F_y", 2 * N, Y2)]
)
@pytest.mark.parametrize("friction", [1.0, 0.5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_curves_numbers_at_both_loads(direction, load, curve, friction, sign):
    force = lambda slip: sign * along(direction, sign * slip, load, friction)
    np.testing.assert_allclose(force(1e-9) / 1e-9, curve.initial_stiffness, rtol=1e-6)
    peak, slide = friction * curve.s_max, friction * curve.s_slide
    np.testing.assert_allclose(force(peak), friction * curve.F_max, rtol=1e-12)
    np.testing.assert_allclose(force(slide), friction * curve.F_slide, rtol=1e-12)
    np.testing.assert_allclose(force(1.2 * slide), friction * curve.F_slide, rtol=1e-12)
    assert max(force(0.999 * peak), force(1.001 * peak)) < friction * curve.F_max


@pytest.mark.parametrize("slip", [0.02, 0.08, 0.159])
def test_the_rise_is_rills_rational_and_the_fall_a_cubic(slip):
    q = slip / 0.16
    expected = 75e3 * slip / (1 + q * (q + 75e3 * 0.16 / 3100.0 - 2))
    np.testing.assert_allclose(along("F_y", slip), expected, rtol=1e-12)
    t = slip / 0.16
    np.testing.assert_allclose(along("F_y", 0.16 + t * 0.44), 3100 - 100 * t**2 * (3 - 2 * t), rtol=1e-12)


@pytest.mark.parametrize("edge", [0.16, 0.60])
def test_the_curve_is_smooth_where_its_parts_meet(edge):
    slope = jax.jit(jax.grad(lambda s: TYRE.forces(Contact(jnp.arctan(s), load=N)).F_y))
    np.testing.assert_allclose([slope(edge - 1e-7), slope(edge + 1e-7)], 0.0, atol=0.1)


@pytest.mark.parametrize("load", [1000.0, 4500.0, 9000.0])
def test_between_loads_forces_follow_a_parabola_and_slips_a_line(load):
    r = load / N
    quadratic = lambda one, two: r * (2 * one - two / 2 - (one - two / 2) * r)
    peak = 0.16 + 0.02 * (r - 1)
    np.testing.assert_allclose(along("F_y", peak, load), quadratic(3100, 5500), rtol=1e-12)
    np.testing.assert_allclose(along("F_y", 0.9, load), quadratic(3000, 5400), rtol=1e-12)
    np.testing.assert_allclose(along("F_y", 1e-9, load) / 1e-9, quadratic(75e3, 120e3), rtol=1e-6)


def test_beyond_three_nominal_loads_forces_grow_with_the_load():
    np.testing.assert_allclose(along("F_y", 0.1, 4 * N), 4 / 3 * along("F_y", 0.1, 3 * N), rtol=1e-13)


def test_one_load_alone_is_proportional_to_it():
    tyre = TMeasy(X1, Y1, N)
    one, two = tyre.forces(contact(0.05, 0.05)), tyre.forces(contact(0.05, 0.05, 2 * N))
    np.testing.assert_allclose(two, [2 * value for value in one], rtol=1e-13)
    assert one.M_z == 0.0


def test_friction_scales_slips_and_forces_down_to_a_millionth():
    """Below, where slips are divided by no less, the forces alone."""
    for direction in ("F_x", "F_y"):
        for friction in (0.3, 1.1e-6):
            whole = along(direction, 0.08)
            np.testing.assert_allclose(
                along(direction, 0.08 * friction, friction=friction), friction * whole, rtol=1e-9
            )
        np.testing.assert_allclose(along(direction, 0.08e-6, friction=1e-7), 1e-7 * whole, rtol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.0, 1.3, math.pi / 2])
def test_combined_slip_is_rills(angle):
    bends = 3300 / 90e3 + 3100 / 75e3
    norm_x, norm_y = 0.11 / 0.27 + 3300 / 90e3 / bends, 0.16 / 0.27 + 3100 / 75e3 / bends
    cosine, sine = math.cos(angle), math.sin(angle)
    between = lambda x, y: math.hypot(x * cosine, y * sine)
    peak, slide = between(0.11 / norm_x, 0.16 / norm_y), between(0.40 / norm_x, 0.60 / norm_y)
    for slip, expected in ((peak, between(3300, 3100)), (slide, between(3200, 3000))):
        forces = TYRE.forces(contact(slip * cosine * norm_x, slip * sine * norm_y))
        np.testing.assert_allclose(forces[:2], [expected * cosine, expected * sine], rtol=1e-12, atol=1e-9)


def test_zero_slip_has_the_slope_of_each_direction():
    slopes = jax.jit(jax.jacfwd(lambda x: jnp.stack(TYRE.forces(Contact(x[0], x[1], N))[:2])))(np.zeros(2))
    np.testing.assert_allclose(slopes, [[0, 90e3], [75e3, 0]], rtol=1e-12)


def test_the_trail():
    lever = lambda slip: -float(TYRE.forces(contact(0.0, slip)).M_z) / along("F_y", slip)
    np.testing.assert_allclose(lever(1e-9), 0.035, rtol=1e-6)
    np.testing.assert_allclose(lever(0.20), 0.0, atol=1e-12)
    assert lever(0.1) > 0 > lever(0.3) > -0.035
    assert lever(0.45) == 0 == lever(0.8)
    mix, x = 0.20 / 0.45, 0.5
    expected = 0.035 * ((1 - mix) * (1 - x) + mix * (1 - (3 - 2 * x) * x**2))
    np.testing.assert_allclose(lever(0.1), expected, rtol=1e-12)
    np.testing.assert_allclose(lever(0.3), -0.035 * (1 - mix) * 0.5 * (0.15 / 0.25) ** 2, rtol=1e-12)
    slope = jax.grad(TRAIL)
    np.testing.assert_allclose(slope(0.2 - 1e-9), slope(0.2 + 1e-9), rtol=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TMeasyCurve(90e3, -0.11, 3300.0, 0.4, 3200.0), r"TMeasyCurve\.s_max = -0\.11: must be positive"),
        (lambda: TMeasyCurve(90e3, 0.11, 3300.0, 0.1, 3200.0), r"s_slide = 0\.1: must be greater than s_max"),
        (lambda: TMeasyCurve(90e3, 0.11, 3300.0, 0.4, 3400.0), r"F_slide = 3400\.0: must be at most F_max"),
        (
            lambda: TMeasyCurve(50e3, 0.11, 3300.0, 0.4, 3200.0),
            r"initial_stiffness = 50000\.0: must be at least 2 F_max",
        ),
        (lambda: TMeasyTrail(0.03, 0.3, 0.2), r"TMeasyTrail\.s_end = 0\.2.*: must be greater than s_zero"),
        (lambda: TMeasyTrail(0.0, 0.3, 0.4), r"TMeasyTrail\.start = 0\.0: must be positive"),
        (lambda: TMeasy(X1, Y1, 0.0), r"TMeasy\.nominal_load = 0\.0: must be positive"),
        (
            lambda: TMeasy(X1, Y1, N, X1),
            r"twice_longitudinal: initial_stiffness = 0\.0: must be positive.* 3 nominal loads",
        ),
        (
            lambda: TMeasy(X1, Y1, N, None, TMeasyCurve(120e3, 0.4, 5500.0, 0.7, 5400.0)),
            r"twice_lateral: s_max = -0\.08.*: must be positive.* 0 nominal loads",
        ),
    ],
)
def test_bad_numbers_are_named(make, message):
    with pytest.raises(InputError, match=message):
        make()


PARABOLAS = TMeasy(X1, Y1, N, X2, Y2, TRAIL, after_peak="parabolas")


def falling(curve):
    """Bend `a` of the first parabola, where it ends, and the bend of the second, by hand from value and slope."""
    a = curve.F_max**2 / (curve.initial_stiffness * curve.s_max**3)
    meet = curve.s_max + (curve.F_max - curve.F_slide) / (a * (curve.s_slide - curve.s_max))
    return float(a), float(meet), float(a * (meet - curve.s_max) / (curve.s_slide - meet))


@pytest.mark.parametrize(("direction", "curve"), [("F_x", X1), ("F_y", Y1)])
def test_two_parabolas_after_the_peak(direction, curve):
    def force(slip, tyre=PARABOLAS):
        return getattr(tyre.forces(contact(*((slip, 0.0) if direction == "F_x" else (0.0, slip)))), direction)

    bend, meet, second = falling(curve)
    assert curve.s_max < meet < curve.s_slide
    for slip in (0.3 * curve.s_max, 1.1 * curve.s_slide):
        assert float(force(slip)) == float(force(slip, TYRE))
    for slip in (curve.s_max, 0.5 * (curve.s_max + meet), meet - 1e-9):
        np.testing.assert_allclose(force(slip), curve.F_max - bend * (slip - curve.s_max) ** 2, rtol=1e-12)
    for slip in (meet + 1e-9, 0.5 * (meet + curve.s_slide), curve.s_slide):
        np.testing.assert_allclose(force(slip), curve.F_slide + second * (curve.s_slide - slip) ** 2, rtol=1e-12)
    # Value and slope meet at all three places, and the second derivative at the peak, which the cubic's does not.
    slope, turn = jax.jit(jax.grad(force)), jax.jit(jax.grad(jax.grad(force)))
    for edge in (curve.s_max, meet, curve.s_slide):
        np.testing.assert_allclose(force(edge - 1e-9), force(edge + 1e-9), rtol=1e-6)
        np.testing.assert_allclose(slope(edge - 1e-9), slope(edge + 1e-9), atol=1e-2)
    np.testing.assert_allclose(turn(curve.s_max - 1e-7), turn(curve.s_max + 1e-7), rtol=1e-3)
    cubic = jax.jit(jax.grad(jax.grad(lambda slip: force(slip, TYRE))))
    assert abs(cubic(curve.s_max - 1e-7) / cubic(curve.s_max + 1e-7) - 1) > 0.2


def test_parabolas_that_do_not_fit_are_the_cubic():
    """A steep fall: the first parabola would not be down at s_slide."""
    steep = TMeasyCurve(90e3, 0.11, 3300.0, 0.13, 1500.0)
    bend, meet, _ = falling(steep)
    assert bend > 0 and meet > steep.s_slide
    either = [TMeasy(steep, steep, N, after_peak=form) for form in ("parabolas", "cubic")]
    for slip in (0.05, 0.115, 0.12, 0.128, 0.2):
        one, other = (tyre.forces(contact(slip)).F_x for tyre in either)
        assert float(one) == float(other)
    with pytest.raises(InputError, match=r"TMeasy\.after_peak = 'line': must be one of 'cubic', 'parabolas'"):
        TMeasy(steep, steep, N, after_peak="line")
