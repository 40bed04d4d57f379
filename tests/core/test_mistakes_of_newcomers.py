"""Mistakes that newcomers make: each is answered by one message that says what, where, and the remedy."""

import builtins
import re
import warnings

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxveh
from jaxveh import (
    InputError,
    JaxvehWarning,
    Recording,
    estimators,
    filters,
    io,
    manoeuvres,
    roads,
    sensors,
    statespace,
    tyres,
    vehicles,
)

DEVICE = sensors.esc(yaw_rate=0.005, a_y=0.1)


@pytest.fixture(scope="module")
def car():
    return vehicles.passenger_car()


@pytest.fixture(scope="module")
def model(car):
    return estimators.state_space(car, DEVICE)


@pytest.fixture(scope="module")
def drive():
    time = np.arange(0.0, 1.0, 0.05)
    return Recording(
        time, {name: 0.01 * np.sin(time) for name in ("steer", "yaw_rate", "a_y")} | {"v_x": 25.0 + 0.0 * time}
    )


def test_a_forgotten_key(model, drive):
    for filter in (filters.ParticleFilter(100), filters.AuxiliaryParticleFilter(100), filters.Ensemble(20)):
        with pytest.raises(InputError, match=r"draws random numbers: give it a key, e.g. key=jax.random.key\(0\)"):
            jaxveh.run(filter, model, drive)


DRAWS = [
    lambda key, model, drive: jaxveh.run(filters.ParticleFilter(100), model, drive, key=key),
    lambda key, model, drive: jaxveh.simulate(vehicles.passenger_car(), manoeuvres.step_steer(25.0, 0.01), DEVICE, key),
    lambda key, model, drive: statespace.draw(model, drive, key),
    lambda key, model, drive: filters.monte_carlo(filters.Extended(), model, drive, key),
    lambda key, model, drive: filters.simulation_based_calibration(filters.Extended(), model, drive, key),
    lambda key, model, drive: filters.log_likelihood_spread(filters.ParticleFilter(10), model, drive, key),
    lambda key, model, drive: manoeuvres.random_steering(25.0, 0.01, key),
    lambda key, model, drive: manoeuvres.cruise(25.0, key),
    lambda key, model, drive: roads.rough("A", key),
    lambda key, model, drive: roads.gauss_markov(0.02, 100.0, key),
    lambda key, model, drive: roads.band(0.02, 100.0, 10.0, key),
    lambda key, model, drive: manoeuvres.wavering_speed(20.0, 1.0, key),
    lambda key, model, drive: statespace.posterior_cramer_rao(model, drive, key, runs=3),
    lambda key, model, drive: sensors.Suite(sensors.IMU("a_x", rate=100.0)).record([0.0], {"a_x": [0.0]}, 0.0, key),
    lambda key, model, drive: sensors.IMU("a_x", rate=100.0).read([0.0], {"a_x": [0.0]}, key),
]  # fmt: skip
"""What draws random numbers from one key."""


@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("key", [0, 1.5, "seed"])
def test_a_number_in_place_of_a_key(draws, key, model, drive):
    with pytest.raises(InputError, match=rf"key = {key!r}: must be a key of jax.random, e.g. key=jax.random.key\(0\)"):
        draws(key, model, drive)


@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("make", [jax.random.key, jax.random.PRNGKey])
def test_several_keys_in_place_of_one(draws, make, model, drive):
    keys = jax.random.split(make(0), 3)
    with pytest.raises(InputError, match=rf"key has shape {re.escape(str(keys.shape))}: must be one key; use jax.vmap"):
        draws(keys, model, drive)


def test_keys_of_the_old_kind_are_keys(model, drive):
    jaxveh.run(filters.ParticleFilter(100), model, drive, key=jax.random.PRNGKey(0))


def test_float32_beside_float64_takes_the_models_type(model, drive):
    single = drive.replace(**{name: np.asarray(drive[name], np.float32) for name in drive.names})
    assert jaxveh.run(filters.Extended(), model, single).mean.sideslip.dtype == jnp.float64
    double = jaxveh.run(filters.Extended(), statespace.cast(model, jnp.float32), drive)
    assert double.mean.sideslip.dtype == jnp.float32


@pytest.mark.parametrize("make", [
    lambda: manoeuvres.double_lane_change(speed=25.0, steer=7.0),
    lambda: manoeuvres.step_steer(speed=25.0, steer=3.0),
    lambda: manoeuvres.named_manoeuvre("slalom", 16.0, 3.0),
])  # fmt: skip
def test_degrees(make):
    with pytest.raises(InputError, match=r"within a quarter turn. It is in rad, not degrees"):
        make()


def test_degrees_in_a_log(drive):
    from jaxveh import diagnostics

    wild = drive.replace(yaw_rate=np.degrees(0.3 + np.asarray(drive["yaw_rate"])))
    found = diagnostics.check_log(wild)
    assert any("deg" in str(finding) for finding in found)


@pytest.mark.parametrize(("where", "words"), [
    (lambda car: car.fronts.B, "no attribute 'fronts'.*Did you mean front?"),
    (lambda car: car.front.b, "no attribute 'b'.*Did you mean B?"),
    (lambda car: 3.0, "where picked 3.0: it must pick array leaves"),
    (lambda car: (car.front.B, car.front.B), "front.B twice: each leaf can be chosen only once"),
    ("front.B", r"estimate = 'front.B': must be a function, such as lambda car"),
])  # fmt: skip
def test_a_wrong_where(where, words, car):
    with pytest.raises(InputError, match=words):
        estimators.state_space(car, DEVICE, estimate=where)


@pytest.mark.parametrize("name", ["a_y", "steer"])
def test_a_missing_channel(name, model, drive):
    with pytest.raises(
        InputError, match=rf"recording lacks a channel the model needs: unknown name\(s\) {name}; there are: "
    ):
        jaxveh.run(filters.Extended(), model, drive.without(name))


def test_a_name_that_is_nearly_right(drive):
    with pytest.raises(InputError, match="unknown name.* yawrate; there are: .*Did you mean yaw_rate?"):
        drive["yawrate"]


@pytest.mark.parametrize(("name", "ours"), [
    ("wheel_speed_front_left", "wheel_speed_fl"), ("wheel_speed_FR", "wheel_speed_fr"), ("omega_rear_right", "omega_rr"),
])  # fmt: skip
def test_wrong_wheel_names(name, ours):
    wheels = {f"{what}_{wheel}": np.ones(3) for what in ("wheel_speed", "omega") for wheel in ("fl", "fr", "rl", "rr")}
    with pytest.raises(InputError, match=rf"Did you mean {ours}\?"):
        Recording(np.arange(3.0), wheels)[name]


def test_a_lambda_in_a_loop(drive):
    from typing import NamedTuple

    class State(NamedTuple):
        v_y: float

    class Seen(NamedTuple):
        a_y: float

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for share in range(8):
            walk = statespace.StateSpace(
                transition=lambda system, t0, t1, x, u: x,
                observation=lambda system, t, x, u, share=share: Seen(x.v_y * share),
                inputs=(), process_noise=statespace.Discrete(statespace.Gaussian({"v_y": 0.1})),
                measurement_noise=statespace.Gaussian({"a_y": 0.1}), prior=statespace.Prior(State(0.0), {"v_y": 1.0}),
            )  # fmt: skip
            filters.run(filters.Kalman(), walk, drive)
    told = [str(one.message) for one in caught if issubclass(one.category, JaxvehWarning)]
    assert len(told) == 2 and all("is a new function at each call" in one and __file__ in one for one in told)
    assert all("outside of the loop" in one for one in told)


def test_functions_that_are_used_again_are_no_loop():
    """Two of one place in the source, in turns: what they compiled is there."""
    from jaxveh._core.fresh_functions import note_function

    pair = [lambda x, k=k: x + k for k in range(2)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for turn in range(20):
            note_function("test", pair[turn % 2])


def test_a_where_in_a_loop_compiles_nothing_anew(car, drive):
    """The parameters that it picks count, not the function."""
    scan = jax.jit(lambda model, rows: filters.scan(filters.Extended(), model, rows).log_likelihood)
    chosen = [
        estimators.state_space(car, DEVICE, estimate=lambda car: car.front.B, prior=share) for share in (0.1, 0.2)
    ]
    first, second = (scan(model, model.rows(drive)) for model in chosen)
    assert scan._cache_size() == 1 and first != second


@pytest.mark.parametrize("make", [filters.ParticleFilter, filters.AuxiliaryParticleFilter, filters.Guided])
@pytest.mark.parametrize("count", [1, 0, -5, 1e3])
def test_one_particle(make, count):
    with pytest.raises(InputError, match=rf"particles = {count}: must be a whole number of at least 2"):
        make(count)


def test_a_nan_in_an_input_and_an_infinity_in_a_measurement(model, drive):
    hole = drive.replace(steer=np.where(np.arange(len(drive)) == 5, np.nan, drive["steer"]))
    with pytest.raises(InputError, match=r"steer is NaN in 1 rows, first at t = 0.25 s: .*recording.fill\("):
        jaxveh.run(filters.Extended(), model, hole)
    wild = drive.replace(yaw_rate=np.where(np.arange(len(drive)) == 5, np.inf, drive["yaw_rate"]))
    with pytest.raises(InputError, match="yaw_rate is inf at t = 0.25 s: must be finite, or NaN if missing"):
        jaxveh.run(filters.Extended(), model, wild)


def test_jit_over_a_string(model, drive):
    """jax names the argument and the remedy; what is ours goes through jit as it is: no string is an argument of a run."""
    with pytest.raises(TypeError, match="path name[^$]*static_argnames"):
        jax.jit(lambda drive, name: drive[name])(drive, "a_y")
    assert jnp.isfinite(jax.jit(jaxveh.run)(filters.Extended(), model, drive).log_likelihood)


@pytest.mark.parametrize("mass", [-1500.0, 0.0, np.nan])
def test_a_negative_mass(mass, car):
    with pytest.raises(InputError, match=r"SingleTrack.mass = .*: must be positive and finite \(kg\)"):
        vehicles.SingleTrack(
            mass=mass, yaw_inertia=2000.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4, front=car.front, rear=car.rear
        )


def test_a_step_that_is_too_long_for_spinning_wheels():
    car = vehicles.named_car("sedan", "seven-dof")
    with pytest.warns(JaxvehWarning, match="max_step"):
        jaxveh.simulate(
            car, manoeuvres.step_steer(4.0, 0.01, duration=1.5), solver=diffrax.Heun(), max_step=0.01, throw=False
        )


def test_an_unknown_manoeuvre_car_and_road():
    with pytest.raises(InputError, match="Did you mean double-lane-change"):
        manoeuvres.named_manoeuvre("double-lane-chnge", 25.0, 0.1)
    with pytest.raises(InputError, match="did you mean 'sedan'"):
        vehicles.named_car("sedn")


@pytest.mark.parametrize("name", ["drive.xlsx", "drive.CVS", "drive"])
def test_a_files_suffix(name):
    with pytest.raises(InputError, match=r"a log must end in one of \.csv, \.parquet"):
        io.read_recording(name)
    with pytest.raises(InputError, match=r"nothing.tir: cannot be read .*Check the name and the folder"):
        tyres.from_property_file("nothing.tir")


def test_a_missing_extra(monkeypatch, tmp_path):
    real = builtins.__import__

    def without(name, *more, **options):
        if name.split(".")[0] == "pandas":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return real(name, *more, **options)

    import importlib

    monkeypatch.setattr(importlib, "import_module", lambda name, package=None: without(name))
    (tmp_path / "drive.csv").write_text("time,v_x\n0,1\n1,1\n")
    with pytest.raises(
        InputError, match=r'pandas is not installed, and reading CSV needs it: run `pip install "jaxveh\[io\]"`'
    ):
        io.read_recording(tmp_path / "drive.csv")


CAR, STEP = vehicles.passenger_car(), manoeuvres.step_steer(25.0, 0.01)


@pytest.mark.parametrize(("call", "words"), [
    (lambda model, drive: jaxveh.run(model, filters.Extended(), drive), "filter = StateSpace: .* filter, model, recording"),
    (lambda model, drive: jaxveh.run(filters.Extended, model, drive), r"filter = Extended: is a class; .*: Extended\("),
    (lambda model, drive: jaxveh.run(filters.Extended(), CAR, drive), "model = SingleTrack: must be a StateSpace"),
    (lambda model, drive: jaxveh.run(filters.Extended(), model, {"a_y": 1.0}), "recording = dict: must be a Recording"),
    (lambda model, drive: filters.smooth(filters.Extended, model, drive), "is a class; make one of it"),
    (lambda model, drive: jaxveh.simulate(STEP, CAR), r"car = StepSteer: .* The order is simulate\(car, manoeuvre\)"),
    (lambda model, drive: jaxveh.simulate(CAR, CAR), "must be a manoeuvre"),
    (lambda model, drive: jaxveh.simulate(CAR, STEP, "esc"), r"such as sensors.esc\(\)"),
])  # fmt: skip
def test_arguments_in_another_order_or_of_another_kind(call, words, model, drive):
    with pytest.raises(InputError, match=words):
        call(model, drive)
