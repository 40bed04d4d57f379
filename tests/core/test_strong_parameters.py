"""A number that `eqx.tree_at` puts into a car or a model compiles nothing anew, and keeps the car's dtype."""

import functools
import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxveh
from jaxveh import estimators, filters, fitting, manoeuvres, sensors, statespace, tyres, vehicles
from jaxveh._core.parameter import strong

KINDS = {
    "a number": lambda value: value,
    "a whole number": int,
    "a weak array": jnp.asarray,
    "a weak whole array": lambda value: jnp.asarray(int(value)),
    "a NumPy number": np.asarray,
}


def changed(car, value):
    return eqx.tree_at(lambda car: car.mass, car, value)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_number_is_what_the_class_makes_of_it(kind):
    car = vehicles.passenger_car()
    found = strong(changed(car, KINDS[kind](1500.0)))
    expected = changed(car, jnp.asarray(1500.0, jnp.float64))
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    assert float(found.mass) == 1500.0 and found.mass.dtype == jnp.float64
    assert isinstance(found.mass, jax.Array) and not found.mass.weak_type


def test_a_car_without_them_is_the_same_object():
    car = vehicles.passenger_car()
    assert strong(car) is car


def test_a_car_in_float32_stays_one():
    car = changed(statespace.cast(vehicles.passenger_car(), np.float32), jnp.asarray(1500.0))
    assert car.mass.dtype == jnp.float64 and strong(car).mass.dtype == jnp.float32


def test_what_a_class_does_not_declare_is_left_alone():
    class Own(eqx.Module):
        brush: tyres.Brush
        chosen: float

    own = Own(eqx.tree_at(lambda t: t.friction, tyres.Brush(1e5, 1e5, 1.0), 0.9), 2.0)
    found = strong(own)
    assert type(found.chosen) is float and isinstance(found.brush.friction, jax.Array)


DEVICE, STEER = sensors.esc(), manoeuvres.step_steer(25.0, 0.02, duration=1.3)
NOISE = {"sideslip": 0.001, "yaw_rate": 0.01}


def simulated(car):
    return jaxveh.simulate(car, STEER, DEVICE, dt=0.1)


@functools.cache
def drive():
    return simulated(vehicles.passenger_car())


KALMAN, KEY = filters.Extended(), jax.random.key(0)
STIFFNESS = lambda model: model.system.vehicle.front_stiffness
SHORT = dict(max_steps=2, standard_errors=False, throw=False)

PROGRAMS = {
    "draw": lambda model: statespace.draw(model, drive(), KEY),
    "log_likelihood_spread": lambda model: filters.log_likelihood_spread(
        filters.ParticleFilter(20), model, drive(), KEY, 3
    ),
    "maximum_likelihood": lambda model: fitting.maximum_likelihood(
        KALMAN, model, drive(), STIFFNESS, prior=0.1, **SHORT
    ),
    "monte_carlo": lambda model: filters.monte_carlo(KALMAN, model, drive(), KEY, 3),
    "multiple_shooting": lambda model: fitting.multiple_shooting(model, drive(), STIFFNESS, prior=0.1, **SHORT),
    "posterior_cramer_rao": lambda model: statespace.posterior_cramer_rao(model, drive(), KEY, 3),
    "prediction_error": lambda model: fitting.prediction_error(
        KALMAN, model, drive(), STIFFNESS, prior=0.1, max_steps=2, throw=False
    ),
    "run": lambda model: jaxveh.run(KALMAN, model, drive()),
    "run_and_keep": lambda model: filters.run_and_keep(KALMAN, model, drive(), covariance),
    "simulation_based_calibration": lambda model: filters.simulation_based_calibration(
        KALMAN, model, drive(), KEY, 3, 9
    ),
    "smooth": lambda model: filters.smooth(KALMAN, model, drive()),
    "smooth_parallel": lambda model: filters.smooth_parallel(filters.Iterated(KALMAN, 1), model, drive()),
}
"""What compiles a model, by name."""

MAKES_A_MODEL = "makes a model, which a program takes"
IN_A_PROGRAM = "is called within a program, or compiles nothing"
NONE = {
    "cut": IN_A_PROGRAM,
    "export_filter": "the model's numbers are constants of its programs",
    "held_rows": IN_A_PROGRAM,
    "observe": "compiles a new function at each call",
    "parameters_of": IN_A_PROGRAM,
    "pose_likelihood": "poses what maximum_likelihood solves",
    "pose_prediction_error": "poses what prediction_error solves",
    "pose_shooting": "poses what multiple_shooting solves",
    "predict_measurements": IN_A_PROGRAM,
    "put_parameters": IN_A_PROGRAM,
    "scan": "the compiled part of run",
    "start_from": MAKES_A_MODEL,
    "uncertain_inputs": MAKES_A_MODEL,
    "with_disturbances": MAKES_A_MODEL,
    "with_parameters": MAKES_A_MODEL,
}
"""The other functions of a model, each with the reason why it is no program here."""


def covariance(belief):
    return belief.covariance


def takes_a_model(function):
    if not inspect.isfunction(inspect.unwrap(function)):
        return False
    given = inspect.signature(function).parameters.get("model")
    return given is not None and "StateSpace" in str(given.annotation)


def test_every_function_of_a_model_is_here():
    rooms = (estimators, filters, fitting, statespace)
    found = {name for room in rooms for name in room.__all__ if takes_a_model(getattr(room, name))}
    assert found == {*PROGRAMS, *NONE}


COMPILED: list = []


@pytest.fixture(autouse=True, scope="module")
def _listen():
    # The listener stays for the process: jax has no public way to take one away alone.
    jax.monitoring.register_event_duration_secs_listener(
        lambda event, _, **about: (
            COMPILED.append(about.get("fun_name")) if event.endswith("backend_compile_duration") else None
        )
    )


def compiled(call, tree):
    """The names of the programs that a call compiles."""
    strong(tree)  # the conversion of a number is a program, too
    COMPILED.clear()
    call(tree)
    return list(COMPILED)


def check_compiled_once(call, tree_of):
    first, again = (compiled(call, tree_of(jnp.asarray(value, jnp.float64))) for value in (1500.0, 1510.0))
    assert first and not again
    for k, number in enumerate(KINDS.values()):
        assert not compiled(call, tree_of(number(1520.0 + k)))


@pytest.mark.product
@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_of_a_model_is_compiled_once_for_all_of_them(name):
    # The car whose programs are the smallest.
    car = vehicles.linear_single_track(vehicles.passenger_car())
    model = estimators.state_space(car, DEVICE, process_noise=NOISE)
    drive()
    jax.clear_caches()
    mass = lambda model: model.system.vehicle.mass
    check_compiled_once(PROGRAMS[name], lambda number: eqx.tree_at(mass, model, number))


def test_a_drive_and_the_model_of_a_car_are_compiled_once_for_all_of_them():
    car, steer = vehicles.passenger_car(), manoeuvres.step_steer(25.0, 0.02, duration=1.7)
    # No other test drives for so long: nothing has to be forgotten.
    drive_once = lambda car: jaxveh.simulate(car, steer, DEVICE, dt=0.1)
    check_compiled_once(drive_once, lambda number: changed(car, number))
    for number in KINDS.values():
        mass = estimators.state_space(changed(car, number(1520.0)), DEVICE).system.vehicle.mass
        assert isinstance(mass, jax.Array) and not mass.weak_type


def test_its_gradient_is_that_of_the_strong_one():
    car = vehicles.passenger_car()
    last = lambda mass: jaxveh.simulate(changed(car, mass), STEER, DEVICE, dt=0.1, throw=False)["true.yaw_rate"][-1]
    weak, exact = (jax.grad(last)(mass) for mass in (1500.0, jnp.asarray(1500.0, jnp.float64)))
    np.testing.assert_allclose(weak, exact, rtol=1e-12)
    assert abs(float(weak)) > 1e-7
