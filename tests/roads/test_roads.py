"""Roads against closed forms, their statistics, bad input."""

import jax
import numpy as np
import pytest

from jaxveh import InputError, io, roads


def test_split_mu_is_each_friction_on_its_side():
    road = roads.SplitMu(1.0, 0.3, blend=0.4, border=0.5)
    np.testing.assert_allclose(
        road.at(7.0, np.array([-3.0, 0.29, 0.5, 0.71, 3.0])).friction, [0.3, 0.3, 0.65, 1.0, 1.0]
    )


def test_mu_jumps_where_it_says():
    road = roads.MuJump(1.0, 0.4, at_distance=50.0, ramp=2.0)
    np.testing.assert_allclose(road.at(np.array([0.0, 50.0, 51.0, 52.0, 90.0])).friction, [1.0, 1.0, 0.7, 0.4, 0.4])


def test_grade_of_a_hill_is_the_slope_of_its_height():
    road = roads.Hill(5.0, 20.0, 60.0, 30.0, 80.0)
    s = np.linspace(0.0, 220.0, 221)
    values = lambda s: (road.at(s).grade, road.elevation(s), jax.vmap(jax.grad(road.elevation))(s))
    grade, height, slope = (np.asarray(value) for value in jax.jit(values)(s))
    np.testing.assert_allclose(np.tan(grade), slope, atol=1e-14)
    np.testing.assert_allclose(height[[20, 80, 100, 190]], [0.0, 5.0, 5.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(np.max(slope), 1.875 * 5.0 / 60.0, rtol=1e-12)


def test_bank_tilts_within_its_ramp():
    road = roads.Banked(0.1, start=10.0, ramp=40.0)
    np.testing.assert_allclose(road.at(np.array([10.0, 30.0, 50.0, 99.0])).bank, [0.0, 0.05, 0.1, 0.1])


def test_profile_is_its_tables():
    road = roads.Profile([0.0, 10.0, 20.0], [1.0, 0.5, 0.5], grade=[0.0, 0.1, 0.0], bank=0.03, interpolation="linear")
    surface = road.at(np.array([-5.0, 5.0, 10.0, 15.0, 99.0]))
    np.testing.assert_allclose(surface.friction, [1.0, 0.75, 0.5, 0.5, 0.5])
    np.testing.assert_allclose(surface.grade, [0.0, 0.05, 0.1, 0.05, 0.0], atol=1e-15)
    np.testing.assert_array_equal(surface.bank, 0.03)


def test_combined_takes_each_quantity_from_its_road():
    friction, grade, bank = roads.Banked(0.1, friction=0.6), roads.Hill(5.0, friction=0.9), roads.Banked(0.2, 0.0, 10.0)
    both, three = roads.Combined(friction, grade).at(30.0, 1.0), roads.Combined(friction, grade, bank).at(30.0, 1.0)
    assert float(both.friction) == 0.6 and float(both.bank) == 0.0 and float(three.bank) == 0.2
    assert float(both.grade) == float(three.grade) == float(grade.at(30.0).grade) > 0


def drawn(draw, key):
    """Of 4000 keys, by one program."""
    return np.asarray(jax.jit(lambda key: jax.vmap(draw)(jax.random.split(key, 4000)))(key))


def test_random_grade_has_its_spread_and_correlation_over_keys():
    std, length, lags = 0.02, 80.0, np.array([0.0, 20.0, 80.0, 200.0])
    draw = lambda key: (
        roads.RandomRoad(roads.gauss_markov(std, length, key, shortest=1.0, count=40)).at(500.0 + lags).grade
    )
    grade = drawn(draw, jax.random.key(1))
    correlation = np.mean(grade[:, :1] * grade, axis=0) / std**2
    np.testing.assert_allclose(correlation, np.exp(-lags / length), atol=4 * np.sqrt(2 / 4000))


def test_random_road_in_a_band_has_its_spread_along_the_way():
    road = roads.RandomRoad(bank=roads.band(0.02, 100.0, 10.0, jax.random.key(2)))
    bank = np.asarray(jax.jit(lambda s: road.at(s).bank)(np.arange(0.0, 100_000.0, 2.0)))
    np.testing.assert_allclose(np.std(bank), 0.02, rtol=0.02)
    # One-sided density over wavenumbers: all of it between 1 / 100 and 1 / 10.
    power = np.abs(np.fft.rfft(bank)) ** 2
    inside = np.abs(np.fft.rfftfreq(bank.size, 2.0) - 0.055) < 0.0455
    assert power[inside].sum() > 0.99 * power.sum()
    thirds = np.array_split(power[inside], 3)
    np.testing.assert_allclose([part.sum() for part in thirds], power.sum() / 3, rtol=0.1)


def test_random_friction_is_lognormal_about_its_median():
    draw = lambda key: roads.RandomRoad(log_friction=roads.gauss_markov(0.3, 50.0, key), friction=0.5).at(0.0).friction
    friction = drawn(draw, jax.random.key(3))
    np.testing.assert_allclose(np.median(friction), 0.5, rtol=0.03)
    np.testing.assert_allclose(np.std(np.log(friction)), 0.3, rtol=0.05)


def test_a_key_is_a_road():
    grade = lambda key: roads.RandomRoad(roads.gauss_markov(0.02, 80.0, jax.random.key(key))).at(np.arange(9.0)).grade
    np.testing.assert_array_equal(grade(5), grade(5))
    assert not np.allclose(grade(5), grade(6))


def test_roads_by_name_and_from_a_file(tmp_path):
    assert float(roads.named_road("ice").at(3.0).friction) < float(roads.named_road("wet").at(3.0).friction) < 1
    spec = io.RoadSpecification((0.0, 50.0), (1.0, 0.5), 0.05, interpolation="linear")
    io.write_road(spec, tmp_path / "r.toml")
    surface = roads.named_road(tmp_path / "r.toml").at(25.0)
    np.testing.assert_allclose(np.stack(surface), [0.75, 0.05, 0.0, 0.0])
    np.testing.assert_allclose(roads.from_specification(io.RoadSpecification(friction=0.4)).at(-9.0).friction, 0.4)


TWO = [0.0, 1.0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: roads.Level(0.0), r"Level\.friction = 0\.0: must be positive"),
        (lambda: roads.SplitMu(1.0, 0.3, blend=0.0), r"SplitMu\.blend = 0\.0: must be positive and finite \(m\)"),
        (lambda: roads.MuJump(1.0, -0.3, 9.0), r"MuJump\.after = -0\.3"),
        (lambda: roads.Hill(5.0, crest=-1.0), r"Hill\.crest = -1\.0: must be at least 0 m"),
        (lambda: roads.Hill(float("nan")), r"Hill\.height = nan: must be finite"),
        (lambda: roads.Banked(5.0), r"Banked\.bank = 5\.0: must be within a quarter turn.*rad"),
        (lambda: roads.Profile([0.0, 0.0], 1.0), r"Profile\.distance = .*must rise"),
        (lambda: roads.Profile([0.0], 1.0), r"Profile\.distance has the shape \(1,\)"),
        (lambda: roads.Profile(TWO, [1.0, 1.0, 1.0]), r"Profile\.friction has the shape \(3,\).*\(2,\) as distance"),
        (lambda: roads.Profile(TWO, grade=3.0), r"Profile\.grade = 3\.0: must be within a quarter turn"),
        (lambda: roads.Profile(TWO, interpolation="spline"), r"interpolation = 'spline': must be one of 'smooth', 'linear'"),
        (lambda: roads.Combined(roads.Level(), 0.1), r"Combined\.grade = [0-9.]+: must be a road"),
        (lambda: roads.RandomRoad(0.1), r"RandomRoad\.grade = [0-9.]+: must be a Variation"),
        (lambda: roads.Variation(0.1, TWO, [0.0]), r"wavenumbers have the shape \(2,\), phases \(1,\)"),
        (lambda: roads.gauss_markov(0.1, -5.0, jax.random.key(0)), r"length = -5\.0: must be positive"),
        (lambda: roads.band(0.1, 5.0, 9.0, jax.random.key(0)), r"longest = 5\.0: must be above shortest = 9"),
        (lambda: roads.band(0.1, 9.0, 5.0, jax.random.key(0), count=0), r"count = 0: must be a whole number of at least 1"),
        (lambda: roads.named_road("icy"), r"road = 'icy': must be one of level, wet, ice"),
        (lambda: roads.under(roads.Level(), 0.0, 0.0, 0.0, [(1.0, 1.0)]), r"wheels: 1 positions; there must be 4"),
    ],
)  # fmt: skip
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()
