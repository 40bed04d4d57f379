"""What a study can name: every manoeuvre, option, number, filter and estimator of the package, each in turn."""

import contextlib
import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import members, wanting
from small_studies import study

from jaxveh import InputError, estimators, filters, roads, sensors, studies, vehicles
from jaxveh._core.parameter import every_parameter, pick
from jaxveh.manoeuvres import MANOEUVRES
from jaxveh.statespace import AbstractFilter
from jaxveh.studies.drives import drive_of, simulate
from jaxveh.studies.estimating import model_of
from jaxveh.studies.named_filters import kebab
from jaxveh.studies.numbers import with_numbers
from jaxveh.studies.settings import put_at
from jaxveh.vehicles import kit

KEY = jax.random.key(0)

FIDELITY = {"mu-jump-braking": "seven-dof", "braking-in-a-turn": "two-track-3dof", "cruise": "longitudinal"}
"""Cars that have what a manoeuvre asks for; otherwise a single track."""


@pytest.mark.parametrize("name", MANOEUVRES)
def test_speed_and_steer_of_every_manoeuvre_vary_within_one_program(name):
    car = {"fidelity": FIDELITY.get(name, "single-track"), "vehicle": "sedan"}
    made = study(drive={**car, "manoeuvre": name, "duration": 40.0, "rate": 1.0}, sensors={"devices": "none"})

    def speed_of(speed, steer):
        settings = put_at(put_at(made.settings, "drive.speed", speed), "drive.steer_deg", steer)
        return simulate(drive_of(settings, KEY), KEY)["true.v_x"]

    assert jax.eval_shape(speed_of, jnp.asarray(12.0), jnp.asarray(1.0)).shape == (41,)


@pytest.mark.parametrize("fidelity", kit.FIDELITIES)
def test_every_number_of_every_car_can_be_replaced(fidelity):
    name = next(n for n in kit.CARS if fidelity in _fidelities(n))
    car = vehicles.named_car(name, fidelity)
    known = every_parameter(car)
    assert "front_axle_to_cg" in known or "mass" in known or "wheelbase" in known
    asked = {
        name: 1.5 * jnp.asarray(value) for name, value in zip(known, pick(car, tuple(known.values())), strict=True)
    }
    moved = with_numbers("car", car, asked)
    for name, value in zip(known, pick(moved, tuple(known.values())), strict=True):
        np.testing.assert_array_equal(value, asked[name])


def _fidelities(name):
    found = []
    for fidelity in kit.FIDELITIES:
        with contextlib.suppress(InputError):
            vehicles.named_car(name, fidelity)
            found.append(fidelity)
    return found


@pytest.mark.parametrize("name", [n for n, one in sensors.DEVICES.items() if not one.takes_noise and n != "none"])
def test_every_number_of_every_device_can_be_replaced(name):
    devices = sensors.named_devices(name, vehicles.named_car("sedan", "seven-dof"))
    known = every_parameter(devices)
    assert len(known) > 10
    asked = {
        name: 2.0 * jnp.asarray(value) + 1.0
        for name, value in zip(known, pick(devices, tuple(known.values())), strict=True)
    }
    moved = with_numbers("sensors", devices, asked)
    for name, value in zip(known, pick(moved, tuple(known.values())), strict=True):
        np.testing.assert_array_equal(value, asked[name])


NEEDED = {
    "particles": 40, "members": 10, "lag": 2, "names": ["yaw_rate"], "bins": {"yaw_rate": 0.1}, "groups": [["yaw_rate"], ["a_y"]],
    "bound": 1e-6, "scales": {"v_y": 1.0}, "most": {"v_y": 1.0}, "channel": "a_y", "widen": {"v_y": 0.1}, "extra": {"v_y": 0.1},
    "linear": ["yaw_rate"], "delays": {"a_y": 0.05},
}  # fmt: skip
"""Options that some filters cannot do without."""

OBJECTS = {
    "interacting-models": "its variants are functions of the model",
    "sigma-point-filter": "its points are a function; unscented, cubature and simplex have names",
}
PARTICLES = {"adaptive-number", "haar-particles", "liu-west", "regularised", "fixed-lag"}
REFUSED = {
    "kalman": "linear",
    "marginalised": "linear",
    "varying-noise": "measurement",
    "paused": "channel",
}
"""Filters that do not take a single track and its tyre's peak, by a word of what they say."""


def inner_of(name):
    return {"name": "particle-filter", "particles": 40} if name in PARTICLES else "extended"


def table_of(name):
    known = inspect.signature(studies.FILTERS[name]).parameters.values()
    needed = [p.name for p in known if p.default is p.empty and p.name != "inner"]
    lacking = [one for one in needed if one not in NEEDED]
    assert not lacking, f"{name} cannot do without {', '.join(lacking)}: add a value to NEEDED, or a reason to OBJECTS"
    table = {one: NEEDED[one] for one in needed}
    return {"name": name, **table, **({"inner": inner_of(name)} if "inner" in [p.name for p in known] else {})}


def test_every_filter_of_the_package_has_a_name():
    assert {kebab(name) for name in members("filters", AbstractFilter)} == set(studies.FILTERS)
    assert set(OBJECTS) < set(studies.FILTERS)


@pytest.mark.parametrize("name", [n for n in studies.FILTERS if n not in OBJECTS])
def test_every_filter_can_be_named_and_runs(name):
    whole = study(filter=table_of(name), estimator={"name": "state-space", "estimate": ["front.D"]})
    if name in REFUSED:
        with pytest.raises(InputError, match=REFUSED[name]):
            whole.check()
        return
    whole.check()
    found = jax.eval_shape(lambda key: whole(whole.design.point({}, {}), key), KEY)
    assert set(found) == {"rmse.sideslip", "baseline.sideslip", "coverage_95.yaw_rate", "failed"}


@pytest.mark.parametrize("name", OBJECTS)
def test_filters_that_are_made_of_functions_say_so(name):
    inner = {"inner": "extended"} if "inner" in studies.filter_options(name) else {}
    with pytest.raises(InputError, match="needs"):
        studies.filter_of({"name": name, **inner})


def test_every_form_has_a_name():
    forms = {kebab(name) for name in members("filters", filters.AbstractForm)}
    assert forms == set(studies.named_filters.FORMS)
    for form in forms:
        assert kebab(type(studies.filter_of({"name": "unscented", "form": form}).form).__name__) == form


TRUTHS = {
    "state-space": {"filter": "extended"},
    "sideslip": {
        "sensors": {"yaw_rate": 0.005, "a_y": 0.1, "a_x": 0.1, "v_x": 0.05},
        "drive": {"fidelity": "two-track-3dof", "vehicle": "sedan"}, "metrics": {"names": ["rmse.sideslip"]},
    },
    "mass-and-grade": {
        "drive": {"vehicle": "sedan", "fidelity": "longitudinal", "manoeuvre": "cruise", "duration": 3.0},
        "sensors": {"v_x": 0.02}, "filter": "unscented", "metrics": {"names": ["rmse.mass", "final.grade"]},
    },
}  # fmt: skip
"""A drive for each estimator."""


def test_every_estimator_of_the_package_has_a_name():
    ready = {name.replace("_", "-") for name in estimators.__all__ if hasattr(getattr(estimators, name), "calibrate")}
    assert set(studies.ESTIMATORS) == {"state-space"} | ready
    assert not wanting(set(studies.ESTIMATORS), set(TRUTHS), {})


@pytest.mark.parametrize("name", studies.ESTIMATORS)
def test_every_estimator_runs(name):
    made = study(estimator=name, **TRUTHS[name])
    made.check()
    found = jax.jit(made)(made.design.point({}, {}), KEY)
    assert found["failed"] == 0
    assert all(np.isfinite(value) for value in found.values())


NOISE = {"measurement_noise": {"yaw_rate": 0.005, "a_y": 0.1}}
CHANNELS = {"production": {"v_x": "speed"}}
"""What devices call otherwise: satellite navigation says a speed over ground."""


ENOUGH = {"production": "sideslip", "proving-ground": "state-space"}
"""An estimator that each set of devices is tried with; those of noise by channel are everywhere else."""


def test_every_set_of_devices_is_tried():
    assert set(ENOUGH) == {name for name, one in sensors.DEVICES.items() if not one.takes_noise} - {"none"}


@pytest.mark.parametrize(("name", "estimator"), ENOUGH.items())
def test_every_set_of_devices_is_enough(name, estimator):
    made = study(
        drive={"vehicle": "sedan", "fidelity": "two-track-3dof"}, sensors={"devices": name}, estimator=estimator,
        channels=CHANNELS.get(name, {}), metrics={"names": ["rmse.sideslip"]}, **(NOISE if estimator == "state-space" else {}),
    )  # fmt: skip
    made.check()
    found = jax.jit(lambda key: made(made.design.point({}, {}), key))(KEY)
    assert found["failed"] == 0 and all(np.isfinite(value) for value in found.values())


@pytest.mark.parametrize("road", roads.ROADS)
def test_every_road_can_be_driven(road):
    made = study(drive={"road": road, "fidelity": "two-track-3dof"}, sensors={"devices": "none"})
    drive = lambda key: simulate(drive_of(made.settings, key), key)["true.v_x"]
    assert jax.eval_shape(drive, KEY).shape == (41,)


MOVED = {"longitudinal": "cruise"}


@pytest.mark.parametrize("fidelity", kit.FIDELITIES)
def test_every_fidelity_can_be_the_truth(fidelity):
    name = next(n for n in kit.CARS if fidelity in _fidelities(n))
    drive = {"vehicle": name, "fidelity": fidelity, "manoeuvre": MOVED.get(fidelity, "step-steer")}
    made = study(drive=drive, sensors={"devices": "none"})
    seen = jax.eval_shape(lambda key: simulate(drive_of(made.settings, key), key)["true.v_x"], KEY)
    assert seen.shape == (41,)


@pytest.mark.parametrize("fidelity", kit.FIDELITIES)
def test_every_fidelity_can_be_told(fidelity):
    """Of a car that has its numbers, on drives of a two-track car where it turns on tyres."""
    name = next(n for n in kit.CARS if fidelity in _fidelities(n))
    straight = fidelity == "longitudinal"
    channel = "v_x" if straight else "yaw_rate"
    truth = fidelity if "kinematic" in fidelity or straight else "two-track-3dof"
    made = study(
        drive={"vehicle": name, "fidelity": truth, "manoeuvre": "cruise" if straight else "step-steer"},
        sensors={channel: 0.01} | ({} if "kinematic" in fidelity or straight else {"a_y": 0.1, "v_x": 0.1}),
        estimator={"name": "state-space", "fidelity": fidelity},
    )  # fmt: skip
    made.check()
    model = model_of(made.settings, drive_of(made.settings, KEY))
    assert channel in model.channels and type(model.system.vehicle) is kit.FIDELITIES[fidelity]


def test_a_filter_is_not_shown_its_inputs_twice():
    made = study(sensors={"yaw_rate": 0.01, "a_y": 0.1, "v_x": 0.1})
    model = model_of(made.settings, drive_of(made.settings, KEY))
    assert model.channels == ("yaw_rate", "a_y") and "v_x" in model.inputs


def test_lists_of_a_file_are_tuples_of_a_filter():
    table = {"name": "adaptive-number", "bins": {"yaw_rate": 0.1}, "sizes": [10, 40]}
    made = studies.filter_of({**table, "inner": {"name": "particle-filter", "particles": 40}})
    assert made.sizes == (10, 40) and hash(made.sizes)
