"""Recordings of several drives, as `jax.vmap` returns them, and what is no recording, where one drive is needed: one message."""

import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxveh
from jaxveh import InputError, Recording, diagnostics, estimators, filters, io, manoeuvres, plots, sensors, vehicles

CAR = vehicles.passenger_car()
SPECIFICATION = vehicles.specification_of(vehicles.kit.CARS["passenger_car"]())
NAMES = ("steer", "v_x", "v_y", "a_x", "a_y", "yaw_rate", "x", "y", "yaw", "load_front", "load_rear", "sideslip")
TIME = np.arange(0.0, 8.0, 0.02)


def drive(time):
    return Recording(time, {name: jnp.sin(time) + 20.0 * (name == "v_x") for name in NAMES})


SEVERAL = jax.vmap(drive)(jnp.stack([TIME, TIME]))


def of_recordings(room):
    """The functions of a room whose first argument is one recording."""
    for name in room.__all__:
        made = getattr(room, name)
        if inspect.isfunction(made) and next(iter(inspect.signature(made).parameters), "").startswith("recording"):
            yield pytest.param(made, id=f"{room.__name__}.{name}")


CALLS = [*of_recordings(plots), *of_recordings(diagnostics)]
MODEL = estimators.state_space(CAR, sensors.esc())
OTHERS = {
    "run": lambda log: jaxveh.run(filters.Extended(), MODEL, log),
    "smooth": lambda log: filters.smooth(filters.Extended(), MODEL, log),
    "open_loop": lambda log: estimators.open_loop(CAR, log),
    "sideslip": lambda log: estimators.sideslip.estimate(SPECIFICATION, log),
    "grade": lambda log: estimators.grade.estimate(SPECIFICATION, log),
    "replay": manoeuvres.replay,
}
CALLS += [pytest.param(call, id=name) for name, call in OTHERS.items()]


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize(("given", "words"), [
    (SEVERAL, r"recording.time has shape \(2, 400\): must be \(T,\), one drive. Take one of several"),
    ({"v_x": TIME}, "recording = (dict|an array of .*): must be a Recording"),
    (TIME, "recording = an array of float64 of shape .*: must be a Recording"),
], ids=["several", "mapping", "array"])  # fmt: skip
def test_one_drive_is_needed(call, given, words):
    with pytest.raises(InputError, match=words):
        call(given)


@pytest.mark.parametrize("call", [
    lambda log: estimators.sideslip.calibrate(SPECIFICATION, log), lambda log: log.fill("a_y", "hold", max_gap=1.0),
    lambda log: io.resample(log, "a_y"), io.to_frame, lambda log: io.write_recording(log, "never_written.csv"),
    lambda log: log.between(0.0, 1.0), lambda log: log.rows(slice(0, 2)), lambda log: log.select(["v_x"]),
])  # fmt: skip
def test_what_several_drives_cannot_do_says_how_to_take_one(call):
    with pytest.raises(InputError, match=r"time has shape \(2, \d+\).*Take one of several, jax.tree.map"):
        call(SEVERAL)


def test_several_models_where_one_is_needed():
    models = jax.vmap(lambda at: jax.tree.map(lambda leaf: leaf * at, MODEL))(jnp.ones(2))
    with pytest.raises(InputError, match=r"prior.mean: v_y has shape \(2,\).* must be one number each.* use jax.vmap"):
        jaxveh.run(filters.Extended(), models, drive(TIME))


@pytest.mark.parametrize("name", ["steer", "v_x"])
def test_an_open_loop_refuses_gaps(name):
    log = drive(TIME)
    with pytest.raises(InputError, match=f"open_loop: input channel {name} is NaN in 1 rows, first at t = 0.1 s"):
        estimators.open_loop(CAR, log.replace(**{name: log[name].at[5].set(jnp.nan)}))


def test_a_quantity_to_compare_is_a_module():
    with pytest.raises(InputError, match="quantity = 'sideslip': must be an object with NAME, METHODS"):
        estimators.compare(SPECIFICATION, drive(TIME), "sideslip")
