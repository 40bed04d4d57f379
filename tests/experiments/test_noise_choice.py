"""The choice of the study's noise: by likelihood alone, on drives of its own."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats

from jaxveh import Recording, filters, numerics
from jaxveh.experiments.tyre_apf import Study, noise, predictive, sharpness
from jaxveh.experiments.tyre_apf.settings import NoiseLevel, StudyNoise

SMALL = dataclasses.replace(Study(), rate=25.0, particles=40)


@pytest.fixture(scope="module")
def choice():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(noise, "V_Y", (1e-3, 0.02, 3.0))
        patch.setattr(noise, "YAW_RATE", (0.01, 2.0))
        yield noise.choose(SMALL, "UKF", drives=3, seed=7)


def test_the_candidate_of_the_largest_likelihood_is_chosen(choice):
    assert choice.candidates.shape == (6, 3)
    assert choice.log_likelihood.shape == (6, 3)
    assert np.isfinite(choice.log_likelihood).all()
    best = choice.candidates[choice.log_likelihood.mean(axis=1).argmax()]
    assert dataclasses.astuple(choice.noise) == tuple(best)
    # The drives have no process noise at all: levels that drown the sensors explain them worse.
    assert choice.noise.v_y < 3.0 and choice.noise.yaw_rate < 2.0
    assert choice.noise.walk == 0.0


@pytest.mark.parametrize("failed", [-np.inf, np.nan])
def test_a_candidate_that_fails_on_one_drive_is_out(monkeypatch, failed):
    def likelihood(study, name, keys):
        return lambda levels: np.array([9.0, failed if levels[2] > 0.05 else float(levels[2])])

    monkeypatch.setattr(noise, "_drives", likelihood)
    assert noise.choose(SMALL, "PF", drives=2).noise.walk == 0.05


CANDIDATES = np.array([(0.02, 0.005, 0.05), (0.02, 0.005, 0.1), (5.0, 0.005, 0.05), (5.0, 0.005, 0.1)])
LEVEL = NoiseLevel(0.02, 0.4, None)


def choose_level(rounds, seed=2000, keep=2):
    return noise.choose_level(SMALL, LEVEL, candidates=CANDIDATES, particles=40, rounds=rounds, keep=keep, seed=seed)


@pytest.fixture
def passes(monkeypatch):
    """The filters' passes, made up: each draws its log-likelihood around a value of its own for every candidate and drive."""

    def made_up(study, filter_, level, again, key):
        assert study is SMALL and filter_.particles == 40 and filter_.resampling is numerics.multinomial
        assert (level.yaw_rate, level.a_y) == (LEVEL.yaw_rate, LEVEL.a_y)
        behind = 10.0 * isinstance(filter_, filters.AuxiliaryParticleFilter) - 3.0 * level.noise.v_y
        mean = behind + 20.0 * level.noise.walk + level.noise.yaw_rate + jax.random.normal(key)
        each = mean + jax.random.normal(jax.random.fold_in(key, 1), (again,))
        return None, each, jnp.zeros(again, jnp.int32)

    monkeypatch.setattr(noise, "several_passes", made_up)
    monkeypatch.setattr(noise, "drive_at", lambda *a: None)
    monkeypatch.setattr(noise, "unexplained_likelihood", lambda drive: -1e9)


def test_both_particle_filters_share_the_noise_of_a_level(monkeypatch, passes):
    found = choose_level([noise.Round(2, 3)])
    np.testing.assert_array_equal(found.candidates, CANDIDATES)
    assert found.log_likelihood.shape == (4, 2) and np.isfinite(found.log_likelihood).all()
    assert dataclasses.astuple(found.noise) == tuple(found.candidates[found.log_likelihood.mean(axis=1).argmax()])
    assert found.noise.v_y == 0.02
    # Both filters count, each with the mean of its passes.
    kinds, each = dict(noise.KINDS), []
    for name, kind in kinds.items():
        monkeypatch.setattr(noise, "KINDS", {name: kind})
        each.append(choose_level([noise.Round(2, 3)]).log_likelihood)
    np.testing.assert_allclose(sum(each), found.log_likelihood, rtol=1e-9)
    assert (np.abs(each[1] - each[0] - 10.0) < 1e-9).all()


def test_a_lost_pass_counts_as_what_mean_and_spread_explain(monkeypatch, passes):
    found = jnp.array([5.0, 3.0, -1e9])
    monkeypatch.setattr(noise, "unexplained_likelihood", lambda drive: -2.0)
    monkeypatch.setattr(noise, "several_passes", lambda *a: (None, found, jnp.zeros(3)))
    np.testing.assert_allclose(choose_level([noise.Round(2, 3)]).log_likelihood, 4.0)
    # A pass that fails rules the candidate out.
    monkeypatch.setattr(noise, "several_passes", lambda *a: (None, found, jnp.array([0, 0, 1])))
    with pytest.raises(ValueError, match="all 4 candidates fail on a drive"):
        choose_level([noise.Round(2, 3)])


def test_drives_of_a_level_are_of_its_sensors(monkeypatch):
    """What the passes go over, and what the mean and the spread are taken of."""
    at = jax.jit(lambda key, *std: sharpness.drive_at(SMALL, NoiseLevel(*std, None), key))
    key, other = jax.random.split(jax.random.key(0))
    drive, clean = at(key, LEVEL.yaw_rate, LEVEL.a_y), at(key, 1e-9, 1e-9)
    for channel in ("yaw_rate", "a_y"):
        np.testing.assert_allclose(np.std(drive[channel] - clean[channel]), getattr(LEVEL, channel), rtol=0.15)
    # It is one lane change: the sensors' noise is all that differs.
    np.testing.assert_allclose(at(other, 1e-9, 1e-9)["a_y"], clean["a_y"], atol=1e-6)
    assert np.abs(at(other, LEVEL.yaw_rate, LEVEL.a_y)["a_y"] - drive["a_y"]).max() > LEVEL.a_y


def test_what_a_mean_and_a_spread_explain():
    rng = np.random.default_rng(0)
    values = {"yaw_rate": rng.normal(0.3, 2.0, 50), "a_y": rng.normal(-1.0, 0.1, 50), "speed": np.ones(50)}
    normal = lambda x: scipy.stats.norm.logpdf(x, x.mean(), x.std()).sum()
    found = noise.unexplained_likelihood(Recording(np.arange(50.0), values))
    np.testing.assert_allclose(found, normal(values["yaw_rate"]) + normal(values["a_y"]), rtol=1e-12)


def test_the_best_of_a_round_go_to_other_drives(passes):
    found = choose_level([noise.Round(2, 1), noise.Round(3, 1)])
    first = choose_level([noise.Round(2, 1)])
    best = np.sort(np.argsort(-first.log_likelihood.mean(axis=1))[:2])
    np.testing.assert_array_equal(found.candidates, CANDIDATES[best])
    # Drives of the next seed.
    again = choose_level([noise.Round(3, 1)], seed=2001)
    np.testing.assert_allclose(found.log_likelihood, again.log_likelihood[best], rtol=1e-9)
    assert not np.isclose(found.log_likelihood[:, :2], first.log_likelihood[best]).any()


def test_a_choice_takes_a_round_at_least():
    with pytest.raises(ValueError, match="number of rounds = 0: must be at least 1"):
        choose_level([])


def test_its_drives_are_not_those_of_the_report(choice):
    keys = jax.random.key_data(jax.random.split(jax.random.key(1000), 8))
    honest, _ = jax.random.split(jax.random.key(0))
    shown = jax.random.key_data(jax.random.split(honest, 50))
    assert not (np.asarray(keys)[:, None] == np.asarray(shown)[None]).all(axis=-1).any()


@pytest.mark.full
def test_the_predictive_look_ahead_is_raced_at_noise_of_its_own_choice():
    study = dataclasses.replace(SMALL, duration=6.0, rate=20.0)
    levels, raced = predictive.race(
        study, 2, jax.random.key(0), levels=[NoiseLevel(0.02, 0.4, None)], candidates=CANDIDATES[:2], rounds=[noise.Round(2, 2)],
        particles=40, again=2,
    )  # fmt: skip
    assert levels[0].noise in [StudyNoise(*candidate) for candidate in CANDIDATES[:2]]
    assert (raced.found[40]["result"] == 0).all()
    assert raced.found[40].compare("error", "filter", "APF", "PF").wins.shape == (1,)
