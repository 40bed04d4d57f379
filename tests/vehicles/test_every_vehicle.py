"""What holds for every vehicle, each in turn: a new one is a line in `CARS` that says what it can do.

Vehicles are evaluated without `jit` wherever one or two looks are enough: compiling one takes as long as a hundred looks.
"""

import dataclasses
import functools
import zlib
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import families
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import left_out
from four_wheel_cars import drive as driven
from jax.flatten_util import ravel_pytree

from jaxveh import InputError, Recording, estimators, manoeuvres, simulation, statespace, tyres, vehicles
from jaxveh._core.bijectors import Positive
from jaxveh._core.names import record
from jaxveh.roads import LEVEL, Ground
from jaxveh.simulation import simulate

pytestmark = pytest.mark.product

SPEED = 15.0
ROUGH = Ground(0.9, 0.8, 1.1, 0.7, 0.02, 0.03, 0.004, -0.003, 0.002, -0.005)
"""No field is that of a level road: what is on record sees all of them."""


def brush():
    return tyres.Brush(80000.0, 60000.0, 1.0)


def geometry():
    return dict(
        mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4,
        track_front=1.5, track_rear=1.52, cg_height=0.5,
    )  # fmt: skip


def seven(front=None, **more):
    return vehicles.SevenDOF(
        **geometry(), front=front or brush(), rear=brush(), drag=0.4, rolling_resistance=0.01, **more
    )


def planar(kind, **more):
    """A car of the same geometry without spins."""
    numbers = geometry()
    if kind is vehicles.SingleTrack3DOF:
        del numbers["track_front"], numbers["track_rear"]
    return kind(**numbers, front=brush(), rear=brush(), **more)


def rolls(kind, **more):
    body = dict(sprung_mass=1350.0, roll_inertia=500.0, roll_stiffness_front=40e3, roll_stiffness_rear=30e3)
    return kind(**geometry(), **body, front=brush(), rear=brush(), roll_yaw_product=20.0, **more)


def fourteen():
    return vehicles.FourteenDOF(
        sprung_mass=1350.0, unsprung_mass_front=40.0, unsprung_mass_rear=38.0, roll_inertia=500.0, pitch_inertia=2000.0,
        yaw_inertia=2300.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4, track_front=1.5, track_rear=1.52, cg_height=0.55,
        spring_front=28e3, spring_rear=26e3, damper_front=2500.0, damper_rear=2300.0, anti_roll_front=9e3, anti_roll_rear=4e3,
        roll_centre_front=0.05, roll_centre_rear=0.1, roll_yaw_product=20.0, front=brush(), rear=brush(), drag=0.4,
        rolling_resistance=0.01,
    )  # fmt: skip


def shifted_mf():
    """A tyre with ply-steer and conicity, which only a mirror image on the other side makes straight again."""
    tyre = tyres.typical_mf_tyre(4000.0)
    return eqx.tree_at(lambda t: (t.lateral.PHY1, t.lateral.PVY1), tyre, (jnp.asarray(0.003), jnp.asarray(0.02)))


def relaxed(car):
    return eqx.tree_at(lambda c: c.front, car, tyres.Relaxed(car.front, None, 0.4))


class Car(NamedTuple):
    """A vehicle and what it can do.

    `told_speed`: its speed is an input, not a state. `lateral`: it turns. `friction`, `slope`: the road's friction and slopes
    count. `heavy`: it takes long to compile, so that what is the same for every tyre is left to the others. `drives`: it stands
    for its kind in the drives of `simulate`, which compile a solver each.
    """

    make: Callable[[], vehicles.AbstractVehicle]
    told_speed: bool = False
    lateral: bool = True
    friction: bool = True
    slope: bool = True
    heavy: bool = False
    drives: bool = False


CARS = {
    "AntiLock": Car(lambda: vehicles.AntiLock(seven())),
    "Commanded": Car(lambda: vehicles.Commanded(vehicles.passenger_car()), told_speed=True),
    "FourteenDOF": Car(fourteen),
    "FourteenDOF, MF-Tyre": Car(
        lambda: eqx.tree_at(lambda c: (c.front, c.rear), fourteen(), (tyres.Relaxed(shifted_mf()), shifted_mf())), heavy=True
    ),
    "Kinematic": Car(lambda: vehicles.Kinematic(2.6, 1.4), told_speed=True, friction=False, slope=False),
    "KinematicCrawl": Car(
        lambda: vehicles.KinematicCrawl(vehicles.linear_single_track(vehicles.passenger_car())),
        told_speed=True, friction=False, slope=False,
    ),
    "KinematicTrailer": Car(lambda: vehicles.KinematicTrailer(3.6, 8.1), told_speed=True, friction=False, slope=False),
    "LinearSingleTrack": Car(
        lambda: vehicles.linear_single_track(vehicles.passenger_car()), told_speed=True, friction=False, slope=False
    ),
    "Longitudinal": Car(lambda: vehicles.Longitudinal(1500.0), lateral=False),
    "Roll3DOF": Car(lambda: rolls(vehicles.Roll3DOF), told_speed=True),
    "Roll4DOF": Car(lambda: rolls(vehicles.Roll4DOF), drives=True),
    "SevenDOF": Car(seven),
    "SevenDOF, quasi-static": Car(lambda: seven(load_transfer=vehicles.QuasiStatic())),
    "SevenDOF, four motors": Car(
        lambda: seven(drive=vehicles.FourMotors(), load_transfer=vehicles.StaticLoads()), drives=True
    ),
    "SevenDOF, relaxed MF-Tyre": Car(lambda: seven(tyres.Relaxed(shifted_mf())), heavy=True),
    "SingleTrack": Car(vehicles.passenger_car, told_speed=True),
    "SingleTrack, relaxed": Car(lambda: relaxed(vehicles.passenger_car()), told_speed=True, drives=True),
    "SingleTrack3DOF": Car(lambda: planar(vehicles.SingleTrack3DOF)),
    "Steered": Car(lambda: vehicles.Steered(planar(vehicles.TwoTrack3DOF), 16.0, 2e-5, trail=0.02), drives=True),
    "Steered, with inertia": Car(
        lambda: vehicles.Steered(
            planar(vehicles.TwoTrack2DOF), 16.0, 1e-4, damping=400.0, inertia=8.0, trail=0.02, assist=1.0
        ),
        told_speed=True,
    ),
    "Travelling": Car(lambda: vehicles.Travelling(seven())),
    "TwoTrack2DOF": Car(lambda: planar(vehicles.TwoTrack2DOF), told_speed=True),
    "TwoTrack3DOF": Car(lambda: planar(vehicles.TwoTrack3DOF)),
    "TwoTrack3DOF, four motors": Car(lambda: planar(vehicles.TwoTrack3DOF, drive=vehicles.FourMotors())),
}  # fmt: skip


def test_every_vehicle_of_the_package_is_here():
    assert not left_out("vehicles", vehicles.AbstractVehicle, [car.make() for car in CARS.values()], {})


KINDS = {type(car.make()).__name__: type(car.make()) for car in CARS.values()}


@pytest.mark.parametrize("kind", KINDS)
def test_help_says_what_every_parameter_is(kind):
    """Those that kinds share included; pairs may be told by the stem (`spring_`) that the front's and the rear's share."""
    told = KINDS[kind].__doc__ or ""
    stem = lambda name: name.removesuffix("front").removesuffix("rear")
    names = [f.name for f in dataclasses.fields(KINDS[kind]) if not (kind == "Steered" and f.name == "own_states")]
    assert not [name for name in names if not any(f"`{form}" in told for form in {name, stem(name)} - {""})]
    assert told.count("**Raises**") == 1


LIGHT = [name for name, car in CARS.items() if not car.heavy]
LATERAL = [name for name, car in CARS.items() if car.lateral]

STEPS = {
    "m/s": 0.3, "rad": 0.02, "rad/s": 0.1, "m": 0.01, "m/s^2": 0.5, "N": 100.0, "N m": 50.0, "rad/s^2": 0.1, "-": 0.01,
}  # fmt: skip
"""By how much states and inputs are stirred, by unit."""

ODD = (
    "y", "v_y", "yaw", "course", "yaw_rate", "yaw_acceleration", "a_y", "a_y_felt", "sideslip", "steer", "steer_rear",
    "steering_wheel", "F_y", "M_z", "M_x", "roll", "roll_rate", "roll_acceleration", "bank", "slip_angle", "steering_torque",
    "steer_rate", "F_yf", "F_yr", "slip_angle_front", "slip_angle_rear", "curvature", "hitch_angle", "hitch_rate",
    "trailer_yaw", "M_zf", "M_zr", "front_deflection_y", "rear_deflection_y", "camber",
)  # fmt: skip
"""What changes sign in the mirror; what a wheel has for itself also changes sides. Tyre states of a wheel (`fl_<name>`) are
kept in the frame of the wheel that is mirrored, so they only change sides."""


@functools.cache
def made(name):
    return CARS[name].make()


def inputs(car, dtype=float, **values):
    return record("Inputs", {name: jnp.asarray(values.get(name, 0.0), dtype) for name in car.inputs})


def begun(car, u, **known):
    """The state at the start, with those of these values that the car has."""
    return car.start(jnp.zeros(()), u, **{k: v for k, v in known.items() if k in car.state_type._fields})


@functools.cache
def start(name, speed=SPEED):
    car = made(name)
    u = inputs(car, v_x=speed, speed=speed)
    return begun(car, u, v_x=speed, speed=speed), u


def turning(name, steer):
    """Straight ahead with the wheels turned, inputs and a state that has settled at them."""
    car = made(name)
    u = inputs(car, v_x=SPEED, speed=SPEED, steer=steer, steering_wheel=16.0 * steer)
    return begun(car, u, v_x=SPEED, speed=SPEED, steer=steer), u


@functools.cache
def stirred(name, seed=0):
    """A state and inputs away from every symmetry, the same each time."""
    car = made(name)
    x, u = start(name)
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    move = lambda values: type(values)(
        *[v + rng.normal() * STEPS.get(car.units.get(n, "-"), 0.01) for n, v in values._asdict().items()]
    )
    return move(x), move(u)


def swapped(name):
    """The name on the other side of the car."""
    sides = {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"}
    parts = name.split("_")
    if parts[-1] in sides:
        return "_".join([*parts[:-1], sides[parts[-1]]])
    return "_".join([sides[parts[0]], *parts[1:]]) if parts[0] in sides else name


def in_mirror(values):
    fields = values._asdict()

    def of(name):
        other = swapped(name)
        stem = (
            "_".join(name.split("_")[:-1])
            if other != name and name.split("_")[0] not in ("fl", "fr", "rl", "rr")
            else name
        )
        return -fields[other] if stem in ODD else fields[other]

    return type(values)(*[of(name) for name in fields])


@pytest.mark.parametrize("name", CARS)
def test_names_units_and_shapes(name):
    car, (x, u) = made(name), stirred(name)
    assert isinstance(car, vehicles.AbstractVehicle)
    assert type(x) is car.state_type
    rates, outputs = car.evaluate(0.0, x, u)
    assert type(rates) is type(x)
    for value in (*rates, *outputs):
        assert value.shape == () and value.dtype == np.float64 and np.isfinite(value)
    told = {
        n
        for n in (*car.state_type._fields, *car.inputs, *outputs._fields)
        if n.split("_")[0] not in ("fl", "fr", "rl", "rr")
    }
    told -= {n for n in told if n.startswith(("front_", "rear_"))}
    assert told <= set(car.units), told - set(car.units)
    moves = car.motion(x, u)._asdict()
    seen = ("v_x", "v_y", "yaw", "yaw_rate") if CARS[name].lateral else ("v_x",)
    assert {*seen, "a_x"} <= set(outputs._fields)
    for field in seen:
        np.testing.assert_allclose(moves[field], getattr(outputs, field), atol=1e-12, err_msg=field)
    again = car.derivatives(0.0, x, u), car.outputs(0.0, x, u)
    assert jax.tree.all(jax.tree.map(lambda a, b: bool(a == b), again, (rates, outputs)))


@pytest.mark.parametrize("name", CARS)
def test_speed_and_course_are_those_of_the_velocity_over_ground(name):
    """Of every car that has a yaw; the others have none."""
    car = made(name)
    for x, u in (stirred(name), start(name, -5.0), start(name, 0.0)):
        outputs, moves = car.outputs(0.0, x, u), car.motion(x, u)
        assert ("course" in outputs._fields) == ("speed" in outputs._fields) == ("yaw" in outputs._fields)
        if "course" not in outputs._fields:
            continue
        assert car.units["course"] == "rad" and car.units["speed"] == "m/s"
        over_ground = complex(moves.v_x, moves.v_y) * np.exp(1j * float(moves.yaw))
        found = float(outputs.speed) * np.exp(1j * float(outputs.course))
        np.testing.assert_allclose([found.real, found.imag], [over_ground.real, over_ground.imag], atol=1e-12)
        if moves.v_x > 1.0:
            np.testing.assert_allclose(outputs.course, outputs.yaw + outputs.sideslip, atol=1e-12)


@pytest.mark.parametrize("name", CARS)
def test_straight_running_stays_straight(name):
    car, (x, u) = made(name), start(name)
    rates, outputs = car.evaluate(0.0, x, u)
    for field in ("v_y", "yaw", "yaw_rate", "roll", "roll_rate"):
        assert abs(getattr(rates, field, 0.0)) < 1e-9, field
    assert abs(getattr(outputs, "a_y", 0.0)) < 1e-9


@pytest.mark.parametrize("name", LATERAL)
def test_a_mirror_turns_everything_round(name):
    car, (x, u) = made(name), stirred(name)
    rates, outputs = car.evaluate(0.0, x, u, ROUGH)
    seen_rates, seen_outputs = car.evaluate(0.0, in_mirror(x), in_mirror(u), in_mirror(ROUGH))
    for got, expected in ((seen_rates, in_mirror(rates)), (seen_outputs, in_mirror(outputs))):
        for field, value in got._asdict().items():
            np.testing.assert_allclose(value, getattr(expected, field), rtol=1e-9, atol=1e-9, err_msg=field)


@pytest.mark.parametrize("name", CARS)
def test_turning_and_moving_the_world_changes_nothing(name):
    car, (x, u) = made(name), stirred(name)
    shift = {field: by for field, by in (("yaw", 2.0), ("x", 50.0), ("y", -7.0)) if field in x._fields}
    if not shift:
        pytest.skip("it knows neither yaw nor place")
    moved = x._replace(**{field: getattr(x, field) + by for field, by in shift.items()})
    (rates, outputs), (other, seen) = car.evaluate(0.0, x, u), car.evaluate(0.0, moved, u)
    for field, value in other._asdict().items():
        if field not in ("x", "y"):
            np.testing.assert_allclose(value, getattr(rates, field), rtol=1e-12, atol=1e-12, err_msg=field)
    for field, value in seen._asdict().items():
        turned_with = {"course": "yaw"}.get(field, field.removeprefix("trailer_"))
        expected = getattr(outputs, field) + shift.get(turned_with, 0.0)
        np.testing.assert_allclose(value, expected, rtol=1e-12, atol=1e-10, err_msg=field)
    if "x" in x._fields:
        turned = complex(rates.x, rates.y) * np.exp(2.0j)
        np.testing.assert_allclose([other.x, other.y], [turned.real, turned.imag], rtol=1e-12)


@pytest.mark.parametrize("name", LIGHT)
def test_standstill_is_an_ordinary_point(name):
    """Nothing moves by itself, and the derivatives are finite."""
    car, (x, u) = made(name), start(name, speed=0.0)
    rates, outputs = car.evaluate(0.0, x, u)
    assert np.all(np.isfinite(jax.tree.leaves((rates, outputs))))
    np.testing.assert_allclose(jax.tree.leaves(rates), 0.0, atol=1e-9)
    # A NaN or an infinity in any column of the Jacobian survives the sum along a direction with no zero in it.
    rng = np.random.default_rng(4)
    evaluate = lambda x, u: car.evaluate(0.0, x, u)
    for _ in range(2):
        along = jax.tree.map(lambda leaf: jnp.asarray(rng.normal()), (x, u))
        slopes = jax.jvp(evaluate, (x, u), along)[1]
        assert all(np.isfinite(leaf) for leaf in jax.tree.leaves(slopes))


@pytest.mark.parametrize("name", CARS)
def test_reversing_and_crawling_are_finite(name):
    car = made(name)
    for speed in (-5.0, -0.01, 1e-6, 0.3):
        x, u = start(name, speed)
        assert np.all(np.isfinite(jax.tree.leaves(car.evaluate(0.0, x, u)))), speed


@pytest.mark.parametrize("name", LIGHT)
def test_gradients_equal_finite_differences(name):
    """Of a sum of all rates and outputs, along a direction through state, inputs, ground and every parameter, in both modes."""
    at = (made(name), *stirred(name), jax.tree.map(jnp.asarray, ROUGH))
    weights = np.random.default_rng(1).normal(size=1000)
    # Each in units of what it is here.
    weights = [
        w / (1e-3 + abs(float(v))) for w, v in zip(weights, jax.tree.leaves(at[0].evaluate(0.0, *at[1:])), strict=False)
    ]
    arrays, rest = eqx.partition(at, eqx.is_inexact_array)
    rng = np.random.default_rng(2)
    size = lambda leaf: 0.01 * (0.01 + np.abs(np.asarray(leaf)))
    along = jax.tree.map(lambda leaf: jnp.asarray(rng.normal(size=leaf.shape) * size(leaf)), arrays)

    def value(arrays):
        car, x, u, ground = eqx.combine(arrays, rest)
        return sum(w * v for w, v in zip(weights, jax.tree.leaves(car.evaluate(0.0, x, u, ground)), strict=True))

    moved = lambda a, d, s: jnp.asarray(np.asarray(a) + s * np.asarray(d))
    on_line = lambda s: float(value(jax.tree.map(lambda a, d: moved(a, d, s), arrays, along)))
    step = 1e-4
    expected = (on_line(step) - on_line(-step)) / (2 * step)
    forward = jax.jvp(value, (arrays,), (along,))[1]
    gradient = jax.grad(value)(arrays)
    reverse = sum(np.vdot(g, d) for g, d in zip(jax.tree.leaves(gradient), jax.tree.leaves(along), strict=True))
    np.testing.assert_allclose(forward, expected, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(reverse, forward, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("name", LIGHT)
def test_a_batch_and_vmap_equal_single_cars(name):
    car = made(name)
    points = [stirred(name, seed) for seed in range(3)]
    batch = jax.tree.map(lambda *leaves: jnp.asarray(np.stack(leaves)), *points)
    singles = jax.tree.map(lambda *leaves: np.stack(leaves), *[car.evaluate(0.0, *point) for point in points])
    evaluate = lambda x, u: car.evaluate(0.0, x, u)
    for got in (evaluate(*batch), jax.jit(jax.vmap(evaluate))(*batch)):
        for a, b in zip(jax.tree.leaves(got), jax.tree.leaves(singles), strict=True):
            np.testing.assert_allclose(np.broadcast_to(a, (3,)), b, rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize("name", CARS)
@pytest.mark.parametrize(
    "kind", [float, lambda value: jnp.asarray(float(value)), lambda value: np.asarray(value, np.float32)]
)
def test_float32_stays_float32_on_a_rough_ground(name, kind):
    """Whatever the ground's numbers are, without a dtype of their own or in float32. Traced and not run."""
    single, (x, u) = statespace.cast(made(name), np.float32), stirred(name)
    x, u = jax.tree.map(lambda leaf: jnp.asarray(leaf, np.float32), (x, u))
    for ground in (LEVEL, ROUGH):
        ground = jax.tree.map(kind, ground)
        found = jax.eval_shape(lambda x, u: single.evaluate(jnp.zeros((), np.float32), x, u, ground), x, u)  # noqa: B023
        assert {leaf.dtype for leaf in jax.tree.leaves(found)} == {np.dtype(np.float32)}


@pytest.mark.parametrize("name", CARS)
def test_outputs_have_the_shape_of_the_batch(name):
    """All of them, loads that nothing moves and inputs that all share included; the rates of a batch of states likewise."""
    car, (x, u) = made(name), stirred(name)
    many = lambda tree: jax.tree.map(lambda value: np.broadcast_to(value, (2, 3)), tree)
    # Traced and not run.
    shapes = lambda function, x, u, ground: jax.eval_shape(lambda x, u: function(0.0, x, u, ground), x, u)
    for ground in (LEVEL, ROUGH):
        rates, outputs = shapes(car.evaluate, many(x), many(u), ground)
        assert not {field: v.shape for field, v in (rates._asdict() | outputs._asdict()).items() if v.shape != (2, 3)}
        for mixed in ((many(x), u), (x, many(u))):
            outputs = shapes(car.outputs, *mixed, ground)
            assert not {field: v.shape for field, v in outputs._asdict().items() if v.shape != (2, 3)}


@pytest.mark.parametrize("name", LIGHT)
def test_float32_in_float32_out(name):
    car, (x, u) = made(name), stirred(name)
    single = statespace.cast(car, np.float32)
    low = jax.tree.map(lambda leaf: jnp.asarray(leaf, np.float32), (x, u))
    found = single.evaluate(jnp.zeros((), np.float32), *low)
    assert {leaf.dtype for leaf in jax.tree.leaves(found)} == {np.dtype(np.float32)}
    begun = single.start(jnp.zeros((), np.float32), low[1])
    assert {leaf.dtype for leaf in jax.tree.leaves(begun)} == {np.dtype(np.float32)}
    for (field, a), b in zip(found[1]._asdict().items(), car.evaluate(0.0, x, u)[1], strict=True):
        np.testing.assert_allclose(a, b, rtol=2e-3, atol=2e-3 * (1 + float(jnp.abs(b))), err_msg=field)


@pytest.mark.parametrize("name", CARS)
def test_the_ground_counts(name):
    car, about = made(name), CARS[name]
    x, u = stirred(name)
    level = car.evaluate(0.0, x, u, LEVEL)
    same = car.evaluate(0.0, x, u, Ground(*jnp.asarray([1.0, 1.0, 1.0, 1.0, 0.0, 0.0])))
    for a, b in zip(jax.tree.leaves(level), jax.tree.leaves(same), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-9)
    if about.friction and about.lateral:
        # Started with the wheels turned, so that relaxed tyres have settled at their slip.
        at = turning(name, 0.05)
        dry = car.evaluate(0.0, *at)[1].a_y
        assert 0.0 < car.evaluate(0.0, *at, Ground(*[0.05] * 4))[1].a_y < 0.5 * dry
    if about.slope and about.lateral:
        rest, u = start(name, 0.0)
        across = car.derivatives(0.0, rest, u, Ground(bank=jnp.asarray(0.1)))
        assert across.v_y < -0.5, "the left side is higher: the car slides to the right"
    if about.slope and not about.told_speed:
        rest, u = start(name, 0.0)
        uphill = car.derivatives(0.0, rest, u, Ground(grade=jnp.asarray(0.1)))
        assert uphill.v_x < -0.5, "the car rolls back"


@pytest.mark.parametrize("name", CARS)
def test_loads_carry_the_car(name):
    outputs = made(name).evaluate(0.0, *start(name))[1]._asdict()
    loads = [value for field, value in outputs.items() if field.startswith("load")]
    if not loads:
        pytest.skip("it has no loads")
    weight = made_mass(name) * vehicles.GRAVITY
    np.testing.assert_allclose(sum(loads), weight, rtol=1e-9)
    assert all(load > 0 for load in loads)


def made_mass(name):
    car = made(name)
    while hasattr(car, "vehicle"):
        car = car.vehicle
    return car.mass


def test_every_car_stands_on_two_axles_a_wheelbase_apart():
    for name in CARS:
        car = made(name)
        (ahead, left), (ahead_too, right), (behind, left_too), (behind_too, right_too) = car.wheel_positions
        assert ahead == ahead_too and behind == behind_too, name
        # A car on one track has both wheels of an axle in the middle.
        assert left == -right and left_too == -right_too and (left > 0) == (left_too > 0) and left >= 0, name
        while hasattr(car, "vehicle"):
            car = car.vehicle
        if hasattr(car, "front_axle_to_cg"):
            assert ahead == car.front_axle_to_cg and behind == -car.rear_axle_to_cg, name
        elif hasattr(car, "wheelbase"):
            assert ahead - behind == pytest.approx(float(car.wheelbase), rel=1e-12), name
        else:
            assert name == "Longitudinal" and ahead == behind == left == 0.0, "a car without a length"


@pytest.mark.parametrize("name", CARS)
def test_parameters_outside_their_domain_raise_by_name(name):
    car = made(name)
    while hasattr(car, "vehicle"):
        car = car.vehicle
    fields = [f for f in dataclasses.fields(car) if isinstance(f.metadata.get("domain"), Positive)]
    assert fields
    for field in fields:
        if getattr(car, field.name) is None:
            continue
        for bad in (0.0, -1.0, np.nan):
            with pytest.raises(InputError, match=rf"{field.name} = .*must be positive"):
                dataclasses.replace(car, **{field.name: bad})


@pytest.mark.parametrize("name", [name for name in LATERAL if name in LIGHT])
def test_it_turns_to_the_side_of_the_steer(name):
    car, (x, u) = made(name), turning(name, 0.02)
    end = jax.tree.map(lambda leaf: leaf[-1], driven(car, lambda t: u, x, 0.3, 1e-3))
    rates, outputs = car.evaluate(0.0, end, u)
    assert outputs.yaw > 0.01 and outputs.a_y > 0.5
    assert rates.yaw > 0.05
    np.testing.assert_allclose(outputs.v_x, SPEED, rtol=0.03)


@pytest.mark.parametrize("name", [name for name, car in CARS.items() if car.drives])
def test_a_drive_turns_to_the_side_of_the_steer(name):
    drive = simulate(made(name), manoeuvres.step_steer(SPEED, 0.02, start=0.1, duration=1.0), dt=0.05)
    assert drive["true.yaw"][-1] > 0.02
    assert drive["true.y"][-1] > 0.1
    assert drive["true.a_y"][-1] > 0.5
    assert 13.0 < drive["true.x"][-1] < 15.5


NOT_DRIVEN = ("Commanded", "KinematicCrawl")
"""They need the rate of the steering, which no manoeuvre gives: `simulate` refuses them."""


@pytest.mark.parametrize("name", CARS)
def test_its_fastest_pole_is_the_largest_eigenvalue(name):
    """At speed and crawling, away from every symmetry, in both precisions: it decides the steps of a simulation."""
    manoeuvre = manoeuvres.step_steer(SPEED, 0.02, start=0.1, duration=1.0)
    if name in NOT_DRIVEN:
        with pytest.raises(InputError, match="needs steer_rate"):
            simulation.driven_car(made(name), manoeuvre)
        return
    car, t = simulation.driven_car(made(name), manoeuvre), jnp.asarray(0.3)
    start = jax.jit(
        lambda speed: car.start(t, float, **({"v_x": speed} if "v_x" in made(name).state_type._fields else {}))
    )
    jacobian = jax.jit(jax.jacfwd(lambda y, shaped: ravel_pytree(car.derivatives(t, shaped(y)))[0]), static_argnums=1)
    pole, rng = jax.jit(simulation.fastest_pole), np.random.default_rng(2)
    for speed in (SPEED, 1.0):
        x = start(speed)
        flat, shaped = ravel_pytree(x)
        flat = flat * (1 + 0.01 * rng.normal(size=flat.size)) + 0.003 * rng.normal(size=flat.size)
        expected = np.max(np.abs(np.linalg.eigvals(np.asarray(jacobian(flat, shaped)))))
        for dtype in (np.float64, np.float32):
            low, at, now = (statespace.cast(some, dtype) for some in (car, shaped(flat), t))
            # 1/s: a car without dynamics of its own has no pole, only rounding.
            assert float(pole(low, now, at)) == pytest.approx(expected, rel=0.02, abs=1e-3)


NO_AXLES = ("Kinematic", "KinematicTrailer", "Longitudinal")
"""Cars without tyres: no linear single track is made of them."""


@pytest.mark.thorough
def test_every_car_with_axles_has_a_linear_single_track_and_an_open_loop():
    """The open loop ends where the linear car's own formulas say: the drive is long, and its steering held."""
    time, steer = np.arange(0.0, 4.0, 0.01), 0.01
    log = Recording(time, {"steer": np.full(time.size, steer), "v_x": np.full(time.size, SPEED)})
    for name in CARS:
        if name in NO_AXLES:
            with pytest.raises(InputError, match=rf"{name}.* has no .*front, rear"):
                vehicles.linear_single_track(made(name))
            continue
        plain = vehicles.linear_single_track(made(name))
        assert float(plain.mass) == float(made_mass(name))
        found = estimators.open_loop(made(name), log)
        np.testing.assert_allclose(found["yaw_rate"][-1], steer * plain.yaw_rate_gain(SPEED), rtol=1e-3, err_msg=name)
        sideslip = steer * plain.sideslip_gain(SPEED)
        np.testing.assert_allclose(found["sideslip"][-1], sideslip, rtol=1e-2, atol=2e-6, err_msg=name)


def test_what_is_wrong_for_an_argument_is_named():
    """Of every car, and of the tyres, drives and steerings in them: one of each class."""
    seen = set()
    for line in CARS.values():
        families.refuses_everywhere(line.make(), seen)
    assert {"SingleTrack", "FourteenDOF", "Travelling", "Commanded"} <= {kind.__name__ for kind in seen}
