"""`LateralSystem` of random entries: slow and fast, stable and unstable, against NumPy's matrices."""

import jax.numpy as jnp
import numpy as np

from jaxveh.vehicles import LateralSystem

SYSTEMS = 300


def drawn():
    """Random entries of A over five decades, so that determinants lie on both sides of 0 and of 1; (SYSTEMS,) each."""
    rng = np.random.default_rng(0)
    scale = 10.0 ** rng.uniform(-3.0, 2.0, SYSTEMS)
    entries = rng.normal(size=(6, SYSTEMS)) * scale
    return LateralSystem(*map(jnp.asarray, entries), jnp.asarray(rng.uniform(1.0, 60.0, SYSTEMS)))


def matrices(system):
    """A, (SYSTEMS, 2, 2)."""
    rows = [[system.a_11, system.a_12], [system.a_21, system.a_22]]
    return np.moveaxis(np.asarray(rows), 2, 0)


def test_eigenvalues_are_those_of_the_matrix():
    system = drawn()
    asked = np.linalg.eigvals(matrices(system))
    found = np.stack([np.asarray(value) for value in system.eigenvalues], axis=1)
    order = lambda values: np.take_along_axis(values, np.lexsort((values.imag, values.real), axis=1), axis=1)
    # The difference of two eigenvalues that nearly agree is a root of a rounded difference.
    np.testing.assert_allclose(order(found), order(asked), rtol=1e-7)
    first, second = found.T
    assert np.all((first.real > second.real) | (first.imag >= -second.imag))
    assert np.iscomplex(first).any() and not np.iscomplex(first).all()


def test_frequency_and_damping_follow_from_the_eigenvalues_and_are_nan_beyond_the_critical_speed():
    system = drawn()
    values = np.linalg.eigvals(matrices(system))
    product, total = np.prod(values, axis=1).real, np.sum(values, axis=1).real
    held = product > 0
    assert (product[held] < 1e-2).any() and (product[held] > 1e2).any() and (~held).any()
    np.testing.assert_allclose(system.natural_frequency[held], np.sqrt(product[held]), rtol=1e-9)
    np.testing.assert_allclose(system.damping_ratio[held], -total[held] / (2 * np.sqrt(product[held])), rtol=1e-7)
    assert np.isnan(system.natural_frequency[~held]).all() and np.isnan(system.damping_ratio[~held]).all()


def test_the_response_solves_the_system_at_every_frequency():
    system = drawn()
    omega = np.random.default_rng(1).uniform(0.0, 30.0, SYSTEMS)
    response = system.frequency_response(jnp.asarray(omega))
    steer = np.stack([system.b_1, system.b_2], axis=1)[..., None]
    asked = np.linalg.solve(1j * omega[:, None, None] * np.eye(2) - matrices(system), steer)[..., 0]
    np.testing.assert_allclose(np.stack([response.sideslip, response.yaw_rate], axis=1), asked, rtol=1e-6)
    a_y = np.asarray(system.speed) * (1j * omega * asked[:, 0] + asked[:, 1])
    np.testing.assert_allclose(response.a_y, a_y, rtol=1e-6)
