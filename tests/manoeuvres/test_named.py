"""Manoeuvres by name: each can be made, and says what can be set of it."""

import inspect

import jax
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


@pytest.mark.parametrize("name", MANOEUVRES)
def test_no_named_manoeuvre_takes_a_speed_that_no_car_has(name):
    for speed in (-0.1, manoeuvres.kit.FASTEST + 1.0, 1e6, np.inf, np.nan):
        with pytest.raises(InputError, match=f"speed = {speed}: must be between 0 and 150 m/s"):
            named_manoeuvre(name, speed, 0.03)


SPEEDS = {
    "SteadySpeed": (lambda v: manoeuvres.SteadySpeed(v),),
    "ChangingSpeed": (lambda v: manoeuvres.ChangingSpeed(v, 20.0), lambda v: manoeuvres.ChangingSpeed(20.0, v)),
    "WaveringSpeed": (lambda v: manoeuvres.wavering_speed(v, 1.0, jax.random.key(0)),),
}


def test_no_law_of_speed_takes_a_speed_that_no_car_has():
    every = (getattr(manoeuvres, name) for name in manoeuvres.__all__)
    kinds = {kind.__name__ for kind in every if inspect.isclass(kind) and issubclass(kind, manoeuvres.AbstractSpeed)}
    assert kinds - {"AbstractSpeed"} == set(SPEEDS)
    for make in (make for makes in SPEEDS.values() for make in makes):
        make(manoeuvres.kit.FASTEST)
        with pytest.raises(InputError, match="= 151.0: must be between 0 and 150 m/s"):
            make(151.0)
    with pytest.raises(InputError, match="from_speed = 151.0: must be between 0 and 150 m/s"):
        manoeuvres.steady_circle(from_speed=151.0)


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("wrong", [None, "fast", 1j, 10**400, object()], ids=lambda one: type(one).__name__)
def test_what_is_no_number_is_refused(name, wrong):
    given = inspect.signature(FUNCTIONS[name]).parameters
    usual = {"speed": 20.0, "steer": 0.03, "key": jax.random.key(0)}
    usual = {key: value for key, value in usual.items() if key in given}
    for key in {"speed", "steer", "from_speed", "to_speed"} & set(given):
        with pytest.raises(InputError, match=f"{key} = "):
            FUNCTIONS[name](**{**usual, key: wrong})


TURNED = [name for name, make in FUNCTIONS.items() if "steer" in inspect.signature(make).parameters]


@pytest.mark.parametrize("name", TURNED)
def test_a_steer_in_front_of_the_speed_is_told_from_a_steer_in_degrees(name):
    more = (jax.random.key(0),) if "key" in inspect.signature(FUNCTIONS[name]).parameters else ()
    with pytest.raises(InputError, match=r"steer = 20.0: must be within a quarter turn. The speed comes first, then"):
        FUNCTIONS[name](0.05, 20.0, *more)
    with pytest.raises(InputError, match=r"steer = 3.0: must be within a quarter turn. It is in rad, not degrees"):
        FUNCTIONS[name](20.0, 3.0, *more)


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
