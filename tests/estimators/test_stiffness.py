"""Cornering stiffness: each method on a linear single track whose stiffnesses are known, and on a simulated car."""

import dataclasses

import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
from steady_logs import pushed

from jaxveh import Recording, manoeuvres, sensors, simulate, vehicles
from jaxveh.estimators import stiffness

# Equation 16 is exact for this inertia.
CAR = dataclasses.replace(method_logs.CAR, yaw_inertia=1500.0 * 1.2 * 1.5)
FRONT, REAR, SPEED, DT = 0.9e5, 1.5e5, 20.0, 0.01
T = np.arange(0.0, 60.0, DT)
SHOWN = {"front_cornering_stiffness": FRONT, "rear_cornering_stiffness": REAR}


def linear(slope, slip, grip):
    """The force of an axle whose tyres never bend."""
    del grip
    return slope * slip


def magic(slope, slip, grip):
    """The Magic Formula with a peak of the axle's `grip`, C = 1.4 and E = -0.5 (H. B. Pacejka 2012, eq 4.49)."""
    x = slope / (1.4 * grip) * slip
    return grip * np.sin(1.4 * np.arctan(x + 0.5 * (x - np.arctan(x))))


def drive(noise=0.0, lean=0.0, offset=0.0, curve=linear, most=0.01, trail=0.03, friction=1.0):
    """A single track whose axles have the slopes FRONT and REAR at zero slip, as sensors show it, and the satellite's course.
    `most` (rad): amplitude of each of four harmonics of the steer; `trail` (m): from the force to the axle before it."""
    rng = np.random.default_rng(3)
    a, b, m, j = CAR.front_axle_to_cg, CAR.rear_axle_to_cg, CAR.mass, CAR.yaw_inertia
    grips = [friction * 9.81 * m / (a + b) * arm for arm in (b, a)]
    steer_at = lambda t: most * sum(np.sin(rate * t + rate) for rate in (1.1, 2.3, 4.7, 7.1))

    def forces(x, steer):
        front = curve(FRONT, steer - (x[0] + a * x[1]) / SPEED, grips[0])
        return front, curve(REAR, -(x[0] - b * x[1]) / SPEED, grips[1])

    def rates(x, t):
        front, rear = forces(x, steer_at(t))
        return np.array([(front + rear) / m - SPEED * x[1], ((a - trail) * front - (b + trail) * rear) / j])

    x, states = np.zeros(2), []
    for t in T:
        states.append(x)
        # Runge and Kutta's method.
        k1 = rates(x, t)
        k2 = rates(x + 0.5 * DT * k1, t + 0.5 * DT)
        k3 = rates(x + 0.5 * DT * k2, t + 0.5 * DT)
        x = x + DT / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rates(x + DT * k3, t + DT))
    steer = steer_at(T)
    v_y, yaw_rate = np.array(states).T
    a_y = sum(forces((v_y, yaw_rate), steer)) / m
    yaw = np.cumsum(yaw_rate) * DT
    late = lambda values, by: np.interp(T - by, T, values)
    noisy = lambda values, std: values + noise * std * rng.normal(size=len(T))
    course = np.where(np.arange(len(T)) % 20 == 0, noisy(late(yaw + v_y / SPEED, 0.15), 0.0025), np.nan)
    return {
        "v_x": np.full(T.shape, SPEED), "steer": steer + offset, "yaw_rate": noisy(late(yaw_rate, 0.025), 0.002),
        "a_y": noisy((1.0 + lean) * late(a_y, 0.025), 0.05), "course": (course + np.pi) % (2.0 * np.pi) - np.pi,
    }  # fmt: skip


def estimated(name, channels, car=CAR):
    method = stiffness.METHODS[name].make(car)
    units = {need.channel: need.unit for need in method.needs}
    channels = {n: v for n, v in channels.items() if n in units}
    return stiffness.estimate(car, Recording(T, channels, {n: units[n] for n in channels}), method=name)


@pytest.mark.parametrize(("name", "within"), [("walking", 0.05), ("axle_forces", 0.05), ("derivatives", 0.05)])
def test_a_car_without_noise_shows_its_stiffnesses(name, within):
    """The older methods are those of a linear car, whose forces act at the axles."""
    ours = name == "walking"
    said = estimated(name, drive(lean=0.059, **({"curve": magic} if ours else {"trail": 0.0})))
    for field, truth in SHOWN.items():
        np.testing.assert_allclose(said[field][-1], truth, rtol=within, err_msg=field)
        assert name == "axle_forces" or bool(getattr(said.known, field)[-1])


def test_the_recommended_one_lives_with_noise_offsets_and_another_lean_and_its_spread_is_honest():
    squares = []
    for lean, offset in ((0.02, 0.001), (0.1, -0.001)):
        said = estimated("walking", drive(noise=1.0, lean=lean, offset=offset, curve=magic))
        for field, truth in SHOWN.items():
            np.testing.assert_allclose(said[field][-1], truth, rtol=0.07, err_msg=f"{field} {lean}")
            squares.append(((said[field][-1] - truth) / getattr(said.std, field)[-1]) ** 2)
    assert np.mean(squares) < 3.0


def test_without_a_course_no_stiffness_is_known_and_the_spread_says_so():
    """The noises of steer and acceleration look like soft tyres."""
    channels = drive(noise=1.0)
    guided, blind = (
        estimated("walking", channels),
        estimated("walking", channels | {"course": np.full(T.shape, np.nan)}),
    )
    for field in SHOWN:
        share = np.asarray(getattr(blind.std, field)) / np.asarray(blind[field])
        assert not np.asarray(getattr(blind.known, field)).any() and share.min() > 0.2
        assert getattr(guided.known, field)[-1] and getattr(guided.std, field)[-1] < 0.07 * guided[field][-1]
    # A receiver that falls silent takes nothing away at once.
    silent = estimated("walking", channels | {"course": np.where(T < 50.0, channels["course"], np.nan)})
    assert all(np.asarray(getattr(silent.known, field))[-1] for field in SHOWN)


def test_straight_ahead_nothing_is_known():
    straight = {name: np.zeros_like(values) for name, values in drive().items()} | {"v_x": np.full(T.shape, SPEED)}
    for name in stiffness.METHODS:
        said = estimated(name, straight)
        for field in SHOWN:
            assert not np.asarray(getattr(said.known, field)).any(), (name, field)


@pytest.mark.parametrize("most", [0.01, 0.02, 0.03])
def test_tyres_that_bend_have_the_slope_at_zero_slip_however_hard_a_car_is_driven(most):
    channels = drive(curve=magic, most=most)
    assert 0.9 < np.std(channels["a_y"]) / (100.0 * most) < 1.1
    found = estimated("walking", channels)
    for name, true in SHOWN.items():
        assert getattr(found.known, name)[-1], name
        np.testing.assert_allclose(found[name][-1], true, rtol=0.05, err_msg=name)


@pytest.mark.parametrize("friction", [0.35, 0.6])
def test_axles_that_bend_early_on_a_slippery_road_are_not_taken_for_soft_ones(friction):
    channels = drive(curve=magic, most=0.04 * friction, friction=friction, noise=1.0, lean=0.059)
    found = estimated("walking", channels)
    for name, true in SHOWN.items():
        assert getattr(found.known, name)[-1], name
        np.testing.assert_allclose(found[name][-1], true, rtol=0.05, err_msg=name)


def test_with_torques_the_stiffnesses_are_those_of_the_cars_mass():
    """The file lacks a load of a sixth of the mass; the car turns as one with softer axles and no load would."""
    light = dataclasses.replace(CAR, mass=CAR.mass / 1.2, yaw_inertia=CAR.yaw_inertia / 1.2)
    turned = drive(noise=1.0, lean=0.059, curve=magic)
    needs = stiffness.METHODS["weighed"].make(light).needs
    log = pushed(needs, mass=CAR.mass, grade=0.0, rows=len(T))
    channels = {name: np.asarray(log[name]) for name in log.names} | turned
    told, alone = (estimated(name, channels, light) for name in ("weighed", "walking"))
    silent = estimated("weighed", {n: v for n, v in channels.items() if not n.endswith("torque")}, light)
    for name, true in SHOWN.items():
        np.testing.assert_allclose(told[name][-1], true, rtol=0.05, err_msg=name)
        np.testing.assert_allclose(alone[name][-1], true / 1.2, rtol=0.07, err_msg=name)
        assert abs(told[name][-1] - true) < 2.0 * getattr(told.std, name)[-1]
        np.testing.assert_allclose(silent[name], alone[name], rtol=1e-9)
        np.testing.assert_allclose(getattr(silent.std, name), getattr(alone.std, name), rtol=1e-3)
    without = stiffness.METHODS["weighed"].make(dataclasses.replace(light, wheel_radius=None))
    assert type(without) is type(stiffness.METHODS["walking"].make(light))


@pytest.mark.full
def test_a_minute_of_ordinary_driving_shows_a_simulated_cars_stiffness_from_a_file_that_is_a_quarter_off():
    car = vehicles.named_car("suv", "seven-dof")
    told = vehicles.specification_of(vehicles.kit.CARS["suv"]())
    assert told.front_cornering_stiffness and told.rear_cornering_stiffness
    manoeuvre = manoeuvres.random_steering(22.0, 0.012, jax.random.key(4), lowest=0.1, highest=0.8, duration=60.0)
    suite = sensors.production_car(float(car.wheel_radius))
    log = simulate(car, manoeuvre, suite, jax.random.key(5), solver="explicit")
    names = ("steer", "yaw_rate", "a_y", "course")
    channels = {name: log[name] for name in names} | {"v_x": log["true.v_x"]}
    units = {name: log.unit(name) for name in names} | {"v_x": "m/s"}
    truth = (told.front_cornering_stiffness, told.rear_cornering_stiffness)
    wrong = dataclasses.replace(
        told, front=None, rear=None, front_cornering_stiffness=1.25 * truth[0], rear_cornering_stiffness=0.8 * truth[1]
    )
    said = stiffness.estimate(wrong, Recording(log.time, channels, units))
    for field, value in zip(SHOWN, truth, strict=True):
        np.testing.assert_allclose(said[field][-1], value, rtol=0.1, err_msg=field)
    assert jnp.isfinite(said.std.front_cornering_stiffness).all()
