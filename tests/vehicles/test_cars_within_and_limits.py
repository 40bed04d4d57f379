"""Cars inside others, limits out of a CommonRoad vehicle, steerings in a car's file: numbers that pass through unchanged."""

import jax.numpy as jnp
import numpy as np
import pytest
from test_every_vehicle import CARS

from jaxveh import InputError, manoeuvres, roads, tyres, vehicles
from jaxveh._core.names import record
from jaxveh.io import CarSpecification, CommonRoadSpecification
from jaxveh.tyres import Contact
from jaxveh.vehicles.steering import specification_of_steering, steering_of
from jaxveh.vehicles.together import alike, long_law, together

NUMBERS = {
    "mass": 1500.0, "yaw_inertia": 2500.0, "front_axle_to_cg": 1.2, "rear_axle_to_cg": 1.5,
    "front_cornering_stiffness": 90e3, "rear_cornering_stiffness": 110e3,
}  # fmt: skip
LIMITS = {
    "steer_min": -0.9, "steer_max": 1.0, "steer_rate_min": -0.4, "steer_rate_max": 0.5, "acceleration_max": 11.5,
    "switching_speed": 4.7, "speed_min": -13.0, "speed_max": 50.0,
}  # fmt: skip


def test_a_commonroad_vehicle_s_limits_are_its_numbers_each_in_its_place():
    steer, drive = vehicles.commonroad_limits(CommonRoadSpecification(1.2, 1.5, **LIMITS))
    found = [float(value) for limits in (steer, drive) for value in vars(limits).values()]
    assert found == list(LIMITS.values())
    for name in LIMITS:
        with pytest.raises(InputError, match=f"limits of the vehicle: {name} missing"):
            vehicles.commonroad_limits(CommonRoadSpecification(1.2, 1.5, **{**LIMITS, name: None}))


WITHIN = [name for name, car in CARS.items() if hasattr(car.make(), "vehicle")]


@pytest.mark.parametrize("name", WITHIN)
def test_the_options_of_a_car_inside_another_are_its_own(name):
    car = CARS[name].make()
    inner = car
    while hasattr(inner, "vehicle"):
        inner = inner.vehicle
    assert vehicles.kit.innermost_car(car) is inner and vehicles.kit.innermost_car(inner) is inner
    for manoeuvre in manoeuvres.MANOEUVRES:
        own = manoeuvres.options_of_car(manoeuvre, inner)
        assert manoeuvres.options_of_car(manoeuvre, car) == own
    own = manoeuvres.options_of_car("steady-circle", inner)
    if hasattr(inner, "front"):
        assert own["understeer_gradient"] == float(vehicles.linear_single_track(inner).understeer_gradient)
        assert own["wheelbase"] == float(inner.front_axle_to_cg) + float(inner.rear_axle_to_cg)


FOUR_WHEEL = {"steering": "four-wheel", "rear_steer_ratio": -0.2}


@pytest.mark.parametrize(
    "said",
    [
        {},
        {"steering": "ackermann"},
        {"steering": "rear"},
        {"steering": "independent"},
        FOUR_WHEEL,
        FOUR_WHEEL | {"rear_steer_ratio_fast": 0.3, "rear_steer_speed": 14.0},
    ],
    ids=lambda said: f"{len(said)} {said.get('steering', 'front')}",
)
def test_a_steering_goes_into_a_car_s_file_and_comes_back(said):
    steering = steering_of(CarSpecification(**NUMBERS, **said))
    assert specification_of_steering(steering) == said
    if "rear_steer_ratio" in said:
        assert float(steering.rear_ratio) == -0.2
        assert (steering.fast_ratio is None) == ("rear_steer_ratio_fast" not in said)
        if steering.fast_ratio is not None:
            assert (float(steering.fast_ratio), float(steering.middle_speed)) == (0.3, 14.0)
    with pytest.raises(InputError, match="a car's file cannot describe this steering"):
        specification_of_steering(vehicles.Ackermann(0.5))


def test_the_linear_car_within_others_is_that_of_the_inner_one():
    """Through every layer; a linear car is itself, but for the height of its centre of gravity."""
    inner = vehicles.passenger_car()
    plain = vehicles.linear_single_track(inner)
    within = vehicles.linear_single_track(vehicles.Travelling(vehicles.Commanded(inner)))
    high = vehicles.linear_single_track(plain, cg_height=0.6)
    for name in ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg", "front_stiffness", "rear_stiffness"):
        assert float(getattr(within, name)) == float(getattr(plain, name)) == float(getattr(high, name))
    assert plain.cg_height is None and float(high.cg_height) == 0.6


def test_a_car_that_travels_sees_its_road_where_its_wheels_are():
    """The outputs tell friction and height at each wheel, and the slopes in the car's axes; the car itself has no say."""
    inner = vehicles.named_car("compact_car", "seven-dof")
    road = roads.Combined(roads.SplitMu(0.9, 0.3), roads.Banked(0.05, ramp=5.0))
    car = vehicles.Travelling(inner, road)
    u = record("Inputs", dict.fromkeys(car.inputs, np.asarray(0.0)))
    x = car.start(0.0, u, v_x=np.asarray(15.0), x=np.asarray(3.0), y=np.asarray(0.0))
    _, outputs = car.evaluate(0.0, x, u)
    found = outputs._asdict()
    moves = inner.motion(car._inner(x), u)
    ground = roads.under(road, x.x, x.y, moves.yaw, inner.wheel_positions)._asdict()
    assert abs(ground["bank"]) > 0.01
    for name, value in ground.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-12)
    assert found["friction_fl"] > found["friction_fr"] and found["friction_rl"] > found["friction_rr"]
    own = inner.evaluate(0.0, car._inner(x), u, roads.under(road, x.x, x.y, moves.yaw, inner.wheel_positions))[1]
    np.testing.assert_allclose([found[name] for name in own._fields], list(own), rtol=1e-12)


def test_masses_of_a_car_on_springs_add_up():
    car = vehicles.named_car("suv", "fourteen-dof")
    wheels = 2.0 * (float(car.unsprung_mass_front) + float(car.unsprung_mass_rear))
    assert float(car.mass) == pytest.approx(float(car.sprung_mass) + wheels, rel=1e-12)


def brush(stiffness):
    return tyres.Brush(jnp.asarray(stiffness), 60e3, 0.9)


def test_tyres_by_one_call_are_those_by_several():
    """Of different numbers and of one, in a batch and alone; a number of Python that is the same for all stays one."""
    force = lambda tyre, angle, load, given: tyre.forces(Contact(slip_angle=angle, load=load, friction=given)).F_y
    different, same = tuple(brush(k * 1e4) for k in (5.0, 6.0, 7.0)), (brush(5e4),) * 3
    for shape in ((), (2,)):
        angles = [jnp.full(shape, 0.01 * (k + 1)) for k in range(3)]
        loads = [jnp.asarray(3000.0), 4000.0, jnp.full(shape, 5000.0)]
        for set_of_tyres in (different, same):
            assert alike(*set_of_tyres)
            found = together(force, set_of_tyres, angles, loads, [1.0] * 3)
            for k, value in enumerate(found):
                expected = force(set_of_tyres[k], angles[k], jnp.asarray(loads[k]), 1.0)
                assert value.shape == shape
                np.testing.assert_allclose(value, expected, rtol=1e-12)
    assert not alike(brush(5e4), brush(np.array([5e4, 6e4])))
    assert not alike(brush(5e4), tyres.Linear(5e4, 6e4))
    mf = tyres.typical_mf_tyre(4000.0)
    assert [long_law(tyre) for tyre in (mf, tyres.Relaxed(mf), brush(5e4))] == [True, True, False]
    # What does not depend on the wheel is the same for all.
    kept = together(lambda tyre, angle: (angle, "held", jnp.asarray(2.0)), different, angles)
    assert [one[1] for one in kept] == ["held"] * 3
    np.testing.assert_array_equal(np.stack([one[2] for one in kept]), np.full((3, 2), 2.0))
