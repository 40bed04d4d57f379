"""The neural network among the methods of sideslip: what it reads, its memory, its weights, and how it is trained."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from method_logs import CAR

from jaxveh import Recording, estimators, manoeuvres, simulate, vehicles
from jaxveh.estimators import kit, learned, sideslip
from jaxveh.estimators.sideslip_methods import network
from jaxveh.experiments.sideslip_review import network_training

V = 20.0


def told(layers, car=CAR):
    return learned.sideslip_network(car, layers)


def saying(slip, spread):
    """A network whose last layer has nothing but a bias."""
    layers = eqx.nn.MLP(learned.SideslipNetwork.size, 2, 4, 2, jnp.tanh, key=jax.random.key(0))
    last = lambda one: (one.layers[-1].weight, one.layers[-1].bias)
    return eqx.tree_at(last, layers, (jnp.zeros((2, 4)), jnp.array([slip, spread])))


def test_sideslip_is_that_of_the_rear_axle_s_slip():
    method = told(saying(0.4, np.log(0.1)))
    row = {"v_x": jnp.asarray(V), "steer": jnp.asarray(0.02), "yaw_rate": jnp.asarray(0.3), "a_y": jnp.asarray(5.0)}
    _, said = method.first(jnp.asarray(0.0), row)
    v_y = CAR.rear_axle_to_cg * 0.3 - V * 0.05 * 0.4
    np.testing.assert_allclose([said.mean.v_y, said.std.v_y], [v_y, V * 0.05 * 0.1])


def test_signals_have_no_size_of_a_car_and_the_memory_is_a_low_pass_whatever_the_rows():
    method = told(saying(0.0, 0.0))
    row = {"v_x": jnp.asarray(V), "steer": jnp.asarray(0.02), "yaw_rate": jnp.asarray(0.2), "a_y": jnp.asarray(4.0)}
    # A linear car in a steady turn has the slip angles that its compliances say.
    slip = CAR.mass * CAR.front_axle_to_cg / (CAR.wheelbase * CAR.rear_cornering_stiffness) * 4.0
    np.testing.assert_allclose(method.signals(row)[5], slip / 0.05)
    large = dataclasses.replace(
        CAR, front_axle_to_cg=2 * CAR.front_axle_to_cg, rear_axle_to_cg=2 * CAR.rear_axle_to_cg, mass=3 * CAR.mass,
        front_cornering_stiffness=3 * CAR.front_cornering_stiffness, rear_cornering_stiffness=3 * CAR.rear_cornering_stiffness,
    )  # fmt: skip
    np.testing.assert_allclose(
        told(saying(0.0, 0.0), large).signals(row | {"yaw_rate": jnp.asarray(0.1)})[jnp.array([0, 1, 2, 4, 5])],
        method.signals(row)[jnp.array([0, 1, 2, 4, 5])],
    )
    start = row | {"a_y": jnp.asarray(0.0)}
    for rows in (2, 20):
        memory, _ = method.first(jnp.asarray(0.0), start)
        for t in np.linspace(0.0, 0.4, rows)[1:]:
            memory, _ = method.next(memory, jnp.asarray(t), row)
        share = 1.0 - np.exp(-0.4 / np.array(network.TIMES))
        np.testing.assert_allclose(memory.slow[:, 2], share * 4.0 / (0.3 * vehicles.GRAVITY))


def test_the_weights_that_are_there_fit_and_do_not_depend_on_the_dtype(tmp_path):
    arrays = network.trained_arrays()
    assert arrays[0].shape[1] == learned.SideslipNetwork.size and arrays[-1].shape == (2,)
    layers = network.layers_of(list(arrays))
    network_training.write_weights(tmp_path / "again.npz", layers)
    with np.load(tmp_path / "again.npz") as stored:
        assert all(
            np.array_equal(stored[name], one.astype(np.float32))
            for name, one in zip(sorted(stored.files), arrays, strict=True)
        )


def test_training_finds_a_slip_that_is_linear_in_what_is_read():
    pytest.importorskip("optax")
    rng = np.random.default_rng(0)
    features = rng.normal(size=(4000, learned.SideslipNetwork.size))
    slip = 0.5 * features[:, 5] - 0.2 * features[:, 0] + 0.05 * rng.normal(size=4000)
    rows = network_training.Rows(features, slip, rng.integers(0, 2, 4000))
    found = network_training.trained_network(
        rows, network_training.Candidate(8, 1e-3), jax.random.key(0), steps=400, batch=256
    )
    mean, spread = np.asarray(jax.vmap(found)(jnp.asarray(features))).T
    assert np.std(mean - slip) < 0.2 * np.std(slip)
    assert 0.5 < np.std((mean - slip) / np.exp(spread)) < 1.5


@pytest.mark.full
def test_on_a_car_that_it_was_not_trained_on_it_is_better_than_nothing_done():
    assert "sedan" not in network_training.TRAINED_ON
    car = vehicles.named_car("sedan", "single-track")
    file = vehicles.specification_of(vehicles.kit.CARS["sedan"]())
    drive = simulate(car, manoeuvres.random_steering(25.0, 0.02, jax.random.key(3), duration=30.0), dt=0.01)
    true = {n: drive[f"true.{n}"] for n in ("yaw_rate", "a_y")}
    log = Recording(drive.time, {n: drive[n] for n in ("steer", "v_x")} | true)
    truth = np.asarray(drive["true.sideslip"])
    rms = lambda values: np.sqrt(np.mean((np.asarray(values) - truth)[200:] ** 2))
    found = sideslip.estimate(file, log, method="neural_network")
    assert rms(found["sideslip"]) < 0.5 * rms(0.0 * truth)
    assert rms(found["sideslip"]) < np.radians(0.3)
    assert isinstance(kit.method_of("sideslip", sideslip.METHODS, file, "neural_network"), estimators.AbstractMethod)
