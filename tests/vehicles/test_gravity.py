"""Free fall in the axes of a car on a sloping road."""

import numpy as np
import pytest

from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles import GRAVITY
from jaxveh.vehicles.wheels import gravity


def test_a_level_road_costs_nothing():
    assert gravity(LEVEL) == (0.0, 0.0, -GRAVITY)


def test_one_slope_at_a_time():
    np.testing.assert_allclose(
        gravity(Ground(grade=0.1)), [-GRAVITY * np.sin(0.1), 0.0, -GRAVITY * np.cos(0.1)], rtol=1e-14
    )
    np.testing.assert_allclose(
        gravity(Ground(bank=-0.2)), [0.0, GRAVITY * np.sin(0.2), -GRAVITY * np.cos(0.2)], rtol=1e-14
    )


@pytest.mark.parametrize(("grade", "bank"), [(0.1, 0.2), (-0.3, 0.05), (0.02, -0.4)])
def test_both_slopes_turn_the_vector_and_keep_its_length(grade, bank):
    """Axes of the road's plane, built from its slopes: x in the vertical plane of the heading, z along the normal."""
    e_x = np.array([1.0, 0.0, np.tan(grade)])
    e_z = np.array([-np.tan(grade), -np.tan(bank), 1.0])
    e_x, e_z = e_x / np.linalg.norm(e_x), e_z / np.linalg.norm(e_z)
    fall = np.array([0.0, 0.0, -GRAVITY])
    expected = [fall @ e_x, fall @ np.cross(e_z, e_x), fall @ e_z]
    np.testing.assert_allclose(gravity(Ground(grade=grade, bank=bank)), expected, rtol=1e-13)
