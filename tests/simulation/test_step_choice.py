"""Which steps "auto" takes: for sensors, drivers, long steps, and where no steps hold."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import peak

from jaxveh import JaxvehWarning, manoeuvres, sensors, simulation, vehicles
from jaxveh.manoeuvres import PathDriver, SpeedControl
from jaxveh.manoeuvres.paths import Straight
from jaxveh.manoeuvres.speeds import SteadySpeed
from jaxveh.simulation import simulate, stiffness

pytestmark = pytest.mark.product

STEER = manoeuvres.step_steer(25.0, 0.02, start=0.1, duration=0.4)


def linear():
    return vehicles.linear_single_track(vehicles.passenger_car())


def radius(driven, x):
    """The spectral radius of the Jacobian of all states."""
    flat, back = jax.flatten_util.ravel_pytree(x)
    jacobian = jax.jacfwd(lambda z: jax.flatten_util.ravel_pytree(driven.derivatives(0.0, back(z)))[0])(flat)
    return np.max(np.abs(np.linalg.eigvals(np.asarray(jacobian))))


def test_a_fast_low_pass_gets_the_steps_that_it_needs():
    fast = sensors.esc(low_pass=sensors.LowPass(240.0))
    auto, fine = simulate(linear(), STEER, fast), simulate(linear(), STEER, fast, max_step=5e-4)
    assert peak(auto["a_y"] - fine["a_y"]) < 0.01 * peak(fine["a_y"])
    with pytest.warns(JaxvehWarning, match=r"steps of 0\.002 s are too long for a motion of 1508 1/s"):
        simulate(linear(), STEER, fast, solver="explicit", throw=False)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_spectral_radius_is_that_of_the_eigenvalues(dtype):
    rng = np.random.default_rng(5)
    drawn = rng.normal(size=(40, 7, 7)) * 10.0 ** rng.uniform(-3, 4, size=(40, 7, 7))
    turning = np.kron(np.eye(2), [[-3.0, 400.0], [-400.0, -3.0]])
    radius_of = jax.jit(stiffness.spectral_radius)
    found = lambda matrix: float(radius_of(jnp.asarray(matrix, dtype)))
    for matrix in (*drawn, turning):
        assert found(matrix) == pytest.approx(np.max(np.abs(np.linalg.eigvals(matrix))), rel=0.02)
    # All eigenvalues are zero.
    assert found(np.zeros((3, 3))) < 1e-5 and found(np.triu(rng.normal(size=(5, 5)), 1)) < 1e-5
    assert np.isnan(found(np.full((2, 2), np.nan)))


@pytest.mark.parametrize(("dtype", "near"), [(np.float32, 2e-3), (np.float64, 1e-8)])
def test_differences_are_the_jacobian(dtype, near):
    rates = lambda x: jnp.stack([x[0] * jnp.sin(x[1]), x[2] ** 2 - 300.0 * x[0], jnp.cos(x[0] * x[2])])
    x = jnp.asarray([0.3, -1.2, 25.0], dtype)
    found = jax.jit(lambda x: stiffness.differences(rates, x))(x)
    assert found.dtype == dtype
    expected = np.asarray(jax.jacfwd(rates)(x))
    error = np.abs(found - expected) / np.max(np.abs(expected), axis=1, keepdims=True)
    assert np.max(error) < near


@pytest.mark.parametrize("fast", ["low-pass", "driver"])
def test_sensors_and_drivers_count_among_the_fastest(fast):
    driver = PathDriver(
        path=Straight(), speed=SteadySpeed(20.0), duration=1.0, reaction_lag=5e-4 if fast == "driver" else 0.1
    )
    fitted = sensors.esc(low_pass=sensors.LowPass(300.0)) if fast == "low-pass" else None
    driven = simulation.driven_car(linear(), driver, fitted)
    assert stiffness.may_be_stiff(driven, 0.002) and not stiffness.may_be_stiff(driven, 5e-4)
    x = driven.start(jnp.asarray(0.0), float)
    assert float(simulation.fastest_pole(driven, 0.0, x)) == pytest.approx(radius(driven, x), rel=0.02)
    assert stiffness.at_start(driven, {}, np.zeros(1)) == pytest.approx(radius(driven, x), rel=0.02)


def test_drivers_say_how_fast_they_are():
    path = PathDriver(path=Straight(), speed=SteadySpeed(20.0), duration=1.0)
    assert float(path.fastest_rate) == pytest.approx(10.0)
    assert float(SpeedControl(path, 1500.0).fastest_rate) == pytest.approx(10.0)
    assert float(SpeedControl(STEER, 1500.0, gain=3.0).fastest_rate) == 3.0

    class Unknown(PathDriver):
        fastest_rate = None

    unknown = Unknown(path=Straight(), speed=SteadySpeed(20.0), duration=1.0)
    assert SpeedControl(unknown, 1500.0).fastest_rate is None
    assert stiffness.may_be_stiff(simulation.driven_car(linear(), unknown), 1e-4)


def test_long_steps_are_looked_at_whatever_the_car():
    slow = manoeuvres.step_steer(3.0, 0.1, start=0.1, duration=2.0)
    car = vehicles.passenger_car()
    long, fine = simulate(car, slow, dt=0.1, max_step=0.1), simulate(car, slow, dt=0.1)
    assert peak(long["true.yaw_rate"] - fine["true.yaw_rate"]) < 0.01 * peak(fine["true.yaw_rate"])


def test_where_no_steps_hold_the_implicit_method_is_the_last_word(monkeypatch):
    taken, poles = [], iter((2000.0, 4000.0, 8000.0))

    def solve(driven, values, grid, choice, *rest):
        taken.append(choice)
        return simulation.solve(driven, values, grid, stiffness.explicit(0.002), *rest)

    monkeypatch.setitem(simulate.__globals__, "solve", solve)
    monkeypatch.setattr(stiffness, "may_be_stiff", lambda *_: True)
    monkeypatch.setattr(stiffness, "at_start", lambda *_: 10.0)
    monkeypatch.setattr(stiffness, "worst", lambda *_: (next(poles), 0.0))
    simulate(linear(), STEER, dt=0.1)
    np.testing.assert_allclose([one.max_step for one in taken[:-1]], [0.002, 1.25e-3, 6.25e-4])
    assert len(taken) == 4 and taken[-1].controller is not None


@pytest.mark.parametrize("what", ["long steps", "low-pass"])
def test_where_no_number_is_known_every_step_holds(what):
    """Under jit: long steps of a crawling car, and a sensor that is faster than the steps of RK4."""
    if what == "long steps":
        drive, sensor, channel = manoeuvres.step_steer(0.6, 0.05, start=0.1, duration=1.0), None, "true.a_y"
        options, step = {"dt": 0.1}, {"max_step": 0.05}
    else:
        drive, sensor, channel = STEER, sensors.esc(low_pass=sensors.LowPass(300.0)), "a_y"
        options, step = {}, {}
    fine = simulate(linear(), drive, sensor, max_step=2e-4, **options)[channel]
    blind = jax.jit(lambda car: simulate(car, drive, sensor, **options, **step)[channel])
    assert peak(blind(linear()) - fine) < 0.002 * peak(fine)
    told = jax.jit(lambda car: simulate(car, drive, sensor, solver="explicit", **options, **step)[channel])
    assert not peak(told(linear()) - fine) < 0.1 * peak(fine)
