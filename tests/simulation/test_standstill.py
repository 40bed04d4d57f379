"""Braking until the car stands: the wheels' spins become stiff on the way, and sliding tyres hide it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import seven

from jaxveh import JaxvehWarning, manoeuvres, vehicles
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


def test_the_same_where_no_number_is_known(drive):
    """Under jit the fastest motion cannot be looked at. RK4 was wrong by 0.2 m/s and 9.8 m/s^2 there."""
    names = ("true.v_x", "true.a_x", "true.slip_ratio_fl")

    @jax.jit
    def unseen(car):
        braked = simulate(car, BRAKES)
        return [braked[name] for name in names]

    for name, found, near in zip(names, unseen(seven()), (1e-5, 5e-3, 2e-5), strict=True):
        np.testing.assert_allclose(found, drive[name], atol=near, err_msg=name)


def test_slopes_of_a_crawl_are_those_of_short_steps():
    """RK4's slope by the wheels' inertia was a hundred times as large, and so were the differences of its own results."""
    slow = manoeuvres.step_steer(0.4, 0.02, start=0.1, duration=0.6)

    def crawl(inertia, **options):
        return jnp.sum(simulate(seven(wheel_inertia=inertia), slow, dt=0.05, **options)["true.omega_fl"])

    slope = jax.jit(jax.grad(crawl))(1.0)
    short = jax.jit(lambda inertia: crawl(inertia, solver="explicit", max_step=2.5e-4))
    differences = (short(1.001) - short(0.999)) / 0.002
    assert abs(differences) > 1e-4
    np.testing.assert_allclose(slope, differences, rtol=0.05)


@pytest.mark.full
@pytest.mark.parametrize("fidelity", [name for name in vehicles.sets.FIDELITIES if name != "kinematic-trailer"])
@pytest.mark.parametrize(("speed", "max_step"), [(0.2, 0.002), (2.0, 0.002), (0.6, 0.05)])
def test_every_car_crawls_where_no_number_is_known(fidelity, speed, max_step):
    car = vehicles.named_car("van", fidelity)
    slow = manoeuvres.step_steer(speed, 0.05, start=0.1, duration=0.5)
    unseen = eqx.filter_jit(lambda car: simulate(car, slow, dt=0.05, max_step=max_step).channels)(car)
    fine = simulate(car, slow, dt=0.05, solver="explicit", max_step=2e-4).channels
    assert set(unseen) == set(fine)
    for name in ("true.v_x", "true.yaw_rate", "true.a_x", "true.a_y"):
        if name in fine:
            np.testing.assert_allclose(unseen[name], fine[name], atol=2e-3 if ".a_" in name else 1e-5, err_msg=name)
