"""The rear axle that sideslip hangs on: its curve, its integral, and every car, size and rate of a log."""

import dataclasses
import functools
import warnings
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import test_sideslip

from jaxveh import InputError, JaxvehWarning, Parameters, Recording, estimators, filters, io, vehicles
from jaxveh._core.names import record
from jaxveh.estimators import coarse_log, rear_axle, rear_axle_fit
from jaxveh.vehicles import sets

RNG = np.random.default_rng(7)


def inputs(n=1, **given):
    """Inputs of the model, (n,) each: zero but for what is given."""
    usual = {"v_x": 20.0, "step": 0.01, "felt": 1.0}
    values = {name: np.full(n, usual.get(name, 0.0)) for name in rear_axle.INPUTS}
    return record("Inputs", {name: jnp.asarray(given.get(name, value)) for name, value in values.items()})


def axle(**given):
    return estimators.RearAxle(
        **{"mass": 1500.0, "yaw_inertia": 2500.0, "front_axle_to_cg": 1.2, "rear_axle_to_cg": 1.4, "cg_height": 0.5,
           "stiffness": 15.0, "a_y_gain": 1.0, "ellipse": 1e-6} | given
    )  # fmt: skip


def at_rest(n=1):
    return estimators.sideslip.model(axle()).prior.mean._replace(
        **{name: jnp.zeros(n) for name in ("v_y", "bank", "slip_error", "stiffening")}
    )


def test_the_slip_angle_is_the_inverse_of_the_curve_that_is_written():
    """Random axles, at forces below those that slide; the slope is that of differences."""
    for _ in range(50):
        stiffness, grip, shape = np.exp(RNG.uniform(np.log([4.0, 0.3, 1.2]), np.log([40.0, 1.6, 4.0])))
        car = axle(stiffness=stiffness, grip=grip, shape=shape)
        a_y = RNG.uniform(-0.88, 0.88, 40) * grip * vehicles.GRAVITY
        angle, slope = car.slip_angle(at_rest(), inputs(40, a_y_smooth=a_y))
        asked = stiffness * np.asarray(angle) / grip
        force = grip * asked / (1 + np.abs(asked) ** shape) ** (1 / shape)
        inside = np.abs(np.asarray(angle)) < rear_axle.LARGEST_SLIP
        np.testing.assert_allclose(force[inside], (a_y / vehicles.GRAVITY)[inside], rtol=1e-9, atol=1e-12)
        step = 1e-5 * vehicles.GRAVITY
        ahead, behind = (car.slip_angle(at_rest(), inputs(40, a_y_smooth=a_y + s * step))[0] for s in (1, -1))
        np.testing.assert_allclose(slope[inside], (np.asarray(ahead - behind) / 2e-5)[inside], rtol=1e-3)


def test_a_force_beyond_the_grip_is_a_large_slip_of_a_larger_spread_and_has_slopes():
    forces = jnp.linspace(-3.0, 3.0, 61) * vehicles.GRAVITY
    seen = lambda car: car.slip_angle(at_rest(), inputs(61, a_y_smooth=forces))
    angle, slope = (np.asarray(one) for one in seen(axle()))
    assert (np.diff(angle) >= -1e-12).all() and np.abs(angle).max() <= rear_axle.LARGEST_SLIP
    assert slope[0] > 20 * slope[30]
    slopes = jax.grad(lambda car: jnp.sum(seen(car)[0]) + jnp.sum(seen(car)[1]))(axle())
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes))


def test_lateral_velocity_is_the_integral_of_what_is_felt():
    car = axle(a_y_gain=1.1, a_y_offset=0.3, yaw_rate_offset=0.01, bank=0.03)
    model = estimators.sideslip.model(car)
    start = at_rest()._replace(v_y=jnp.asarray(0.5), bank=jnp.asarray(2.0))
    u = inputs(a_y=2.0, turning=1.5, v_x=20.0, yaw_rate=0.1)
    moved = model.transition(0.0, 0.02, start, u)
    felt = (2.0 - 0.3) / 1.1 - (1.5 - 20.0 * 0.01) - vehicles.GRAVITY * 0.03 * 2.0
    np.testing.assert_allclose(moved.v_y, 0.5 + 0.02 * felt, rtol=1e-12)
    slow = model.transition(0.0, 0.02, start, inputs(a_y=2.0, turning=1.5, v_x=1.0, yaw_rate=0.1))
    np.testing.assert_allclose(slow.v_y, 1.4 * (0.1 - 0.01), rtol=1e-12)  # 1.4 m to the rear axle


def test_a_car_whose_acceleration_is_not_known_goes_as_a_steady_turn_wants_it():
    car = axle(sensor_x=0.4, slip_error=0.01)
    model = estimators.sideslip.model(car)
    start = at_rest()._replace(v_y=jnp.asarray(9.0), slip_error=jnp.asarray(1.5))
    u = inputs(felt=np.zeros(1), turning=4.0, a_y=4.0, a_y_smooth=4.0, yaw_rate=0.2, yaw_rate_smooth=0.2)
    moved = model.transition(0.0, 0.02, start, u)
    angle = float(car.slip_angle(start, u)[0][0])
    slip = np.tan(angle) + 0.01 * 1.5 * np.exp(-0.02 / 2.0)
    np.testing.assert_allclose(moved.v_y, (1.4 + 0.4) * 0.2 - 20.0 * slip, rtol=1e-12)
    # So it does after a gap in time, when nothing is known of it any more.
    usual = inputs(turning=4.0, a_y=4.0, a_y_smooth=4.0, yaw_rate=0.2, yaw_rate_smooth=0.2)
    np.testing.assert_allclose(
        model.transition(0.0, 120.0, start, usual).v_y, (1.4 + 0.4) * 0.2 - 20.0 * np.tan(angle), rtol=1e-9
    )
    assert (
        float(model.process_noise.over(120.0).std.v_y)
        > rear_axle.LOST
        > 10 * float(model.process_noise.over(0.3).std.v_y)
    )


def test_an_accelerometer_elsewhere_is_felt_there_and_the_centre_of_gravity_is_told():
    """A body that turns about a point: v_y at the sensor, and a_y, are the rigid body's."""
    ahead, aside, turns, spin = 0.7, 0.3, 0.5, 1.2
    here, there = axle(), axle(sensor_x=ahead, sensor_y=aside)
    at_sensor = inputs(a_y_smooth=3.0 + ahead * spin - aside * turns**2, yaw_acceleration=spin, yaw_rate_smooth=turns)
    at_centre = inputs(a_y_smooth=3.0, yaw_acceleration=spin, yaw_rate_smooth=turns)
    np.testing.assert_allclose(there.shares(at_sensor)[1], here.shares(at_centre)[1], rtol=1e-12)
    told = dataclasses.replace(test_sideslip.CAR, sensor_position=(ahead, aside, 0.2))
    system = estimators.sideslip.car_of(told)
    np.testing.assert_allclose((system.sensor_x, system.sensor_y), (ahead, aside))
    state, u = at_rest()._replace(v_y=jnp.asarray(0.9)), inputs(yaw_rate=turns)
    told = rear_axle.report(there, 0.0, state, u)
    np.testing.assert_allclose(told.v_y, 0.9 - ahead * turns)
    np.testing.assert_allclose(told.sideslip, np.arctan2(0.9 - ahead * turns, 20.0))


def drive_of(car, rate=100.0, seconds=66.0, speed=22.0):
    """A car that follows its own linear single track, at up to 3 m/s^2, and what its sensors say.

    Times go with the root of its size, so that all logs have as many rows, and one program serves them.
    """
    size = (car.wheelbase / rear_axle.USUAL_WHEELBASE) ** 0.5
    time = np.arange(round(seconds * rate)) / rate * size
    v_x = np.full(len(time), speed * size)
    wave = np.sin(2 * np.pi * 0.35 / size * time) + 0.7 * np.sin(2 * np.pi * 0.13 / size * time + 1.0)
    straight = vehicles.from_specification(car)
    truth = estimators.open_loop(straight, Recording(time, {"steer": 0.01 * wave, "v_x": v_x}))
    a_y = np.gradient(truth["v_y"], time) + v_x * truth["yaw_rate"]
    gain = 3.0 / np.max(np.abs(a_y))
    rng = np.random.default_rng(3)
    said = {"yaw_rate": 0.001 / size, "a_y": 0.05}
    seen = {"yaw_rate": gain * truth["yaw_rate"], "a_y": gain * a_y}
    noisy = {name: values + said[name] * rng.normal(size=len(time)) for name, values in seen.items()}
    return Recording(
        time, {"steer": gain * 0.01 * wave, "v_x": v_x, "a_x": np.zeros(len(time)), **noisy, "v_y": gain * truth["v_y"]}
    )


def errors(told, log, source):
    found = estimators.sideslip.estimate(source, log.without("v_y"))
    return estimators.sideslip.score(told, found, log, least_speed=0.5)["sideslip_rmse_deg"]


def known(name):
    numbers = sets.CARS[name]()
    stiffness = lambda tyre: 2.0 * tyre.cornering_stiffness
    return io.CarSpecification(
        mass=numbers.mass, yaw_inertia=numbers.yaw_inertia, front_axle_to_cg=numbers.front_axle_to_cg,
        rear_axle_to_cg=numbers.rear_axle_to_cg, front_cornering_stiffness=stiffness(numbers.front),
        rear_cornering_stiffness=stiffness(numbers.rear),
    )  # fmt: skip


def scaled(car, size):
    """The car `size` times as large, of the same material: forces go with its weight, which goes with the cube."""
    return dataclasses.replace(
        car, mass=car.mass * size**3, yaw_inertia=car.yaw_inertia * size**5,
        front_axle_to_cg=car.front_axle_to_cg * size, rear_axle_to_cg=car.rear_axle_to_cg * size,
        front_cornering_stiffness=car.front_cornering_stiffness * size**3,
        rear_cornering_stiffness=car.rear_cornering_stiffness * size**3,
    )  # fmt: skip


WHOLE = {name: functools.partial(known, name) for name in sets.CARS if name != "semi_trailer"}
"""Every parameter set that has a mass."""
SIZES = {f"{size:g} of it": functools.partial(scaled, test_sideslip.CAR, size) for size in (0.1, 0.5, 2.0)}


@pytest.mark.parametrize(
    "name", [*list(WHOLE)[:2], *(pytest.param(name, marks=pytest.mark.full) for name in (*list(WHOLE)[2:], *SIZES))]
)
def test_every_cars_stiffness_is_found_where_its_file_is_wrong(name):
    car = (WHOLE | SIZES)[name]()
    told = dataclasses.replace(car, rear_cornering_stiffness=0.7 * car.rear_cornering_stiffness)
    log = drive_of(car)
    calibration = estimators.sideslip.calibrate(told, log.without("v_y"))
    fitted = estimators.sideslip.fitted_car(calibration, told)
    assert fitted.rear_cornering_stiffness == pytest.approx(car.rear_cornering_stiffness, rel=0.15)
    assert errors(car, log, calibration) < 0.5 * errors(car, log, told)


@pytest.mark.parametrize("rate", [10.0, *(pytest.param(rate, marks=pytest.mark.full) for rate in (25.0, 400.0))])
def test_every_rate_of_a_log_serves(rate):
    told = dataclasses.replace(test_sideslip.CAR, rear_cornering_stiffness=0.7 * 127000.0)
    log = drive_of(test_sideslip.CAR, rate)
    calibration = estimators.sideslip.calibrate(told, log.without("v_y"))
    assert errors(test_sideslip.CAR, log, calibration) < 0.5 * errors(test_sideslip.CAR, log, told)


def test_a_coarse_log_keeps_integrals_and_counts_no_gap():
    log = drive_of(test_sideslip.CAR, seconds=40.0)
    a_y = np.asarray(log["a_y"]).copy()
    a_y[1000:1200] = np.nan
    found = coarse_log.coarse(log.replace(a_y=a_y), test_sideslip.CAR.wheelbase)
    assert len(found) % coarse_log.ROWS == 0
    time = np.asarray(found.time)
    used = np.isfinite(np.asarray(found["slip_balance"]))
    assert not used[(time > 10.4) & (time < 11.6)].any()
    assert used[(time > 1.0) & (time < 9.5)].all()


def test_a_coarse_logs_steps_are_the_integral_of_what_is_slow():
    time = np.arange(4000) * 0.01
    yaw_rate = 0.2 * np.sin(2 * np.pi * 0.05 * time)
    channels = {"v_x": np.full(4000, 20.0), "yaw_rate": yaw_rate, "a_y": 20.0 * yaw_rate, "a_x": np.zeros(4000)}
    found = coarse_log.coarse(Recording(time, channels), test_sideslip.CAR.wheelbase)
    whole = np.asarray(found.time) < 38.0
    step = np.asarray(found["step"])[0]
    for name in ("turning", "a_y"):
        gained = np.append(0.0, np.cumsum(np.asarray(found[name])[whole] * step)[:-1])
        exact = 20.0 * 0.2 / (2 * np.pi * 0.05) * (1 - np.cos(2 * np.pi * 0.05 * np.asarray(found.time)[whole]))
        np.testing.assert_allclose(gained, exact, atol=0.02 * np.std(exact))


def test_a_span_in_which_nothing_drives_or_is_measured_is_refused():
    log = drive_of(test_sideslip.CAR, seconds=25.0).without("v_y")
    for speed in (0.0, 0.5, -15.0):
        words = f"no row is fast enough and measured: v_x is {speed:g} to {speed:g} m/s, and must be above 1"
        with pytest.raises(InputError, match=words):
            estimators.sideslip.calibrate(test_sideslip.CAR, log.replace(v_x=np.full(len(log), speed)))
    with pytest.raises(InputError, match="yaw_rate .* is NaN in every row"):
        estimators.sideslip.calibrate(test_sideslip.CAR, log.replace(yaw_rate=np.full(len(log), np.nan)))


def test_a_steer_that_is_none_leaves_the_front_axle_as_told():
    log = drive_of(test_sideslip.CAR)
    calibration = estimators.sideslip.calibrate(test_sideslip.CAR, log.without("v_y"))
    with pytest.warns(UserWarning, match="the front axle cannot be fitted to steer"):
        fitted = estimators.sideslip.fitted_car(
            calibration, test_sideslip.CAR, recording=log.replace(steer=-np.asarray(log["steer"]))
        )
    assert fitted.front_cornering_stiffness == test_sideslip.CAR.front_cornering_stiffness
    # A log without steer leaves it, too, and says so; without a log nothing was asked for.
    for unsteered in (log.without("steer"), [log.replace(steer=np.full(len(log), np.nan)), log.without("a_y")]):
        with pytest.warns(JaxvehWarning, match="no log has both steer and a_y; the file's front axle and steer_offset"):
            assert estimators.sideslip.fitted_car(calibration, test_sideslip.CAR, recording=unsteered) == fitted
    with warnings.catch_warnings():
        warnings.simplefilter("error", JaxvehWarning)
        assert estimators.sideslip.fitted_car(calibration, test_sideslip.CAR) == fitted


def test_a_log_without_steer_is_scored_without_the_baseline():
    log = drive_of(test_sideslip.CAR)
    found = estimators.sideslip.estimate(test_sideslip.CAR, log.without("v_y"))
    both = (estimators.sideslip.score(test_sideslip.CAR, found, one) for one in (log, log.without("steer")))
    with_baseline, without = both
    assert {name for name in with_baseline if name not in without} == {
        n for n in with_baseline if n.startswith("open_loop")
    }
    assert without["sideslip_rmse_deg"] == with_baseline["sideslip_rmse_deg"]


def test_a_fit_that_runs_out_of_steps_says_so(monkeypatch):
    monkeypatch.setattr(rear_axle_fit, "STEPS", 1)
    log = drive_of(test_sideslip.CAR).without("v_y")
    with pytest.warns(UserWarning, match="the fit ended after"):
        estimators.sideslip.calibrate(test_sideslip.CAR, log)


def test_the_likelihood_counts_for_less_than_it_says_and_the_prior_as_it_is(monkeypatch):
    log = drive_of(test_sideslip.CAR).without("v_y")
    calibrate = lambda: estimators.sideslip.calibrate(test_sideslip.CAR, log).fit.parameters_std
    monkeypatch.setattr(rear_axle_fit, "VARIED", 0.0)
    wide, most = calibrate(), rear_axle_fit.OVERCONFIDENCE**0.5
    monkeypatch.setattr(rear_axle_fit, "OVERCONFIDENCE", 1.0)
    narrow = calibrate()
    # Known by the log, and by the prior alone.
    assert 0.9 * most < float(wide["stiffness"] / narrow["stiffness"]) < most + 0.01
    assert float(wide["heading_offset"] / narrow["heading_offset"]) == pytest.approx(1.0, rel=1e-3)


def test_the_likelihood_has_gradients_in_every_parameter():
    log = coarse_log.coarse(drive_of(test_sideslip.CAR).without("v_y"), test_sideslip.CAR.wheelbase)
    model = estimators.sideslip.model(test_sideslip.CAR)
    cost = lambda model: filters.run(filters.Extended(), model, log, throw=False).log_likelihood
    slopes = eqx.filter_jit(eqx.filter_grad(cost))(model)
    for name in ("stiffness", "grip", "shape", "a_y_offset", "a_y_gain", "yaw_rate_offset", "force_noise", "bank"):
        step = 1e-5 * max(abs(float(getattr(model.system, name))), 1e-3)
        at = lambda s, name=name, step=step: eqx.tree_at(
            lambda m: getattr(m.system, name), model, getattr(model.system, name) + s * step
        )
        difference = float(eqx.filter_jit(cost)(at(1)) - eqx.filter_jit(cost)(at(-1))) / (2 * step)
        assert float(getattr(slopes.system, name)) == pytest.approx(difference, rel=1e-4, abs=1e-5), name


@dataclasses.dataclass(frozen=True)
class FakeFit:
    """What `_widened` reads of a fit."""

    covariance: jax.Array
    parameters_std: Parameters
    chosen: list


@pytest.mark.parametrize("seed", range(6))
def test_a_covariance_that_is_lost_in_rounding_is_told_and_stays_positive(seed):
    """Data that tell of some directions alone, in single precision; and the same without rounding, as the formula has it."""
    draw = np.random.default_rng(seed)
    size = 9
    spread = 10.0 ** draw.uniform(-3, 0, size)
    told = draw.normal(size=(size, draw.integers(2, size))) * 10.0 ** draw.uniform(0, 3)
    information = told @ told.T / np.outer(spread, spread)
    prior = np.diag(1 / spread**2)
    names = [SimpleNamespace(name=f"p{k}") for k in range(size)]
    fit_of = lambda cov: FakeFit(
        jnp.asarray(cov),
        Parameters({one.name: s for one, s in zip(names, np.sqrt(np.abs(np.diag(cov))), strict=True)}),
        names,
    )
    exact = np.linalg.inv(information + prior)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wide = rear_axle_fit._widened(fit_of(exact), spread, 8.0)
    wanted = np.linalg.inv(information / 8.0 + prior)
    np.testing.assert_allclose(wide.covariance, wanted, rtol=1e-5, atol=1e-9 * np.abs(wanted).max())
    stds = np.array([wide.parameters_std[one.name] for one in names])
    np.testing.assert_allclose(stds, np.sqrt(np.diag(wanted)), rtol=1e-6)
    # Rounding of this size leaves no variance along what the data tell, and too much along the rest.
    noise = draw.normal(size=(size, size)) * 0.05 * np.outer(spread, spread)
    with pytest.warns(JaxvehWarning, match="lost in rounding.*jax_enable_x64"):
        rough = rear_axle_fit._widened(fit_of((exact + noise + noise.T).astype(np.float32)), spread, 8.0)
    assert np.isfinite(rough.covariance).all()
    assert (np.diag(rough.covariance) > 0).all() and (np.diag(rough.covariance) <= spread**2 * (1 + 1e-6)).all()
