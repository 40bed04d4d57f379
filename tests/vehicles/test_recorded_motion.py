"""Every vehicle's rates and outputs in general position, and every number of every car that is given by name, as recorded."""

import contextlib
import dataclasses
import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from planar_cars import MAKERS, point
from recorded_numbers import check_declared, check_recorded, classes_of, declared_names, lively, without_effect
from test_every_steering import STEERINGS
from test_every_steering import made as steered
from test_every_steering import stirred as steered_point
from test_every_vehicle import CARS, ROUGH, made, seven, shifted_mf, start, stirred

from jaxveh import InputError, roads, vehicles
from jaxveh.roads import LEVEL
from jaxveh.vehicles.sets import commonroad_cars

pytestmark = pytest.mark.whole

GIVEN = {
    name: maker
    for name, maker in {**vars(commonroad_cars), **vars(vehicles.sets), **vars(vehicles)}.items()
    if inspect.isfunction(maker) and not name.startswith("_") and not [
        one for one in inspect.signature(maker).parameters.values()
        if one.default is one.empty and one.kind not in (one.VAR_KEYWORD, one.VAR_POSITIONAL)
    ]
}  # fmt: skip
"""Functions that make a car, or the numbers of one, of nothing."""


@pytest.mark.parametrize("name", CARS)
def test_motion_is_that_recorded(name):
    """Stirred, on level ground and on a rough one; slowly, nearly standing; hard to the left; with no number that is 0 or 1."""
    car, (x, u) = made(name), stirred(name)
    slow = x._replace(**{n: 0.02 * getattr(x, n) for n in x._fields if n.startswith(("v_", "omega"))})
    slow_u = u._replace(**{n: 0.02 * getattr(u, n) for n in u._fields if n.startswith(("v_x", "speed"))})
    cases = {
        "level": (x, u, LEVEL),
        "rough": (x, u, ROUGH),
        "slow": (slow, slow_u, ROUGH),
        "other": (*stirred(name, 3), ROUGH),
    }
    found = {"start": start(name)[0]._asdict(), "motion": car.motion(x, u)._asdict(), "wheels": car.wheel_positions}
    for what, case in cases.items():
        rates, outputs = car.evaluate(0.0, *case)
        found[what] = {"rates": rates._asdict(), "outputs": outputs._asdict()}
    rates, outputs = lively(car).evaluate(0.0, x, u, ROUGH)
    found["lively"] = {"rates": rates._asdict(), "outputs": outputs._asdict()}
    if hasattr(car, "rear"):
        rates, outputs = uneven(car).evaluate(0.0, x, u, ROUGH)
        found["uneven"] = {"rates": rates._asdict(), "outputs": outputs._asdict()}
    check_recorded(__file__, name, found)


def test_no_field_of_the_rough_ground_is_that_of_a_level_one():
    assert all(rough != level for rough, level in zip(ROUGH, LEVEL, strict=True))


OPTIONS = {
    "not mirrored": ("SevenDOF", lambda car: dataclasses.replace(car, front=shifted_mf(), mirrored=False)),
    "mirrored": ("SevenDOF", lambda car: dataclasses.replace(car, front=shifted_mf())),
    "a share of the roll": ("SevenDOF", lambda car: dataclasses.replace(car, front_roll_share=0.7)),
    "crawling at a higher speed": ("SevenDOF", lambda car: dataclasses.replace(car, crawl_speed=40.0)),
    "another road": ("Travelling", lambda car: dataclasses.replace(car, road=roads.Banked(0.1, -10.0, 40.0))),
}


@pytest.mark.parametrize("option", OPTIONS)
def test_motion_by_other_options_is_that_recorded(option):
    name, change = OPTIONS[option]
    rates, outputs = change(made(name)).evaluate(0.0, *stirred(name), ROUGH)
    check_recorded(__file__, f"option: {option}", {"rates": rates._asdict(), "outputs": outputs._asdict()})


def test_every_number_and_option_of_a_car_has_an_effect_in_one_on_record():
    cars = {name: made(name) for name in CARS}
    changed = [change(cars[name]) for name, change in OPTIONS.values()]
    steered_cars = [steered(kind, steering) for kind in ("SingleTrack", "TwoTrack3DOF") for steering in STEERINGS]
    members = [*changed, *map(lively, cars.values()), *(make() for make in MAKERS.values()), *steered_cars]
    of_one_function = {"crawl_speed", "front_roll_share", "mirrored"}  # which all cars call: SevenDOF stands for them
    found = without_effect(members, "jaxveh.vehicles")
    assert {name for name in found if name.partition(".")[2] not in of_one_function} == set()


def test_long_laws_with_other_numbers_behind_move_as_recorded():
    """Four wheels in one call of the law, each with its axle's numbers."""
    x, u = stirred("SevenDOF")
    weaker = eqx.tree_at(
        lambda t: (t.lateral.PDY1, t.longitudinal.PKX1), shifted_mf(), (jnp.asarray(0.7), jnp.asarray(15.0))
    )
    even, other = (eqx.tree_at(lambda c: c.rear, seven(shifted_mf()), rear) for rear in (shifted_mf(), weaker))
    found = {}
    for what, car in (("even", even), ("weaker behind", other)):
        rates, outputs = car.evaluate(0.0, x, u, ROUGH)
        found[what] = {"rates": rates._asdict(), "outputs": outputs._asdict()}
    assert abs(found["even"]["rates"]["yaw_rate"] - found["weaker behind"]["rates"]["yaw_rate"]) > 0.01
    check_recorded(__file__, "SevenDOF on MF-Tyres", found)


@pytest.mark.parametrize("steering", STEERINGS)
def test_motion_of_steered_cars_is_that_recorded(steering):
    found = {}
    for kind in ("Kinematic", "LinearSingleTrack", "SingleTrack", "TwoTrack3DOF", "FourteenDOF"):
        x, u = steered_point(kind, steering)
        rates, outputs = steered(kind, steering).evaluate(0.0, x, u, ROUGH)
        found[kind] = {"rates": rates._asdict(), "outputs": outputs._asdict()}
    check_recorded(__file__, f"steering: {steering}", found)


def uneven(car):
    """With other tyres behind: all their numbers a tenth smaller."""
    return eqx.tree_at(lambda c: c.rear, car, jax.tree.map(lambda number: 0.9 * number, car.rear))


@pytest.mark.parametrize("name", MAKERS)
def test_motion_of_planar_cars_is_that_recorded(name):
    car = MAKERS[name]()
    rates, outputs = car.evaluate(0.0, *point(car), ROUGH)
    check_recorded(__file__, f"planar: {name}", {"rates": rates._asdict(), "outputs": outputs._asdict()})


@pytest.mark.parametrize("name", GIVEN)
def test_numbers_of_cars_given_by_name_are_those_recorded(name):
    check_recorded(__file__, f"given: {name}", np.stack([0.0, *leaves(GIVEN[name]())]), given=True)


@pytest.mark.parametrize("name", vehicles.sets.CARS)
def test_every_named_car_has_the_numbers_recorded(name):
    """Its own, those of its file, and those that it has as every kind of vehicle that they reach."""
    found = {"own": vehicles.sets.CARS[name]()}
    with contextlib.suppress(InputError):  # no file can say what it is
        found["file"] = vehicles.specification_of(found["own"])
    for fidelity in vehicles.sets.FIDELITIES:
        try:
            found[fidelity] = vehicles.named_car(name, fidelity)
        except InputError:  # its numbers do not reach
            continue
    check_recorded(
        __file__, f"named: {name}", {kind: np.stack(list(leaves(one))) for kind, one in found.items()}, given=True
    )


def leaves(thing):
    """All numbers in a tree, a dataclass or a tuple, in the order in which a class's fields are on record, wherever its bases
    declare them now."""
    if isinstance(thing, float | int | np.ndarray | jax.Array) and not isinstance(thing, bool):
        yield np.asarray(thing, float)
    elif dataclasses.is_dataclass(thing):
        for name in declared_names(__file__, type(thing)):
            yield from leaves(getattr(thing, name))
    elif isinstance(thing, tuple | list | dict):
        for one in thing.values() if isinstance(thing, dict) else thing:
            yield from leaves(one)


DECLARED = classes_of(vehicles, vehicles.sets)


@pytest.mark.parametrize("name", DECLARED)
def test_parameters_are_declared_as_recorded(name):
    check_declared(__file__, name, DECLARED[name])
