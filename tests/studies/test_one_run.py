"""One run of a study: its metrics by their definitions, its baseline, and that nothing depends on what else varies."""

import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from small_studies import DRIVE, study

from jaxveh import (
    InputError,
    Recording,
    diagnostics,
    estimators,
    filters,
    manoeuvres,
    sensors,
    simulate,
    studies,
    sweeps,
    vehicles,
)
from jaxveh.studies import channels, metrics

KEY = jax.random.key(5)


@pytest.mark.parametrize("name", [n for n, one in studies.METRICS.items() if one.of_quantity])
def test_every_metric_of_a_quantity_is_what_it_says(name):
    rng = np.random.default_rng(0)
    error, std = rng.normal(0.1, 1.0, 200), rng.uniform(0.5, 1.5, 200)
    counts, nothing = np.arange(200) >= 20, rng.normal(0.0, 2.0, 200)
    band = diagnostics.score_band(np.where(counts, -error, np.nan), np.zeros(200), std)
    expected = {
        "rmse": band.rmse, "baseline": np.sqrt(np.mean(nothing[20:] ** 2)), "bias": band.constant, "worst": band.worst,
        "final": abs(error[-1]), "coverage_50": band.coverage_50, "coverage_95": band.coverage_95, "crps": band.crps,
        "nees": np.mean((error / std)[20:] ** 2),
    }  # fmt: skip
    errors = metrics.Errors(*map(jnp.asarray, (error, std, counts, nothing)))
    np.testing.assert_allclose(studies.METRICS[name].compute(errors), expected[name], rtol=1e-12)


def test_a_run_is_what_one_would_write_in_python():
    made = study(
        sensors={"yaw_rate": 0.01, "a_y": 0.2}, told={"mass": 1500.0}, process_noise={"v_y": 0.05, "yaw_rate": 0.02},
        filter="unscented", metrics={"names": ["rmse.sideslip", "nis", "log_likelihood"], "after": 0.5},
    )  # fmt: skip
    found = jax.jit(lambda key: made(made.design.point({}, {}), key))(KEY)
    car, device = vehicles.named_car("passenger_car"), sensors.esc(0.01, 0.2)
    _, sensor_key, _ = jax.random.split(KEY, 3)
    driver = manoeuvres.step_steer(20.0, np.radians(1.0), duration=2.0)
    drive = simulate(car, driver, device, sensor_key, dt=0.05, solver="explicit")
    told = eqx.tree_at(lambda c: c.mass, car, jnp.asarray(1500.0))
    model = estimators.state_space(told, device, process_noise={"v_y": 0.05, "yaw_rate": 0.02})
    estimate = filters.run(filters.Unscented(), model, drive)
    rms = lambda values: np.sqrt(np.mean(np.asarray(values)[10:] ** 2))
    truth = drive["true.sideslip"]
    nothing = estimators.open_loop(told, drive)["sideslip"]
    np.testing.assert_allclose(found["rmse.sideslip"], rms(estimate.mean.sideslip - truth), rtol=1e-9)
    np.testing.assert_allclose(found["baseline.sideslip"], rms(nothing - truth), rtol=1e-9)
    np.testing.assert_allclose(found["nis"], np.mean(estimate.info.nis[10:]), rtol=1e-9)
    np.testing.assert_allclose(found["log_likelihood"], estimate.log_likelihood, rtol=1e-9)
    assert found["failed"] == 0


def test_what_varies_is_what_would_be_said_by_itself():
    vary = {
        "car": {"mass": [1300.0, 1600.0]}, "sensors.yaw_rate": [0.002, 0.02],
        "drive": {"speed": {"from": 15, "to": 25, "count": 2}},
        "filter": {"E": "extended", "P": {"name": "particle-filter", "particles": 50}},
    }  # fmt: skip
    made = study(sensors={"yaw_rate": 0.005, "a_y": 0.1}, vary=vary)
    found = sweeps.sweep(made, made.design, made.seeds, made.key)
    assert found.values["rmse.sideslip"].shape == (2, 2, 2, 2, 3)
    key = jax.random.split(made.key, 3)[1]
    pf = {"name": "particle-filter", "particles": 50}
    alone = study(sensors={"yaw_rate": 0.02, "a_y": 0.1}, car={"mass": 1300.0}, drive={"speed": 25.0}, filter=pf)
    one = jax.jit(lambda key: alone(alone.design.point({}, {}), key))(key)
    for name, value in one.items():
        seen = found.at(name, car_mass=1300.0, sensors_yaw_rate=0.02, drive_speed=25.0, filter="P")[1]
        np.testing.assert_allclose(seen, value, rtol=1e-8, err_msg=name)


def test_samples_stand_where_their_names_say():
    samples = {
        "count": 4,
        "method": "latin-hypercube",
        "ranges": {"told": {"front.D": [6000.0, 9000.0]}, "car.mass": [1300.0, 1700.0]},
    }
    made = study(vary={"samples": samples})
    column = made.design.axis("samples").columns
    point = made.design.point({"samples": {name: values[2] for name, values in column.items()}}, {})
    settings = made.at(point)
    assert settings["told"]["front"]["D"] == column["told_front_D"][2]
    assert settings["car"]["mass"] == column["car_mass"][2]
    units = made.units()
    assert units["samples.car_mass"] == "kg" and units["samples.told_front_D"] == "N"


def test_doing_nothing_is_told_the_same_car_as_the_filter():
    """Of an estimator that is no single track: its mass and axles, on the file's tyres."""
    made = study(
        estimator={"name": "state-space", "fidelity": "linear"}, told={"mass": 1700.0}, drive={"speed": 25.0},
        sensors={"yaw_rate": 0.01, "a_y": 0.1},
    )  # fmt: skip
    found = jax.jit(lambda key: made(made.design.point({}, {}), key))(KEY)
    car = vehicles.named_car("passenger_car")
    _, sensor_key, _ = jax.random.split(KEY, 3)
    driver = manoeuvres.step_steer(25.0, np.radians(1.0), duration=2.0)
    drive = simulate(car, driver, sensors.esc(0.01, 0.1), sensor_key, dt=0.05, solver="explicit")
    nothing = estimators.open_loop(eqx.tree_at(lambda c: c.mass, car, jnp.asarray(1700.0)), drive)["sideslip"]
    rms = np.sqrt(np.mean((nothing - np.asarray(drive["true.sideslip"])) ** 2))
    np.testing.assert_allclose(found["baseline.sideslip"], rms, rtol=1e-9)


def test_a_parameter_is_scored_against_the_true_cars():
    made = study(
        estimator={"name": "state-space", "estimate": ["mass"]}, car={"mass": 1600.0}, told={"mass": 1400.0}, filter="unscented",
        metrics={"names": ["rmse.mass", "final.mass"]}, drive={"duration": 4.0, "steer_deg": 3.0},
    )  # fmt: skip
    found = jax.jit(lambda key: made(made.design.point({}, {}), key))(KEY)
    np.testing.assert_allclose(found["baseline.mass"], 200.0, rtol=1e-6)
    assert found["final.mass"] < 200.0


@pytest.mark.parametrize("lost", [{"told": {"yaw_inertia": 1e-9}}, {"car": {"mass": 1e-306}}])
def test_a_filter_or_a_drive_that_fails_is_told(lost):
    made = study(**lost)
    found = jax.jit(lambda key: made(made.design.point({}, {}), key))(KEY)
    assert found["failed"] == 1


def test_drives_of_one_program_are_as_long_as_the_longest():
    told = {"drive": {**DRIVE["drive"], "manoeuvre": "iso-lane-change"}, "vary": {"drive.speed": [15.0, 25.0]}}
    del told["drive"]["duration"], told["drive"]["steer_deg"]
    made = studies.study_of(told)
    lengths = []
    for point in made._ends({}, lambda path: True):
        lengths.append(made._duration(point))
    slow = manoeuvres.named_manoeuvre("iso-lane-change", 15.0).duration
    assert set(lengths) == {slow}


def test_a_quantity_that_is_not_estimated_or_not_true_is_named():
    for name, said in (("rmse.load_fl", "no estimated quantity"), ("rmse.friction", "no true quantity")):
        made = study(metrics={"names": [name]}, drive={"fidelity": "two-track-2dof"})
        with pytest.raises(InputError, match=said):
            jax.eval_shape(lambda key, made=made: made(made.design.point({}, {}), key), KEY)


def test_every_metric_is_documented_and_takes_what_it_says():
    for name, one in studies.METRICS.items():
        assert one.help and one.unit, name
        assert len(inspect.signature(one.compute).parameters) == 1


def test_inputs_are_held_from_the_row_in_which_they_were_said():
    nan = np.nan
    recording = Recording(
        np.arange(5.0), {"v_x": np.array([nan, 2.0, nan, nan, 3.0]), "a_y": np.array([nan, 1.0, nan, 1.0, 1.0])}
    )
    held = channels.hold(recording, ("v_x", "steer"))
    np.testing.assert_array_equal(held["v_x"], [2.0, 2.0, 2.0, 2.0, 3.0])
    np.testing.assert_array_equal(held["a_y"], recording["a_y"])
    unknown = channels.hold(recording.replace(v_x=np.full(5, nan)), ("v_x",))
    assert np.isnan(unknown["v_x"]).all()
    named = channels.renamed_channels(recording, {"speed": "v_x"})
    np.testing.assert_array_equal(named["speed"], recording["v_x"])
    with pytest.raises(InputError, match="channels: no recorded channel 'v_z' .*v_x"):
        channels.renamed_channels(recording, {"speed": "v_z"})
