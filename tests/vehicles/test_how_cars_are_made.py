"""Every car and its parts: made inside jit, of traced and of known numbers, which are copied; and it equals its copies."""

import jax
import jax.numpy as jnp
import pytest
from copies import check_copies, unset_fields
from families import is_made_inside_jit, keeps_copies, made_again, refuses_arrays_as_settings
from test_every_vehicle import CARS

from jaxveh import InputError, vehicles

pytestmark = pytest.mark.filterwarnings("ignore:A JAX array is being set as static:UserWarning")


def parts():
    """Each class of vehicle, steering, drive, ... in the cars, once."""
    seen = set()
    for name, car in CARS.items():
        for made, given in made_again(car.make(), seen):
            yield pytest.param(made, given, id=f"{name}-{made.__name__}")


PARTS = list(parts())


@pytest.mark.parametrize(("made", "given"), PARTS)
def test_it_can_be_made_inside_jit(made, given):
    is_made_inside_jit(made, given)


@pytest.mark.parametrize(("made", "given"), PARTS)
def test_its_numbers_are_copied(made, given):
    keeps_copies(made, given)


@pytest.mark.parametrize(("made", "given"), PARTS)
def test_no_setting_is_an_array(made, given):
    refuses_arrays_as_settings(made, given)


def test_slips_that_are_known_are_compared_inside_jit_too():
    car, low, high = vehicles.named_car("sedan", "seven-dof"), jnp.asarray(0.3, float), jnp.asarray(0.2, float)
    with pytest.raises(InputError, match=r"AntiLock\.slip_high = 0\.2: must be above slip_low = 0\.3"):
        jax.eval_shape(lambda x: (vehicles.AntiLock(car, slip_low=low, slip_high=high), x)[1], 1.0)


@pytest.mark.parametrize("name", CARS)
def test_it_equals_its_copies(name):
    value = CARS[name].make()
    check_copies(value)
    assert not unset_fields(value)
