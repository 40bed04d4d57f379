"""The review chapter by chapter: its cars and scenarios, what a drive is scored by, the conclusions' ratios; whole in the full
run."""

import functools
import re
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import estimators
from jaxveh.experiments.sideslip_review import chapters
from jaxveh.experiments.sideslip_review.chapters import conclusions, fleet, fleet_drives, racing, scenarios
from jaxveh.experiments.sideslip_review.chapters.chapter_figures import error_ratios

TIME = np.arange(0.0, 20.0, racing.STEP)


def scored(mean, truth, known=True, held=True, std=np.nan):
    one = lambda value: jnp.broadcast_to(jnp.asarray(value), TIME.shape)
    found = jax.jit(racing.metrics)(one(mean), one(std), one(known), one(truth), one(held))
    return {name: float(value) for name, value in found.items()}


def test_every_quantity_of_the_library_has_its_chapter_and_every_chapter_its_quantities():
    there = {name for name in estimators.__all__ if hasattr(getattr(estimators, name), "METHODS")}
    assert set(racing.quantities()) == there


def test_an_error_is_scored_from_the_warm_up_until_the_car_is_lost():
    error = np.where(TIME < racing.WARM_UP, 9.0, np.where(TIME < 10.0, 1.0, np.where(TIME < 15.0, 2.0, 7.0)))
    held = TIME < 15.0
    found = scored(error, 0.0, TIME >= 10.0, held)
    assert found["early"] == pytest.approx(1.0) and found["late"] == pytest.approx(2.0)
    assert found["rmse"] == pytest.approx(np.sqrt(2.5)) and found["rmse_known"] == pytest.approx(2.0)
    assert found["worst"] == 2.0 and found["known"] == pytest.approx(0.5) and found["failed"] == 0.0
    assert scored(np.where(TIME == 7.0, np.nan, error), 0.0, held=held)["failed"] == 1.0
    assert scored(np.where(TIME == 17.0, np.nan, error), 0.0, held=held)["failed"] == 0.0


@pytest.mark.parametrize("channel", ["sideslip", "roll"])
def test_a_car_that_spins_or_tips_over_is_lost_to_the_end(channel):
    drives = {f"true.{name}": np.zeros((2, 1, TIME.size)) for name in ("sideslip", "roll")}
    drives[f"true.{channel}"][1, 0, 700:720] = -1.1 * racing.LOST
    held = np.asarray(racing.held_rows(drives))
    assert held[0].all() and held[1, 0, :700].all() and not held[1, 0, 700:].any()


def test_a_claimed_spread_is_scored_where_the_method_says_that_it_knows():
    error = np.where(TIME < 10.0, 6.0, 2.0)
    assert scored(error, 0.0, TIME >= 10.0, std=0.5)["nees"] == pytest.approx(16.0)
    assert scored(error, 0.0, std=np.where(TIME < 10.0, np.nan, 1.0))["nees"] == pytest.approx(4.0)
    assert np.isnan(scored(error, 0.0)["nees"])


def test_what_follows_late_is_late_by_as_much():
    wave = lambda t: np.sin(1.3 * t) + 0.4 * np.sin(3.7 * t)
    assert scored(wave(TIME - 0.25) + 3.0, wave(TIME))["delay"] == pytest.approx(0.25, abs=racing.STEP)
    assert scored(wave(TIME + 0.1), wave(TIME))["delay"] == pytest.approx(-0.1, abs=racing.STEP)


def test_files_say_every_number_that_the_methods_ask_for_or_the_reason_stands_in_the_table():
    told = fleet.told_cars()
    assert len(told) == len(fleet.CARS) == 3
    asked = {
        key
        for module in racing.quantities().values()
        for one in module.METHODS.values()
        for key in estimators.kit.keys_asked(one)
    }
    assert not {key for key in asked if getattr(told[0], key) is None} - {"antenna_position", "camera_delay"}
    for index, (_name, one) in enumerate(scenarios.SCENARIOS.items()):
        looked = scenarios.scenario_at(index)
        np.testing.assert_allclose([float(value) for value in looked], [float(value) for value in one])


def raced(errors):
    """Of two seeds, by method's key: the same error in every scenario, one a seed."""
    count = len(scenarios.SCENARIOS)
    found = {key: {"rmse": np.tile(np.asarray(values, float), (count, 1))} for key, values in errors.items()}
    return chapters.ChaptersRaced({}, found, {}, {})


def test_a_road_that_rolls_and_pitches_is_felt_and_the_roll_is_that_against_the_horizon():
    time = jnp.arange(0.0, 10.0, 0.01)
    none = 0.0 * time
    bank, grade = 0.05 * jnp.sin(time), 0.04 * jnp.sin(0.7 * time + 1.0)
    inner = slice(2, -2)
    roll_rate, pitch_rate = jax.jit(fleet_drives.road_rates)(none, bank, none, time)
    np.testing.assert_allclose(roll_rate[inner], 0.05 * np.cos(time)[inner], atol=1e-6)
    np.testing.assert_allclose(pitch_rate[inner], 0.0, atol=1e-4)
    # Nose up is a negative pitch.
    roll_rate, pitch_rate = jax.jit(fleet_drives.road_rates)(grade, none, none, time)
    np.testing.assert_allclose(pitch_rate[inner], -0.028 * np.cos(0.7 * time + 1.0)[inner], atol=1e-6)
    np.testing.assert_allclose(roll_rate[inner], 0.0, atol=1e-4)
    # On a slope that does not move a car that turns rolls and pitches by what its heading makes of it.
    yaw = 0.2 * time
    slope = 0.06
    roll_rate, pitch_rate = jax.jit(fleet_drives.road_rates)(
        jnp.arctan(slope * jnp.cos(yaw)), jnp.arctan(-slope * jnp.sin(yaw)), yaw, time
    )
    np.testing.assert_allclose(jnp.stack([roll_rate, pitch_rate])[:, inner], 0.0, atol=1e-3)
    roll = fleet_drives.roll_of_horizon(0.0, jnp.asarray(0.1), jnp.asarray(0.03), jnp.asarray(0.0))
    np.testing.assert_allclose(roll, 0.13, rtol=1e-9)


def test_a_stiffness_is_the_slope_at_little_slip():
    slip = jnp.linspace(-0.1, 0.1, 2001)
    np.testing.assert_allclose(fleet_drives.slope_at_zero(8e4 * slip, slip), 8e4)
    bent = fleet_drives.slope_at_zero(8e4 * slip * (1.0 - 10.0 * jnp.abs(slip)), slip)
    np.testing.assert_allclose(bent, 8e4 * (1.0 - 7.5 * fleet_drives.SMALL), rtol=2e-2)


def test_a_conclusion_is_a_ratio_of_errors_on_the_same_seeds():
    one = conclusions.CONCLUSIONS[0]
    found = conclusions.ratio(raced({one.follows: [1.0, 2.0, 3.0], one.does_not: [2.0, 4.0, 6.0]}), one)
    assert found.value == pytest.approx(0.5) and found.low == pytest.approx(0.5)
    table = chapters.conclusion_table(raced({one.follows: [1.0, 2.0], one.does_not: [2.0, 4.0]}))
    assert len(table.rows) == len(conclusions.CONCLUSIONS)
    assert table.rows[0][-1] == "supports" and table.rows[-1][-1] == "not raced"
    assert {one.number for one in conclusions.CONCLUSIONS} == {1, 2, 3, 4}
    for one in conclusions.CONCLUSIONS:
        for quantity, method, shown in (one.follows, one.does_not):
            module = getattr(estimators, quantity)
            assert method in module.METHODS and shown in module.SHOWN


def test_a_chapter_is_drawn_as_errors_over_those_of_doing_nothing():
    found = raced({("sideslip", "ekf", "sideslip"): [1.0, 3.0], ("speed", "weighted", "v_x"): [2.0, 2.0]})
    nothing = {
        key: {"rmse": np.full((len(scenarios.SCENARIOS), 2), 4.0)}
        for key in (("sideslip", "sideslip"), ("speed", "v_x"))
    }
    nothing["sideslip", "sideslip"]["rmse"][1] = [np.nan, 4.0]
    found = found._replace(nothing=nothing)
    labels, ratios = error_ratios(found, ("sideslip",))
    assert labels == ["sideslip: ekf"] and ratios.shape == (1, len(scenarios.SCENARIOS))
    assert ratios[0, 0] == pytest.approx(0.5) and ratios[0, 1] == pytest.approx(0.75)
    figures = chapters.chapter_figures(found)
    assert set(figures) == {"chapter_lateral_velocity", "chapter_longitudinal_speed"}
    for name, figure in figures.items():
        figure.draw_without_rendering()
        for axes in figure.axes:
            box = axes.get_tightbbox()
            assert box.y0 >= 0 and box.y1 <= figure.bbox.height and box.x1 <= figure.bbox.width, name


@pytest.mark.full
def test_every_method_is_raced_on_drives_that_are_driven():
    drives = chapters.chapter_drives(2, jax.random.key(0), duration=20.0)
    names = list(scenarios.SCENARIOS)
    braked = drives["true.v_x"][names.index("ABS")]
    assert (braked[:, -1] < braked[:, 900] - 8.0).all()
    found = chapters.race_methods(drives, 2, jax.random.key(1))
    assert {key[:2] for key in found.found} | set(found.left_out) == {
        (quantity, method) for quantity, module in racing.quantities().items() for method in module.METHODS
    }
    for table in (*chapters.chapter_tables(found), chapters.conclusion_table(found)):
        assert table.rows and all(len(row) == len(table.columns) for row in table.rows)


def test_the_scores_of_methods_with_as_many_quantities_are_one_program(monkeypatch):
    """Of any two methods, whatever channels they read."""
    there = ["true.sideslip", "true.v_y", "true.v_x", "true.roll", "true.roll_rate", "true.bank", "true.friction"]
    drives = {name: np.zeros((2, 3, 700)) for name in (*racing.channels_kept(), *there)} | {
        "car": np.zeros((2, 3), int)
    }
    texts = {}
    for shown in (["sideslip"], ["v_x"], ["bank"], ["friction"], ["sideslip", "v_y"], ["roll", "roll_rate"]):
        module = types.SimpleNamespace(SHOWN=dict.fromkeys(shown, "-"))
        data = jax.tree.map(lambda one: one[0, 0], racing._data(module, types.SimpleNamespace(needs=()), drives))
        said = {f"{part}.{name}": data["true.v_x"] for part in ("mean", "std") for name in shown}
        said |= {f"known.{name}": data["held"] for name in shown}
        score = functools.partial(racing._score, shown)
        texts[tuple(shown)] = jax.jit(score).lower(said, data).as_text()
    programs = {}
    for shown, text in texts.items():
        programs.setdefault(len(shown), set()).add(re.sub(r'jax.result_info = "[^"]*"', "", text))
    assert {count: len(some) for count, some in programs.items()} == {1: 1, 2: 1}
