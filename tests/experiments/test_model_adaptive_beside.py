"""What the model-adaptive-pf experiment has beside its race: wheel spins, autoregressions with a matrix, tails of the process."""

import dataclasses
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import filters, sweeps
from jaxveh._core.names import record
from jaxveh.experiments import model_adaptive_pf as experiment
from jaxveh.experiments.model_adaptive_pf import beside, models
from jaxveh.experiments.model_adaptive_pf import drives as own_drives
from jaxveh.experiments.model_adaptive_pf.aar import Fitted, MatrixAutoRegressive
from jaxveh.experiments.model_adaptive_pf.contestants import EVERY, PLAIN, Contestant, metrics, of_a_point
from jaxveh.experiments.model_adaptive_pf.figures import six_figure
from jaxveh.experiments.model_adaptive_pf.settings import SLOW, SWERVE

STUDY = experiment.Study(duration=2.0, periods=0.4, particles=40)


def test_a_matrix_of_order_two_is_that_of_least_squares_with_forgetting():
    """Against the batch solution: squares weigh (1 - U) a row, the start A_1 = I, P = I as much as it says."""
    U, n, rng = 0.05, 6, np.random.default_rng(0)
    series = np.cumsum(rng.normal(size=(40, 3)), axis=0)
    method = MatrixAutoRegressive(filters.ParticleFilter(4), 2, U)
    learn = jax.jit(method.learn)
    memory = Fitted(jnp.eye(3, n), jnp.eye(n), jnp.concatenate([series[1], series[0]]))
    for now in series[2:]:
        memory = learn(memory, jnp.asarray(now))
    phi = np.hstack([series[1:-1], series[:-2]])
    weights = (1.0 - U) ** np.arange(len(phi))[::-1]
    # In front of all rows stands the start, which has been forgotten as often as there were rows.
    start = (1.0 - U) ** len(phi)
    left = (phi.T * weights) @ phi + start * np.eye(n)
    right = (phi.T * weights) @ series[2:] + start * np.eye(n, 3)
    np.testing.assert_allclose(memory.coefficients, np.linalg.solve(left, right).T, rtol=1e-6)
    np.testing.assert_array_equal(memory.past, np.concatenate([series[-1], series[-2]]))


def test_the_autoregression_moves_by_its_matrix_and_by_rows_before():
    car = own_drives.model_car(STUDY, own_drives.fiala(STUDY))
    model = models.matrix_autoregression(STUDY, car, jnp.asarray(14.0), models.mixture(STUDY))
    x, A = models.BodyState(14.0, 0.2, 0.1), np.arange(9.0).reshape(3, 3)
    np.testing.assert_allclose(models._matrix_decay(model.system, 0.0, 0.01, x, None), x)
    moved = model.system._replace(own=jnp.asarray(A), offset=models.BodyState(1.0, 2.0, 3.0))
    np.testing.assert_allclose(models._matrix_decay(moved, 0.0, 0.01, x, None), A @ np.array(x) + [1.0, 2.0, 3.0])


def test_a_matrix_without_news_is_the_walk_of_its_start():
    """While it has learned nothing (U = 0, a constant mean), order two says what order one says."""
    method = MatrixAutoRegressive(filters.ParticleFilter(4), 2, 0.0)
    now = jnp.asarray([1.4, 0.0, 0.0])
    memory = method.learn(Fitted(jnp.eye(3, 6), jnp.eye(6), jnp.concatenate([now, now])), now)
    np.testing.assert_allclose(memory.coefficients, np.eye(3, 6), atol=1e-12)


def test_wheels_spin_up_by_what_the_torque_has_over_the_tyres_force():
    """`J_w dw = T - r_e F_x`, `S = (r_e w - u) / u`, `F_x = C_s S`: at no torque a wheel that rolls freely is at rest."""
    still = dataclasses.replace(STUDY, rolling_resistance=0.0)
    car = own_drives.spinning_car(still, own_drives.fiala(still))
    model = models.spinning_model(still, car, jnp.asarray(14.0))
    assert model.states == ("v_x", "v_y", "yaw_rate", *(f"omega_{at}" for at in own_drives.WHEELS))
    assert model.channels == (*still.stds, *models.RIMS)
    x = model.prior.mean
    u = lambda torque: record("Inputs", {"steer": jnp.asarray(0.0), "drive_torque": torque, "brake_torque": 0.0})
    rates = models._rates(car, 0.0, x, u(100.0))
    np.testing.assert_allclose([rates.omega_fl, rates.omega_rl], [50.0 / still.wheel_inertia, 0.0], atol=1e-9)
    slipping = x._replace(omega_rr=x.omega_rr * 1.01)
    rate = models._rates(car, 0.0, slipping, u(0.0)).omega_rr
    np.testing.assert_allclose(rate, -still.wheel_radius * 0.01 * still.slip_stiffness / still.wheel_inertia, rtol=1e-3)
    seen = models._spinning_observation(car, 0.0, slipping, u(0.0))
    np.testing.assert_allclose([seen.rim_fl, seen.rim_rr], [14.0, 14.14], rtol=1e-12)


def test_heavy_process_noise_is_the_mixture_of_the_same_gaussian_part():
    car = own_drives.model_car(STUDY, own_drives.fiala(STUDY))
    law = models.heavy_dynamics(STUDY, car, jnp.asarray(14.0)).process_noise.over(STUDY.dt)
    plain = models.dynamics(STUDY, car, jnp.asarray(14.0)).process_noise.over(STUDY.dt)
    np.testing.assert_allclose(law.std, plain.std)
    drawn = law.sample(jax.random.key(0), (4000,))["v_y"]
    beyond = float(np.mean(np.abs(drawn) > 6.0 * plain.std.v_y))
    # Of a Cauchy law of the scale std / sqrt(2), beyond 6 std: 2 / pi arctan(1 / (6 sqrt 2)).
    assert beyond == pytest.approx(STUDY.weight * 2.0 / np.pi * np.arctan(1.0 / (6.0 * 2.0**0.5)), rel=0.3)


def made_up_drive(rows=11, slip=0.02):
    ones = np.ones(rows)
    fields = dict.fromkeys(own_drives.Drive._fields, ones)
    rims = 10.0 * (1.0 + slip) * np.ones((rows, 4))
    return own_drives.Drive(**fields | {"true_v_x": 10.0 * ones, "true_rims": rims, "rims": rims})


def test_numbers_are_of_six_states_and_of_slip():
    drive = made_up_drive()
    six = dict(zip(models.SIX, (10.0, 1.0, 1.0, 1.0, 1.5, 1.0), strict=True))
    said = {name: value * np.ones(11) for name, value in six.items()}
    found = lambda **more: types.SimpleNamespace(
        mean=types.SimpleNamespace(**said, **more), log_likelihood=0.0, result=np.int32(0)
    )
    plain = metrics(found(), drive)
    np.testing.assert_allclose([plain["a_x"], plain["a_y"], plain["slip"]], [0.5, 0.0, 2.0], rtol=1e-6)
    assert plain["six"].shape == (6, len(range(0, 11, EVERY)))
    spinning = metrics(found(**dict.fromkeys(models.RIMS, 10.15 * np.ones(11))), drive)
    np.testing.assert_allclose(spinning["slip"], 0.5, rtol=1e-6)


def test_filters_are_told_the_friction_of_the_road_or_not():
    cars = []

    def run(study, car, drive, key):
        cars.append(float(car.front.friction))
        return types.SimpleNamespace(
            mean=types.SimpleNamespace(**dict.fromkeys(models.SIX, np.ones(11))), log_likelihood=0.0, result=0
        )

    for name in ("30 km/h, friction 0.4, told", "30 km/h, friction 0.4, not told"):
        of_a_point(STUDY, Contestant(run, ""))(None, None, (SLOW[name], made_up_drive()))
        assert SLOW[name].friction == 0.4
    np.testing.assert_allclose(cars, [0.4 * STUDY.friction, STUDY.friction])


def made_up_race(names, cases, **errors):
    """A race of three seeds in which every error is 1, but for those that a test wants."""
    shape = (len(names), len(cases), 3)
    values = {what: np.ones(shape) for what in (*beside.STATES, "slip")}
    for name, error in errors.items():
        values["sideslip"][list(names).index(name.replace("_", " "))] = error
    values["six"] = np.zeros((*shape, 6, 3))
    design = sweeps.Design(estimator=dict.fromkeys(names), case=range(len(cases)))
    leaf = jax.tree.map(lambda x: np.broadcast_to(x, (len(cases), 3, *x.shape)), made_up_drive())
    return experiment.Raced(STUDY, dict(cases), leaf, sweeps.Swept(design, 3, values))


RACED = ("open loop", *beside.FOUR, "PF, no relaxation", "CKF", "PF, redesigned")


def test_the_tables_compare_each_with_its_rival():
    raced = made_up_race(RACED, SWERVE, AAR=0.5)
    own = made_up_race(tuple(beside.RIVALS), SWERVE)
    rows = {row[0]: row for row in beside.beside_table(raced, own).rows}
    assert rows["AAR, matrix"][1] == "AAR" and rows["AAR, matrix"][3].startswith("2 ")
    assert rows[beside.SEVEN][1] == "PF, no relaxation" and rows[beside.SEVEN][3].startswith("1 ")
    assert rows["open loop"][1] == PLAIN and rows["open loop"][-1] == "does nothing"
    slow = made_up_race(beside.SLOWLY, SLOW, AAR=3.0)
    last = beside.slow_table(raced, slow).rows[2]
    assert last[0] == "AAR" and last[1].startswith("0.5 ") and last[2].startswith("3 ") and "; 3 " in last[2]
    table = beside.six_table(raced)
    assert table.columns[2:] == (
        "v_x, m/s", "v_y, m/s", "a_x, m/s^2", "a_y, m/s^2", "yaw rate, degrees/s", "sideslip, degrees"
    )  # fmt: skip
    assert {row[0]: row[-1] for row in table.rows}["AAR"].startswith("0.5 ")


def test_the_figure_of_six_states_has_their_units():
    study = dataclasses.replace(STUDY, duration=0.1)
    raced = made_up_race(RACED, SWERVE)
    ramp = raced.drives._replace(**{f"true_{n}": np.tile(np.linspace(0.0, 1.0, 11), (2, 3, 1)) for n in beside.STATES})
    axes = six_figure(raced._replace(study=study, drives=ramp)).axes
    assert [one.get_ylabel() for one in axes] == [
        "v_x [m/s]", "v_y [m/s]", "a_x [m/s²]", "a_y [m/s²]", "yaw rate [°/s]", "sideslip [°]",
    ]  # fmt: skip
    (truth,) = [line for line in axes[4].lines if line.get_label() == "truth"]
    np.testing.assert_allclose(truth.get_ydata(), np.rad2deg(np.linspace(0.0, 1.0, 11)))


@pytest.mark.full
def test_what_the_paper_has_beside_runs_on_its_own_drives():
    drives = experiment.drives_of(STUDY, SWERVE, 2, jax.random.key(3))
    turning = drives.true_rims / drives.true_v_x[..., None] - 1.0
    # Wheels slip by little, and run faster at the outside of a bend.
    assert 1e-4 < np.abs(turning).max() < 0.05
    np.testing.assert_allclose((drives.rims - drives.true_rims)[0].std(), STUDY.rim, rtol=0.1)
    raced = experiment.race(STUDY, SWERVE, drives, jax.random.key(0), entrants=beside.entrants(STUDY))
    assert (raced.found["result"] == 0).all()
    # Who measures the wheels' speeds knows their slip.
    none = np.sqrt(np.mean(turning**2)) * 100.0
    assert np.median(raced.of("slip", beside.SEVEN, "constant")) < 0.5 * none
    assert np.median(raced.of("sideslip", beside.SEVEN, "constant")) < 0.3
