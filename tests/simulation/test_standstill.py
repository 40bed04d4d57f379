"""Braking until the car stands: the wheels' spins become stiff on the way, and sliding tyres hide it."""

import numpy as np
import pytest
from systems import seven

from jaxveh import JaxvehWarning, manoeuvres
from jaxveh.simulation import simulate

BRAKES = manoeuvres.mu_jump_braking(8.0, brake_at=0.2, deceleration=5.0, mass=1500.0, wheel_radius=0.32, duration=2.6)


@pytest.fixture(scope="module")
def drive():
    return simulate(seven(), BRAKES)


def test_the_car_stands_and_nothing_trembles(drive):
    v, slip = np.asarray(drive["true.v_x"]), np.asarray(drive["true.slip_ratio_fl"])
    assert 0.0 <= v[-1] < 0.05
    assert np.all(np.diff(v) < 1e-9)
    assert np.min(np.asarray(drive["true.a_x"])) > -5.0
    # Braking evenly the slip is even; it fades with the speed. Ringing steps made it four times as large.
    assert np.min(slip) > -0.04
    assert np.all(np.diff(slip[v < 0.5]) > -1e-6)


def test_steps_that_hide_the_stiffness_by_ringing_are_found():
    """With steps of 2 ms the wheels ring up until the tyres slide, where the state's own poles are slow."""
    with pytest.warns(JaxvehWarning, match="steps of 0.002 s are too long for a motion of [4-9][0-9]{3} 1/s"):
        rung = simulate(seven(), BRAKES, solver="explicit")
    assert np.min(np.asarray(rung["true.slip_ratio_fl"])) < -0.1
