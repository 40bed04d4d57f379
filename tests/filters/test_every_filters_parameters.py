"""Estimated parameters have one shape, whoever estimated them: every filter of the package, and every smoother.

Filters are traced alone, not run: names and shapes are all that is looked at. Their measurement noise depends on the state where
they take such a law, so that it is seen of each in the same trace that they do. Fits are in `tests/fitting/test_every_fit.py`,
observers in `tests/observers/test_every_observer.py`, a sweep's runs in `tests/sweeps/test_sweep.py`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_observation, linear_recording, linear_transition
from test_every_filter import FILTERS, linear
from test_state_dependent_noise import ONE_LAW, never_changes, with_noise

from jaxveh import Parameters, filters
from jaxveh import statespace as ss
from jaxveh._core.parameter import positive

NAMES = ("spring.gain", "offset")
ROWS = 6


class Spring(eqx.Module):
    gain: jax.Array = positive("N/m")


class Car(eqx.Module):
    spring: Spring
    offset: jax.Array = positive("m")


class Held(eqx.Module):
    car: Car = eqx.field(metadata=ss.kit.UNNAMED)
    linear: dict


def moved(system, t0, t1, x, u):
    return linear_transition(system.linear, t0, t1, x, u)


def seen(system, t, x, u):
    return linear_observation(system.linear, t, x, u)


def model():
    """The filters' linear model in a car with two parameters, chosen in another order than they stand in it."""
    plain = linear()
    held = ss.StateSpace(
        system=Held(Car(Spring(2.0), 0.5), plain.system), transition=moved, observation=seen, inputs=plain.inputs,
        process_noise=plain.process_noise, measurement_noise=plain.measurement_noise, prior=plain.prior,
    )  # fmt: skip
    return ss.with_parameters(held, lambda m: (m.system.car.spring.gain, m.system.car.offset), prior=0.1, walk=0.1)


MODEL = model()
STATE_DEPENDENT = with_noise(MODEL, ss.StateDependent(never_changes, ("y0", "y1")))
RECORDING = linear_recording(MODEL, rows=ROWS)


def check(estimate):
    for found in (estimate.parameters, estimate.parameters_std):
        assert isinstance(found, Parameters) and tuple(found) == NAMES
        assert found.spring.gain.shape == found["offset"].shape == (ROWS,)


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_s_parameters_are_found_as_in_the_car(name):
    line = FILTERS[name]
    key = jax.random.key(0) if line.drawn else None
    taken = MODEL if name in ONE_LAW else STATE_DEPENDENT
    line.make().check(taken)
    estimate = eqx.filter_eval_shape(filters.scan, line.make(), taken, MODEL.rows(RECORDING), key)
    check(estimate)
    floats = [leaf.dtype for leaf in jax.tree.leaves(estimate) if jnp.issubdtype(leaf.dtype, jnp.floating)]
    assert set(floats) == {np.dtype("float64")}


@pytest.mark.parametrize("lag", [None, 2])
def test_a_smoother_s_parameters_are_found_as_in_the_car(lag):
    check(filters.smooth(filters.Cubature(), MODEL, RECORDING, lag=lag))


def test_a_parallel_smoother_s_parameters_are_found_as_in_the_car():
    found = filters.smooth_parallel(filters.Iterated(filters.Cubature()), MODEL, RECORDING)
    check(found)
    check(found.filtered)
