"""The model-adaptive-pf experiment at small size: noise has the levels it says, filters rank as they should, errata show."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import filters, sweeps
from jaxveh import statespace as ss
from jaxveh.experiments import model_adaptive_pf as experiment
from jaxveh.experiments.model_adaptive_pf import choice, criteria, figures, models, printed, report
from jaxveh.experiments.model_adaptive_pf import drives as own_drives
from jaxveh.experiments.model_adaptive_pf.aar import AutoRegressive
from jaxveh.experiments.model_adaptive_pf.contestants import (
    ADAPTIVE,
    CUBATURE,
    JUDGED,
    PLAIN,
    REDESIGNED,
    ROBUST,
    STUDENT,
    TOLD,
    Contestant,
    contestants,
    dynamics_filter,
    informed_filter,
    metrics,
    of_a_point,
    redesigned_particles,
)
from jaxveh.statespace.belief import AbstractBelief
from jaxveh.statespace.contract import AbstractFilter
from jaxveh.tyres import Contact, Linear, Relaxed

SMALL = experiment.Study(duration=2.5, periods=0.6, particles=60, max_step=0.005)
NOISY = experiment.Case(level=6.0, outliers=0.05)


def quick_tyre(study, share=1.0):
    """One whose program is short."""
    return Linear(share * study.cornering_stiffness)


def quick_car(study):
    """A truth of three degrees of freedom on lagging linear tyres."""
    return models.lagging_car(study, own_drives.model_car(study, quick_tyre(study)))


@pytest.fixture(scope="module")
def drives():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(own_drives, "true_car", quick_car)
        return experiment.drives_of(SMALL, {"both": NOISY, "quiet": experiment.Case()}, 3, jax.random.key(5))


def test_the_drive_is_a_slalom_of_the_printed_car(drives):
    assert drives.v_x.shape == (2, 3, 251)
    assert np.abs(drives.true_v_x - SMALL.speed).max() < 0.1 * SMALL.speed
    assert 2.5 < np.rad2deg(drives.steer).max() < 3.5
    assert 0.7 < np.rad2deg(np.abs(drives.true_sideslip)).max() < 4.0
    # Cases of one seed drive the same way.
    np.testing.assert_array_equal(drives.true_v_y[0], drives.true_v_y[1])
    # Tyres build up their force over some centimetres: at the front the force lags the steer.
    assert np.argmax(drives.true_a_y[1, 0]) > np.argmax(drives.steer[1, 0])


def test_the_truth_is_the_printed_car_on_tyres_of_the_printed_stiffness():
    car = own_drives.true_car(SMALL)
    assert (float(car.mass), float(car.front_axle_to_cg), float(car.track_rear)) == (1528.0, 1.48, 1.594)
    seen = eqx.filter_jit(lambda tyre, contact: (tyre.forces(contact).F_y, tyre.outputs(contact).sigma_y))
    for axle, load in zip((car.front, car.rear), own_drives.numbers_of(SMALL).wheel_loads(), strict=True):
        assert isinstance(axle, Relaxed) and axle.sigma_y is None
        small, none, load, speed = map(jnp.asarray, (1e-3, 0.0, float(load), 14.0))
        F_y, sigma_y = seen(axle.tyre, Contact(slip_angle=small, slip_ratio=none, load=load, speed=speed))
        assert float(F_y) == pytest.approx(SMALL.cornering_stiffness * 1e-3, rel=0.02)
        # What the filters are told of its relaxation length.
        assert float(sigma_y) == pytest.approx(SMALL.relaxation, abs=0.01)


def test_a_lagging_tyre_is_the_static_one_after_some_way():
    static = own_drives.model_car(SMALL, own_drives.fiala(SMALL))
    car = models.lagging_car(SMALL, static)
    model = models.dynamics(SMALL, car, jnp.asarray(14.0))
    assert model.states == ("v_x", "v_y", "yaw_rate", *(f"{w}_deflection_y" for w in ("fl", "fr", "rl", "rr")))
    u = models.record_type("Inputs", models.INPUTS)(*map(jnp.asarray, (0.02, 0.0, 0.0)))
    x = model.prior.mean
    rates = models._rates(car, 0.0, x, u)
    # dv/dt = V alpha - V v / sigma: nothing deflects yet, and the front wheels slip by the steer.
    np.testing.assert_allclose(rates.fl_deflection_y, 14.0 * np.tan(0.02), rtol=1e-3)
    settled = SMALL.relaxation * np.tan(0.02)
    # The right wheel's tyre is a mirror image.
    x = x._replace(fl_deflection_y=jnp.asarray(settled), fr_deflection_y=jnp.asarray(-settled))
    body = models.BodyState(*x[:3])
    np.testing.assert_allclose(
        models._observation(car, 0.0, x, u).a_y, models._observation(static, 0.0, body, u).a_y, rtol=1e-3
    )


def test_noise_has_the_levels_that_the_case_says():
    study = experiment.Study(duration=100.0)

    @jax.jit
    def noise_at(level, outliers):
        return own_drives.noise_of(study, experiment.Case(level=level, outliers=outliers), jax.random.key(0))

    usual = experiment.Case()
    noise_of = lambda level=usual.level, outliers=usual.outliers: jax.tree.map(np.asarray, noise_at(level, outliers))
    noise, level = noise_of()
    assert level.min() == level.max() == 1.0
    for name, std in study.stds.items():
        np.testing.assert_allclose(noise[name].std(), std, rtol=0.03)
    noise, level = noise_of(level=5.0)
    np.testing.assert_allclose([level.min(), level.max()], [1.0, 5.0], atol=1e-3)
    np.testing.assert_allclose((noise["a_y"] / level).std(), study.a_y, rtol=0.03)
    noise, _ = noise_of(outliers=0.03)
    # A normal number is beyond 5 of the small standard deviations with 0.96 of the outliers.
    np.testing.assert_allclose((np.abs(noise["a_y"]) > 5 * study.a_y).mean(), 0.03 * 0.96, rtol=0.1)
    wild = noise["a_y"][np.abs(noise["a_y"]) > 5 * study.a_y]
    np.testing.assert_allclose(np.median(np.abs(wild)), 0.6745 * study.outlier_size * study.a_y, rtol=0.15)


@pytest.mark.full
def test_what_knows_outliers_beats_what_does_not(drives):
    cases = {"both": NOISY, "quiet": experiment.Case()}
    particles = filters.ParticleFilter(60)
    entrants = {
        PLAIN: Contestant(dynamics_filter(particles, lags=False), ""),
        ADAPTIVE: Contestant(dynamics_filter(filters.HaarParticles(particles), models.mixture, lags=False), ""),
    }
    entrants |= {
        REDESIGNED: Contestant(redesigned_particles(SMALL), ""),
        TOLD: Contestant(informed_filter(filters.Cubature()), ""),
    }
    raced = experiment.race(SMALL, cases, drives, jax.random.key(0), entrants=entrants, tyre=quick_tyre)
    error = lambda name, case, what="yaw_rate": np.median(raced.of(what, name, case))
    assert error(ADAPTIVE, "both") < 0.8 * error(PLAIN, "both")
    assert error(ADAPTIVE, "quiet") < 1.1 * error(PLAIN, "quiet") < error(PLAIN, "both")
    assert error(REDESIGNED, "both") < 0.8 * error(PLAIN, "both")
    assert error(TOLD, "both", "sideslip") < error(REDESIGNED, "both", "sideslip")
    assert (raced.found["result"] == 0).all()
    assert raced.of("course", PLAIN, "both").shape == (3, 251)
    assert experiment.settings(experiment.Reproduction(3, *[raced] * 6))["cases"]["both"]["level"] == 6.0


def test_who_is_told_weighs_by_the_true_noise_and_leaves_out_what_is_wild(drives):
    """On quiet rows the plain filter's numbers; a row with a wild value and one without it are the same to it."""
    one = own_drives.Drive(*(jnp.asarray(leaf[1, 0]) for leaf in drives))
    car = own_drives.model_car(SMALL, quick_tyre(SMALL))
    plain, knows = dynamics_filter(filters.Cubature()), informed_filter(filters.Cubature())
    course = lambda run, drive: np.asarray(run(SMALL, car, drive, jax.random.key(0)).mean.sideslip)
    np.testing.assert_allclose(course(knows, one), course(plain, one), atol=1e-12)
    missing = one._replace(a_y=one.a_y.at[100].set(jnp.nan))
    wild = one._replace(a_y=one.a_y.at[100].add(50.0 * SMALL.a_y))
    np.testing.assert_allclose(course(knows, wild), course(plain, missing), atol=1e-12)
    loud = dataclasses.replace(SMALL, v_x=3.0 * SMALL.v_x, a_y=3.0 * SMALL.a_y, yaw_rate=3.0 * SMALL.yaw_rate)
    # But for the prior's spread of the speed, which is the data sheet's.
    expected = np.asarray(plain(loud, car, one, None).mean.sideslip)
    np.testing.assert_allclose(course(knows, one._replace(level=3.0 * one.level)), expected, atol=1e-4)
    assert np.abs(course(knows, one) - expected).max() > 1e-3


def test_the_redesigned_filter_follows_with_both_parts(drives, monkeypatch):
    """It scans with the filter, model and rows that it should: what it makes of them is in the race above."""
    monkeypatch.setattr(filters, "scan", lambda *given: given)
    one = own_drives.Drive(*(jnp.asarray(leaf[0, 0]) for leaf in drives))
    car = own_drives.model_car(SMALL, quick_tyre(SMALL))
    own = dataclasses.replace(SMALL, short_window=8, heavy_alpha=1.2, fewest=6, initial=9.0)
    found = redesigned_particles(own)(own, car, one, jax.random.key(0))
    filter_ = filters.HaarParticles(
        filters.ParticleFilter(60), 8, SMALL.forgetting, fewest=6, initial=9.0, follows="both"
    )
    law = models.mixture(dataclasses.replace(SMALL, alpha=1.2))
    expected = dynamics_filter(filter_, lambda study: law)(SMALL, car, one, jax.random.key(0))
    assert len(found) == 4 and eqx.tree_equal(found, expected)


def test_the_robust_filter_shares_the_redesigned_one_s_wavelet(drives):
    one = own_drives.Drive(*(jnp.asarray(leaf[0, 0]) for leaf in drives))
    car = own_drives.model_car(SMALL, quick_tyre(SMALL))
    own = dataclasses.replace(SMALL, short_window=8, fewest=6, initial=9.0, wild_share=0.1, wild_factor=20.0)
    found = contestants(own)[ROBUST].run(own, car, one, None)
    filter_ = filters.HaarNoise(
        filters.Contaminated(filters.Cubature(), 0.1, 20.0), 8, SMALL.forgetting, fewest=6, initial=9.0
    )
    expected = dynamics_filter(filter_)(SMALL, car, one, None)
    np.testing.assert_array_equal(found.mean.sideslip, expected.mean.sideslip)


@pytest.mark.studies
def test_the_choice_is_of_the_likelihood(monkeypatch):
    monkeypatch.setattr(own_drives, "true_car", quick_car)
    monkeypatch.setattr(choice, "fiala", quick_tyre)
    found = choice.redesigned_likelihoods(SMALL, windows=(16,), alphas=(1.5, 1.99), drives=2)
    assert found.shape == (1, 2, 2) and np.isfinite(found).all()
    # There are outliers: a law without tails does not like them.
    assert (found[0, 0] > found[0, 1] + 10.0).all()
    starts = ((None, 1.0), (4, 16.0))
    found = choice.robust_likelihoods(
        SMALL, windows=(16,), starts=starts, shares=(0.03,), factors=(1.5, 30.0), drives=3
    )
    assert found.shape == (1, 2, 1, 2, 3) and np.isfinite(found).all()
    # Nor one that has them hardly wider, nor, on most drives, one that believes the data sheet for sixteen rows.
    assert (found[..., 1, :] > found[..., 0, :] + 10.0).all()
    assert found[0, 1, 0, 1].sum() > found[0, 0, 0, 1].sum()


def test_the_table_by_process_noise_shows_each_ones_own_choice():
    cases = {"x 1": experiment.Case(), "x 2": experiment.Case(process=2.0)}
    design = sweeps.Design(estimator={PLAIN: None, TOLD: None}, case=range(2))
    values = np.array([[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]], [[0.5, 0.5, 0.5], [0.25, 0.25, 0.25]]])
    likelihood = np.array([[[-9.0, -9.0, 7.0], [-1.0, -1.0, -8.0]], [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]])
    found = sweeps.Swept(design, 3, {"sideslip": values, "log_likelihood": likelihood})
    raced = experiment.Raced(SMALL, cases, None, found)
    table = report._noise_table(raced)
    assert table.columns == ("estimator", "x 1", "x 2", "its own choice")
    assert [row[0] for row in table.rows] == [PLAIN, TOLD]
    assert table.rows[0][1].startswith("2") and table.rows[0][2].startswith("4")
    # Of sums, not of the best drive; and none of who leaves rows out.
    assert [row[-1] for row in table.rows] == ["x 2", "-"]
    lost = raced._replace(
        found=sweeps.Swept(design, 3, {"log_likelihood": np.where(likelihood == -8.0, np.nan, likelihood)})
    )
    assert report.likeliest(lost, PLAIN) == "x 1"
    (axes,) = figures.pressed_figure(raced).axes
    np.testing.assert_allclose([line.get_ydata() for line in axes.lines[:2]], [[2.0, 4.0], [0.5, 0.25]])
    np.testing.assert_allclose(axes.lines[0].get_xdata(), [1.0, 2.0])


class Built(Exception):
    """Ends a run once its model is there."""


def test_nobody_knows_of_relaxation_where_it_is_said_so(drives, monkeypatch):
    """With `lags=False` no contestant's car has tyres that lag, else all but the one named so and the regressions."""

    def scan(filter_, model, rows, key=None):
        raise Built(getattr(model.system, "car", model.system).front)

    monkeypatch.setattr(filters, "scan", scan)
    one = own_drives.Drive(*(jnp.asarray(leaf[0, 0]) for leaf in drives))
    car = own_drives.model_car(SMALL, quick_tyre(SMALL))

    def who_knows(lags):
        found = set()
        for name, contestant in contestants(SMALL, lags).items():
            with pytest.raises(Built) as built:
                contestant.run(SMALL, car, one, jax.random.key(0))
            found |= {name} if isinstance(built.value.args[0], Relaxed) else set()
        return found

    assert who_knows(False) == set()
    assert who_knows(True) == set(contestants(SMALL)) - {"PF, no relaxation", "AAR", "AAR as printed"}


def test_filters_are_told_the_relaxation_length_that_the_case_says():
    told_lengths = []

    def run(study, car, drive, key):
        told_lengths.append(float(study.relaxation))
        kind = models.record_type("Report", models.SIX)
        return dataclasses.make_dataclass("Found", ("mean", "log_likelihood", "result"))(
            kind(*[jnp.zeros(3)] * len(models.SIX)), 0.0, 0
        )

    drive = own_drives.Drive(*[jnp.zeros(3)] * len(own_drives.Drive._fields))._replace(true_rims=jnp.zeros((3, 4)))
    point = of_a_point(SMALL, Contestant(run, ""), quick_tyre)
    for case in (experiment.Case(), experiment.Case(relaxation=0.5)):
        point(None, None, (case, drive))
    assert told_lengths == pytest.approx([SMALL.relaxation, 0.5 * SMALL.relaxation])


def made_up(cases, **sideslip):
    """Races in which every contestant's sideslip is 1 in both seeds, or that of `sideslip` by case."""
    values = [[sideslip.get(case, {}).get(name, 1.0) for case in cases] for name in JUDGED]
    values = np.repeat(np.array(values)[..., None], 2, axis=-1)
    design = sweeps.Design(estimator=dict.fromkeys(JUDGED), case=range(len(cases)))
    return experiment.Raced(SMALL, cases, None, sweeps.Swept(design, 2, {"sideslip": values}))


def test_criteria_are_asked_of_the_first_contestant_that_knows_nothing():
    """What was made later, and what is told the length, stands beside; of two wrong lengths the worse counts."""
    cases = {name: experiment.Case() for name in ("constant", "both")}
    wrong = {f"{name}, {what}": experiment.Case() for name in cases for what in ("half", "double")}
    result = report.Reproduction(
        2,
        raced=made_up(cases, both={ADAPTIVE: 0.79, REDESIGNED: 0.70, STUDENT: 0.85, ROBUST: 0.69, CUBATURE: 5.0}),
        pressed=None,
        unaware=made_up(cases, both={ADAPTIVE: 0.90, REDESIGNED: 0.77, STUDENT: 0.95, ROBUST: 0.80}),
        misled=made_up(wrong, **{"both, half": {ADAPTIVE: 0.6}, "both, double": {ADAPTIVE: 0.81, PLAIN: 0.9}}),
        beside=None,
        slow=None,
    )
    checks = report.check(result)
    found = {(check.name.split(";")[0].split(": ")[1], check.name.split("; ")[1]): check for check in checks[:6]}
    of = lambda name, knows: found[f"{name} over {PLAIN}", knows]
    first = of(ADAPTIVE, criteria.NOTHING)
    assert (first.value, first.status, first.original) == (pytest.approx(0.90), "failed", "")
    assert (of(ADAPTIVE, criteria.TOLD_LENGTH).value, of(ADAPTIVE, criteria.TOLD_LENGTH).status) == (0.79, "failed")
    assert of(ADAPTIVE, criteria.WRONG_LENGTH).value == pytest.approx(0.9)
    assert of(REDESIGNED, criteria.TOLD_LENGTH).status == "met"
    assert all(check.original == first.name for check in checks[1:6])
    (lost,) = [check for check in checks if check.name.startswith(f"both: {ADAPTIVE} loses") and not check.original]
    assert (lost.value, lost.status) == (0.0, "met")
    (robust,) = [check for check in checks if check.bound == 0.72 and not check.original]
    assert (robust.value, robust.status) == (pytest.approx(0.95), "failed")
    rows = {row[0]: row for row in report._knowledge(result, "both").rows}
    np.testing.assert_allclose(rows[ADAPTIVE][5:], [0.90, 0.6, 0.79, 0.9])


class Told(AbstractBelief):
    """The mean that a test says."""

    told: models.BodyState
    count: jax.Array

    @property
    def mean(self):
        return self.told

    def moments(self, model):
        return self.told, self.told


class Scripted(AbstractFilter):
    """Says each row's measurements, and keeps the coefficients that it was given."""

    def check(self, model):
        del model

    def _init(self, model, row, key):
        return Told(models.BodyState(*row.y), jnp.int32(0)), model.system.keeps

    def _step(self, model, belief, row):
        return Told(models.BodyState(*row.y), belief.count + 1), model.system.keeps


def learned(as_printed, first):
    """Coefficients after 200 rows that grow by 1, 0.5 and 0.1 %, from `first`."""
    shares, rows = np.array([1.01, 1.005, 1.001]), 200
    values = np.array(first) * shares ** np.arange(rows)[:, None]
    system = models.Regressed(None, models.BodyState(*jnp.ones(3)))
    model = ss.StateSpace(
        system=system, transition=lambda s, t0, t1, x, u: x, observation=lambda s, t, x, u: x, process_noise=None,
        measurement_noise=dict.fromkeys(("v_x", "v_y", "yaw_rate"), 1.0),
        prior=ss.Prior(models.BodyState(0.0, 0.0, 0.0), dict.fromkeys(("v_x", "v_y", "yaw_rate"), 1.0)),
    )  # fmt: skip
    filter_ = AutoRegressive(Scripted(), as_printed=as_printed)
    y = lambda k: models.BodyState(*map(jnp.asarray, values[k]))
    belief, _ = filter_.init(model, ss.Row(jnp.asarray(0.0), None, y(0)))
    step = jax.jit(filter_.step)
    for k in range(1, rows):
        belief, _ = step(model, belief, ss.Row(jnp.asarray(0.01 * k), None, y(k)))
    return shares, np.array(belief.memory.keeps)


def test_least_squares_learns_whatever_the_size_and_the_printed_law_does_not():
    shares, found = learned(False, (10.0, 0.1, 0.1))
    np.testing.assert_allclose(found, shares, atol=2e-4)
    _, found = learned(True, (10.0, 0.1, 0.1))
    assert abs(found[0] - 1.01) < 2e-4
    assert abs(found[1] - 1.0) < 1e-3 and abs(found[2] - 1.0) < 1e-4


def test_the_mixture_is_that_of_the_paper_with_its_errata_corrected():
    study = experiment.Study()
    assert study.weight == pytest.approx((4 - 1.7**2) / (3 * 1.7**2))
    law = models.mixture(study)
    x = 0.03
    scale, std = study.yaw_rate / np.sqrt(2), study.yaw_rate
    cauchy = scale / (np.pi * (x**2 + scale**2))
    normal = np.exp(-(x**2) / (2 * std**2)) / np.sqrt(2 * np.pi * std**2)
    residual = {"v_x": jnp.asarray(0.0), "a_y": jnp.asarray(0.0), "yaw_rate": jnp.asarray(x)}
    only = {"v_x": jnp.asarray(False), "a_y": jnp.asarray(False), "yaw_rate": jnp.asarray(True)}
    expected = np.log(study.weight * cauchy + (1 - study.weight) * normal)
    np.testing.assert_allclose(law.log_prob(residual, only), expected, rtol=1e-6)


def test_the_printed_variance_grows_to_a_standard_deviation():
    study = dataclasses.replace(experiment.Study(), duration=4.0)
    noise, _ = jax.jit(lambda key: own_drives.noise_of(study, experiment.Case(), key))(jax.random.key(1))
    noise = {name: np.asarray(noise[name]) for name in study.stds}
    filter_ = printed.PrintedNoise(filters.HaarParticles(filters.ParticleFilter(2)))
    own = jnp.asarray(np.square(list(study.stds.values())))
    model = ss.StateSpace(
        transition=lambda s, t0, t1, x, u: x, observation=lambda s, t, x, u: x, process_noise=None,
        measurement_noise=models.mixture(study),
        prior=ss.Prior(models.BodyState(0.0, 0.0, 0.0), dict.fromkeys(("v_x", "v_y", "yaw_rate"), 1.0)),
    )  # fmt: skip
    window = filters.kit.first_window(filter_.inner, own)
    seen = jax.jit(filter_._window_after)
    Measured = models.record_type("Measurements", study.stds)
    for k in range(400):
        window = seen(model, window, ss.Row(jnp.asarray(0.0), None, Measured(*(v[k] for v in noise.values()))))
        if k == 40:
            np.testing.assert_allclose(window.variances, own, rtol=1e-9)
    expected = np.array(list(study.stds.values())) * 0.6745 / 0.627
    # Of a median of 32, some per cent; the variances themselves are 10 to 200 times smaller.
    np.testing.assert_allclose(window.variances, expected, rtol=0.6)


def test_the_printed_tyre_jumps():
    as_printed, corrected = printed.tyre_table(experiment.Study()).rows
    _, force, moment, trail, push = as_printed
    assert force == pytest.approx(-0.2, abs=0.15) or force == pytest.approx(0.2, abs=0.15)
    assert moment == pytest.approx(64.0, abs=1.0)
    assert trail == pytest.approx(0.2749 * 70.0, rel=1e-2)
    assert push < 5.0
    assert abs(corrected[2]) < 0.2 and corrected[3] == pytest.approx(31.7, rel=1e-2) and corrected[4] > 90.0


def test_numbers_of_a_known_course(drives):
    drive = own_drives.Drive(*(jnp.asarray(leaf[0, 0]) for leaf in drives))
    truth = {name: getattr(drive, f"true_{name}") for name in models.SIX}
    wrong = {"v_y": truth["v_y"] + 0.1, "sideslip": truth["sideslip"] + jnp.deg2rad(0.5), "a_y": truth["a_y"] - 0.3}
    mean = models.record_type("Report", models.SIX)(**{**truth, **wrong})
    found = dataclasses.make_dataclass("Found", ("mean", "log_likelihood", "result"))(mean, 0.0, 0)
    numbers = metrics(found, drive)
    said = [numbers[name] for name in ("sideslip", "v_y", "yaw_rate", "a_y", "a_x")]
    np.testing.assert_allclose(said, [0.5, 0.1, 0.0, 0.3, 0.0], atol=1e-12)


def test_every_contestant_says_what_it_is():
    for name, one in {**contestants(SMALL), **printed.entrants(SMALL)}.items():
        assert name and one.what
