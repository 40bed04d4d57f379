"""What a public function or class is given by mistake is named: None, text, objects, lists that hold text, for each argument.

The functions and classes are those that rooms list in `__all__`; what is right for an argument stands here by its name.
"""

import inspect

import jax
import numpy as np
import pytest
from families import arguments_of, arrays_among, refuses

from jaxveh import InputError, Recording, io, manoeuvres, roads, sensors, statespace, vehicles

KEY = jax.random.key(0)
T = np.arange(5.0)
STEER = manoeuvres.step_steer(20.0, 0.02)
UNIT = sensors.IMU("a_x", rate=100.0)
LEVEL = roads.Level()
COURSE = manoeuvres.iso_3888_1(1.8)

RIGHT = {
    # Of drives.
    "speed": 20.0, "steer": 0.02, "duration": 60.0, "start": 1.0, "key": KEY, "name": "step-steer", "deceleration": 5.0,
    "amplitude": 1.5, "wavelength": 30.0, "before": 15.0, "after": 20.0, "radius": 50.0, "mean": 20.0, "manoeuvre": STEER,
    "driver": STEER, "what": STEER, "mass": 1500.0, "recording": Recording(T, {"steer": T, "v_x": T}), "s": 0.5,
    "width": 1.8, "length": 4.5, "course": COURSE, "lead": 2.0, "x": T, "y": T, "yaw": T, "lanes": COURSE.lanes,
    "car": vehicles.passenger_car(), "path": manoeuvres.Straight(), "over": 3.5, "back": -3.5, "over_from": 10.0, "over_to": 30.0,
    "back_from": 50.0, "back_to": 70.0, "frequencies": T,
    # Of roads.
    "std": 0.02, "longest": 300.0, "shortest": 50.0, "roughness": "C", "height": 5.0, "bank": 0.05, "left": 0.3, "right": 1.0,
    "at_distance": 50.0, "distance": [0.0, 100.0], "heights": T, "wavenumbers": T, "phases": T, "slants": T, "road": LEVEL,
    "wheels": ((1.2, 0.7), (1.2, -0.7), (-1.4, 0.7), (-1.4, -0.7)), "spec": io.RoadSpecification(),
    # Of devices.
    "rate": 100.0, "device": UNIT, "devices": UNIT, "channel": "a_x", "at": 1.0, "size": 0.5, "probability": 0.1,
    "noise": statespace.Gaussian({"a_y": 0.1}), "channels": ("v_x",), "names": {"a_x": "second"},
    "vehicle": vehicles.passenger_car(),
}  # fmt: skip
"""A right value by the argument's name."""

OTHERWISE = {
    "Combined": {"friction": LEVEL, "grade": LEVEL}, "named_road": {"name": "wet"}, "rough": {"shortest": 0.5},
    "gauss_markov": {"length": 100.0, "shortest": 20.0}, "PathDriver": {"speed": manoeuvres.SteadySpeed(20.0)},
    "options_of_car": {"name": "braking-in-a-turn"}, "random_steering": {"duration": 20.0}, "Dropout": {"probability": 0.1},
    "WheelSpeeds": {"radius": 0.3}, "named_devices": {"name": "esc", "noise": {}}, "cones": {"spacing": 3.0},
    "iso_lane_change": {"duration": None}, "iso_obstacle_avoidance": {"duration": None}, "slalom_course": {"duration": None},
    "steady_circle": {"duration": None},
}  # fmt: skip
"""Right values of one function or class, where they differ from `RIGHT`."""

NO_USERS = {
    "a manoeuvre of the room's functions, which check": lambda one: issubclass(one, manoeuvres.AbstractManoeuvre),
    "what functions return": lambda one: issubclass(one, tuple),
    "abstract": inspect.isabstract,
}
"""Classes that users do not make, by the reason."""

ELEMENTWISE = {"smooth_step"}
"""Formulas of arrays, like those of `jax.numpy`, which speak for themselves."""

TAKEN = {("named_devices", "noise"): ("a mapping",)}
"""What is wrong for others."""

ROOMS = (roads, manoeuvres, sensors)
SAID = {
    "name": "manoeuvre|road|devices", "what": "manoeuvre", "wheel_radius": "radius", "steering_ratio": "ratio", "mean": "speed",
    "channels": "replay|low_pass",
}  # fmt: skip
"""What messages call an argument, if it is not the argument's name."""


def is_made_by_users(name, one):
    if inspect.isfunction(one):
        return name not in ELEMENTWISE
    return inspect.isclass(one) and not any(holds(one) for holds in NO_USERS.values())


def right(name, made):
    """The arguments by name with which a function or class works."""
    given, own = OTHERWISE.get(name, {}), RIGHT | OTHERWISE.get(name, {})
    asked = [one.name for one in arguments_of(made) if one.default is one.empty or one.name in given]
    assert set(asked) <= set(own), f"{name}: add what is right for {set(asked) - set(own)} to RIGHT"
    return {one: own[one] for one in asked}


CASES = [
    pytest.param(name, getattr(room, name), id=f"{room.__name__.split('.')[-1]}.{name}")
    for room in ROOMS
    for name in room.__all__
    if is_made_by_users(name, getattr(room, name))
]


@pytest.mark.parametrize(("name", "made"), CASES)
def test_what_is_wrong_for_an_argument_is_named(name, made):
    given = right(name, made)
    made(**given)
    for argument in arguments_of(made):
        refuses(made, given, argument, SAID.get(argument.name, ""), TAKEN.get((name, argument.name), ()))


ENDLESS = {("band", "longest"): "waves from the length zero of wavenumbers on"}
"""Numbers that may be infinite."""


@pytest.mark.parametrize(("name", "made"), CASES)
def test_no_number_is_nan_or_infinite(name, made):
    given = right(name, made)
    for argument, value in arrays_among(made, given).items():
        for wrong in (np.nan, np.inf, -np.inf):
            if value.ndim == 0 and not (wrong == np.inf and (name, argument) in ENDLESS):
                with pytest.raises(InputError):
                    made(**given | {argument: wrong})


def test_shapes_that_do_not_go_together_are_named():
    with pytest.raises(InputError, match=r"x, y, yaw have shapes \(5,\), \(2,\), \(\): must go together"):
        roads.under(LEVEL, T, T[:2], 0.1, RIGHT["wheels"])
    for frequencies, phases in ((T, T[:2]), (0.5, 0.5), (T[:0], T[:0]), (T[None], T[None])):
        with pytest.raises(InputError, match=r"frequencies, phases have shapes .*: must be \(n,\)"):
            manoeuvres.WaveringSpeed(20.0, 1.0, frequencies, phases).v_x(1.0)
