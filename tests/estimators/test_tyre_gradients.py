"""The bootstrap filter's gradient with respect to tyres and noise levels of a car is the exact or the unscented filter's."""

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxveh import estimators, filters, manoeuvres, sensors, simulate, vehicles
from jaxveh.statespace import Heun
from jaxveh.vehicles.linearisation import linear_single_track

SEEDS = 40
NOISE = {"yaw_rate": 0.02}


def of_a_magic_formula(car):
    return (car.front.B, car.front.D, car.rear.B, car.rear.D)


def of_a_linear_law(car):
    return (car.front_stiffness, car.rear_stiffness)


CARS = {
    "linear, exact": (
        linear_single_track(vehicles.passenger_car()),
        {"sideslip": 0.004},
        of_a_linear_law,
        filters.Kalman(),
        1000,
    ),
    "Magic Formula, unscented": (
        vehicles.passenger_car(),
        {"v_y": 0.1},
        of_a_magic_formula,
        filters.Unscented(),
        300,
    ),
}


def gradients(filter_, model, rows, coefficients, seeds):
    """(seeds, k): the relative slope with respect to each tyre coefficient, and to the spread of each noise."""
    leaves, rest = eqx.partition(model, eqx.is_inexact_array)
    of = lambda leaves, key: filters.scan(filter_, eqx.combine(leaves, rest), rows, key).log_likelihood
    found = jax.jit(jax.vmap(jax.grad(of), in_axes=(None, 0)))(leaves, jax.random.split(jax.random.key(1), seeds))
    chosen = lambda model: (
        *coefficients(model.system.vehicle),
        *model.process_noise.law.std,
        *model.measurement_noise.std,
    )
    pairs = zip(chosen(found), chosen(model), strict=True)
    return np.stack([np.asarray(slope) * float(value) for slope, value in pairs], axis=-1)


@pytest.mark.parametrize(
    ("name", "gradient"),
    [
        ("linear, exact", "score"),
        pytest.param("Magic Formula, unscented", "score", marks=pytest.mark.studies),
        pytest.param("linear, exact", "held", marks=pytest.mark.full),
    ],
)
def test_scores_agree_with_the_kalman_filters_and_held_ancestors_do_not(name, gradient):
    car, noise, coefficients, reference, particles = CARS[name]
    manoeuvre = manoeuvres.double_lane_change(speed=25.0, steer=0.05)
    recording = simulate(vehicles.passenger_car(), manoeuvre, sensors.esc(), key=jax.random.key(0), dt=0.05)
    model = estimators.state_space(car, sensors.esc(), process_noise=noise | NOISE, minimum_speed=0.0, solver=Heun())
    # Noisier sensors than the drive's: the particles' likelihood then scatters by less than one.
    levels = model.measurement_noise.std
    model = eqx.tree_at(lambda m: m.measurement_noise.std, model, jax.tree.map(lambda level: 4.0 * level, levels))
    rows = model.rows(recording.rows(slice(0, 30)))
    expected = gradients(reference, model, rows, coefficients, 1)[0]
    found = gradients(filters.ParticleFilter(particles, gradient=gradient), model, rows, coefficients, SEEDS)
    scatter = found.std(axis=0) / np.sqrt(SEEDS)
    off = np.abs(found.mean(axis=0) - expected)
    if gradient == "score":
        assert (off < 4.0 * scatter + 0.003 * np.abs(expected)).all()
    else:
        assert np.max(off / scatter) > 10.0
