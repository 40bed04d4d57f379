"""Steer at the road wheels, of a log that has that of the steering wheel."""

import dataclasses

import numpy as np

from jaxveh import Recording, io

CAR = io.CarSpecification(
    mass=1400.0, yaw_inertia=2100.0, front_axle_to_cg=1.1, rear_axle_to_cg=1.5, front_cornering_stiffness=9e4,
    rear_cornering_stiffness=9e4, steering_ratio=16.0,
)  # fmt: skip


def test_steer_is_the_steering_wheel_over_the_ratio_where_there_is_no_other():
    log = Recording(np.arange(3.0), {"steering_wheel": np.array([1.6, -3.2, np.nan])})
    np.testing.assert_allclose(io.with_road_steer(CAR, log)["steer"], [0.1, -0.2, np.nan], rtol=1e-15)
    own = log.replace(steer=np.array([0.01, 0.02, 0.03]))
    assert io.with_road_steer(CAR, own) is own
    assert io.with_road_steer(dataclasses.replace(CAR, steering_ratio=None), log) is log
    bare = Recording(np.arange(3.0), {"v_x": np.ones(3)})
    assert io.with_road_steer(CAR, bare) is bare
