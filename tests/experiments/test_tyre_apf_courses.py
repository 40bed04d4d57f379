"""What the tyre-apf experiment shows over time and in other ways: tracks, variants, order, the paper's sentences."""

import dataclasses
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import sweeps, vehicles
from jaxveh._core.names import record
from jaxveh.experiments.report import FAILED, MET
from jaxveh.experiments.tyre_apf import Study, figures, order, variants
from jaxveh.experiments.tyre_apf.claims import claims_table
from jaxveh.experiments.tyre_apf.course_figures import step_figure, tracks_figure
from jaxveh.experiments.tyre_apf.printed import Printed
from jaxveh.experiments.tyre_apf.settings import STEP_OUTPUTS, STEPS
from jaxveh.experiments.tyre_apf.tracks import Tracks, course_of, tracks_of, tracks_table

SEEDS, ROWS = 4, 101
TRUTH, SCALE = figures.truth()[:, None], figures.true_spread(Study())[:, None]


def made_up_tracks(**offsets):
    """Tracks `offset(time)` prior standard deviations beside the truth, in every parameter of each seed alike."""
    time = np.linspace(0.0, 7.0, ROWS)
    at = lambda values: np.broadcast_to(values, (SEEDS, 8, ROWS))
    mean = {name: at(TRUTH + SCALE * offset(time)) for name, offset in offsets.items()}
    return Tracks(time, mean, dict.fromkeys(offsets, at(0.5 * SCALE)), {"PF": np.full((SEEDS, ROWS), 0.3)})


def test_a_course_is_told_in_prior_standard_deviations():
    """A filter that is one of them off until the last fifth of the drive, and two there."""
    given = made_up_tracks(PF=lambda t: np.where(t < 0.8 * 7.0, 1.0, 2.0))
    found = course_of(given, "PF", Study())
    np.testing.assert_allclose(found.middle, 1.0)
    np.testing.assert_allclose(found.end, 2.0)
    np.testing.assert_allclose(found.claimed, 0.5)
    late = np.where(np.linspace(0.0, 1.0, ROWS)[50:] < 0.8, 1.0, 2.0)
    np.testing.assert_allclose(found.restless, late.std())
    np.testing.assert_allclose(found.restless_E, found.restless)
    _, *cells = tracks_table(given, Study()).rows[0]
    assert cells[3].startswith("2 [2, 2]") and cells[6].startswith("4 ") and cells[7].startswith("0.3 ")


def test_tracks_keep_every_tenth_row_and_hold_the_prior():
    rng = np.random.default_rng(0)
    fields = {name: rng.normal(size=(SEEDS, ROWS)) for name in figures.NAMES}
    info = types.SimpleNamespace(ess=np.full((SEEDS, ROWS), 250.0))
    estimate = types.SimpleNamespace(parameters=fields, parameters_std=fields, info=info)
    guess = rng.normal(size=(SEEDS, 8))
    found = tracks_of(np.zeros((SEEDS, ROWS)), {"PF": estimate}, guess, np.abs(guess), 1000)
    np.testing.assert_array_equal(found.mean["PF"][:, 2], fields["front.D"][:, ::10])
    np.testing.assert_array_equal(found.mean["prior"], np.repeat(guess[:, :, None], 11, axis=2))
    np.testing.assert_allclose(found.share["PF"], 0.25)


def test_longitudinal_forces_are_those_of_the_papers_equations():
    """Eqs 12, 14 in the car's axes: m a_y = F_TP + F_TA cos(delta) + F_LA sin(delta), J dr/dt = a (...) - b F_TP, F_L = T / R."""
    car = variants.driven_car(vehicles.passenger_car())
    delta, torque = 0.05, 400.0
    u = record("Inputs", {"steer": jnp.asarray(delta), "drive_torque": torque, "brake_torque": 0.0})
    x = car.state_type(v_x=25.0, v_y=-0.3, yaw=0.1, yaw_rate=0.4)
    rates, seen = car.evaluate(0.0, x, u)
    F_LA = torque / car.wheel_radius
    np.testing.assert_allclose(seen.F_xf, F_LA, rtol=1e-12)
    across = seen.F_yf * np.cos(delta) + F_LA * np.sin(delta)
    np.testing.assert_allclose(car.mass * seen.a_y, across + seen.F_yr, rtol=1e-12)
    turning = car.front_axle_to_cg * across - car.rear_axle_to_cg * seen.F_yr
    np.testing.assert_allclose(car.yaw_inertia * rates.yaw_rate, turning, rtol=1e-12)
    # Without torque its tyres are the study's car's.
    plain = vehicles.passenger_car()
    given = record("Inputs", {"steer": jnp.asarray(delta), "v_x": 25.0})
    same = plain.outputs(0.0, plain.state_type(v_y=-0.3, yaw=0.1, yaw_rate=0.4), given)
    freely = car.outputs(0.0, x, u._replace(drive_torque=0.0))
    np.testing.assert_allclose([freely.F_yf, freely.F_yr, freely.a_y], [same.F_yf, same.F_yr, same.a_y], rtol=1e-6)
    along = F_LA * np.cos(delta) - seen.F_yf * np.sin(delta)
    np.testing.assert_allclose(car.mass * (rates.v_x - x.v_y * x.yaw_rate), along, rtol=1e-9)


def test_the_speed_of_an_acceleration_begins_at_the_drives():
    study = Study(speed=20.0, rate=10.0)
    found = variants._integrated(study, np.full((2, 11), 0.5))
    np.testing.assert_allclose(found[:, [0, 10]], [[20.0, 20.5]] * 2)


@pytest.mark.full
def test_every_variant_beats_the_prior_with_the_unscented_filter():
    study = Study(rate=50.0)
    found = variants.run_variants(study, 4, jax.random.key(5), kinds=("UKF",))
    for name in variants.VARIANTS:
        error = lambda who, name=name: np.median(variants.at_variant(found, "curve_error", name, who))
        assert error("UKF") < 0.5 * error("prior"), name
        assert (variants.at_variant(found, "result", name, "UKF") == 0).all(), name


@pytest.mark.full
def test_the_particle_filter_runs_with_every_order_and_integrator():
    found = order.run_order(Study(), Printed(particles=50), 3, jax.random.key(6))
    assert found["error"].shape == (len(order.CASES), len(order.SOLVERS), 3)
    few, many, _ = found.design.axis("case").labels
    at = lambda metric, case: found.at(metric, case=case, solver="Euler")
    # Nothing is learned of tyres that are not unknown.
    np.testing.assert_array_equal(at("error", few), at("prior_error", few))
    assert (at("error", many) != at("prior_error", many)).all()


def made_up_result():
    """A result in which every error is 1, but for those that a test wants."""
    ones = np.ones((SEEDS, 2))
    found = {}
    for model in dict.fromkeys(one.model for one in variants.VARIANTS.values()):
        names = [name for name, one in variants.VARIANTS.items() if one.model == model]
        who = ("prior", *variants.ESTIMATORS)
        curves = np.broadcast_to(ones, (len(who), len(names), SEEDS, 2)).copy()
        values = {"curve_error": curves, "state_error": curves.copy(), "result": np.zeros(curves.shape[:-1])}
        design = sweeps.Design(estimator=dict.fromkeys(who), variant=range(len(names)))
        found[model] = sweeps.Swept(design, SEEDS, values)
    steps = {name.format(long=0.09, short=0.01): None for name in order.CASES}
    design = sweeps.Design(case=steps, solver=dict.fromkeys(order.SOLVERS))
    shape = (len(steps), len(order.SOLVERS), SEEDS)
    values = {name: np.ones(shape) for name in ("error", "prior_error", "v_y", "yaw_rate", "share", "result")}
    outputs = np.ones((SEEDS, len(STEP_OUTPUTS)))
    return types.SimpleNamespace(
        study=Study(), seeds=SEEDS, variants=found, order=sweeps.Swept(design, SEEDS, values),
        steps={STEPS[0]: {"prior": outputs, "APF": 0.5 * outputs}},
        tracks=made_up_tracks(prior=lambda t: 1.0 + 0 * t, PF=lambda t: 1.0 + 0 * t, APF=lambda t: 0.5 + (t > 5.0)),
    )  # fmt: skip


def test_sentences_of_the_paper_are_judged_by_ratios():
    result = made_up_result()
    # Runge-Kutta halves the error of v_y, and the order leaves the parameters where they were.
    result.order.values["v_y"][1, 0] = 0.5
    rows = {claim: cells for claim, *cells in claims_table(result).rows}
    ratio = lambda *words: next(cells for claim, cells in rows.items() if all(word in claim for word in words))
    assert ratio("v_y, against Euler", "0.09")[0].startswith("0.5 ") and ratio("v_y, against Euler", "0.09")[-1] == MET
    assert ratio("parameters, against the first guess", "0.09")[-1] == FAILED
    assert ratio("drifts away")[0].startswith("3 ") and ratio("drifts away")[-1] == MET
    assert ratio("APF's final parameters")[-1] == FAILED
    assert ratio("predict yaw_rate")[-1] == MET
    assert ratio("no difference")[-1] == MET and ratio("longitudinal")[-1] == FAILED


def test_the_figures_show_what_was_found_with_units():
    tracks = made_up_tracks(prior=lambda t: 1.0 + 0 * t, PF=lambda t: t, APF=lambda t: -t, UKF=lambda t: 0 * t)
    axes = tracks_figure(tracks, figures.truth(), seed=1).axes
    assert [one.get_ylabel() for one in axes[:2]] == ["front B [1/rad]", "rear B [1/rad]"]
    (rear,) = [one for one in axes if one.get_ylabel() == "rear D [kN]"]
    drawn = {line.get_label(): line.get_ydata() for line in rear.lines}
    np.testing.assert_allclose(drawn["PF"], 1e-3 * tracks.mean["PF"][1, 6])
    np.testing.assert_allclose(drawn["truth"], 5.609)
    course = np.arange(5.0)[None, :, None] * np.ones((2, 5, 11))
    first = {name: (i + 1) * course for i, name in enumerate(("truth", "prior", "PF", "APF", "MAP"))}
    result = types.SimpleNamespace(first_step=first, study=dataclasses.replace(Study(), rate=10.0))
    axes = step_figure(result).axes
    assert [one.get_ylabel() for one in axes] == [
        "yaw rate [°/s]", "yaw [°]", "v_y [m/s]", "front F_y [kN]", "rear F_y [kN]",
    ]  # fmt: skip
    assert axes[-1].get_xlabel() == "time [s]"
    (apf,) = [line for line in axes[3].lines if line.get_label() == "APF"]
    np.testing.assert_allclose(apf.get_ydata(), 4.0 * list(STEP_OUTPUTS).index("F_yf") * 1e-3)
    np.testing.assert_allclose(apf.get_xdata(), np.arange(11) / 10.0)
