"""The further parts of the tyre-apf experiment at small size: saturated drives, sharpness, looks at the truth."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics, sweeps
from jaxveh.experiments.tyre_apf import Study, saturated, sharpness
from jaxveh.experiments.tyre_apf.printed import closest_share
from jaxveh.experiments.tyre_apf.sweep_figures import saturated_figure, sharpness_figure


@pytest.fixture(scope="module")
def peaks():
    return saturated.run_saturated(Study(), 4, jax.random.key(3), unknown=("D and B",), only=("prior", "UKF"))


@pytest.mark.studies
def test_beyond_the_peak_the_filter_is_near_the_bound(peaks):
    for case in peaks.cases:
        assert saturated.over_bound(peaks, "D and B", "UKF", case).max() < 3.0
        assert saturated.over_bound(peaks, "D and B", "prior", case).max() > 20.0
    assert (peaks.found["D and B"]["result"] == 0).all()


@pytest.mark.studies
def test_the_drives_tell_d_and_b(peaks):
    for case in peaks.cases:
        seen = peaks.bounds["D and B"][case]
        assert seen.names == ("front.B", "front.D", "rear.B", "rear.D")
        assert seen.observable() == seen.names


@pytest.mark.studies
def test_the_figure_shows_errors_beside_the_bound(peaks):
    figure = saturated_figure(peaks)
    (axes, _), seen = figure.axes, peaks.bounds["D and B"][peaks.cases[0]]
    assert [text.get_text() for text in axes.get_xticklabels()] == ["f.B", "f.D", "r.B", "r.D"]
    (bounds,) = axes.collections
    np.testing.assert_allclose([line[0, 1] for line in bounds.get_segments()], 100 * seen.bounds.array())
    drawn = {line.get_label(): line.get_ydata() for line in axes.lines}
    ratio = saturated.over_bound(peaks, "D and B", "UKF", peaks.cases[0])
    np.testing.assert_allclose(drawn["UKF"], 100 * ratio * seen.bounds.array())
    assert set(drawn) == {"prior", "UKF"} and "%" in axes.get_ylabel()


def test_single_shooting_finds_what_made_the_data():
    """On a drive without noise, from a start 2 % beside; the prior's mean is the truth."""
    from jaxveh import manoeuvres, sensors, simulate, vehicles
    from jaxveh.experiments.tyre_apf.study import model_of

    study = Study(duration=6.0)
    car = vehicles.passenger_car()
    manoeuvre = manoeuvres.double_lane_change(speed=40.0, steer=0.1, duration=6.0)
    drive = simulate(car, manoeuvre, sensors.esc(yaw_rate=1e-9, a_y=1e-9), key=jax.random.key(0), dt=0.01)
    model = model_of(study, car, study.saturated, saturated.stiffness_and_peak, "linear")
    truth = jnp.stack(model.prior.mean)[-4:]
    rows, beside = model.rows(drive), truth + jnp.asarray([0.02, -0.02, 0.01, 0.02])
    fit = jax.jit(lambda rows: saturated.single_shooting(model, rows, beside))
    found, converged = fit(rows)
    assert converged
    np.testing.assert_allclose(found, truth, atol=2e-4)
    # Where nothing was measured the prior alone is left.
    nothing = rows._replace(y=jax.tree.map(lambda leaf: jnp.full_like(leaf, jnp.nan), rows.y))
    np.testing.assert_allclose(fit(nothing)[0], truth, atol=1e-9)


def test_errors_of_the_prior_are_one_standard_deviation(monkeypatch):
    monkeypatch.setattr(sharpness, "KINDS", {"PF": sharpness.KINDS["PF"]})
    study = Study(duration=6.0, rate=20.0)
    found = sharpness.run_sharpness(study, 20, jax.random.key(0), counts=(20,), again=3).found[20]
    assert sharpness.pairs(found) == []
    prior = found.at("error", filter="prior")
    np.testing.assert_allclose(np.sqrt(np.mean(prior**2)), 1.0, rtol=0.15)
    # The same guess at every level; the filter's estimates differ between levels.
    np.testing.assert_array_equal(prior[0], prior[2])
    error = found.at("error", filter="PF")
    assert (found.at("result", filter="PF") == 0).all() and not np.isclose(error[0], error[2]).any()
    assert (found.at("likelihood_spread", filter="PF") > 0).all()


def test_the_paper_resamples_multinomially_and_systematically_stands_beside_it():
    few, paper = sharpness.contestants(100), sharpness.contestants(300)
    assert list(few) == ["PF", "APF"] and list(paper) == ["PF", "APF", "PF, systematic", "APF, systematic"]
    for name, filter_ in {**few, **paper}.items():
        systematic = name.endswith("systematic")
        assert filter_.resampling is (numerics.systematic if systematic else numerics.multinomial)
        assert filter_.threshold == 1.0 and type(filter_) is type(sharpness.KINDS[name.split(",")[0]](2))
    design = sweeps.Design(filter={"prior": 0, **dict.fromkeys(paper, 1)}, level=[0.0])
    pairs = sharpness.pairs(sweeps.Swept(design, 2, {}))
    assert pairs == [("APF", "PF"), ("APF, systematic", "PF, systematic")]


def test_the_ratio_is_of_medians():
    design = sweeps.Design(filter={"prior": 0, "PF": 1, "APF": 2}, level=[0.0, 1.0])
    spreads = np.stack(
        [np.full((2, 3), np.nan), [[1.0, 2.0, 9.0], [4.0, 4.0, 4.0]], [[1.0, 1.0, 0.1], [2.0, 8.0, 3.0]]]
    )
    given = sharpness.Sharpness({300: sweeps.Swept(design, 3, {"likelihood_spread": spreads})})
    assert sharpness.likelihood_ratio(given, 300, 0) == pytest.approx(0.5)
    assert sharpness.likelihood_ratio(given, 300, 1) == pytest.approx(0.75)


def test_the_closest_fifth_looks_at_the_truth():
    series = jnp.asarray([[5.0, 1.1, 0.7, 3.0, 9.0, 1.2, 4.0, 8.0, 0.0, 7.0]])
    np.testing.assert_allclose(closest_share(series, jnp.asarray([1.0]), 0.2), [0.5 * (1.1 + 1.2)])


def test_the_figure_shows_medians_with_quartiles():
    levels, seeds = 3, 5
    design = sweeps.Design(filter={"prior": 0, "PF": 1, "APF": 2}, level=range(levels))
    values = np.arange(3.0 * levels * seeds).reshape(3, levels, seeds) + 1.0
    runs = sweeps.Swept(design, seeds, {"error": values, "likelihood_spread": 10.0 * values})
    left, right = sharpness_figure(sharpness.Sharpness({100: runs, 300: runs})).axes
    (prior,) = [line for line in left.lines if line.get_label() == "prior"]
    np.testing.assert_allclose(prior.get_ydata(), np.median(values[0], axis=-1))
    for axes, factor in ((left, 1.0), (right, 10.0)):
        assert [bars.get_label() for bars in axes.containers] == [
            f"{n}, {c} particles" for c in (100, 300) for n in ("PF", "APF")
        ]
        for bars, mine in zip(axes.containers, (values[1], values[2]) * 2, strict=True):
            line, _, (stems,) = bars.lines
            np.testing.assert_allclose(line.get_ydata(), factor * np.median(mine, axis=-1))
            ends = np.array([stem[:, 1] for stem in stems.get_segments()])
            np.testing.assert_allclose(ends, factor * np.quantile(mine, [0.25, 0.75], axis=-1).T)
