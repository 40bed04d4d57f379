"""Sideslip from logs: cleaning, a car with known parameters, the real log."""

import dataclasses
import functools
import types
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shared_data import shared

from jaxveh import InputError, Recording, estimators, filters, io, sensors, vehicles
from jaxveh._core.parameter import pick
from jaxveh.cli.sideslip import untold_in_words
from jaxveh.estimators import parameter_bands
from jaxveh.estimators.cleaning import FORCE_CUTOFF
from jaxveh.estimators.rear_axle_prior import car_of

CAR = io.CarSpecification(
    mass=1420.0, yaw_inertia=2124.0, front_axle_to_cg=0.96, rear_axle_to_cg=1.59,
    front_cornering_stiffness=88000.0, rear_cornering_stiffness=127000.0, cg_height=0.5,
)  # fmt: skip


ROWS = 3000


def log(rows=ROWS):
    """The first rows of a drive on a winding road."""
    return drive().rows(slice(0, rows))


@functools.cache
def drive():
    """A car on a winding road that follows the linear single track at modest lateral acceleration, 100 Hz."""
    rows, rng = ROWS, np.random.default_rng(0)
    time = np.arange(rows) * 0.01
    steer = 0.02 * np.sin(2 * np.pi * 0.4 * time) + 0.01 * np.sin(2 * np.pi * 0.17 * time + 1.0)
    v_x = np.full(rows, 20.0)
    recording = Recording(time, {"steer": steer, "v_x": v_x})
    truth = estimators.open_loop(vehicles.from_specification(CAR), recording)
    yaw_rate, v_y = truth["yaw_rate"], truth["v_y"]
    a_y = np.gradient(v_y, time) + v_x * yaw_rate
    return recording.replace(
        a_x=np.zeros(rows), v_y=v_y,
        yaw_rate=yaw_rate + 0.002 * rng.standard_normal(rows), a_y=a_y + 0.1 * rng.standard_normal(rows),
    )  # fmt: skip


BALANCE = "slip_balance"


def missing(cleaned):
    return np.flatnonzero(np.isnan(np.asarray(cleaned[BALANCE]))).tolist()


def test_clean_leaves_spikes_and_repeats_out_and_looks_back_only():
    recording = log(500)
    yaw_rate, a_y = (np.array(recording[name]) for name in ("yaw_rate", "a_y"))
    a_y[200], yaw_rate[250] = a_y[200] + 20.0, yaw_rate[250] + 2.0
    yaw_rate[301], a_y[301] = yaw_rate[300], a_y[300]
    a_y[401] = a_y[400]
    cleaned = estimators.clean(recording.replace(yaw_rate=yaw_rate, a_y=a_y))
    # The first row has no row before it.
    assert missing(cleaned) == [0, 200, 250, 301]
    assert float(cleaned["a_y"][200]) == a_y[199]
    longer = estimators.clean(recording)
    shorter = estimators.clean(recording.rows(slice(0, 100)))
    for name in ("a_x", "yaw_rate_smooth", "a_y_smooth", "a_y_lead", "turning_lead"):
        np.testing.assert_array_equal(np.asarray(longer[name])[:100], np.asarray(shorter[name]))


def test_a_channel_that_is_nothing_but_noise_has_no_spikes():
    recording, rng = log(1000), np.random.default_rng(1)
    noisy = np.asarray(recording["a_y"]) + 6.0 * rng.normal(size=1000)
    assert len(missing(estimators.clean(recording.replace(a_y=noisy)))) < 20


def test_a_step_is_believed_after_a_while_and_a_stuck_channel_is_missing():
    recording = log(1000)
    stepped = np.asarray(recording["a_y"]) + np.where(np.arange(1000) < 500, 0.0, 12.0)
    cleaned = estimators.clean(recording.replace(a_y=stepped))
    assert np.asarray(cleaned["a_y"])[500] == stepped[499]
    assert np.asarray(cleaned["a_y"])[-1] == stepped[-1]
    assert set(missing(cleaned)) <= {0, *range(500, 512)}
    stuck = np.asarray(recording["a_y"]).copy()
    stuck[300:600] = stuck[300]
    lost = missing(estimators.clean(recording.replace(a_y=stuck)))
    assert set(range(355, 600)) <= set(lost) and max(lost) < 605


def test_the_low_pass_costs_no_delay():
    """What was felt since the low-passed rows is what v_y is ahead of its own low-pass."""
    recording = log(1500)
    v_y = np.asarray(recording["v_y"])
    yaw_rate = estimators.open_loop(vehicles.from_specification(CAR), recording)["yaw_rate"]
    exact = recording.replace(a_y=np.gradient(v_y, 0.01) + 20.0 * yaw_rate, yaw_rate=yaw_rate)
    cleaned = estimators.clean(exact)
    ahead = np.asarray(cleaned["a_y_lead"]) - np.asarray(cleaned["turning_lead"])
    behind = np.asarray(sensors.low_pass(recording, ["v_y"], FORCE_CUTOFF)["v_y"])
    np.testing.assert_allclose(ahead[500:], (v_y - behind)[500:], atol=0.03 * np.std(v_y))


def test_missing_channels_and_gaps_are_named():
    with pytest.raises(InputError, match="yaw_rate"):
        estimators.clean(log(100).without("yaw_rate"))
    with pytest.raises(InputError, match=r"v_x is NaN in 1 rows.*fill"):
        estimators.clean(log(100).replace(v_x=np.append(np.full(99, 20.0), np.nan)))


def test_without_an_accelerometer_it_estimates_and_calibrates_nothing():
    recording = log()
    told = estimators.sideslip.estimate(CAR, recording.select(["v_x", "yaw_rate"]))
    numbers = estimators.sideslip.score(CAR, told, recording)
    assert numbers["sideslip_rmse_deg"] < 0.3
    seen = estimators.clean(recording.select(["v_x", "yaw_rate"]))
    # Nothing is measured: every turn is taken to be steady.
    assert not np.asarray(seen["felt"]).any() and not np.isfinite(np.asarray(seen["slip_balance"])).any()
    for less in (recording.without("a_y"), recording.replace(a_y=np.full(ROWS, np.nan))):
        with pytest.raises(InputError, match="a_y .* is missing from the log: without an accelerometer no tyre"):
            estimators.sideslip.calibrate(CAR, less)


def test_a_short_span_and_an_unknown_reference_are_refused():
    with pytest.raises(InputError, match="at least 5 s"):
        estimators.sideslip.calibrate(CAR, log(400))
    with pytest.raises(InputError, match="uses"):
        estimators.sideslip.calibrate(CAR, log(), uses=("course",))


def test_a_reference_is_compared_and_supervises_where_the_file_says_that_it_is_measured(monkeypatch):
    recording, ahead = log(), 1.5
    elsewhere = recording.replace(v_y=np.asarray(recording["v_y"]) + ahead * np.asarray(recording["yaw_rate"]))
    told = dataclasses.replace(CAR, reference_position=(ahead, 0.0, 0.0))
    found = estimators.sideslip.estimate(CAR, recording.without("v_y"))
    here, there = estimators.sideslip.score(CAR, found, recording), estimators.sideslip.score(told, found, elsewhere)
    for name in ("v_y_rmse", "v_y_worst", "v_y_coverage_95", "rows"):
        np.testing.assert_allclose(there[name], here[name], rtol=1e-9)
    # What is left is the noise of the yaw rate that the reference was moved by.
    assert there["open_loop_sideslip_rmse_deg"] < 0.02
    assert estimators.sideslip.score(CAR, found, elsewhere)["open_loop_sideslip_rmse_deg"] > 0.2
    moved = estimators.sideslip.at_centre(told, elsewhere)
    np.testing.assert_allclose(moved["v_y"], recording["v_y"], atol=1e-12)
    seen = []
    monkeypatch.setattr(estimators.sideslip, "coarse_logs", lambda logs, wheelbase: seen.extend(logs) or 1 / 0)
    for name, uses in (("v_y", ("v_y",)), ("sideslip", ("sideslip",))):
        reference = {"sideslip": np.arctan2(elsewhere["v_y"], elsewhere["v_x"])} if name == "sideslip" else {}
        with pytest.raises(ZeroDivisionError):
            estimators.sideslip.calibrate(told, elsewhere.replace(**reference), uses=uses)
        np.testing.assert_allclose(seen.pop()["v_y"], recording["v_y"], atol=1e-9)


def test_estimates_the_sideslip_of_a_car_as_told_and_scores_it():
    recording = log()
    found = estimators.sideslip.estimate(CAR, recording.without("v_y"))
    numbers = estimators.sideslip.score(CAR, found, recording)
    assert numbers["rows"] == 3000
    assert numbers["open_loop_sideslip_rmse_deg"] < 1e-6
    assert numbers["sideslip_rmse_deg"] < 0.15
    assert 0.5 < numbers["sideslip_coverage_95"] <= 1.0
    # The score counts what it is told: shifting the reference by one degree is one degree of error.
    off = recording.replace(v_y=np.asarray(recording["v_y"]) - np.radians(1.0) * 20.0)
    assert estimators.sideslip.score(CAR, found, off)["sideslip_rmse_deg"] == pytest.approx(1.0, abs=0.15)


def test_slow_rows_are_not_scored():
    recording = log(1500)
    v_x = np.where(np.arange(1500) < 600, 2.0, 20.0)
    slow = recording.replace(v_x=v_x, v_y=np.where(v_x < 3.0, 1.0, np.asarray(recording["v_y"])))
    found = estimators.sideslip.estimate(CAR, slow.without("v_y"))
    score = lambda **more: estimators.sideslip.score(CAR, found, slow, **more)
    numbers = score()
    assert (numbers["rows"], numbers["least_speed"]) == (900, 3.0)
    assert score(least_speed=1.0)["rows"] == 1500
    small = dataclasses.replace(CAR, front_axle_to_cg=0.15, rear_axle_to_cg=0.18)
    assert estimators.sideslip.least_speed_of(small) == 0.5
    with pytest.raises(InputError, match="speed of at least 30 m/s"):
        score(least_speed=30.0)


def test_the_reference_cannot_reach_a_blind_estimate():
    recording = log()
    found = estimators.sideslip.estimate(CAR, recording)
    blind = estimators.sideslip.estimate(CAR, recording.without("v_y"))
    np.testing.assert_array_equal(np.asarray(found.mean.sideslip), np.asarray(blind.mean.sideslip))


@pytest.mark.parametrize(("log", "begin", "measured", "open_loop"), [
    ("ferrari_250lm", 13750, 0.329, 0.302), ("ferrari_250lm", 16750, 0.267, 0.675), ("genesis", 16129, 0.217, 0.328),
])  # fmt: skip
def test_real_logs_at_the_files_word_as_near_as_they_were_measured(log, begin, measured, open_loop):
    """Half a minute of each: sideslip RMSE without its constant part, degrees, as measured, and 3 % for another rounding.

    At its file's word an estimate can be worse than the open loop: the file's stiffness is a guess, and so are the sensors. A
    bound far above what was measured would hide it.
    """
    recording, car = io.read_recording(shared(f"{log}_100hz.csv")), io.read_car(shared(f"{log}.toml"))
    span = recording.rows(slice(begin, begin + 3000))
    found = estimators.sideslip.estimate(car, span.without("v_y"))
    numbers = estimators.sideslip.score(car, found, span)
    assert numbers["open_loop_sideslip_rmse_without_constant_deg"] == pytest.approx(open_loop, rel=0.03)
    assert numbers["sideslip_rmse_without_constant_deg"] <= 1.03 * measured


@pytest.mark.xfail(
    strict=True, reason="a model of the rear axle alone trusts a guessed stiffness more than a whole car does"
)
@pytest.mark.parametrize(("log", "begin", "measured", "open_loop"), [
    ("ferrari_250lm", 13750, 0.1816, 0.3047), ("ferrari_250lm", 16750, 0.2364, 0.6899),
    ("genesis", 16129, 0.4819, 0.4752),
])  # fmt: skip
def test_real_logs_at_the_files_word_are_as_near_as_the_handling_model_was(log, begin, measured, open_loop):
    """The criterion of the model before this one: RMSE as measured, degrees. It stands until it holds."""
    recording, car = io.read_recording(shared(f"{log}_100hz.csv")), io.read_car(shared(f"{log}.toml"))
    span = recording.rows(slice(begin, begin + 3000))
    found = estimators.sideslip.estimate(car, span.select(["steer", "v_x", "a_x", "a_y", "yaw_rate"]))
    numbers = estimators.sideslip.score(car, found, span)
    assert numbers["open_loop_sideslip_rmse_deg"] == pytest.approx(open_loop, rel=0.03)
    assert numbers["sideslip_rmse_deg"] <= 1.03 * measured


def real_log():
    recording = io.read_recording(shared("ferrari_250lm_100hz.csv"))
    return (
        recording.rows(slice(0, 13750)),
        recording.rows(slice(13750, None)),
        io.read_car(shared("ferrari_250lm.toml")),
    )


@pytest.mark.full
def test_real_log_taken_at_its_word():
    _, rest, car = real_log()
    found = estimators.sideslip.estimate(car, rest.select(["steer", "v_x", "a_x", "a_y", "yaw_rate"]))
    numbers = estimators.sideslip.score(car, found, rest)
    assert numbers["open_loop_sideslip_rmse_deg"] == pytest.approx(0.605, abs=0.005)
    assert numbers["sideslip_rmse_deg"] <= 0.305  # 0.296 measured


@pytest.mark.full
def test_real_log_calibrated_with_the_reference():
    first, rest, car = real_log()
    calibration = estimators.sideslip.calibrate(car, first, uses=("v_y",))
    blind = rest.select(["steer", "v_x", "a_x", "a_y", "yaw_rate"])
    numbers = estimators.sideslip.score(car, estimators.sideslip.estimate(calibration, blind), rest)
    assert numbers["sideslip_rmse_deg"] <= 0.26  # 0.184 measured
    assert [weight for weight, _ in calibration.validation] == [None, 0.05, 0.02]
    fitted = estimators.sideslip.fitted_car(calibration, car, recording=first)
    assert fitted.rear.nominal_load == pytest.approx(982 * 9.80665 * 1.33 / 2.40, rel=1e-6)


CALIBRATED = {
    ("ferrari_250lm", "forward"): (0.165, 0.605), ("ferrari_250lm", "reversed"): (0.272, 0.412),
    ("genesis", "forward"): (0.119, 0.264), ("genesis", "reversed"): (0.203, 0.286),
    ("f1tenth", "forward"): (3.86, 10.83), ("f1tenth", "reversed"): (3.27, 11.43),
}  # fmt: skip
"""By log and direction: RMSE of the half that was not calibrated on, and of the open loop, degrees; of the Genesis, whose
reference is turned by half a degree, without the constant part."""

IN_CI = ("ferrari_250lm", "forward")
"""The one that is `thorough`; the others are left to the full run."""


@pytest.mark.parametrize(
    ("log", "direction"),
    [pytest.param(*case, marks=pytest.mark.studies if case == IN_CI else pytest.mark.full) for case in CALIBRATED],
)
def test_real_logs_calibrated_blind_on_the_other_half(log, direction):
    recording, car = io.read_recording(shared(f"{log}_100hz.csv")), io.read_car(shared(f"{log}.toml"))
    middle = 0.5 * (float(recording.time[0]) + float(recording.time[-1]))
    halves = [recording.between(recording.time[0], middle), recording.between(middle, recording.time[-1] + 1.0)]
    fitted, rest = halves if direction == "forward" else halves[::-1]
    calibration = estimators.sideslip.calibrate(car, fitted.without("v_y"))
    found = estimators.sideslip.estimate(calibration, rest.without("v_y"))
    numbers = estimators.sideslip.score(car, found, rest)
    part = "_without_constant" if log == "genesis" else ""
    measured, open_loop = CALIBRATED[log, direction]
    assert numbers[f"open_loop_sideslip_rmse{part}_deg"] == pytest.approx(open_loop, rel=0.03)
    assert numbers[f"sideslip_rmse{part}_deg"] <= 1.05 * measured
    assert set(calibration.summary()) >= {"stiffness", "grip", "a_y_offset", "process noise.v_y"}
    written = estimators.sideslip.fitted_car(calibration, car, recording=fitted)
    assert 0.4 < written.front_cornering_stiffness / car.front_cornering_stiffness < 2.5
    assert written.rear_cornering_stiffness == pytest.approx(written.rear.B * written.rear.C * written.rear.D, rel=1e-6)


@functools.cache
def calibrated():
    return estimators.sideslip.calibrate(CAR_TOLD, log().without("v_y"))


CAR_TOLD = dataclasses.replace(CAR, rear_cornering_stiffness=0.7 * 127000.0, front_cornering_stiffness=60000.0)


def test_a_calibration_finds_stiffnesses_that_the_file_does_not_know():
    fitted = estimators.sideslip.fitted_car(calibrated(), CAR_TOLD, recording=log())
    assert fitted.rear_cornering_stiffness == pytest.approx(127000.0, rel=0.1)
    assert fitted.front_cornering_stiffness == pytest.approx(88000.0, rel=0.1)
    assert abs(fitted.steer_offset) < 1e-3
    told, found = (estimators.sideslip.estimate(one, log().without("v_y")) for one in (CAR_TOLD, calibrated()))
    errors = [estimators.sideslip.score(CAR, one, log())["sideslip_rmse_deg"] for one in (told, found)]
    assert errors[1] < 0.5 * errors[0]


def test_a_log_that_tells_nothing_is_said_to_in_one_sentence():
    of = lambda size: dataclasses.replace(
        calibrated(), fit=dataclasses.replace(calibrated().fit, covariance=size * calibrated().fit.covariance)
    )
    assert untold_in_words(of(1e-6)) is None
    assert "little information about" in untold_in_words(calibrated())
    assert "too little information for a calibration" in untold_in_words(of(1e6))


def test_what_a_log_hardly_tells_is_named():
    found = estimators.sideslip.little_told(calibrated())
    # It corners at 3 m/s^2, half a minute long: of the grip, the inertia and the height that is nothing; of the stiffness much.
    assert {"grip", "yaw_inertia", "cg_height"} <= set(found)
    assert not {"stiffness", "heading_offset", "a_y_offset"} & set(found)
    sharp = dataclasses.replace(calibrated().fit, covariance=1e-6 * calibrated().fit.covariance)
    assert estimators.sideslip.little_told(dataclasses.replace(calibrated(), fit=sharp)) == ()
    with_reference = dataclasses.replace(calibrated(), weight=0.05)
    assert "heading_offset" in estimators.sideslip.little_told(with_reference)


@pytest.mark.full
def test_a_reference_is_used_only_where_it_helps_inside_the_span():
    calibration = estimators.sideslip.calibrate(CAR_TOLD, log(), uses=("v_y",))
    assert [weight for weight, _ in calibration.validation] == [None, 0.05, 0.02]
    assert calibration.weight == min(calibration.validation, key=lambda one: one[1])[0]


def test_a_smoother_knows_more_than_a_filter():
    recording = log().without("v_y")
    both = [estimators.sideslip.estimate(calibrated(), recording, smoothed=how) for how in (True, False)]
    smooth, causal = (estimators.sideslip.score(CAR, one, log())["sideslip_rmse_deg"] for one in both)
    assert smooth < causal


@pytest.mark.parametrize("smoothed", [True, False])
def test_a_class_in_place_of_a_filter_is_named_with_bands_too(smoothed):
    with pytest.raises(InputError, match="filter = Extended: is a class; make one of it"):
        estimators.sideslip.estimate(
            CAR, log().rows(slice(0, 50)).without("v_y"), filter=filters.Extended, smoothed=smoothed
        )


def test_an_a_y_that_is_a_little_late_is_in_the_bands():
    """The integral of a late a_y lacks the delay times a_y; the bands hold 10 ms of it."""
    recording, delay = log(1500).without("v_y"), 0.01
    time = np.asarray(recording.time)
    late = recording.replace(a_y=np.interp(time - delay, time, np.asarray(recording["a_y"])))
    said = lambda source, log: np.asarray(estimators.sideslip.estimate(source, log).mean.v_y)[100:]
    model = estimators.sideslip.model(CAR)
    corrected = eqx.tree_at(lambda model: model.system.a_y_delay_error, model, jnp.asarray(delay))
    punctual = said(model, recording)
    lacks, left = (np.std(said(one, late) - punctual) for one in (model, corrected))
    assert lacks > 0.5 * delay * np.std(np.asarray(recording["a_y"])) and left < 0.3 * lacks
    usual = eqx.tree_at(lambda model: model.system.rear_axle_to_cg, model, 2.6 - CAR.front_axle_to_cg)
    for size, one in ((CAR.wheelbase / 2.6, model), (1.0, usual)):
        spreads = estimators.sideslip.unfitted_spreads(one.system)
        members = parameter_bands.members_of_prior(one, lambda model: model.system.grip, {"grip": 1e-6}, spreads)
        spread = members.models.system.a_y_delay_error
        np.testing.assert_allclose([spread.mean(), spread.std()], [0.0, delay * size**0.5], atol=1e-12)


@pytest.mark.parametrize("columns", [1, 2, 3, 15, 16, 24])
def test_signs_of_members_are_orthogonal(columns):
    signs = parameter_bands._signs(columns)
    assert columns < len(signs) <= 2 * columns + 2 and set(np.unique(signs)) == {-1.0, 1.0}
    np.testing.assert_array_equal(signs.T @ signs, len(signs) * np.eye(columns))
    np.testing.assert_array_equal(signs.sum(axis=0), 0.0)


@pytest.mark.thorough
def test_bands_know_that_parameters_are_uncertain(monkeypatch):
    fit = calibrated().fit
    models = parameter_bands.members_of_fit(fit).models
    line = np.stack(
        [np.asarray(p.domain.inverse(v)) for p, v in zip(fit.chosen, pick(models, fit.chosen), strict=True)], axis=1
    )
    np.testing.assert_allclose(line.mean(axis=0), fit.unconstrained, atol=1e-8)
    np.testing.assert_allclose(
        line.T @ line / len(line) - np.outer(fit.unconstrained, fit.unconstrained), fit.covariance, atol=1e-6
    )
    recording = log().without("v_y")
    sure = estimators.sideslip.estimate(fit.model, recording)
    found = estimators.sideslip.estimate(calibrated(), recording)
    # All but the bands is the model's own estimate, to rounding: it runs in one batch with its members.
    for one, other in zip(*(jax.tree.leaves(dataclasses.replace(e, std=None)) for e in (found, sure)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-9)
    assert np.mean(found.std.sideslip) > 1.2 * parameter_bands.WIDER * np.mean(sure.std.sideslip)
    causal = estimators.sideslip.estimate(calibrated(), recording.rows(slice(0, 300)), smoothed=False)
    sure = estimators.sideslip.estimate(fit.model, recording.rows(slice(0, 300)), smoothed=False)
    assert np.mean(causal.std.sideslip) > 1.2 * parameter_bands.WIDER * np.mean(sure.std.sideslip)
    wider = parameter_bands.WIDER
    monkeypatch.setattr(parameter_bands, "WIDER", 1.0)
    plain = estimators.sideslip.estimate(calibrated(), recording)
    np.testing.assert_allclose(found.std.sideslip, wider * plain.std.sideslip, rtol=1e-9)


def test_bands_of_a_car_at_its_word_are_as_wide_as_its_file_is_worth(monkeypatch):
    """Where only the stiffness is not known, they are those of the stiffest and the softest car that the file may mean."""
    recording = log(1500).without("v_y")
    monkeypatch.setattr(estimators.sideslip, "SPREADS", dict.fromkeys(estimators.sideslip.SPREADS, 1e-4))
    monkeypatch.setattr(estimators.sideslip, "unfitted_spreads", lambda system: {})
    sure = estimators.sideslip.estimate(estimators.sideslip.model(CAR), recording)
    known = estimators.sideslip.estimate(CAR, recording)
    told = parameter_bands.TOLD
    np.testing.assert_allclose(known.std.sideslip, told * sure.std.sideslip, rtol=1e-2)
    monkeypatch.setitem(estimators.sideslip.SPREADS, "stiffness", 0.6)
    found = estimators.sideslip.estimate(CAR, recording)
    factors = np.exp([0.6, -0.6])
    cars = [dataclasses.replace(CAR, rear_cornering_stiffness=f * CAR.rear_cornering_stiffness) for f in factors]
    others = [estimators.sideslip.estimate(estimators.sideslip.model(car), recording) for car in cars]
    variances = [one.std.sideslip**2 + (one.mean.sideslip - sure.mean.sideslip) ** 2 for one in others]
    np.testing.assert_allclose(found.std.sideslip, told * np.sqrt(np.mean(variances, axis=0)), rtol=1e-2)
    assert np.max(found.std.sideslip / np.asarray(sure.std.sideslip)) > 1.1 * told


USED = {
    **dict.fromkeys(
        ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg", "rear_cornering_stiffness", "cg_height", "sensor_position",
         "low_pass", "drag", "front_drive", "front_brake", "rear"), "estimate"),
    **dict.fromkeys(("front_cornering_stiffness", "steer_offset", "reference_position", "steering_ratio", "front"), "score"),
    "name": "a word",
    **dict.fromkeys(("track_front", "track_rear"), "one track"),
    **dict.fromkeys(("wheel_radius", "wheel_inertia", "rolling_resistance"), "wheels do not turn here"),
    "roll_gradient": "estimate",
    **dict.fromkeys(("roll_frequency", "roll_damping", "pitch_gradient"), "the body leans at once, and does not pitch here"),
    **dict.fromkeys(("antenna_position", "satellite_delay", "camera_delay"), "of satellites and a camera"),
    "inertial_delay": "all channels are as late",
    "brake_torque_per_pressure": "nobody brakes here",
    "steering": "on one track an inner wheel that turns further changes nothing; steered rear wheels are refused",
    "rear_steer_speed": "of a ratio that goes with the speed",
    **dict.fromkeys(("front_tyre", "rear_tyre"), "of a wheel: nobody opens them before a car on four wheels is built"),
}  # fmt: skip
"""What of a car's file moves the estimate, or the score alone; and why the rest does neither."""


class Found(NamedTuple):
    """As much of an estimate as a score looks at."""

    mean: types.SimpleNamespace
    std: types.SimpleNamespace

    def __getitem__(self, name):
        return getattr(self.mean, name)


@pytest.mark.parametrize("entry", dataclasses.fields(io.CarSpecification), ids=lambda entry: entry.name)
def test_what_a_cars_file_says_is_used_or_named(entry):
    plain = dataclasses.replace(CAR, rear=None, front=None)
    if entry.name.startswith("rear_steer_ratio"):
        # Nothing of a car whose front wheels alone turn.
        with pytest.raises(InputError, match="four-wheel"):
            dataclasses.replace(plain, **{entry.name: 0.2})
        return
    other = {
        "name": "another", "steering": "ackermann", "sensor_position": (0.1, 0.1, 0.0), "reference_position": (0.3, 0.0, 0.0),
        "front_tyre": "a.tir",
        "rear_tyre": "a.tir", "front": io.AxleTyre(B=9.0, C=1.3, D=9e3, E=0.0), "rear": io.AxleTyre(B=9.0, C=1.3, D=9e3, E=0.0),
        "front_drive": 0.7, "front_brake": 0.7, "steer_offset": 0.02, "rolling_resistance": 0.02,
        **dict.fromkeys(("track_front", "track_rear", "wheel_radius", "roll_frequency"), 1.0),
        **dict.fromkeys(("roll_gradient", "pitch_gradient"), 0.01), "roll_damping": 0.4, "antenna_position": (0.1, 0.0, 1.0),
        **dict.fromkeys(("satellite_delay", "inertial_delay", "camera_delay"), 0.1), "brake_torque_per_pressure": 1e-3,
    }.get(entry.name, 1.07 * (getattr(plain, entry.name) or 10.0))  # fmt: skip
    changed = dataclasses.replace(plain, **{entry.name: other})
    leaves = lambda car: [float(leaf) for leaf in jax.tree.leaves(car_of(car))]
    kind = "estimate" if leaves(changed) != leaves(plain) else "neither"
    if kind == "neither":
        time = np.arange(0.0, 2.0, 0.01)
        wave, ones = np.sin(time), np.ones_like(time)
        std = {"v_y": 0.1 * ones, "sideslip": 0.01 * ones}
        found = Found(types.SimpleNamespace(v_y=0.1 * wave), types.SimpleNamespace(**std))
        steer = "steering_wheel" if entry.name == "steering_ratio" else "steer"
        log = Recording(time, {"v_x": 20 * ones, "v_y": 0.2 * wave, steer: 0.02 * wave, "yaw_rate": 0.1 * wave})
        score = lambda car: repr(estimators.sideslip.score(car, found, log))
        kind = "score" if score(changed) != score(plain) else "neither"
    assert USED[entry.name] == kind if kind != "neither" else USED[entry.name] not in ("estimate", "score")
