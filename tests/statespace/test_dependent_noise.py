"""Noise that depends on state and inputs, in the models around models: the law is that of the model inside."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording
from jaxveh import statespace as ss
from jaxveh._core.names import record, record_type

State = record_type("State", ("x",))


def fade(system, t0, t1, x, u):
    return State(system["a"] * x.x + u.force)


def see(system, t, x, u):
    return record_type("Y", ("y",))(x.x)


def worse(system, t, x, u):
    return {"y": system["r"] * (1.0 + x.x**2) + 0.1 * u.force**2}


def model(noise=None):
    number = lambda value: jnp.asarray(value, float)
    return ss.StateSpace(
        system={"a": number(0.9), "r": number(0.5)},
        transition=fade,
        observation=see,
        process_noise=ss.Discrete(ss.Gaussian({"x": 0.3})),
        measurement_noise=noise or ss.StateDependent(worse, "y"),
        prior=ss.Prior(State(0.4), {"x": 0.5}),
        inputs=("force",),
    )


U = record("Inputs", {"force": jnp.asarray(2.0)})
T = jnp.asarray(0.0)


def test_its_law_is_that_of_state_and_input():
    law = model().measurement_law(T, State(jnp.asarray(3.0)), U)
    assert float(law.std.y) == pytest.approx(0.5 * 10.0 + 0.4)
    assert model().channels == ("y",)
    plain = model(ss.Gaussian({"y": 0.2}))
    assert plain.measurement_law(T, None, None) is plain.measurement_noise


def test_chosen_parameters_reach_it():
    joint = ss.with_parameters(model(), lambda m: m.system["r"], 0.1)
    x = joint.prior.mean._replace(x=jnp.asarray(3.0), r=1.4 * joint.prior.mean.r)
    physical = float(joint.chosen.physical([x.r])[0])
    assert float(joint.measurement_law(T, x, U).std.y) == pytest.approx(physical * 10.0 + 0.4)


def test_errors_of_inputs_reach_it_and_disturbances_do_not():
    uncertain = ss.uncertain_inputs(model(), {"force": 0.1})
    x = uncertain.prior.mean._replace(x=jnp.asarray(3.0), force_error=jnp.asarray(-1.0))
    assert float(uncertain.measurement_law(T, x, U).std.y) == pytest.approx(0.5 * 10.0 + 0.1)
    pushed = ss.with_disturbances(model(), {"x": 0.3}, felt={"x": "y"})
    x = pushed.prior.mean._replace(x=jnp.asarray(3.0), disturbance_x=jnp.asarray(5.0))
    assert float(pushed.measurement_law(T, x, U).std.y) == pytest.approx(0.5 * 10.0 + 0.4)


def test_draws_are_as_wide_as_their_row_s_law():
    rows = 4000
    force = np.where(np.arange(rows) % 2, 0.0, 3.0)
    drawn = ss.draw(model(), Recording(np.arange(float(rows)), {"force": force}), jax.random.key(1))
    x = np.asarray(drawn.states.x)
    white = (np.asarray(drawn.recording["y"]) - x) / (0.5 * (1 + x**2) + 0.1 * force**2)
    for part in (white[::2], white[1::2], white[np.abs(x) > 3.0]):
        assert abs(np.mean(part)) < 4 / part.size**0.5
        assert np.mean(part**2) == pytest.approx(1.0, abs=5 * (2 / part.size) ** 0.5)


def test_draws_of_one_law_are_what_they_were():
    """A law that sees the residual alone is drawn at once, for all rows."""
    plain = model(ss.Gaussian({"y": 0.2}))
    drawn = ss.draw(plain, Recording(np.arange(5.0), {"force": np.zeros(5)}), jax.random.key(1))
    error = plain.measurement_noise.sample(jax.random.split(jax.random.key(1), 3)[2], (5,))["y"]
    np.testing.assert_allclose(drawn.recording["y"] - np.asarray(drawn.states.x), error, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: ss.StateDependent({"y": 1.0}, "y"),
            r"StateDependent.function = dict: must be a function. It takes",
        ),
        (lambda: ss.StateDependent(worse, ()), "StateDependent.names is empty"),
        (lambda: look(lambda s, t, x, u: 1.0), "its function returned 1.0: must be a noise law, or a mapping"),
        (lambda: look(lambda s, t, x, u: {"z": 1.0}), "its function returned a law of z: must be of y"),
    ],
)
def test_mistakes_are_named(make, message):
    with pytest.raises(InputError, match=message):
        make()


def look(function):
    return model(ss.StateDependent(function, "y")).measurement_law(T, State(jnp.asarray(0.0)), U)
