"""Physics against networks inside the filter: what the truth is, what is told, and one small line of the table."""

import jax
import numpy as np
import pytest

from jaxveh import vehicles
from jaxveh.experiments.sideslip_review import hybrid
from jaxveh.tyres import Contact


@pytest.mark.parametrize("name", ["passenger_car", "suv"])
def test_the_truth_falls_behind_its_peak_and_the_told_brushes_have_wrong_slopes(name):
    true, told = hybrid.true_and_told(name)
    slopes = [
        (one.front_stiffness, one.rear_stiffness) for one in (vehicles.linear_single_track(car) for car in (true, told))
    ]
    np.testing.assert_allclose(np.divide(slopes[1], slopes[0]), hybrid.WRONG, rtol=1e-3)
    for car_tyre, told_tyre, load, grip in zip(
        (true.front, true.rear), (told.front, told.rear), true.static_loads(), hybrid.GRIP, strict=True
    ):
        force = lambda tyre, slip, load=load: float(tyre.forces(contact(slip, load)).F_y)
        slips = np.linspace(0.01, 0.5, 60)
        most = max(force(car_tyre, slip) for slip in slips)
        np.testing.assert_allclose(most, grip * load, rtol=1e-3)
        assert force(car_tyre, 0.5) < 0.93 * most
        # A brush keeps what it has.
        assert force(told_tyre, 0.5) > 0.999 * max(force(told_tyre, slip) for slip in slips)


def contact(slip, load):
    return Contact(jax.numpy.asarray(slip), load=load, speed=jax.numpy.asarray(25.0))


def test_a_drive_goes_beyond_the_peak_and_does_not_spin():
    true, _ = hybrid.true_and_told("passenger_car")
    log = hybrid.drive(true, 20.0, jax.random.key(0))
    assert np.degrees(np.abs(log["true.slip_angle_front"]).max()) > 6.0
    assert np.degrees(np.abs(log["true.sideslip"]).max()) < 20.0


@pytest.mark.full
def test_a_line_of_the_table_compares_all_four():
    table = hybrid.hybrid_table(("passenger_car",), (1.0,), 1, jax.random.key(0), steps=150)
    (row,) = table.rows
    nothing, physics, networks, law, ratio = row[3:]
    assert law < networks < physics < nothing and ratio == networks / physics
