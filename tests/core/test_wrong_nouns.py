"""A vehicle, a car's file, a recording, a filter, a tyre, a model, devices or answers in place of one another are refused with
the name of what was given.

The functions are all that modules list in `__all__`, but for tools of those who add to a room; what is right for an argument
stands here by its name. Values are made when a test asks, so that collecting tests takes no time.
"""

import functools
import inspect
from types import SimpleNamespace

import jax
import matplotlib.pyplot as plt
import numpy as np
import pytest
from families import arguments_of, listed_modules

import jaxveh
from jaxveh import (
    Recording,
    estimators,
    filters,
    io,
    manoeuvres,
    sensors,
    sweeps,
    tyres,
    vehicles,
)

CAR = vehicles.passenger_car()
DEVICE = sensors.esc(yaw_rate=0.005, a_y=0.1)
T = np.arange(310) / 10
DRIVE = Recording(T, {
    "steer": 0.02 * np.sin(T), "v_x": 20.0 + 0 * T, "v_y": 0 * T, "yaw_rate": 0.1 * np.sin(T), "a_y": 2.0 * np.sin(T),
    "a_x": 0 * T, "x": T, "y": T, "yaw": T, "steering_wheel": 0.3 * np.sin(T), "drive_torque": 0 * T, "brake_torque": 0 * T,
})  # fmt: skip
FILE = io.CarSpecification(
    mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4, front_cornering_stiffness=8e4,
    rear_cornering_stiffness=9e4, wheel_radius=0.3, steering_ratio=15.0,
    roll_gradient=0.006, cg_height=0.5, track_front=1.5, track_rear=1.5,
)  # fmt: skip
SLIP = np.linspace(-0.2, 0.2, 40)
RIG = io.RigTable(SLIP, 0 * SLIP, np.full(40, 4000.0), F_y=3000.0 * np.tanh(10 * SLIP))
AXLE = SimpleNamespace(time=T, mean=SimpleNamespace(slip_angle_rear=T, F_yr=T))
FORCE = lambda model: (model.system.vehicle.front.D,)


@functools.cache
def nouns():
    """Each noun by its name: made when a test asks, not when tests are collected."""
    return {
        "a vehicle": CAR, "a car's file": FILE, "a recording": DRIVE, "a filter": filters.Extended(),
        "a tyre": tyres.Linear(8e4), "a model": estimators.state_space(CAR, DEVICE), "devices": DEVICE,
        "answers": estimators.sideslip.estimate(FILE, DRIVE, method="open_loop"), "rig data": RIG,
    }  # fmt: skip


OF_NOUNS = {
    "car", "cars", "recording", "recordings", "filter", "tyre", "law", "model", "source", "vehicle", "estimate", "estimates",
    "spec", "specification", "rig", "schedule", "fit", "logs", "manoeuvre", "driven", "turns", "runs", "bound", "frame", "found",
    "truth", "system", "learned", "sensors", "road",
}  # fmt: skip
"""Names of arguments that are a noun."""


@functools.cache
def rights():
    """A right value by the argument's name, of nouns and of the arguments that are looked at before one."""
    model, answers = nouns()["a model"], nouns()["answers"]
    estimate = filters.run(filters.Extended(), model, DRIVE)
    learner = estimators.geometry.METHODS["learner"].make(FILE)
    learned = estimators.geometry.numbers_learned(estimators.geometry.estimate(learner, DRIVE))
    return {
        "car": CAR, "cars": {"truth": CAR}, "recording": DRIVE, "recordings": DRIVE, "filter": filters.Extended(),
        "tyre": tyres.Linear(8e4), "law": tyres.Linear(8e4), "model": model, "source": FILE, "vehicle": CAR, "estimate": estimate,
        "estimates": estimate, "spec": FILE, "specification": FILE, "rig": RIG, "schedule": DRIVE, "key": jax.random.key(0),
        "manoeuvre": manoeuvres.step_steer(20.0, 0.02), "sensors": DEVICE, "where": FORCE, "std": {"steer": 0.1},
        "prior": {"v_y": 0.1}, "path": "nothing.csv", "raster": "a_y", "time": T, "mean": T, "truth": T, "reference": T,
        "slips": {"front": T, "rear": T}, "contact": tyres.Contact(0.0, load=4000.0), "u": {"v_x": 20.0}, "dt": 0.1,
        "gain": np.zeros((3, 2)), "points": ((model.prior.mean, {"v_x": 20.0}),), "poles": [-5.0, -6.0], "rate": {"front_D": 1.0},
        "design": sweeps.Design(x=[1.0]), "run": lambda point, key: {"y": point.x}, "window": 0.3, "rows": model.rows(DRIVE),
        "found": answers, "learned": learned, "method": learner, "load": 4000.0, "name": "sideslip", "told": {},
        "quantity": estimators.sideslip, "start": model.prior.mean, "stiffness": 8e4, "bandwidth": 5.0, "residuals": T,
        "duration": 1.0, "folder": "nothing",
    }  # fmt: skip


OF_FILES = {name for name in listed_modules() if name.startswith("estimators.") and "kit" not in name}
"""Modules whose `car` is a car's file."""


@functools.cache
def otherwise():
    """Right values of one function, where they differ from `rights`."""
    model = nouns()["a model"]
    chosen = estimators.state_space(CAR, DEVICE, estimate=lambda car: (car.front.D,), prior=0.1)
    turn = filters.Turn(filters.Extended(), model, lambda told: told, lambda *told: told[2])
    return {
        "filters.smooth_parallel": {"filter": filters.Iterated(filters.Extended())},
        "fitting.starting_tyre": {"model": "mf"}, "plots.fit": {"fit": {"a": 1.0}}, "sensors.named_devices": {"name": "esc"},
        "io.with_road_steer": {"car": FILE}, "io.write_car": {"car": FILE}, "diagnostics.check_car": {"car": FILE},
        "plots.rear_axle": {"estimate": AXLE}, "plots.rear_axle_points": {"estimate": AXLE},
        "estimators.compare": {"methods": ("open_loop",), "car": FILE}, "estimators.observe": {"model": chosen},
        "estimators.open_loop_of_file": {"car": FILE}, "estimators.sideslip.score": {"found": nouns()["answers"]},
        "filters.interleave": {"turns": {"one": turn}},
    }  # fmt: skip


SEVERAL = {
    ("diagnostics.check_log", "car"): ("a car's file",), ("estimators.learned.with_residual_tyres", "car"): ("a vehicle",),
    ("estimators.mass_and_grade.estimate", "source"): ("a model",),
    ("estimators.mass_and_grade.live", "source"): ("a model",),
    ("filters.monte_carlo", "truth"): ("a model",), ("filters.simulation_based_calibration", "truth"): ("a model",),
    ("plots.car", "vehicle"): ("a car's file",), ("plots.closeup", "estimate"): ("answers",),
    ("plots.closeup", "truth"): ("a recording",), ("plots.drive", "car"): ("a car's file",),
    ("plots.estimate", "estimates"): ("answers",), ("plots.estimate", "truth"): ("a recording",),
    ("plots.top_view", "car"): ("a car's file",),
}  # fmt: skip
"""What an argument takes beside what stands in `rights`, by function and argument."""

LATER = {
    ("diagnostics.delay_of_rows", "truth"): "a traced formula of arrays",
    ("filters.rmse_beside_bound", "bound"): "needs runs, which take long; `runs` is looked at first",
    ("plots.rig_fit", "rig"): "needs a fit, which takes long; `fit` is looked at first",
}
"""What is not looked at, with the reason."""

TOOLS = ("kit", "numerics", "experiments", "studies.figures")
"""Modules of those who add to a room, and of papers."""

ALL = [
    pytest.param(f"{module}.{name}", function, argument.name, id=f"{module}.{name}-{argument.name}")
    for module, room in listed_modules().items()
    if not any(tool in module for tool in TOOLS)
    for name in getattr(room, "__all__", ())
    if inspect.isfunction(function := getattr(room, name))
    for argument in arguments_of(function)
    if argument.name in OF_NOUNS
]
CASES = [case for case in ALL if (case.values[0], case.values[2]) not in LATER]


def right(name, function):
    """The arguments by name with which a function works, as far as the first check."""
    own = rights() | ({"car": FILE} if name.rpartition(".")[0] in OF_FILES else {}) | otherwise().get(name, {})
    asked = [one.name for one in arguments_of(function) if one.default is one.empty]
    return {one: own.get(one) for one in asked}, own


@pytest.mark.parametrize(("name", "function", "argument"), CASES)
def test_a_noun_in_place_of_another_is_named(name, function, argument, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given, own = right(name, function)
    for noun, wrong in nouns().items():
        if type(wrong) is type(own.get(argument)) or noun in SEVERAL.get((name, argument), ()):
            continue
        with pytest.raises(jaxveh.InputError) as told:
            pytest.fail(f"{name}({argument}={noun}) is {function(**given | {argument: wrong})}")
        # Of answers their mean may be named, an `Answer`.
        assert type(wrong).__name__.removesuffix("s") in str(told.value), f"{argument}={noun}: {told.value}"
    plt.close("all")


def test_what_is_left_out_is_there():
    there = {(case.values[0], case.values[2]) for case in ALL}
    assert {*LATER, *SEVERAL} <= there and set(otherwise()) <= {name for name, _ in there}
