"""What every device says of one drive, and every number of the devices that come ready made, as recorded."""

import jax
import numpy as np
import pytest
from recorded_numbers import check_declared, check_recorded, classes_of, without_effect
from test_every_device import DEVICES, SMOOTH, heard, light

from jaxveh import sensors

pytestmark = pytest.mark.whole

MADE = {
    "production": sensors.production_car,
    "production, wheels": lambda: sensors.production_car(0.31, steering_ratio=15.5, gnss=False),
    "proving ground": sensors.proving_ground_car,
    "proving ground, wheels": lambda: sensors.proving_ground_car(0.31, steering_ratio=15.5),
    "ESC": sensors.esc,
}


OPTIONS = {
    "WheelSpeeds, signed": lambda **c: sensors.WheelSpeeds(
        "omega_fl", teeth=40, below="nan", signed=True, lowest=4.0, **c
    ),
    "GNSS, slowly": lambda **c: sensors.GNSS(0.05, 0.03, 4.0, SMOOTH, **c),
    "Dropout of a channel": lambda **c: sensors.Dropout(light(**c), "a_y", probability=0.3),
}
MAKERS = {name: one.make for name, one in DEVICES.items()} | OPTIONS


def made(name):
    return MAKERS[name](rate=50.0, delay=0.013, phase=0.004)


def test_every_number_and_option_of_a_device_has_an_effect_in_one_on_record():
    assert without_effect(list(map(made, MAKERS)), "jaxveh.sensors") == set()


@pytest.mark.parametrize("name", MAKERS)
def test_readings_are_those_recorded(name):
    """With noise and without."""
    device = made(name)
    found = {"silent": heard(device), "noisy": heard(device, jax.random.key(4))}
    few = jax.tree.map(lambda values: np.asarray(values)[::9], found)
    check_recorded(__file__, name, {"channels": few, "times": np.asarray(device.sample_times(2.0))[:5]})


@pytest.mark.parametrize("name", MADE)
def test_numbers_of_ready_made_devices_are_those_recorded(name):
    suite = MADE[name]()
    numbers = [leaf for leaf in jax.tree.leaves(suite) if isinstance(leaf, float | int | np.ndarray | jax.Array)]
    clocks = [
        [float(getattr(device, what, 0.0) or 0.0) for what in ("rate", "delay", "phase", "lowest")]
        for device in getattr(suite, "devices", ())
    ]
    check_recorded(__file__, name, {"numbers": numbers, "clocks": clocks}, given=True)


DECLARED = classes_of(sensors)


@pytest.mark.parametrize("name", DECLARED)
def test_parameters_are_declared_as_recorded(name):
    check_declared(__file__, name, DECLARED[name])
