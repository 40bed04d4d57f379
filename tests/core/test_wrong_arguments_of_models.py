"""What functions of models, fits, observers and sweeps are given by mistake is named, as in `test_wrong_arguments`.

The functions and classes are those that rooms list in `__all__`; what is right for an argument stands here by its name.
"""

import inspect

import jax
import numpy as np
import pytest
from families import arguments_of, members, refuses

import jaxveh
from jaxveh import (
    Recording,
    estimators,
    filters,
    fitting,
    io,
    manoeuvres,
    observers,
    sensors,
    statespace,
    sweeps,
    tyres,
    vehicles,
)

KEY = jax.random.key(0)
CAR = vehicles.passenger_car()
DEVICE = sensors.esc(yaw_rate=0.005, a_y=0.1)
T = np.arange(8) / 10
DRIVE = Recording(T, {"steer": 0.02 + 0 * T, "v_x": 20.0 + 0 * T, "yaw_rate": 0.1 * T, "a_y": 2.0 * T})
MODEL = estimators.state_space(CAR, DEVICE)
CHOSEN = estimators.state_space(CAR, DEVICE, estimate=lambda car: (car.front.D,), prior=0.1)
BANKED = statespace.with_disturbances(MODEL, {"v_y": 1.0})
FORCE = lambda model: (model.system.vehicle.front.D,)
FILE = io.CarSpecification(
    mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4, front_cornering_stiffness=8e4,
    rear_cornering_stiffness=9e4,
)  # fmt: skip
AT = {"v_x": 20.0}
COMMONROAD = io.CommonRoadSpecification(
    front_axle_to_cg=1.2, rear_axle_to_cg=1.4, steer_min=-0.9, steer_max=0.9, steer_rate_min=-0.4, steer_rate_max=0.4,
    acceleration_max=11.5, switching_speed=7.0, speed_min=-13.0, speed_max=50.0,
)  # fmt: skip
GAIN = observers.place_poles(MODEL, [-5.0, -6.0], dt=0.01, u=AT, leave=("yaw",))
AXLE = estimators.RearAxle(2500.0, 0.5, 12.0, mass=1500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4)
SLIP = np.linspace(-0.2, 0.2, 40)
RIG = io.RigTable(SLIP, 0 * SLIP, np.full(40, 4000.0), F_y=3000.0 * np.tanh(10 * SLIP))
ANSWERS = estimators.sideslip.estimate(estimators.sideslip.METHODS["open_loop"].make(FILE), DRIVE)
SEGMENTS = fitting.cut(MODEL, DRIVE, 0.3)

RIGHT = {
    "car": CAR, "sensors": DEVICE, "model": MODEL, "recording": DRIVE, "recordings": DRIVE, "filter": filters.Extended(),
    "where": FORCE, "key": KEY, "stiffness": 8e4, "load": 7000.0, "numbers": vehicles.sets.sedan(), "kind": vehicles.SingleTrack,
    "specification": FILE, "spec": FILE, "name": "sedan", "dt": 0.01, "bandwidth": 5.0, "gain": np.zeros((3, 2)),
    "poles": [-5.0, -6.0], "u": AT, "leave": ("yaw",), "points": ((MODEL.prior.mean, AT),), "switching": 0.1, "boundary": 0.1,
    "rate": {"front_D": 1.0}, "count": 4, "seed": 0, "a": np.ones((2, 3)), "b": np.ones((2, 3)), "axis": -1,
    "run": lambda point, key: {"y": point.x}, "design": sweeps.Design(x=[1.0, 2.0]), "seeds": 1, "window": 0.3,
    "segments": SEGMENTS, "quantity": estimators.sideslip, "rows": MODEL.rows(DRIVE),
    "start": MODEL.prior.mean, "path": "nothing", "calibration": None,
    "law": tyres.Linear(8e4), "rig": RIG, "residuals": T, "system": AXLE,
    "tyre": tyres.typical_mf_tyre(4000.0), "found": ANSWERS, "truth": T,
    "v": T, "v_x": T, "v_y": T, "crawl": 2.0,
}  # fmt: skip
"""A right value by the argument's name."""

METHOD = estimators.speed.METHODS["accelerometer"].make(FILE)

OTHERWISE = {
    "Exchange": {"methods": {"speed": METHOD}, "gives": {}}, "LiveMethod": {"method": METHOD},
    "Live": {"cleaning": estimators.kit.AsItIs()},
    "simulate": {"manoeuvre": manoeuvres.step_steer(20.0, 0.02, start=0.1, duration=0.6), "dt": 0.1},
    "observe": {"model": CHOSEN}, "extended_state": {"model": BANKED, "u": AT, "leave": ("yaw",)},
    "contraction_rate": {"gain": GAIN, "leave": ("yaw",)},
        "compare": {"methods": ("open_loop",), "car": FILE, "axis": -1}, "from_commonroad": {"specification": COMMONROAD},
    "state_space": {"estimate": lambda car: (car.front.D,), "prior": 0.1, "walk": 0.1},
    "steering_without_sideslip": {"car": vehicles.linear_single_track(CAR)}, "commonroad_limits": {"specification": COMMONROAD},
    "open_loop_of_file": {"car": FILE},
    "solve": {"problem": fitting.pose_shooting(MODEL, SEGMENTS, FORCE), "start": None},
    "bootstrap": {"problem": fitting.pose_shooting(MODEL, SEGMENTS, FORCE)},
    "pose_shooting": {"prior": 0.1, "where": FORCE}, "pose_likelihood": {"prior": 0.1}, "pose_prediction_error": {"prior": 0.1},
    "sweep": {"seeds": 1, "key": KEY}, "multiple_shooting": {"where": FORCE}, "starting_tyre": {"model": "mf"},
    "score_answers": {"name": "sideslip"}, "place_poles": {"leave": ("yaw",), "u": AT},
}  # fmt: skip
"""Right values of one function, where they differ from `RIGHT`."""

MORE = {"latin_hypercube": {"x": (0.0, 1.0)}, "sobol": {"x": (0.0, 1.0)}}
"""What a function takes by any name."""

LONG = {"solve", "bootstrap", "multiple_shooting", "maximum_likelihood", "prediction_error", "sweep", "compare", "fit_rig",
    "read_sweep", "read_calibration", "write_calibration"}  # fmt: skip
"""What computes for long or needs a file: what is right is right by other tests."""

SAID = {
    "recordings": "recording",
    "name": "car",
    "estimate": "where",
    "axis": "a has",
    "methods": "method",
    "store": "path",
}
"""What messages call an argument, if it is not the argument's name."""

TAKEN = {
    ("Adaptive", "rate"): ("a mapping",),
    ("place_poles", "leave"): ("none",), ("contraction_rate", "leave"): ("none",),
    ("extended_state", "leave"): ("none",), ("canonical", "fixed"): ("none", "text", "a mapping", "a list with text"),
    ("from_commonroad", "name"): ("text",), ("write_calibration", "path"): ("text",),
    ("from_commonroad", "source"): ("text",), ("fit_rig", "free"): ("none",), ("pose_rig", "free"): ("none",),
    ("read_calibration", "path"): ("text",),
    ("read_sweep", "path"): ("text",), ("sweep", "note"): ("text",), ("sweep", "store"): ("text",),
}  # fmt: skip
"""What is wrong for others."""

ROOMS = (vehicles, observers, sweeps, fitting, estimators)
CLASSES = {
    (observers, name) for name in observers.__all__ if name in members("observers", observers.AbstractObserver)
} | {(estimators, name) for name in ("Exchange", "Live", "LiveMethod")}
"""Classes that users make of models; those of cars are looked at where all cars are."""

CASES = [
    pytest.param(name, getattr(room, name), id=f"{room.__name__.split('.')[-1]}.{name}")
    for room in ROOMS
    for name in room.__all__
    if inspect.isfunction(getattr(room, name)) or (room, name) in CLASSES
]


def right(name, made):
    """The arguments by name with which a function works."""
    given, own = OTHERWISE.get(name, {}), RIGHT | OTHERWISE.get(name, {})
    asked = [one.name for one in arguments_of(made) if one.default is one.empty or one.name in given]
    assert set(asked) <= set(own), f"{name}: add what is right for {set(asked) - set(own)} to RIGHT"
    return {one: own[one] for one in asked} | MORE.get(name, {})


@pytest.mark.parametrize(("name", "made"), [pytest.param("simulate", jaxveh.simulate, id="simulate"), *CASES])
def test_what_is_wrong_for_an_argument_is_named(name, made):
    given = right(name, made)
    if name not in LONG:
        made(**given)
    for argument in arguments_of(made):
        refuses(made, given, argument, SAID.get(argument.name, ""), TAKEN.get((name, argument.name), ()))
