"""Fits to rig data: the truth is found within its errors, and each setting does what it says."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from rig_sweeps import brush, measured_of, peak, small_plan, table

from jaxveh import fitting, tyres
from jaxveh._core.errors import FilterError, InputError
from jaxveh.fitting.rig_data import RigData, Settings, fold_of
from jaxveh.fitting.rig_in_turn import MANY, SOME, some_rows
from jaxveh.fitting.rig_problem import contact_of
from jaxveh.fitting.rig_stages import Stage

CHANNELS = ("F_x", "F_y", "M_z")
COLUMNS, RUN = small_plan()


@pytest.fixture(scope="module")
def clean():
    return measured_of(brush(), COLUMNS, CHANNELS)


def rig(clean, noise=0.02, seed=1, **changed):
    return table({**clean, **changed}, COLUMNS, RUN, noise, seed)


def start():
    return tyres.Brush(jnp.asarray(5e4), jnp.asarray(5e4), jnp.asarray(0.7), jnp.asarray(0.04))


TRUE = np.array([9e4, 7e4, 0.95, 0.06])


def test_without_noise_the_truth_comes_back(clean):
    fit = fitting.fit_rig(start(), rig(clean, noise=0.0))
    assert fit.names == ("slip_stiffness", "cornering_stiffness", "friction", "half_length")
    np.testing.assert_allclose(fit.parameters.array(), TRUE, rtol=1e-5)
    assert fit.tyre.friction == fit.parameters.array()[2]
    assert all(fit.rmse[name] < 1e-4 * fit.peak[name] < 0.05 * fit.start_rmse[name] for name in CHANNELS)
    assert fit.identified == 4 and fit.stages[-1].converged


def test_standard_errors_cover(clean):
    """200 repetitions: of nominally 95 % intervals, 90 to 98 % hold the truth."""
    fits = [fitting.fit_rig(start(), rig(clean, seed=seed)) for seed in range(200)]
    held = np.array([np.abs(fit.parameters.array() - TRUE) < 1.96 * fit.parameters_std.array() for fit in fits])
    assert np.all((held.mean(axis=0) > 0.90) & (held.mean(axis=0) < 0.99))
    assert 0.92 < held.mean() < 0.98
    # And they are no larger than they have to be.
    spread = np.std([fit.parameters.array() for fit in fits], axis=0)
    np.testing.assert_allclose(np.mean([fit.parameters_std.array() for fit in fits], axis=0), spread, rtol=0.2)


def test_residuals_and_noise_are_those_of_the_data(clean):
    data = rig(clean)
    fit = fitting.fit_rig(start(), data)
    found = measured_of(fit.tyre, COLUMNS, CHANNELS)
    for name in CHANNELS:
        np.testing.assert_allclose(fit.residuals[name], found[name] - getattr(data, name), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(fit.rmse[name], np.sqrt(np.mean(fit.residuals[name] ** 2)), rtol=1e-12)
        np.testing.assert_allclose(fit.noise[name], 0.02 * peak(clean[name]), rtol=0.15)


def test_missing_measurements_are_left_out(clean):
    gone = np.random.default_rng(3).random(RUN.size) < 0.4
    fit = lambda force: fitting.fit_rig(start(), rig(clean, F_y=force), measured=("F_y",))
    with_gaps, whole = fit(np.where(gone, np.nan, clean["F_y"])), fit(clean["F_y"])
    assert np.array_equal(np.isnan(with_gaps.residuals["F_y"]), gone)
    assert 1.15 < with_gaps.parameters_std.array()[1] / whole.parameters_std.array()[1] < 1.45
    np.testing.assert_allclose(with_gaps.parameters.array()[1:3], TRUE[1:3], rtol=0.03)


def test_outliers_count_little_where_a_fit_is_robust(clean):
    wrong = np.random.default_rng(4).random(RUN.size) < 0.1
    data = rig(clean, F_y=np.where(wrong, 0.1, 1.0) * clean["F_y"])
    error = lambda fit: np.abs(fit.parameters.array()[1:3] / TRUE[1:3] - 1).max()
    plain, robust = (fitting.fit_rig(start(), data, measured=("F_y",), robust=robust) for robust in (False, True))
    assert 3 * error(robust) < error(plain) and error(robust) < 0.02


def test_weights_move_the_compromise(clean):
    """Both directions cannot be met by one friction: the weight says which one is."""
    data = rig(clean, noise=0.01, F_x=1.1 * clean["F_x"])
    rmse = lambda **weights: fitting.fit_rig(start(), data, weights=weights, throw=False).rmse
    along, across = rmse(F_x=1e4), rmse(F_y=1e4)
    assert along["F_x"] < 0.9 * across["F_x"] and across["F_y"] < 0.9 * along["F_y"]


def test_weights_do_not_make_data_better(clean):
    """Standard errors cover what weights do to the fit; they do not take them for knowledge."""
    weights = {"F_y": 25.0}
    plain = fitting.fit_rig(start(), rig(clean))
    fits = [fitting.fit_rig(start(), rig(clean, seed=seed), weights=weights) for seed in range(40)]
    assert np.all(fits[0].parameters_std.array() > 0.9 * plain.parameters_std.array())
    assert fits[0].identified == plain.identified
    spread = np.std([fit.parameters.array() for fit in fits], axis=0)
    np.testing.assert_allclose(np.mean([fit.parameters_std.array() for fit in fits], axis=0), spread, rtol=0.3)


def test_weights_leave_unknown_what_the_data_do_not_show(clean):
    fit = fitting.fit_rig(start(), rig(clean), measured=("F_y",), weights={"F_y": 4.0}, throw=False)
    assert np.isnan(fit.parameters_std.array()[3]) and fit.identified == 3


def test_a_speed_of_zero_throughout_was_not_told(clean):
    columns = COLUMNS.copy()
    columns[4] = 0.0
    silent = contact_of(table(clean, columns))
    assert silent.speed is None and contact_of(table(clean, COLUMNS)).speed is not None


def test_a_start_without_finite_forces_is_named(clean):
    with pytest.raises(InputError, match=r"F_x is not finite in row 0 of rig table: start from another tyre"):
        fitting.fit_rig(Nowhere(*start().__dict__.values()), rig(clean))


class Nowhere(tyres.Brush):
    def forces(self, contact, state=None):
        found = super().forces(contact)
        return found._replace(F_x=found.F_x * jnp.nan)


def test_bounds_hold(clean):
    fit = fitting.fit_rig(start(), rig(clean), bounds={"friction": (0.5, 0.9)}, throw=False)
    assert 0.88 < fit.parameters.array()[2] < 0.9
    inside = fitting.fit_rig(start(), rig(clean), bounds={"friction": (0.5, 1.5)})
    free = fitting.fit_rig(start(), rig(clean))
    np.testing.assert_allclose(inside.parameters.array(), free.parameters.array(), rtol=1e-4)
    np.testing.assert_allclose(inside.parameters_std.array(), free.parameters_std.array(), rtol=1e-2)


def test_where_picks_what_is_fitted(clean):
    fit = fitting.fit_rig(start(), rig(clean), where=lambda tyre: (tyre.friction, tyre.cornering_stiffness))
    assert fit.names == ("friction", "cornering_stiffness")
    assert fit.tyre.slip_stiffness == 5e4 and fit.tyre.half_length == 0.04


def test_measured_says_which_channels_count(clean):
    fit = fitting.fit_rig(start(), rig(clean), measured=("F_y",), throw=False)
    assert set(fit.rmse) == {"F_y"}
    # The lateral force shows neither the trail nor much of the slip stiffness.
    assert np.isnan(fit.parameters_std.array()[3]) and fit.identified == 3
    np.testing.assert_allclose(fit.tyre.half_length, 0.04, rtol=1e-9)


def test_cross_validation_is_worse_than_the_fit_and_better_than_the_start(clean):
    fit = fitting.fit_rig(start(), rig(clean), folds=3)
    share = lambda rmse: np.sum([(rmse[name] / fit.noise[name]) ** 2 for name in CHANNELS])
    assert share(fit.rmse) < share(fit.cross_validation) < 1.1 * share(fit.rmse) < share(fit.start_rmse)
    assert np.isnan(list(fitting.fit_rig(start(), rig(clean)).cross_validation.values())).all()


def test_a_long_table_is_fitted_in_some_of_its_rows_and_then_in_all():
    columns, run = small_plan(points=1500)
    data = table(measured_of(brush(), columns, CHANNELS), columns, run, 0.02, 1)
    assert MANY < data.load.size < 2 * MANY
    fit = fitting.fit_rig(start(), data)
    some, everything = fit.stages
    assert some.rows == SOME and everything.rows == data.load.size
    # The end is that of all rows at once, and each standard error that of all.
    once = fitting.fit_rig(fit.tyre, data, staged=False)
    std = fit.parameters_std.array()
    np.testing.assert_allclose(fit.parameters.array(), once.parameters.array(), atol=1e-2 * std.min(), rtol=1e-6)
    assert np.all(np.abs(fit.parameters.array() - TRUE) < 4.0 * std)
    # No row is preferred: whatever repeats in the table, the rows drawn have their share of it.
    drawn = np.bincount(run[some_rows_of(data)], minlength=run.max() + 1)
    assert 0.6 * SOME / len(drawn) < drawn.min() <= drawn.max() < 1.4 * SOME / len(drawn)


def some_rows_of(data):
    """The rows in which a fit of a long table begins."""
    parts = RigData(data, contact_of(data), CHANNELS, ("friction",), Settings({}, {}, False, 1, 1e-6))
    return some_rows(parts, [Stage("joint", CHANNELS, ("friction",), np.ones(data.load.shape, bool))])


def test_folds_are_whole_runs_or_blocks(clean):
    with_runs = fold_of(rig(clean), 3)
    assert set(with_runs) == {0, 1, 2}
    assert all(len(set(with_runs[run == RUN])) == 1 for run in np.unique(RUN))
    blocks = fold_of(table(clean, COLUMNS), 3)
    assert set(blocks) == {0, 1, 2} and np.count_nonzero(np.diff(blocks)) == 11


def test_progress_comes_to_its_end(clean):
    told = []
    fitting.fit_rig(start(), rig(clean), folds=2, progress=lambda done, total, stage: told.append((done, total, stage)))
    assert [done for done, *_ in told] == [0, 1, 2, 3]
    assert {total for _, total, _ in told} == {3} and told[1][2] == "cross-validation"


TRACES = []


class Counted(tyres.Brush):
    def forces(self, contact, state=None):
        TRACES.append(contact)
        return super().forces(contact, state)


def test_a_second_fit_compiles_nothing(clean):
    law = Counted(*start().__dict__.values())
    fitting.fit_rig(law, rig(clean), folds=2)
    once = len(TRACES)
    fitting.fit_rig(law, rig(clean, seed=2), folds=2)
    # What the law offers is asked anew, without compiling.
    assert len(TRACES) <= once + 1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (dict(measured=("F_z",)), "measured = 'F_z': must be one of 'F_x'"),
        (dict(measured=("M_x",)), "measured: M_x is not in rig table; there are: F_x, F_y, M_z"),
        (dict(weights={"M_y": 2.0}), "weights: .*M_y"),
        (dict(weights={"F_y": -1.0}), r"weights\['F_y'\] = -1.0: must be positive"),
        (dict(bounds={"grip": (0.0, 1.0)}), "bounds: .*grip"),
        (dict(bounds={"friction": (0.8, 1.0)}), r"bounds\['friction'\] = \(0.8, 1\): the start 0.7 must lie inside"),
        (dict(folds=1), "folds = 1: must be at least 2"),
        (dict(max_steps=0), "max_steps = 0: must be at least 1"),
        (dict(where=lambda tyre: tyre.grip), "where: .*grip"),
    ],
)
def test_bad_settings_are_named(clean, settings, message):
    with pytest.raises(InputError, match=message):
        fitting.fit_rig(start(), rig(clean), **settings)


def test_too_few_rows_and_empty_channels_are_named(clean):
    few = rig(clean).take(np.array([0]))
    with pytest.raises(InputError, match="measurements for 4 coefficients = 3: must be at least 5"):
        fitting.fit_rig(start(), few)
    with pytest.raises(InputError, match="largest M_z = nan"):
        fitting.fit_rig(start(), dataclasses.replace(rig(clean), M_z=np.full(RUN.size, np.nan)))
    with pytest.raises(InputError, match="rig table has M_x, Brush F_x, F_y, M_z: nothing in common"):
        fitting.fit_rig(start(), table({"M_x": clean["F_x"]}, COLUMNS))


def test_a_fit_that_stops_short_says_so(clean):
    with pytest.raises(FilterError, match="stopped after 2 steps; throw=False"):
        fitting.fit_rig(start(), rig(clean), max_steps=2)
    fit = fitting.fit_rig(start(), rig(clean), max_steps=2, throw=False)
    assert not fit.stages[-1].converged
