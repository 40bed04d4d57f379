"""`estimators.learned`: a network beside a tyre's law, and training through a filter's likelihood."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, estimators, filters, manoeuvres, sensors, simulate, tyres, vehicles
from jaxveh.estimators import learned
from jaxveh.tyres import Contact

DEVICE = sensors.esc(yaw_rate=0.002, a_y=0.05)


def on_brushes(front=1.0, rear=1.0):
    """The car of the tyre papers on brush tyres, whose stiffnesses may be wrong."""
    car = vehicles.passenger_car()
    made = [tyres.Brush(k * s, k * s, friction=1.0) for k, s in ((88e3, front), (127e3, rear))]
    return eqx.tree_at(lambda c: (c.front, c.rear), car, tuple(made))


def drive(car, seed, seconds, dt=0.02):
    wander = manoeuvres.random_steering(25.0, 0.05, jax.random.key(seed), highest=1.0, duration=float(seconds))
    return simulate(car, wander, DEVICE, jax.random.key(100 + seed), dt=dt)


def model_of(car):
    return estimators.state_space(car, DEVICE, process_noise={"v_y": 0.05, "yaw_rate": 0.02})


def physics(model):
    car = model.system.vehicle
    inner = [getattr(tyre, "tyre", tyre) for tyre in (car.front, car.rear)]
    return (*(one.cornering_stiffness for one in inner), *(one.friction for one in inner))


def contacts(load=4000.0):
    return Contact(jnp.linspace(-0.3, 0.3, 41), load=jnp.full(41, load), speed=jnp.full(41, 20.0))


def test_a_network_that_is_not_trained_changes_nothing_and_a_trained_one_is_odd_in_the_slip_angle():
    car = on_brushes()
    wide = learned.with_residual_tyres(car, jax.random.key(0))
    for tyre, plain in ((wide.front, car.front), (wide.rear, car.rear)):
        np.testing.assert_array_equal(tyre.forces(contacts()).F_y, plain.forces(contacts()).F_y)
        moved = eqx.tree_at(lambda t: (t.outer, t.load_share), tyre, (0.1 + 0.0 * tyre.outer, 0.5 + 0.0 * tyre.outer))
        found = moved.forces(contacts())
        np.testing.assert_allclose(found.F_y, -np.asarray(found.F_y)[::-1], atol=1e-9)
        assert np.abs(found.F_y - plain.forces(contacts()).F_y).max() > 100.0
        np.testing.assert_array_equal(found.M_z, plain.forces(contacts()).M_z)
        # By the formula, at one slip angle and one load.
        s = tyre.stiffness * 0.3 / 4000.0
        bends = 0.5 * (np.tanh(tyre.inner * s + tyre.bias) + np.tanh(tyre.inner * s - tyre.bias))
        expected = 4000.0 * np.sum(0.1 * (1.0 + 0.5 * (4000.0 / tyre.load - 1.0)) * bends)
        np.testing.assert_allclose((found.F_y - plain.forces(contacts()).F_y)[-1], expected)


def test_a_tyre_with_states_is_refused():
    car = vehicles.passenger_car()
    relaxed = eqx.tree_at(lambda c: c.front, car, tyres.Relaxed(car.front, sigma_y=0.4))
    with pytest.raises(InputError, match="must be a tyre without states"):
        learned.with_residual_tyres(relaxed, jax.random.key(0))


@pytest.mark.full
def test_training_finds_what_a_fit_finds_and_tells_how_far_it_is():
    """Two wrong stiffnesses, by the likelihood alone."""
    log, told, ends = drive(on_brushes(), 1, 40), [], []
    for seed in (0,):
        found = learned.train(
            filters.Extended(), model_of(on_brushes(1.3, 0.8)), log, physics, prior=0.5, steps=75, learning_rate=0.05,
            key=jax.random.key(seed), progress=lambda done, total, stage: told.append(done / total),
        )  # fmt: skip
        car = found.model.system.vehicle
        ends.append([car.front.cornering_stiffness / 88e3, car.rear.cornering_stiffness / 127e3])
        assert found.history.shape == (75,) and found.history[-10:].mean() < found.history[:5].mean()
    np.testing.assert_allclose(ends, 1.0, atol=0.04)
    assert told[0] == 0.0 and told[-1] == 1.0


def test_bad_arguments_are_named():
    log, model = drive(on_brushes(), 1, 12), model_of(on_brushes())
    go = lambda **options: learned.train(
        filters.Extended(), model, options.pop("log", log), physics, key=jax.random.key(0), steps=1, **options
    )
    with pytest.raises(InputError, match="learning_rate = 0.0"):
        go(learning_rate=0.0)
    with pytest.raises(InputError, match="prior: no standard deviation for .*friction"):
        go(prior={"cornering_stiffness": 1.0})
    with pytest.raises(InputError, match="no recording to learn from"):
        go(log=[])
    with pytest.raises(InputError, match="must be longer"):
        go(log=log.rows(slice(0, 120)))


@pytest.mark.full
def test_the_network_finds_a_curve_that_the_physics_cannot_form():
    """Truth: Magic Formulas that fall behind their peaks; the filter has brushes. Judged on drives that it has not seen."""
    made = [
        tyres.MagicFormula(B=k / (1.6 * load), C=1.6, D=load, E=-1.5)
        for k, load in zip((88e3, 127e3), vehicles.passenger_car().static_loads(), strict=True)
    ]
    truth = eqx.tree_at(lambda c: (c.front, c.rear), vehicles.passenger_car(), tuple(made))
    log, unseen = drive(truth, 1, 300), [drive(truth, seed, 60) for seed in (50, 51)]

    def rmse(model):
        errors = [filters.run(filters.Extended(), model, one).mean.sideslip - one["true.sideslip"] for one in unseen]
        return float(np.degrees(np.sqrt(np.mean(np.concatenate(errors) ** 2))))

    options = dict(learning_rate=0.03, steps=200, key=jax.random.key(0))
    told = model_of(on_brushes(1.15, 0.87))
    alone = learned.train(filters.Extended(), told, log, physics, prior=0.3, **options).model
    wide = model_of(learned.with_residual_tyres(told.system.vehicle, jax.random.key(1)))
    both = lambda model: (*physics(model), *learned.network_weights(model))
    prior = {"cornering_stiffness": 0.3, "friction": 0.3, "inner": 0.5, "bias": 1.0, "outer": 1.0, "load_share": 1.0}
    hybrid = learned.train(filters.Extended(), wide, log, both, prior=prior, **options).model
    assert rmse(hybrid) < 0.8 * rmse(alone) < 0.8 * rmse(told)
