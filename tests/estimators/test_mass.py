"""Mass: each method where the right answer is known, and the filter on simulated cars."""

import dataclasses

import numpy as np
import pytest
from banked_drives import file_of, follow_all
from method_logs import CAR
from steady_logs import pushed
from winding_roads import SCORED, heard_of

from jaxveh import InputError
from jaxveh.estimators import mass

EVERY = list(mass.METHODS)
LIGHT = dataclasses.replace(CAR, mass=1320.0)


@pytest.mark.parametrize("name", EVERY)
def test_pedals_that_move_tell_the_mass(name):
    method = mass.METHODS[name].make(LIGHT)
    found = mass.estimate(method, pushed(method.needs, mass=1500.0, rows=6000))
    assert found.known.mass[4000:].any()
    assert abs(found["mass"][-1] / 1500.0 - 1.0) < 0.03
    if not np.isnan(found.std.mass[-1]):
        assert abs(found["mass"][-1] - 1500.0) < 3.0 * found.std.mass[-1] + 15.0


@pytest.mark.parametrize("name", [name for name in EVERY if name != "forgetting"])
def test_a_steady_drive_tells_no_mass(name):
    method = mass.METHODS[name].make(LIGHT)
    log = pushed(method.needs, mass=1500.0, grade=0.0, swing=0.0)
    found = mass.estimate(method, log)
    assert not found.known.mass[-1] or abs(found["mass"][-1] / 1500.0 - 1.0) < 0.03
    assert found.std.mass[-1] > 0.03 * found["mass"][-1]


@pytest.mark.parametrize("name", ["gated", "forgetting", "kinematic_grade", "high_pass"])
def test_a_steady_drive_leaves_the_mass_of_the_file(name):
    method = mass.METHODS[name].make(LIGHT)
    found = mass.estimate(method, pushed(method.needs, mass=1500.0, grade=0.0, swing=0.0))
    np.testing.assert_allclose(found["mass"][-1], 1320.0, rtol=0.03)
    assert not found.known.mass[-1]


def test_a_grade_is_no_mass_to_what_is_fast():
    method = mass.METHODS["high_pass"].make(LIGHT)
    two = [mass.estimate(method, pushed(method.needs, grade=slope, rows=6000))["mass"][-1] for slope in (-0.04, 0.04)]
    np.testing.assert_allclose(two[0], two[1], rtol=0.01)


WITHOUT_THE_TORQUES_ERROR = ("joint", "forgetting")
"""The filter of `mass_and_grade` shows its own state; the observer gives no standard deviation."""


@pytest.mark.parametrize("name", [name for name in EVERY if name not in WITHOUT_THE_TORQUES_ERROR])
@pytest.mark.parametrize("gain", [0.95, 1.05])
def test_the_standard_deviation_contains_torques_that_are_wrong_in_all_rows(name, gain):
    method = mass.METHODS[name].make(LIGHT)
    log = pushed(method.needs, mass=1500.0, rows=6000)
    torques = {torque: gain * np.asarray(log[torque]) for torque in ("drive_torque", "brake_torque")}
    found = mass.estimate(method, log.replace(**torques))
    assert found.known.mass[-1]
    assert 0.03 * found["mass"][-1] < found.std.mass[-1] < 0.05 * found["mass"][-1]
    assert abs(found["mass"][-1] / 1500.0 - 1.0) > 0.02
    assert abs(found["mass"][-1] - 1500.0) < 2.0 * found.std.mass[-1]


def test_a_file_without_the_wheels_radius_is_refused():
    for name in EVERY:
        with pytest.raises(InputError, match=r"wheel_radius \(m\)"):
            mass.METHODS[name].make(dataclasses.replace(CAR, wheel_radius=None))


@pytest.mark.full
def test_on_unseen_cars_the_mass_is_within_three_per_cent():
    cases, _, _, time = heard_of(SCORED, range(4), 120.0)
    said = follow_all(lambda car: mass.METHODS["filter"].make(file_of(car, 1.12)), cases, time)
    true = np.array([file_of(car).mass for car, _ in cases])
    assert said.known.mass[:, -1].all()
    assert np.abs(said.mean.mass[:, -1] / true - 1.0).max() < 0.03
    assert np.mean(((said.mean.mass[:, -1] - true) / said.std.mass[:, -1]) ** 2) < 2.0
