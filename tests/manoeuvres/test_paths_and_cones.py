"""Paths: their geometry. Cones: the courses of ISO 3888, and the clearance of a body that is driven through them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from simple_cars import clearance

from jaxveh import InputError, manoeuvres
from jaxveh.manoeuvres import Circle, LaneChanges, Sine, Straight
from jaxveh.statespace import cast

pytestmark = pytest.mark.product

PATHS = {
    "Circle, left": lambda: Circle(30.0),
    "Circle, right": lambda: Circle(-30.0),
    "LaneChanges": lambda: LaneChanges(3.5, -3.2, 20.0, 50.0, 60.0, 95.0),
    "Sine": lambda: Sine(1.5, 36.0, 10.0, 3.0),
    "Straight": lambda: Straight(0.5),
}


@pytest.fixture(params=PATHS)
def path(request):
    return PATHS[request.param]()


def point(path, s):
    """The path's point at the distance s from where it begins, found by its own preview in small steps."""

    def step(place, _):
        x, y, heading = place
        target = path.preview(x, y, heading, s / 2000)
        cosine, sine = jnp.cos(heading), jnp.sin(heading)
        x = x + target.ahead * cosine - target.left * sine
        y = y + target.ahead * sine + target.left * cosine
        return (x, y, path.beside(x, y).heading), None

    start = (jnp.asarray(0.0), path.y(0.0) if hasattr(path, "y") else jnp.asarray(0.0), jnp.asarray(0.0))
    return jax.lax.scan(step, start, None, length=2000)[0]


def test_preview_stays_on_the_path_and_goes_the_distance(path):
    for s in (15.0, 40.0, 80.0):
        x, y, heading = jax.jit(point)(path, s)
        beside = path.beside(x, y)
        np.testing.assert_allclose(beside.left, 0.0, atol=1e-12)
        near = jax.jit(point)(path, s + 0.01)
        np.testing.assert_allclose(np.hypot(near[0] - x, near[1] - y), 0.01, rtol=1e-3)
        np.testing.assert_allclose(
            np.arctan2(near[1] - y, near[0] - x), np.arctan2(np.sin(heading), np.cos(heading)), atol=1e-3
        )


def test_a_place_is_left_by_as_much_as_it_is_moved(path):
    x, y, heading = jax.jit(point)(path, 40.0)
    for left in (-1e-3, 2e-3):
        moved = path.beside(x - left * jnp.sin(heading), y + left * jnp.cos(heading))
        np.testing.assert_allclose(moved.left, left, rtol=1e-3)


def test_preview_turns_with_the_direction(path):
    x, y, _ = jax.jit(point)(path, 30.0)
    ahead, left = path.preview(x, y + 0.3, 0.0, 9.0)
    turned = path.preview(x, y + 0.3, np.pi / 2, 9.0)
    np.testing.assert_allclose([turned.ahead, turned.left], [left, -ahead], atol=1e-12)


def test_preview_is_smooth_finite_and_keeps_its_precision(path):
    x = np.linspace(-5.0, 120.0, 26)
    preview = lambda path, x: jnp.stack(
        path.preview(x, 0.1 * jnp.ones_like(x), 0.2 * jnp.ones_like(x), 8.0 * jnp.ones_like(x))
    )

    @jax.jit
    def everything(path, x):
        gradients = jax.grad(lambda path, x: jnp.sum(preview(path, x)), argnums=(0, 1))(path, x)
        single = preview(cast(path, jnp.float32), x.astype(jnp.float32))
        return preview(path, x), gradients, single, jax.vmap(lambda x: preview(path, x), out_axes=1)(x)

    seen, gradients, single, mapped = everything(path, x)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradients))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, seen, atol=2e-4)
    np.testing.assert_allclose(mapped, seen, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["LaneChanges", "Sine", "Straight"])
def test_graphs_have_a_continuous_curvature(name):
    path = PATHS[name]()
    curve = jax.jit(jax.vmap(jax.grad(jax.grad(path.y))))
    jumps = [np.max(np.abs(np.diff(curve(np.linspace(-5.0, 130.0, n))))) for n in (5001, 20001)]
    assert np.isfinite(jumps).all() and jumps[1] <= 0.3 * jumps[0]


def test_circles_leave_the_origin_along_x_and_bend_their_way():
    @jax.jit
    def seen(circle, radius):
        gradients = jax.grad(lambda y, c: sum(c.preview(0.0, y, 0.0, 5.0)), argnums=(0, 1))(radius, circle)
        return circle.preview(0.0, 0.0, 0.0, 30 * np.pi / 2), circle.beside(0.0, radius / 10), gradients

    for radius in (30.0, -30.0):
        target, inside, gradients = seen(Circle(radius), radius)
        np.testing.assert_allclose([target.ahead, target.left], [30.0, radius], rtol=1e-12)
        np.testing.assert_allclose([inside.left, inside.heading], [radius / 10, 0.0], atol=1e-12)
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradients))


def test_sine_passes_cones_on_alternating_sides():
    sine = Sine(1.5, 36.0, 10.0, 3.0)
    peaks = 10.0 + 36.0 * np.array([0.75, 1.25, 1.75, 2.25])
    np.testing.assert_allclose(sine.y(jnp.asarray(peaks)), [-1.5, 1.5, -1.5, 1.5], rtol=1e-12)
    np.testing.assert_allclose(sine.y(jnp.array([0.0, 10.0, 118.0, 130.0])), 0.0, atol=1e-12)


# Courses


@pytest.mark.parametrize("count", [2, 5, 6])
def test_the_slaloms_path_passes_every_cone_at_its_whole_amplitude(count):
    driver = manoeuvres.slalom_course(14.0, count=count)
    course = manoeuvres.slalom_cones(count=count)
    x = np.linspace(0.0, 14.0 * driver.duration, 5001)
    y, slope = jax.jit(jax.vmap(jax.value_and_grad(driver.path.y)))(x)
    beside = eqx.filter_jit(driver.path.y)(np.array([lane.start for lane in course.lanes]))
    np.testing.assert_allclose(beside, -1.5 * (-1.0) ** np.arange(count), rtol=1e-12)
    # A short body that follows the path exactly has what is left of the amplitude beside each cone.
    for lane in course.lanes:
        one = manoeuvres.Course("one", (lane,))
        left, _ = clearance(x, y, np.arctan(slope), 1.8, 0.1, one)
        np.testing.assert_allclose(left, 1.5 - 0.9 - 0.15, atol=2e-3)
    assert driver.path.y(jnp.asarray(x[-1])) == 0


def test_a_slalom_has_one_cone_in_each_place_and_both_sides_are_told_apart():
    course = manoeuvres.slalom_cones(10.0, 3, 5.0)
    np.testing.assert_allclose(manoeuvres.cones(course), [[20.0, 0.0], [30.0, 0.0], [40.0, 0.0]], atol=1e-12)
    x, y, yaw = straight(-1.5)
    first, second, third = (manoeuvres.Course("one", (lane,)) for lane in course.lanes)
    np.testing.assert_allclose(clearance(x, y, yaw, 1.8, 4.5, first)[0], 0.45, rtol=1e-12)
    np.testing.assert_allclose(clearance(x, y, yaw, 1.8, 4.5, second)[0], -1.5 - 0.9 - 0.15, rtol=1e-12)
    assert clearance(x, y, yaw, 1.8, 4.5, third)[1]


def test_the_usual_steady_circle_asks_for_what_a_tyre_can_give():
    driver = manoeuvres.steady_circle()
    speeds = eqx.filter_jit(driver.speed.v_x)(np.linspace(0.0, driver.duration, 101))
    assert 5.0 < np.max(speeds) ** 2 / 40.0 < 7.5


def test_iso_3888_1_has_its_sections_widths_and_offset():
    first, second, third = manoeuvres.iso_3888_1(2.0, start=10.0).lanes
    assert (first.start, first.end, second.start, second.end, third.start, third.end) == (10, 25, 55, 80, 105, 135)
    np.testing.assert_allclose([lane.left - lane.right for lane in (first, second, third)], [2.45, 2.65, 2.85])
    assert first.centre == 0
    np.testing.assert_allclose([second.right - first.right, third.right - first.right], [3.5, 0.0])


@pytest.mark.parametrize(("width", "third_width"), [(1.6, 3.0), (2.2, 3.11)])
def test_iso_3888_2_has_its_sections_widths_and_offset(width, third_width):
    first, second, third = manoeuvres.iso_3888_2(width, start=0.0).lanes
    assert (first.start, first.end, second.start, second.end, third.start, third.end) == (0, 12, 25.5, 36.5, 49, 61)
    widths = [lane.left - lane.right for lane in (first, second, third)]
    np.testing.assert_allclose(widths, [1.1 * width + 0.25, width + 1, third_width])
    np.testing.assert_allclose([second.right - first.left, third.left - first.left], [1.0, 0.0], atol=1e-12)


def test_cones_touch_the_limits_from_outside_and_stand_at_the_ends():
    course = manoeuvres.iso_3888_1(1.8)
    places = manoeuvres.cones(course, spacing=5.0, diameter=0.4)
    for lane in course.lanes:
        for side in (lane.right - 0.2, lane.left + 0.2):
            row = places[np.isclose(places[:, 1], side) & (places[:, 0] >= lane.start) & (places[:, 0] <= lane.end), 0]
            assert row[0] == lane.start and row[-1] == lane.end and 0 < np.max(np.diff(row)) <= 5.0
    assert len(places) == 2 * (4 + 6 + 7)


def test_the_centre_line_runs_through_the_middle_of_the_lanes():
    course = manoeuvres.iso_3888_1(1.8)
    line = manoeuvres.centre_line(course, lead=4.0)
    for lane in course.lanes:
        middle = (lane.start + lane.end) / 2
        np.testing.assert_allclose(line.y(middle), lane.centre, atol=1e-12)


def straight(y, count=2001, ends=(0.0, 200.0)):
    x = np.linspace(*ends, count)
    return x, np.full(count, y), np.zeros(count)


COURSE = manoeuvres.Course(
    "two gates", (manoeuvres.Lane(50.0, 60.0, -1.5, 1.5), manoeuvres.Lane(100.0, 120.0, -1.2, 2.0))
)


def test_clearance_of_a_straight_drive_is_what_is_left_beside_the_body():
    for y, left in ((0.0, 0.3), (0.25, 0.35), (1.0, -0.4), (-0.5, -0.2)):
        found, passes = clearance(*straight(y), 1.8, 4.5, COURSE)
        np.testing.assert_allclose(found, left, rtol=1e-12)
        assert bool(passes) == (left > 0)


def test_clearance_sees_the_corners_and_the_sides_of_a_body_that_stands_askew():
    x, y, yaw = straight(0.0)
    width, length, angle = 1.0, 4.0, 0.1
    corner = length / 2 * np.sin(angle) + width / 2 * np.cos(angle)
    wide, _ = clearance(x, y, yaw + angle, width, length, COURSE)
    np.testing.assert_allclose(wide, min(1.5, 1.2) - corner, rtol=1e-12)
    # Only the flank passes a short gate while no corner is in it.
    gate = manoeuvres.Course("short", (manoeuvres.Lane(50.0, 50.1, -1.5, 1.5),))
    x = np.array([0.0, 50.05, 200.0])
    flank, _ = clearance(x, 0 * x, np.array([0.0, angle, 0.0]), width, length, gate)
    np.testing.assert_allclose(flank, 1.5 - (width / 2 / np.cos(angle) + 0.05 * np.tan(angle)), rtol=1e-12)


def test_clearance_counts_the_overhang():
    x, y, yaw = straight(0.0)
    ahead, _ = clearance(x, y, yaw + 0.1, 1.0, 4.0, COURSE, centre=0.5)
    front, rear = (reach * np.sin(0.1) + 0.5 * np.cos(0.1) for reach in (2.5, 1.5))
    np.testing.assert_allclose(ahead, min(1.5 - front, 1.2 - rear), rtol=1e-12)
    back, _ = clearance(x, y, yaw + 0.1, 1.0, 4.0, COURSE, centre=-0.5)
    np.testing.assert_allclose(back, min(1.5 - rear, 1.2 - front), rtol=1e-12)


def test_a_drive_that_ends_before_the_course_does_not_pass():
    for ends in ((0.0, 110.0), (55.0, 200.0)):
        left, passes = clearance(*straight(0.0, ends=ends), 1.8, 4.5, COURSE)
        assert left == -np.inf and not passes


def test_clearance_has_finite_gradients():
    x, y, yaw = straight(0.1)
    left = lambda y, yaw: manoeuvres.clearance(x, y, yaw, 1.8, 4.5, COURSE)
    gradient = jax.jit(jax.grad(left, argnums=(0, 1)))(y, yaw)
    assert all(np.isfinite(leaf).all() for leaf in gradient)
    np.testing.assert_allclose(np.sum(gradient[0]), 1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Circle(0.0), r"Circle\.radius = 0\.0: must be other than 0 m"),
        (lambda: Sine(1.0, -3.0), r"Sine\.wavelength = -3\.0: must be positive"),
        (lambda: Sine(1.0, 3.0, periods=0.5), r"Sine\.periods = 0\.5: must be at least 1"),
        (lambda: LaneChanges(3.0, -3.0, 5.0, 5.0, 9.0, 12.0), r"over_to - over_from = 0\.0: must be positive"),
        (lambda: Straight(float("inf")), r"Straight\.left = inf: must be finite"),
        (lambda: manoeuvres.iso_3888_1(0.0), r"width = 0\.0: must be positive"),
        (lambda: manoeuvres.centre_line(manoeuvres.iso_3888_2(1.8), 6.0), r"lead = 6\.0: must be between 0 and .* 5\.5 m"),
        (lambda: manoeuvres.centre_line(COURSE, 1.0), r"course = two gates: 2 lanes; must have 3"),
        (lambda: manoeuvres.cones(COURSE, spacing=0.0), r"spacing = 0\.0: must be positive"),
        (lambda: manoeuvres.clearance(0.0, 0.0, 0.0, -1.0, 4.0, COURSE), r"width = -1\.0: must be positive"),
        (lambda: manoeuvres.slalom_cones(diameter=0.0), r"diameter = 0\.0: must be positive"),
        (lambda: manoeuvres.slalom_course(15.0, count=1), r"count = 1: must be a whole number of at least 2"),
        (lambda: manoeuvres.iso_lane_change(0.0), r"speed = 0\.0: must be positive"),
    ],
)  # fmt: skip
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()
