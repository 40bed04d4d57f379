"""What holds for every driver, each in turn: a new one is a line in `DRIVERS`."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import manoeuvres
from jaxveh.manoeuvres import Motion, OpenLoop, SpeedControl
from jaxveh.statespace import cast

pytestmark = pytest.mark.product

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


@pytest.fixture(scope="module")
def batch():
    return Motion(*[jnp.asarray(values) for values in zip(*MOTIONS, strict=True)])


@pytest.mark.parametrize("dtype", [pytest.param(jnp.float32, marks=pytest.mark.full), jnp.float64])
def test_values_and_gradients_are_finite_in_their_precision(driver, batch, dtype):
    driver, batch, t = cast(driver, dtype), cast(batch, dtype), jnp.asarray(5.0, dtype)
    state = eqx.filter_jit(driver.start)(t, batch)
    assert state._fields == driver.state_names
    assert type(jax.eval_shape(driver.derivatives, t, batch, state)) is type(state)
    assert {leaf.dtype for leaf in state} <= {jnp.dtype(dtype)}

    @eqx.filter_jit
    @eqx.filter_value_and_grad(has_aux=True)
    def total(args):
        driver, t, batch, state = args
        values = jax.vmap(lambda motion, own: everything(driver, t, motion, own))(batch, state)
        return jnp.sum(values), values

    (_, values), gradients = total((driver, t, batch, state))
    assert values.dtype == dtype and np.isfinite(values).all()
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradients))


def test_a_batch_is_its_members(driver, batch):
    t = jnp.asarray(5.0)
    whole = lambda t, m, x: everything(driver, t, m, x)

    @jax.jit
    def together(t, batch):
        state = driver.start(t, batch)
        return state, jax.vmap(whole, in_axes=(None, 0, 0))(t, batch, state)

    @jax.jit
    def alone(t, motion):
        state = driver.start(t, motion)
        return state, whole(t, motion, state)

    state, mapped = together(t, batch)
    for number, motion in enumerate(MOTIONS):
        own, said = alone(t, arrays(motion))
        np.testing.assert_allclose([np.asarray(leaf)[number] for leaf in state], list(own), rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(np.asarray(mapped)[number], said, rtol=1e-11, atol=1e-12)


def test_gradients_are_those_of_differences(driver):
    t, motion = jnp.asarray(5.0), arrays(MOTIONS[0])
    state = eqx.filter_jit(driver.start)(t, motion)
    if driver.state_names:
        state = type(state)(*[leaf + 0.01 for leaf in state])
    # Values and slopes by one program.
    found = jax.jit(lambda args, along: jax.jvp(lambda args: everything(driver, *args), (args,), (along,)))
    leaves, treedef = jax.tree.flatten((t, motion, state))
    for number in range(len(leaves)):
        along = jax.tree.unflatten(treedef, [np.asarray(float(i == number)) for i in range(len(leaves))])
        _, column = found((t, motion, state), along)
        up, down = (
            jax.tree.map(lambda v, d, h=h: np.asarray(v) + d * h, (t, motion, state), along) for h in (1e-6, -1e-6)
        )
        difference = (np.asarray(found(up, along)[0]) - np.asarray(found(down, along)[0])) / 2e-6
        np.testing.assert_allclose(column, difference, rtol=1e-5, atol=1e-5)


def test_drivers_last_as_long_as_they_say(driver):
    assert isinstance(driver.duration, float) and driver.duration > 0
