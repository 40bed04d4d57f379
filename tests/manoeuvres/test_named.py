"""Manoeuvres by name: each can be made, and says what can be set of it."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, manoeuvres
from jaxveh.manoeuvres import MANOEUVRES, Motion, as_driver, manoeuvre_options, named_manoeuvre
from jaxveh.manoeuvres.options import FUNCTIONS


@pytest.mark.parametrize("name", MANOEUVRES)
def test_every_named_manoeuvre_gives_steer_and_speed_from_its_start(name):
    driver = as_driver(named_manoeuvre(name, 20.0, 0.03))
    still = Motion(*[jnp.zeros(())] * 6)._replace(v_x=jnp.asarray(20.0))
    u = driver.inputs(0.0, still, driver.start(0.0, still))
    assert isinstance(driver.duration, float) and driver.duration > 0
    assert np.isfinite(u.steer) and np.isfinite(u.v_x)
    if name not in ("steady-circle", "cruise", "random-steering"):
        np.testing.assert_allclose([u.steer, u.v_x], [0.0, 20.0], atol=1e-9)


def test_the_functions_of_options_are_those_of_the_names():
    assert set(FUNCTIONS) == set(MANOEUVRES)


@pytest.mark.parametrize("name", MANOEUVRES)
def test_every_option_can_be_set_to_its_default(name):
    options = {key: value for key, value in manoeuvre_options(name).items() if value is not None}
    assert "duration" in manoeuvre_options(name)
    made, usual = named_manoeuvre(name, 20.0, 0.03, **options), named_manoeuvre(name, 20.0, 0.03)
    assert made.duration == usual.duration


def test_an_option_changes_the_manoeuvre():
    assert named_manoeuvre("step-steer", 20.0, 0.03, ramp=0.5).ramp == 0.5
    assert float(named_manoeuvre("iso-lane-change", 20.0, preview_time=0.8).preview_time) == 0.8
    assert manoeuvre_options("iso-lane-change")["preview_time"] == 0.6
    assert "path" not in manoeuvre_options("iso-lane-change")
    assert not {"speed", "steer", "to_speed"} & set(manoeuvre_options("steady-circle"))


def test_unknown_names_and_options_are_named():
    with pytest.raises(InputError, match="step-steer: no option.s. radius, rate; there are: ramp, start, duration"):
        named_manoeuvre("step-steer", 20.0, 0.03, radius=4.0, rate=1.0)
    with pytest.raises(InputError, match="manoeuvre = 'step': must be one of 'double-lane-change'"):
        manoeuvres.manoeuvre_options("step")
