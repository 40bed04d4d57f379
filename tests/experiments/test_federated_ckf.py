"""The federated-ckf experiment at small size: truth and filters' model are one car, estimators rank as they should."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import Parameters, filters, sweeps
from jaxveh._core.errors import InputError
from jaxveh.diagnostics.observability import observability_at
from jaxveh.experiments import federated_ckf as experiment
from jaxveh.experiments.federated_ckf import contestants, criteria, drives, model, observed, printed, report, study
from jaxveh.experiments.federated_ckf.settings import OTHER_START, PARAMETERS, PRINTED_START, Start
from jaxveh.tyres import Contact

SMALL = experiment.Study(duration=6.0, settled=3.0, fault_at=3.5, fault_time=1.5)
CASES = ("nearer start", "fault")


@pytest.fixture(scope="module")
def driven():
    """Steer of 3 and 8 degrees, (2, 1, 2 seeds, T)."""
    return study.drives_of(SMALL, tuple(np.radians([3.0, 8.0])), (0.3,), 2, jax.random.key(5))


@pytest.fixture(scope="module")
def slalom(driven):
    return drives.Drive(*(leaf[1, 0] for leaf in driven))


def true_car():
    return model.planar(SMALL, Start(*study.truth(SMALL)))


def test_the_drive_is_the_papers(slalom):
    assert slalom.omega.shape == (2, 301, 4) and np.isfinite(slalom.a_y).all()
    np.testing.assert_allclose(slalom.true_v_x.mean(), 20 / 3.6, rtol=0.1)
    # Front wheels slide: no more than mu g, and near to it.
    assert 1.2 < np.abs(slalom.a_y).max() < 0.2 * 9.81 + 5 * SMALL.a_y
    np.testing.assert_allclose((slalom.yaw_rate - slalom.true_yaw_rate).std(), SMALL.yaw_rate, rtol=0.1)
    # Wheels do not ring: from row to row they change by noise alone.
    np.testing.assert_allclose(np.diff(slalom.omega, axis=1).std(), SMALL.wheel_speed * 2**0.5, rtol=0.15)


def test_the_fault_is_what_it_says(slalom):
    found = study.drives_by_case(SMALL, CASES, 2, None, known=slalom)
    off = found.yaw_rate[1] - found.yaw_rate[0]
    assert set(np.unique(off.round(12))) == {0.0, SMALL.bias}
    np.testing.assert_allclose((off > 0).sum(axis=-1) * SMALL.dt, SMALL.fault_time)
    np.testing.assert_array_equal(found.a_y[0], found.a_y[1])


def test_the_filters_model_is_the_truth_s(slalom):
    """At the true states and parameters it says what was measured, but for noise, and moves as the truth does."""

    @jax.jit
    def said_and_rates(car, drive):
        rows = model.rows_of(SMALL, drive)
        x = model.State(drive.true_v_x, drive.true_v_y, drive.true_yaw_rate)
        return rows, x, model.sensor_outputs(car, 0.0, x, rows.u), model.rates(car, 0.0, x, rows.u)

    for seed in range(2):
        rows, x, said, rates = said_and_rates(true_car(), drives.Drive(*(leaf[seed] for leaf in slalom)))
        for name, level in model.noise_levels(SMALL).items():
            rest = np.asarray(getattr(rows.y, name) - getattr(said, name))[50:]
            assert rest.std() < 1.15 * level and abs(rest.mean()) < 0.3 * level, name
        for rate, values in zip(rates, x, strict=True):
            slope = np.gradient(values, SMALL.dt)
            assert np.abs(rate - slope)[50:-1].max() < 0.02 * np.abs(slope).max() + 0.01


@eqx.filter_jit
def under_a_pull(car, law, along, across, load, pull, friction):
    """Lateral forces that the car finds for a pull, and the law's forces at the slip that goes with it."""
    F_y, slip = car._lateral_and_slip(along, across, load, pull, friction)
    at = Contact(slip_angle=-jnp.arctan(across / along), slip_ratio=slip, load=load, friction=friction, speed=along)
    return F_y, law.forces(at)


@pytest.mark.parametrize("pull", [-150.0, 0.0, 120.0])
def test_the_slip_under_a_pull_is_dugoff_s(pull):
    along, load, pulls, friction = (np.full(3, value) for value in (5.5, 3000.0, pull, 0.2))
    across = np.array([0.05, 0.4, -0.8])
    F_y, forces = under_a_pull(true_car(), drives.dugoff(SMALL), along, across, load, pulls, friction)
    np.testing.assert_allclose(forces.F_x, pull, rtol=0.01, atol=1e-9)
    np.testing.assert_allclose(forces.F_y, F_y, rtol=2e-3)


def test_the_joint_filter_finds_the_car_and_its_gate_keeps_the_fault_out(slalom):
    faulty = study.drives_by_case(SMALL, CASES, 2, None, known=slalom)
    raced = study.race(SMALL, faulty, CASES, only=("joint, gated",))
    error = lambda name, who, case="nearer start": float(np.median(raced.at(name, who, case)))
    guessed = np.abs(np.array(dataclasses.astuple(OTHER_START)) / study.truth(SMALL) - 1.0)
    for name, guess in zip(PARAMETERS, guessed, strict=True):
        assert error(f"{name}_error", "joint, gated") < 0.3 * guess
    assert error("sideslip_rmse", "joint, gated") < 0.1
    # A gate that let the fault in would be off by more.
    assert error("sideslip_rmse", "joint, gated", "fault") < 2.0 * error("sideslip_rmse", "joint, gated")


def test_small_steer_says_nothing_of_friction(driven):
    """Where no wheel slides, Dugoff's force does not depend on friction: its sensitivity is zero, not small."""
    first = drives.Drive(*(leaf[:, 0, 0] for leaf in driven))
    true = Start(*study.truth(SMALL))
    small, large = np.asarray(jax.jit(jax.vmap(lambda drive: observed.sensitivities(SMALL, true, drive)))(first))
    assert np.abs(small[:, 0]).max() == 0.0 < np.abs(large[:, 0]).max()
    assert np.abs(small[:, 1:4]).max(axis=0).min() > 0.0
    spread = np.array([0.8, 0.4, 0.3, 0.1, 0.1, 0.1, 0.05, 0.3])
    bounds = observability_at(lambda z: jnp.asarray(large) @ z, jnp.zeros(8), PARAMETERS, spread, nuisance=4)
    assert bounds.unobservable() == ()


def test_numbers_of_a_known_course():
    rows, right = 301, study.truth(SMALL)
    zeros = np.zeros(rows)
    drive = drives.Drive(*(zeros,) * 11)._replace(true_v_x=zeros + 5.0)
    off = np.log(right) + np.log([1.0, 1.02, 1.0, 1.0])
    vector = np.tile(np.concatenate([[5.0, 5.0 * np.tan(0.01), 0.0], off]), (rows, 1))
    covariance = np.tile(np.diag([1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-4, 1e-4]), (rows, 1, 1))
    found = contestants.Found(vector[:, 0], vector[:, 1], vector[:, 2], np.exp(vector[:, 3:]), vector, covariance)
    seen = jax.jit(lambda *given: contestants.metrics(SMALL, *given))(found, drive, right)
    np.testing.assert_allclose(seen["mass_error"], 0.02, rtol=1e-9)
    np.testing.assert_allclose(seen["sideslip_rmse"], np.rad2deg(0.01), rtol=1e-6)
    off = contestants.metrics(SMALL, found, drive._replace(true_v_x=zeros + 4.9, true_v_y=zeros + 0.02), right)
    np.testing.assert_allclose([off["v_x_rmse"], off["v_y_rmse"]], [0.1, 5.0 * np.tan(0.01) - 0.02], rtol=1e-6)
    np.testing.assert_allclose(seen["nees"], (np.log(1.02) / 0.01) ** 2 / 4, rtol=1e-6)
    every = (np.log(1.02) / 0.01) ** 2 + (5.0 * np.tan(0.01)) ** 2
    np.testing.assert_allclose(seen["nees_all"], every / 7, rtol=1e-6)


def test_the_printed_noise_leaves_the_mass_where_it_was():
    """What 30 s tell of the mass with the printed R, even if all else were known, over what the printed P0 knows."""
    car = model.planar(SMALL, PRINTED_START)
    per_kilogram = 0.2 * 9.81 / float(car.mass)
    told = 1500 * per_kilogram**2 * (1 / 1000.0 + 1 / 1000.0 + 1 / 10.0)
    assert told * printed.BODY_P < 0.02
    # P_g and Q_g of two locals: their informations add up.
    np.testing.assert_allclose(1 / printed.BODY_P, 1 / 100.0 + 1 / 10.0)


def test_the_printed_shares_and_sensors_are_refused():
    cubature = filters.Cubature()
    with pytest.raises(InputError, match="positive, with the sum 1"):
        filters.Federated(cubature, contestants.GROUPS, shares=(0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="a_y, yaw_rate in more than one group"):
        filters.Federated(cubature, contestants.SHARED)


def test_what_another_tyre_does_stands_beside_the_truths_own():
    names, cases = tuple(contestants.contestants(SMALL)), tuple(study.cases(SMALL))
    shape = (len(names), len(cases), 2)
    values = {f"{name}_error": np.full(shape, 0.001) for name in PARAMETERS}
    values |= {"sideslip_rmse": np.ones(shape), "nees": np.ones(shape)}
    values["friction_error"][:, cases.index(criteria.OTHER)] = 0.22
    design = sweeps.Design(estimator=dict.fromkeys(names), case=range(len(cases)))
    raced = study.Raced(SMALL, cases, None, sweeps.Swept(design, 2, values))
    known = dataclasses.make_dataclass("Known", ("bounds", "spread"))(
        Parameters({"friction": np.inf}), Parameters({"friction": 0.8})
    )
    checks = report.check(report.Reproduction(2, raced, (3.0,), (0.0,), None, {"known": [[known]]}, None))
    found = {check.name: check for check in checks}
    own, other = (found[criteria.final(case, "friction")] for case in ("nearer start", criteria.OTHER))
    assert (own.value, own.status, own.original) == (pytest.approx(0.1), "met", "")
    assert (other.value, other.status, other.original) == (pytest.approx(22.0), "failed", own.name)
    assert checks[checks.index(own) + 1] is other
    assert found[criteria.SMALL_STEER].status == "met"


def test_every_contestant_says_what_it_is():
    every = contestants.contestants(dataclasses.replace(SMALL))
    assert next(iter(every)) == "first guess"
    for name, one in every.items():
        assert name and one.what
