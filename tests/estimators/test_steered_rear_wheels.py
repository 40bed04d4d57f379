"""Estimators whose equations are those of a car that steers its front wheels alone refuse another one, and say what to do."""

import dataclasses

import method_logs
import numpy as np
import pytest
from test_every_method import QUANTITIES

from jaxveh import InputError, Recording, diagnostics, estimators, vehicles
from jaxveh.estimators.linear_baseline import open_loop
from jaxveh.estimators.method_of_car import TURNING, method_of

REFUSAL = (
    r'steering = "rear", but the equations used here hold only for a car with front steering.*estimators.state_space'
)
REAR = dataclasses.replace(method_logs.CAR, steering="rear")


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_methods_that_read_how_the_car_turns_refuse_a_steered_rear_axle(quantity):
    methods = QUANTITIES[quantity].METHODS
    for name in methods:
        needs = methods[name].make(method_logs.CAR).needs
        if any(need.channel in TURNING for need in needs):
            with pytest.raises(InputError, match=f"{quantity}: {name}: the car's file has {REFUSAL}"):
                method_of(quantity, methods, REAR, name)
        else:
            assert method_of(quantity, methods, REAR, name).needs == needs


def test_calibrated_sideslip_refuses_it_too():
    with pytest.raises(InputError, match=f"sideslip: the car's file has {REFUSAL}"):
        estimators.sideslip.model(REAR)
    estimators.sideslip.model(dataclasses.replace(REAR, steering="ackermann"))


def test_a_log_is_not_checked_against_such_a_car():
    log = Recording(0.01 * np.arange(200.0), {"v_x": np.full(200, 10.0)})
    with pytest.raises(InputError, match=f"check_log: the car's file has {REFUSAL}"):
        diagnostics.check_log(log, car=REAR)


def test_the_baseline_knows_a_ratio_and_refuses_an_angle_of_its_own():
    car = vehicles.passenger_car()
    log = Recording(0.05 * np.arange(100.0), {"steer": np.full(100, 0.02), "v_x": np.full(100, 15.0)})
    turns = lambda steering: open_loop(dataclasses.replace(car, steering=steering), log)["yaw_rate"][-1]
    ratio = turns(vehicles.FourWheelSteering(0.25)) / turns(vehicles.FrontSteering())
    np.testing.assert_allclose(ratio, 0.75, rtol=1e-3)
    with pytest.raises(
        InputError,
        match="car.steering = RearSteering: needs steer, steer_rear; must be a steering whose only input is steer",
    ):
        turns(vehicles.RearSteering())
