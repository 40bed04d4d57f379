"""A vehicle with sensors as a state space: names, checks, the hold at low speed, gradients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import (
    InputError,
    Recording,
    estimators,
    filters,
    fitting,
    manoeuvres,
    sensors,
    simulate,
    statespace,
    vehicles,
)


def tyres(car):
    return (car.front.B, car.front.D, car.rear.B, car.rear.D)


@pytest.fixture(scope="module")
def drive():
    manoeuvre = manoeuvres.double_lane_change(speed=25.0, steer=0.12)
    return simulate(vehicles.passenger_car(), manoeuvre, sensors.esc(), key=jax.random.key(0), dt=0.05)


@pytest.fixture(scope="module")
def model():
    return estimators.state_space(
        vehicles.passenger_car(), sensors.esc(), estimate=tyres, report=("sideslip", "F_yf"), steps=2,
        minimum_speed=3.0, solver=statespace.Heun(),
    )  # fmt: skip


def test_a_parameter_has_one_name_on_every_road(model, drive):
    """`where` sees the car, or the model that holds it: names are those in the car."""
    plain, of_model = estimators.state_space(vehicles.passenger_car(), sensors.esc()), lambda m: tyres(m.system.vehicle)
    ukf = filters.Unscented()
    roads = {
        "state_space": model.chosen.parameters,
        "with_parameters": statespace.with_parameters(plain, of_model, prior=0.1).chosen.parameters,
        "maximum_likelihood": fitting.pose_likelihood(ukf, plain, drive, of_model).chosen,
        "prediction_error": fitting.pose_prediction_error(ukf, plain, drive, of_model).chosen,
        "multiple_shooting": fitting.pose_shooting(plain, fitting.cut(plain, drive, 0.5), of_model).chosen,
        "of states": fitting.pose_shooting(model, fitting.cut(model, drive, 0.5)).chosen,
    }
    for road, chosen in roads.items():
        assert [p.name for p in chosen] == ["front.B", "front.D", "rear.B", "rear.D"], road
    levels = fitting.pose_likelihood(ukf, plain, drive, lambda m: (m.measurement_noise.std.a_y, m.system.vehicle.mass))
    assert [p.name for p in levels.chosen] == ["measurement_noise.std.a_y", "mass"]


def test_names_of_states_channels_and_report(model, drive):
    assert model.states == ("v_y", "yaw", "yaw_rate", "front_B", "front_D", "rear_B", "rear_D")
    assert model.channels == ("yaw_rate", "a_y")
    found = filters.run(filters.Unscented(), model, drive)
    assert found.mean._fields == (
        "v_y",
        "yaw",
        "yaw_rate",
        "sideslip",
        "F_yf",
        "front_B",
        "front_D",
        "rear_B",
        "rear_D",
    )
    assert found.parameters.front.B.shape == (len(drive),)
    assert "mass" not in found.parameters
    error = np.asarray(found.mean.sideslip - drive["true.sideslip"])
    assert np.sqrt(np.mean(error**2)) < 0.004
    force = np.asarray(found.mean.F_yf - drive["true.F_yf"])
    assert np.sqrt(np.mean(force**2)) < 300.0


def test_noise_levels_stand_once(model):
    assert jax.tree.leaves(model.system.sensors.noise) == []
    assert float(model.measurement_noise.std.a_y) == 0.1


def test_holds_the_state_below_the_minimum_speed(model, drive):
    n = len(drive)
    speed = np.array([5.0, 5.0, 1.0, 1.0, 0.0, *[5.0] * (n - 5)])
    recording = Recording(
        np.arange(n) * 0.01,
        {"v_x": speed, "steer": np.full(n, 0.1), "yaw_rate": np.full(n, np.nan), "a_y": np.full(n, np.nan)},
    )
    assert np.asarray(estimators.held_rows(model, recording)).tolist() == (speed < 3.0).tolist()
    v_y = np.asarray(filters.run(filters.Unscented(), model, recording).mean.v_y)
    assert v_y[3] == pytest.approx(v_y[2], abs=1e-12)
    assert v_y[5] == pytest.approx(v_y[4], abs=1e-12)
    assert abs(v_y[1] - v_y[0]) > 1e-6


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"report": ("sidslip",)}, "sidslip"),
        ({"process_noise": {"v_z": 0.1}}, "v_z"),
        ({"start": {"speed": 1.0}}, "speed"),
        ({"steps": 0}, "steps"),
        ({"estimate": tyres, "prior": 0.0}, "prior"),
        ({"estimate": lambda car: car.tyre.B}, "tyre"),
    ],
)
def test_bad_settings_are_named(settings, message):
    with pytest.raises(InputError, match=message):
        estimators.state_space(vehicles.passenger_car(), sensors.esc(), **settings)


@pytest.mark.full
def test_observability_tells_what_the_drive_can_teach(model, drive):
    report = estimators.observe(model, drive)
    assert report.names == ("front.B", "front.D", "rear.B", "rear.D")
    assert np.all(report.bounds.array() >= report.bounds_alone.array())
    assert "front.D" in report.observable(share=0.5)
    loose = estimators.observe(model, drive, known_start=False)
    assert np.all(loose.bounds.array() >= report.bounds.array() * (1 - 1e-9))


@pytest.mark.full
def test_gradient_reaches_noise_and_start_of_the_parameters(drive):
    # With one parameter the filter's gradient compiles in a fraction of the time that it takes with four.
    model = estimators.state_space(
        vehicles.passenger_car(), sensors.esc(), estimate=lambda car: (car.front.B,), steps=2
    )
    rows = model.rows(drive)
    value = jax.jit(jax.value_and_grad(lambda m: filters.scan(filters.Unscented(), m, rows).log_likelihood))
    slope = value(model)[1]
    h = 1e-5

    def shifted(sign):
        prior = model.prior.mean._replace(front_B=model.prior.mean.front_B + sign * h)
        import equinox as eqx

        return value(eqx.tree_at(lambda m: m.prior.mean, model, prior))[0]

    finite = (shifted(1) - shifted(-1)) / (2 * h)
    assert float(slope.prior.mean.front_B) == pytest.approx(float(finite), rel=1e-4)
    assert jnp.isfinite(slope.measurement_noise.std.a_y)
    assert float(slope.measurement_noise.std.a_y) != 0.0
