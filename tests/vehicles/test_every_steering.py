"""What holds for every steering in every car: a new member of either family comes in by itself, and says what it can do.

Cars are those of `test_every_vehicle`, one of each class; steerings take their members from `vehicles.__all__`.
"""

import dataclasses
import functools
import zlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import left_out, members, wanting
from test_every_vehicle import CARS, ROUGH, SPEED, STEPS, in_mirror, inputs

from jaxveh import InputError, io, statespace, tyres, vehicles
from jaxveh._core.names import record
from jaxveh.vehicles import kit

pytestmark = pytest.mark.product

STEERINGS = {
    "FrontSteering": vehicles.FrontSteering,
    "Ackermann": lambda: vehicles.Ackermann(0.8),
    "RearSteering": vehicles.RearSteering,
    "FourWheelSteering": lambda: vehicles.FourWheelSteering(-0.2, fast_ratio=0.3, middle_speed=18.0),
    "IndependentSteering": vehicles.IndependentSteering,
}


ONE_EACH = {}
for _name, _car in CARS.items():
    ONE_EACH.setdefault(type(_car.make()).__name__, _name)
STEERED = {kind: name for kind, name in ONE_EACH.items() if hasattr(kit.innermost_car(CARS[name].make()), "steering")}
"""The first car of each class, by class, of those that take a steering."""

UNSTEERED = {"Longitudinal": "goes straight"}
"""Cars without a field `steering`, and why."""

REFUSED = {
    ("Commanded", "RearSteering"): "inputs steer, steer_rear, v_x: must be steer and v_x",
    ("Commanded", "IndependentSteering"): "inputs steer_fl, .*: must be steer and v_x",
    ("KinematicCrawl", "RearSteering"): "must steer only the front wheels",
    ("KinematicCrawl", "FourWheelSteering"): "must steer only the front wheels.*crawl_speed works with any",
    ("KinematicCrawl", "IndependentSteering"): "must steer only the front wheels",
    ("Steered", "IndependentSteering"): "inputs are steer_fl, .*; steer must be one of them",
}
"""Who cannot take what, and what it says."""


def with_steering(car, steering):
    """The car with another steering, each class around it made anew, so that all checks run."""
    if not hasattr(car, "vehicle"):
        return dataclasses.replace(car, steering=steering)
    inner = with_steering(car.vehicle, steering)
    options = {f.name: getattr(car, f.name) for f in dataclasses.fields(car) if f.name not in ("vehicle", "own_states")}
    return type(car)(inner, **options)


@functools.cache
def made(kind, steering):
    return with_steering(CARS[STEERED[kind]].make(), STEERINGS[steering]())


@functools.cache
def stirred(kind, steering):
    """A state and inputs away from every symmetry, the same each time; wheels that are told apart turned apart."""
    car = made(kind, steering)
    u = inputs(car, v_x=SPEED)
    x = car.start(jnp.zeros(()), u, **({"v_x": SPEED} if "v_x" in car.state_type._fields else {}))
    rng = np.random.default_rng(zlib.crc32(f"{kind} {steering}".encode()))
    move = lambda values: type(values)(
        *[v + rng.normal() * STEPS.get(car.units.get(n, "-"), 0.01) for n, v in values._asdict().items()]
    )
    return move(x), move(u)


TAKEN = [(kind, steering) for kind in STEERED for steering in STEERINGS if (kind, steering) not in REFUSED]
each_pair = pytest.mark.parametrize(("kind", "steering"), TAKEN, ids=[" on ".join(pair) for pair in TAKEN])


def test_every_steering_and_every_steered_car_is_here():
    assert not left_out("vehicles", vehicles.AbstractSteering, [make() for make in STEERINGS.values()], {})
    assert set(STEERINGS) == members("vehicles", vehicles.AbstractSteering)
    assert set(ONE_EACH) == members("vehicles", vehicles.AbstractVehicle)
    assert not wanting(set(ONE_EACH), set(STEERED), UNSTEERED), (
        "one takes a `steering`, or is in UNSTEERED with a reason"
    )
    assert {kind.__name__ for kind in kit.STEERINGS.values()} == set(STEERINGS)
    assert tuple(kit.STEERINGS) == io.kit.STEERINGS


def test_axle_gains_are_the_angles_of_the_axles_over_a_small_steer():
    car, small = vehicles.named_car("sedan", "seven-dof"), 1e-6
    for name, make in STEERINGS.items():
        steering = make()
        if "steer" not in steering.inputs:
            with pytest.raises(InputError, match="steer"):
                steering.axle_gains(20.0)
            continue
        u = record("Inputs", {one: small if one == "steer" else 0.0 for one in steering.inputs})
        for v_x in (2.0, 30.0):
            at = steering.angles(car, u, v_x)
            found = np.array([at.fl + at.fr, at.rl + at.rr]) / (2.0 * small)
            np.testing.assert_allclose(found, steering.axle_gains(v_x), rtol=1e-9, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("pair", REFUSED, ids=" on ".join)
def test_a_car_that_cannot_take_a_steering_says_so(pair):
    with pytest.raises(InputError, match=REFUSED[pair]):
        made(*pair)


@each_pair
def test_a_steered_car_moves_and_its_mirror_image_too(kind, steering):
    car, (x, u) = made(kind, steering), stirred(kind, steering)
    rates, outputs = car.evaluate(0.0, x, u, ROUGH)
    assert np.all(np.isfinite(jax.tree.leaves((rates, outputs))))
    asked = {name for name in (*car.inputs, *outputs._fields) if "steer" in name}
    assert asked and not {name for name in asked if name not in car.units}
    seen_rates, seen_outputs = car.evaluate(0.0, in_mirror(x), in_mirror(u), in_mirror(ROUGH))
    for got, expected in ((seen_rates, in_mirror(rates)), (seen_outputs, in_mirror(outputs))):
        for field, value in got._asdict().items():
            np.testing.assert_allclose(value, getattr(expected, field), rtol=1e-9, atol=1e-9, err_msg=field)


@each_pair
def test_every_angle_that_is_told_turns_the_car(kind, steering):
    """Running straight, the rates change with each of the steering's inputs."""
    car = made(kind, steering)
    x, u = circling(car, {}, SPEED, 0.0, 0.0)
    steers = [name for name in car.inputs if "steer" in name and name != "steer_rate"]
    if kind != "Commanded":
        assert len(steers) == len(STEERINGS[steering]().inputs)
    for name in steers:
        moved = lambda angle, name=name: car.derivatives(0.0, x, u._replace(**{name: angle}))
        slopes = jax.jvp(moved, (getattr(u, name),), (jnp.ones(()),))[1]
        assert max(abs(float(slope)) for slope in slopes) > 0.1, name


@each_pair
def test_what_a_car_says_of_its_wheels_is_how_they_stand(kind, steering):
    car, (x, u) = made(kind, steering), stirred(kind, steering)
    shown = car.outputs(0.0, x, u)._asdict()
    each = [shown.get(name) for name in kit.wheel_names("steer")]
    if "steer_fl" in shown:
        np.testing.assert_allclose(shown["steer"], 0.5 * (each[0] + each[1]), rtol=1e-12)
    if steering == "IndependentSteering" and "steer" in shown and kind != "SingleTrack3DOF":
        np.testing.assert_array_equal(each, [getattr(u, name) for name in kit.wheel_names("steer")])
    if steering == "FrontSteering":
        assert "steer_fl" not in shown and "steer_rear" not in shown
    if steering == "FourWheelSteering" and "steer_rl" in shown:
        v_x = float(getattr(x, "v_x", getattr(u, "v_x", 0.0)))
        ratio = (-0.2 + 0.3 * (v_x / 18.0) ** 2) / (1.0 + (v_x / 18.0) ** 2)
        np.testing.assert_allclose([each[2], each[3]], ratio * each[0], rtol=1e-12)


@each_pair
def test_gradients_of_steered_cars_equal_finite_differences(kind, steering):
    """Along a direction through state, inputs and every parameter, those of the steering included, in both modes."""
    at = (made(kind, steering), *stirred(kind, steering))
    scales = [1e-3 + abs(float(v)) for v in jax.tree.leaves(at[0].evaluate(0.0, *at[1:]))]
    rng = np.random.default_rng(3)
    weights = [rng.normal() / scale for scale in scales]
    arrays, rest = eqx.partition(at, eqx.is_inexact_array)
    along = jax.tree.map(lambda leaf: jnp.asarray(0.01 * rng.normal(size=leaf.shape) * (0.01 + np.abs(leaf))), arrays)

    def value(arrays):
        car, x, u = eqx.combine(arrays, rest)
        return sum(w * v for w, v in zip(weights, jax.tree.leaves(car.evaluate(0.0, x, u)), strict=True))

    on_line = lambda s: float(value(jax.tree.map(lambda a, d: a + s * d, arrays, along)))
    expected = (on_line(1e-4) - on_line(-1e-4)) / 2e-4
    slope, pull = jax.jvp(value, (arrays,), (along,))[1], jax.grad(value)(arrays)
    np.testing.assert_allclose(slope, expected, rtol=1e-5, atol=1e-7)
    found = sum(np.vdot(g, d) for g, d in zip(jax.tree.leaves(pull), jax.tree.leaves(along), strict=True))
    np.testing.assert_allclose(found, slope, rtol=1e-8, atol=1e-10)
    steered = kit.innermost_car(pull[0]).steering if kind not in ("Commanded", "KinematicCrawl", "Steered") else None
    assert all(float(jnp.abs(leaf)) > 0.0 for leaf in jax.tree.leaves(steered)) or kind in ON_ONE_TRACK


ON_ONE_TRACK = ("Kinematic", "KinematicTrailer", "LinearSingleTrack", "SingleTrack", "SingleTrack3DOF")
"""Where inner and outer wheel are one, so that `Ackermann` has no part."""


@each_pair
def test_a_steered_car_in_float32(kind, steering):
    car, (x, u) = made(kind, steering), stirred(kind, steering)
    low = jax.tree.map(lambda leaf: jnp.asarray(leaf, np.float32), (x, u))
    found = statespace.cast(car, np.float32).evaluate(jnp.zeros((), np.float32), *low)
    assert {leaf.dtype for leaf in jax.tree.leaves(found)} == {np.dtype(np.float32)}
    for (field, a), b in zip(found[1]._asdict().items(), car.outputs(0.0, x, u), strict=True):
        np.testing.assert_allclose(a, b, rtol=2e-3, atol=2e-3 * (1 + float(jnp.abs(b))), err_msg=field)


ALIKE = [kind for kind, steering in TAKEN if steering == "IndependentSteering"]


@pytest.mark.parametrize("kind", ALIKE)
def test_front_wheels_turned_alike_are_front_steering_to_the_last_bit(kind):
    x, u = stirred(kind, "FrontSteering")
    steers = {"steer_fl": u.steer, "steer_fr": u.steer, "steer_rl": 0.0 * u.steer, "steer_rr": 0.0 * u.steer}
    car = made(kind, "IndependentSteering")
    same = inputs(car, **{**u._asdict(), **steers})
    for got, expected in zip(car.evaluate(0.0, x, same), made(kind, "FrontSteering").evaluate(0.0, x, u), strict=True):
        for field, value in expected._asdict().items():
            assert float(getattr(got, field)) == float(value), field


def circling(car, steers, v_x, v_y, yaw_rate):
    """The car with these wheel angles, speeds and yaw rate, its wheels rolling freely where they spin."""
    u = inputs(car, v_x=v_x, **steers)
    x = car.start(jnp.zeros(()), u, **({"v_x": v_x} if "v_x" in car.state_type._fields else {}))
    aside = {"v_y": v_y, "sideslip": np.arctan2(v_y, v_x), "yaw_rate": yaw_rate}
    return x._replace(**{name: jnp.asarray(v) for name, v in aside.items() if name in x._fields}), u


@pytest.mark.parametrize(
    "kind", [kind for kind in ALIKE if "vehicle" not in dataclasses.asdict(made(kind, "FrontSteering"))]
)
def test_parallel_wheels_carry_the_car_away_like_a_crab(kind):
    """All four alike: it goes where the wheels point, no wheel slips sideways, and nothing turns the car."""
    car, angle = made(kind, "IndependentSteering"), 0.3
    if kind == "LinearSingleTrack":  # knows small angles alone
        angle = 0.01
    x, u = circling(car, dict.fromkeys(kit.wheel_names("steer"), angle), 2.0, 2.0 * np.tan(angle), 0.0)
    rates, outputs = car.evaluate(0.0, x, u)
    slips = [value for name, value in outputs._asdict().items() if name.startswith("slip_angle")]
    np.testing.assert_allclose(slips, 0.0, atol=1e-12)
    np.testing.assert_allclose(outputs.sideslip, angle, rtol=1e-12)
    assert abs(float(outputs.yaw_rate)) < 1e-12 and abs(float(rates.yaw)) < 1e-12
    if slips and not hasattr(x, "omega_fl"):
        assert abs(float(rates.yaw_rate)) < 1e-9


TWO_TRACKS = [kind for kind in STEERED if hasattr(made(kind, "FrontSteering"), "track_front")]


@pytest.mark.parametrize("kind", TWO_TRACKS)
def test_with_ackermann_s_angles_no_wheel_slips_on_a_circle(kind):
    """Slowly about a point on the rear axle's line: each wheel rolls where it points."""
    car = with_steering(CARS[STEERED[kind]].make(), vehicles.Ackermann())
    length = float(car.front_axle_to_cg + car.rear_axle_to_cg)
    turn = 1.0 * np.tan(0.4) / length
    x, u = circling(car, {"steer": 0.4}, 1.0, float(car.rear_axle_to_cg) * turn, turn)
    slips = lambda car: [getattr(car.outputs(0.0, x, u), name) for name in kit.wheel_names("slip_angle")]
    np.testing.assert_allclose(slips(car), 0.0, atol=1e-12)
    parallel = with_steering(car, vehicles.FrontSteering())
    assert max(abs(float(slip)) for slip in slips(parallel)) > 0.02
    cotangents = [1.0 / np.tan(getattr(car.outputs(0.0, x, u), name)) for name in ("steer_fr", "steer_fl")]
    np.testing.assert_allclose(cotangents[0] - cotangents[1], float(car.track_front) / length, rtol=1e-9)


def test_ackermann_of_fourteen_dof_is_the_same_by_both_names():
    car, (x, u) = made("FourteenDOF", "FrontSteering"), stirred("FourteenDOF", "FrontSteering")
    own = dataclasses.replace(car, ackermann=0.8).derivatives(0.0, x, u)
    told = made("FourteenDOF", "Ackermann").derivatives(0.0, x, u)
    np.testing.assert_allclose(told, own, rtol=1e-12, atol=1e-12)
    for steering in (vehicles.Ackermann(), vehicles.IndependentSteering()):
        with pytest.raises(InputError, match=r"FourteenDOF.ackermann = 0.5: must be 0 with"):
            dataclasses.replace(car, ackermann=0.5, steering=steering)


def linear(steering):
    return vehicles.LinearSingleTrack(
        mass=1500.0, yaw_inertia=2600.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.5, front_stiffness=80e3,
        rear_stiffness=110e3, steering=steering,
    )  # fmt: skip


@pytest.mark.parametrize("ratio", [-0.3, 0.0, 0.4, 1.0])
def test_steady_turns_with_a_proportional_rear_angle_are_those_of_the_book(ratio):
    """Yaw rate over steer is v (1 - k) / (L + K v^2); with all wheels alike the car goes aside and does not turn."""
    car, plain = linear(vehicles.FourWheelSteering(ratio)), linear(vehicles.FrontSteering())
    for speed in (4.0, 15.0, 35.0):
        gain = float(car.yaw_rate_gain(speed))
        stiff = 2.7 + float(plain.understeer_gradient) * speed**2
        np.testing.assert_allclose(gain, speed * (1.0 - ratio) / stiff, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(car.lateral_acceleration_gain(speed), speed * gain, rtol=1e-12, atol=1e-15)
        u = inputs(car, steer=0.01, v_x=speed)
        x = car.start(0.0, u, sideslip=0.01 * car.sideslip_gain(speed), yaw_rate=0.01 * gain)
        rates = car.derivatives(0.0, x, u)
        np.testing.assert_allclose([rates.sideslip, rates.yaw_rate], 0.0, atol=1e-12)
        slow = car.system(speed).frequency_response(0.0)
        np.testing.assert_allclose(
            [slow.sideslip, slow.yaw_rate], [car.sideslip_gain(speed), gain], rtol=1e-10, atol=1e-12
        )
    if ratio == 1.0:
        np.testing.assert_allclose(car.sideslip_gain(np.array([4.0, 35.0])), 1.0, rtol=1e-12)


@pytest.mark.parametrize("kind", ["SingleTrack", "SingleTrack3DOF", "TwoTrack2DOF", "TwoTrack3DOF", "SevenDOF"])
def test_small_turns_of_every_car_are_those_of_its_linear_single_track(kind):
    """Just after a small turn of the rear wheels C_r / m and -b C_r / J, as C_f / m and a C_f / J after one of the front
    wheels."""
    car = with_steering(CARS[STEERED[kind]].make(), vehicles.RearSteering())
    car = dataclasses.replace(car, front=tyres.Linear(7e4), rear=tyres.Linear(9e4))
    u = inputs(car, v_x=SPEED)
    x = car.start(jnp.zeros(()), u, **({"v_x": SPEED} if "v_x" in car.state_type._fields else {}))
    slopes = lambda **turn: jax.jvp(lambda u: car.outputs(0.0, x, u), (u,), (inputs(car, **turn),))[1]
    front, rear = slopes(steer=1.0), slopes(steer_rear=1.0)
    a, b, J = (float(getattr(car, n)) for n in ("front_axle_to_cg", "rear_axle_to_cg", "yaw_inertia"))
    book = vehicles.linear_single_track(car)
    C_f, C_r = float(book.front_stiffness), float(book.rear_stiffness)
    np.testing.assert_allclose(front.a_y, C_f / car.mass, rtol=1e-6)
    np.testing.assert_allclose(rear.a_y, C_r / car.mass, rtol=1e-6)
    np.testing.assert_allclose(front.yaw_acceleration, a * C_f / J, rtol=1e-6)
    np.testing.assert_allclose(rear.yaw_acceleration, -b * C_r / J, rtol=1e-6)
    assert type(book.steering) is vehicles.RearSteering


def test_the_law_of_no_sideslip_has_none_at_any_speed():
    plain = linear(vehicles.FrontSteering())
    car = linear(vehicles.steering_without_sideslip(plain))
    speeds = np.array([1.0, 5.0, 12.0, 20.0, 40.0])
    np.testing.assert_allclose(car.sideslip_gain(speeds), 0.0, atol=1e-12)
    assert np.abs(plain.sideslip_gain(speeds)).min() > 0.02
    np.testing.assert_allclose(car.steering.ratio(0.0), -1.5 / 1.2, rtol=1e-12)
    still = car.system(12.0).frequency_response(0.0)
    np.testing.assert_allclose(np.abs(still.sideslip), 0.0, atol=1e-12)
    with pytest.raises(InputError, match="has no axle stiffnesses: give linear_single_track"):
        vehicles.steering_without_sideslip(vehicles.passenger_car())


def test_gains_over_a_steer_that_is_no_input_are_refused():
    car = linear(vehicles.IndependentSteering())
    for gain in (car.yaw_rate_gain, car.sideslip_gain, car.system):
        with pytest.raises(InputError, match=r"no input steer.*Use FourWheelSteering or RearSteering"):
            gain(20.0)


def test_kinematic_cars_turn_by_both_axles():
    """Effective curvature (tan f - tan r) / L; the rear axle goes where its wheels point."""
    for kind in ("Kinematic", "KinematicTrailer"):
        car = made(kind, "RearSteering")
        u = inputs(car, steer=0.2, steer_rear=-0.1, v_x=3.0)
        x = car.start(0.0, u)
        moves = car.motion(x, u)
        np.testing.assert_allclose(
            moves.yaw_rate, 3.0 * (np.tan(0.2) - np.tan(-0.1)) / float(car.wheelbase), rtol=1e-12
        )
        ahead = float(getattr(car, "rear_axle_to_reference", 0.0))
        np.testing.assert_allclose(moves.v_y, 3.0 * np.tan(-0.1) + ahead * moves.yaw_rate, rtol=1e-12)


def test_a_trailer_is_pulled_where_the_steered_rear_axle_goes():
    """Straight behind a crab: the hitch angle changes as that of a point that moves aside, v_y cos(alpha) / l."""
    car = vehicles.KinematicTrailer(3.6, 8.0, hitch_behind_axle=0.5, steering=vehicles.RearSteering())
    u = inputs(car, steer=0.1, steer_rear=0.1, v_x=2.0)
    x = car.start(0.0, u, hitch_angle=0.3)
    rates, outputs = car.evaluate(0.0, x, u)
    aside = 2.0 * np.tan(0.1)
    np.testing.assert_allclose(rates.hitch_angle, (-2.0 * np.sin(0.3) + aside * np.cos(0.3)) / 8.0, rtol=1e-12)
    np.testing.assert_allclose(outputs.trailer_v_x, 2.0 * np.cos(0.3) + aside * np.sin(0.3), rtol=1e-12)


BAD = {
    "Ackermann.share = 5.0: must be between -1 and 2": lambda: vehicles.Ackermann(5.0),
    "FourWheelSteering.rear_ratio = 9.0: must be between -5 and 5": lambda: vehicles.FourWheelSteering(9.0),
    "FourWheelSteering.fast_ratio = -7.0: must be between": lambda: vehicles.FourWheelSteering(0.0, fast_ratio=-7.0),
    "middle_speed = 0.0: must be positive": lambda: vehicles.FourWheelSteering(0.0, middle_speed=0.0),
    "SevenDOF.steering = 'rear': must be a steering of jaxveh.vehicles: FrontSteering, Ackermann": lambda: dataclasses.replace(
        CARS["SevenDOF"].make(), steering="rear"
    ),
}  # fmt: skip


@pytest.mark.parametrize("message", BAD)
def test_what_is_no_steering_raises(message):
    with pytest.raises(InputError, match=message):
        BAD[message]()


SAID = {"four-wheel": {"rear_steer_ratio": -0.2, "rear_steer_ratio_fast": 0.1, "rear_steer_speed": 15.0}}
"""What a car's file says beside the name of a steering."""


@pytest.mark.parametrize("name", kit.STEERINGS)
def test_a_car_s_file_makes_and_remembers_every_steering(name):
    plain = vehicles.specification_of(vehicles.sets.sedan())
    said = dataclasses.replace(plain, steering=name, **SAID.get(name, {}))
    numbers = vehicles.numbers_of(said)
    for fidelity, kind in kit.FIDELITIES.items():
        if fidelity in ("kinematic-trailer", "roll-3dof", "roll-4dof", "fourteen-dof") or kind.__name__ in UNSTEERED:
            continue  # no trailer and no suspension in a file
        car = vehicles.specified_car(said, fidelity)
        assert type(car) is kind and type(car.steering) is kit.STEERINGS[name]
        leaves = [float(leaf) for leaf in jax.tree.leaves(car.steering)]
        np.testing.assert_allclose(leaves, {"four-wheel": [-0.2, 0.1, 15.0], "ackermann": [1.0]}.get(name, []))
    again = vehicles.specification_of(numbers)
    assert again.steering == (None if name == "front" else name)
    assert [getattr(again, key) for key in SAID["four-wheel"]] == [getattr(said, key) for key in SAID["four-wheel"]]


def test_a_steering_that_no_file_can_say_is_refused():
    numbers = dataclasses.replace(vehicles.sets.sedan(), steering=vehicles.Ackermann(0.5))
    with pytest.raises(InputError, match=r"a car's file cannot describe this steering; it can have front, ackermann"):
        vehicles.specification_of(numbers)
