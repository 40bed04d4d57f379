"""What holds for every driver, each in turn: a new one is a line in `DRIVERS`."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import manoeuvres
from jaxveh.manoeuvres import Motion, OpenLoop, SpeedControl
from jaxveh.statespace import cast

DRIVERS = {
    "ISO lane change": manoeuvres.iso_lane_change,
    "ISO obstacle avoidance": manoeuvres.iso_obstacle_avoidance,
    "OpenLoop": lambda: OpenLoop(manoeuvres.step_steer(20.0, 0.05)),
    "SpeedControl of a manoeuvre": lambda: SpeedControl(manoeuvres.braking_in_a_turn(20.0, 0.05), 1500.0),
    "SpeedControl of a driver": lambda: SpeedControl(manoeuvres.steady_circle(), 1500.0),
    "slalom course": lambda: manoeuvres.slalom_course(14.0),
    "steady circle": manoeuvres.steady_circle,
}
# At speed, backwards, at rest, and in the middle of a circle.
MOTIONS = [
    Motion(40.0, 0.5, 0.1, 20.0, -0.3, 0.2),
    Motion(40.0, 0.5, 3.3, -5.0, 0.3, 0.2),
    Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    Motion(0.0, 40.0, 0.0, 10.0, 0.0, 0.0),
]


@pytest.fixture(params=DRIVERS)
def driver(request):
    return DRIVERS[request.param]()


def arrays(motion, dtype=jnp.float64):
    return Motion(*[jnp.asarray(value, dtype) for value in motion])


def everything(driver, t, motion, state):
    return jnp.stack([*driver.inputs(t, motion, state), *driver.derivatives(t, motion, state)])


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_values_and_gradients_are_finite_in_their_precision(driver, motion, dtype):
    driver, motion, t = cast(driver, dtype), arrays(motion, dtype), jnp.asarray(5.0, dtype)
    state = driver.start(t, motion)
    assert state._fields == driver.state_names
    assert type(driver.derivatives(t, motion, state)) is type(state)
    assert {leaf.dtype for leaf in state} <= {jnp.dtype(dtype)}
    values = jax.jit(everything)(driver, t, motion, state)
    assert values.dtype == dtype and np.isfinite(values).all()
    total = lambda *args: jnp.sum(everything(*args))
    gradients = eqx.filter_jit(eqx.filter_grad(lambda args: total(*args)))((driver, t, motion, state))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradients))


def test_a_batch_is_its_members(driver):
    batch = Motion(*[jnp.asarray(values) for values in zip(*MOTIONS, strict=True)])
    t = jnp.asarray(5.0)
    state = driver.start(t, batch)
    mapped = jax.vmap(lambda motion: driver.start(t, motion))(batch)
    for name in driver.state_names:
        np.testing.assert_allclose(getattr(state, name), getattr(mapped, name), rtol=1e-12, atol=1e-13)
    one = jax.vmap(lambda m, x: everything(driver, t, m, x))(batch, mapped)
    for number, motion in enumerate(MOTIONS):
        alone = everything(driver, t, arrays(motion), driver.start(t, arrays(motion)))
        np.testing.assert_allclose(one[number], alone, rtol=1e-11, atol=1e-12)


def test_gradients_are_those_of_differences(driver):
    t, motion = jnp.asarray(5.0), arrays(MOTIONS[0])
    state = driver.start(t, motion)
    if driver.state_names:
        state = type(state)(*[leaf + 0.01 for leaf in state])
    slope = jax.jacfwd(lambda *args: everything(driver, *args), argnums=(0, 1, 2))(t, motion, state)
    leaves, treedef = jax.tree.flatten((t, motion, state))
    for number, column in enumerate(jax.tree.leaves(slope)):
        up, down = (
            jax.tree.unflatten(treedef, [v + (i == number) * h for i, v in enumerate(leaves)]) for h in (1e-6, -1e-6)
        )
        difference = (everything(driver, *up) - everything(driver, *down)) / 2e-6
        np.testing.assert_allclose(column, difference, rtol=1e-5, atol=1e-5)


def test_drivers_last_as_long_as_they_say(driver):
    assert isinstance(driver.duration, float) and driver.duration > 0
