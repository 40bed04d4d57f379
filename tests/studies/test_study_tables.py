"""Tables and figures of a sweep: numbers that one can count, units that a reader thinks in, every figure with labelled axes."""

import numpy as np
import pytest

from jaxveh import InputError, studies, sweeps
from jaxveh.studies import summary
from jaxveh.studies.tables import by_axis, by_point, compare_by_seed

UNITS = {"rmse.sideslip": "rad", "baseline.sideslip": "rad", "speed": "m/s", "noise": "rad/s", "samples.mass": "kg"}


def swept(seeds=5):
    """A design with every kind of axis; the error of B is twice A's, but for one run in which B is lost."""
    design = sweeps.Design(
        speed=[10.0, 20.0],
        noise=[0.001, 0.1],
        filter={"A": 1, "B": 2, "C": 3},
        samples=sweeps.latin_hypercube(4, mass=(1.0, 2.0)),
    )
    rng = np.random.default_rng(0)
    base = rng.uniform(0.01, 0.02, (2, 2, 1, 4, seeds))
    error = base * np.array([1.0, 2.0, 1.0])[:, None, None]
    error[0, 0, 1, 0, 0] = np.nan
    values = {
        "rmse.sideslip": error,
        "baseline.sideslip": 4.0 * error,
        "nis": 1.0 + error,
        "rows": rng.normal(size=(*error.shape, 3)),
    }
    return sweeps.Swept(design, seeds, values, UNITS, "a note")


def test_medians_and_quartiles_are_those_of_everything_else():
    found = swept()
    table = by_axis(found, ["rmse.sideslip"])
    assert table.columns == ("axis", "", "rmse.sideslip [°]")
    values = np.degrees(np.where(np.isfinite(found["rmse.sideslip"]), found["rmse.sideslip"], np.inf))
    rows = {(row[0], row[1]): row[2] for row in table.rows}
    low, median, high = np.quantile(values[1], [0.25, 0.5, 0.75], method="nearest")
    assert rows["", "20"] == f"{median:.3g} ({low:.2g}–{high:.2g})"
    assert rows["noise [°/s]", "0.0572958"].startswith(f"{np.quantile(values[:, 0], 0.5, method='nearest'):.3g} (")
    # Samples have no row of their own.
    assert len(rows) == 1 + 2 + 2 + 3


def test_every_point_has_a_row():
    table = by_point(swept(), ["rmse.sideslip", "nis"])
    assert table.columns == ("speed [m/s]", "noise [°/s]", "filter", "rmse.sideslip [°]", "nis")
    assert len(table.rows) == 12 and table.left == 3
    assert table.rows[1][:3] == ("10", "0.0572958", "B")


@pytest.mark.parametrize("done", [0, 1, 3])
def test_seeds_that_are_not_computed_yet_are_no_ties(done):
    """Of a store that is half done, or in which nothing is finite: what is shown is what the seeds that are done say."""
    whole = swept()
    late = {name: np.array(values, float) for name, values in whole.values.items()}
    for values in late.values():
        values[:, :, :, :, done:] = np.nan
    rows = lambda one: {t.title.partition(" against")[0]: t.rows for t in studies.tables(one) if "ratio" in t.columns}
    told = rows(sweeps.Swept(whole.design, 5, late, UNITS, "a note"))
    (against,) = told["Against doing nothing (baseline), on the same drives"]
    if done < 2:
        assert against[1:] == ("-", "-", "-")
    else:
        first = {name: values[:, :, :, :, :done] for name, values in whole.values.items()}
        alone = rows(sweeps.Swept(whole.design, done, first, UNITS, "a note"))
        assert [against] == alone["Against doing nothing (baseline), on the same drives"]
    if not done:
        assert all(row[2:] == ("-", "-", "-") for row in told["filter"])


@pytest.mark.parametrize("study", [True, False])
@pytest.mark.parametrize("late", ["B", "C", "all"])
def test_a_choice_that_is_not_computed_yet_has_neither_lost_nor_tied(late, study):
    """Choices are computed one after the other: a killed sweep has none of the later ones, and said that they are the worst."""
    whole = swept()
    names = {"rmse.sideslip", "baseline.sideslip"}
    values = {name: np.array(whole[name], float) for name in names}
    if study:
        values["failed"] = np.isnan(values["rmse.sideslip"]).astype(float)
    of_late = slice(None) if late == "all" else [whole.design.axis("filter").labels.index(late)]
    for one in values.values():
        one[:, :, of_late] = np.nan
    found = sweeps.Swept(whole.design, 5, values, UNITS, "a note")
    told = {t.title.partition(" ")[0]: t.rows for t in studies.tables(found)}
    assert all(row[2:] == ("-", "-") for row in told["Ranks"])
    rows = {row[1]: row[2:] for row in told["filter"]}
    first = {t.title.partition(" ")[0]: t.rows for t in studies.tables(whole)}
    for label, row in rows.items():
        known = {r[1]: r[2:] for r in first["filter"]}[label]
        assert row == (("-", "-", "-") if late in (label, "all") else known)
    one = summary.ranks(found, "rmse.sideslip", whole.design.axis("filter"))
    assert np.isnan(one.mean).all() and studies.figures.rank_bars(found, "rmse.sideslip", whole.design.axis("filter"))


def test_pairs_count_runs_and_weigh_seeds():
    found = swept()
    one = next(t for t in studies.tables(found) if t.title.startswith("filter against A"))
    row = {r[1]: r for r in one.rows}
    assert row["B"][2] == pytest.approx(2.0) and row["B"][4] == "0.0 %"
    # A tie is half a win.
    assert row["C"][2] == 1.0 and row["C"][4] == "50.0 %"
    nothing = next(t for t in studies.tables(found) if t.title.startswith("Against doing nothing"))
    assert nothing.rows[0][1] == pytest.approx(0.25)
    # Where both have lost it is a tie.
    assert nothing.rows[0][3] == f"{100 * (239 + 0.5) / 240:.1f} %"


def test_intervals_are_those_of_seeds_not_of_runs():
    rng = np.random.default_rng(1)
    # Each seed is good or bad at all of 100 points: there are ten pairs, not a thousand.
    of_seed = np.exp(rng.normal(0.0, 0.5, (1, 10)))
    ratio = compare_by_seed(of_seed * np.ones((100, 1)), np.ones((100, 10))).ratio
    alone = sweeps.compare(of_seed[0], np.ones(10)).ratio
    np.testing.assert_allclose([ratio.low, ratio.value, ratio.high], [alone.low, alone.value, alone.high], rtol=1e-12)


def test_ranks_share_places_and_put_the_lost_last():
    found = swept()
    one = summary.ranks(found, "rmse.sideslip", found.design.axis("filter"))
    np.testing.assert_allclose(one.mean, [1.5, 3.0, 1.5])
    np.testing.assert_allclose(one.shares, [[0.5, 0.5, 0.0], [0.0, 0.0, 1.0], [0.5, 0.5, 0.0]])
    drawn = np.random.default_rng(2).normal(size=(4, 1000))
    design = sweeps.Design(way=dict.fromkeys("wxyz", 0))
    among = summary.ranks(sweeps.Swept(design, 1000, {"error": drawn}), "error", design.axis("way"))
    np.testing.assert_allclose(among.shares.sum(axis=0), 1.0)
    np.testing.assert_allclose(among.shares @ [1, 2, 3, 4], among.mean)
    assert among.mean[0] == pytest.approx(np.mean([np.sum(run <= run[0]) for run in drawn.T]))


def test_values_are_chosen_by_name_and_rows_are_left_out():
    found = swept()
    assert summary.plain_values(found) == ["rmse.sideslip", "baseline.sideslip", "nis"]
    assert next(t.columns[2:] for t in studies.tables(found, ["nis"])) == ("nis",)
    with pytest.raises(InputError, match="no value 'rmse.sidslip' \\(did you mean 'rmse.sideslip'\\?\\)"):
        studies.tables(found, ["rmse.sidslip"])


def test_a_sweep_without_axes_has_one_row():
    found = sweeps.Swept(sweeps.Design(), 1, {"rmse.v_y": np.array([0.25])}, {"rmse.v_y": "m/s"})
    (table,) = studies.tables(found)
    assert table.rows == [("all", "", "0.25")]
    assert list(studies.figures.figures(found)) == []


def test_large_designs_are_told_by_axes_alone():
    design = sweeps.Design(a=np.arange(10.0), b=np.arange(10.0))
    found = sweeps.Swept(design, 2, {"rmse.v_y": np.ones((10, 10, 2))})
    assert len(studies.tables(found)) == 1


FIGURES = {
    "rmse_sideslip_over_speed": ("speed [m/s]", "RMSE of sideslip [°]"),
    "rmse_sideslip_over_noise": ("noise [°/s]", "RMSE of sideslip [°]"),
    "rmse_sideslip_map_speed_noise": ("speed [m/s]", "noise [°/s]"),
    "rmse_sideslip_by_filter": ("", "RMSE of sideslip [°]"),
    "rmse_sideslip_ranks_filter": ("share of runs [%]", ""),
    "rmse_sideslip_over_samples": ("mass [kg]", "RMSE of sideslip [°]"),
}


def test_every_figure_has_labelled_axes(tmp_path):
    from jaxveh import plots

    drawn = dict(studies.figures.figures(swept()))
    assert set(drawn) == set(FIGURES)
    for stem, figure in drawn.items():
        plots.save(figure, tmp_path / f"{stem}.png")
        first = figure.axes[0]
        shown = {ax.get_xlabel() for ax in figure.axes} | {ax.get_ylabel() for ax in figure.axes}
        assert set(FIGURES[stem]) - {""} <= shown, stem
        assert first.has_data()


def test_lines_show_what_they_say():
    found = swept()
    figure = studies.figures.lines(found, "rmse.sideslip", found.design.axis("speed"), found.design.axis("filter"))
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    assert set(lines) == {"A", "B", "C", "doing nothing"}
    values = np.degrees(found.at("rmse.sideslip", filter="A").reshape(2, -1))
    np.testing.assert_allclose(lines["A"].get_ydata(), np.quantile(values, 0.5, axis=1, method="nearest"))


def test_maps_show_the_medians_of_each_label_on_one_scale():
    found = swept()
    axes = [found.design.axis(name) for name in ("speed", "noise", "filter")]
    figure = studies.figures.heat_map(found, "rmse.sideslip", *axes)
    meshes = [ax.collections[0] for ax in figure.axes[:3]]
    assert len({mesh.get_clim() for mesh in meshes}) == 1
    values = np.degrees(found.at("rmse.sideslip", filter="C").reshape(2, 2, -1))
    np.testing.assert_allclose(
        meshes[2].get_array().reshape(2, 2), np.quantile(values, 0.5, axis=-1, method="nearest").T
    )


def test_a_violin_says_how_many_were_lost():
    found = swept()
    figure = studies.figures.violins(found, "rmse.sideslip", found.design.axis("filter"))
    ticks = [tick.get_text() for tick in figure.axes[0].get_xticklabels()]
    assert ticks == ["A", "B\n1 not finite", "C"]


def test_errors_of_very_different_size_are_drawn_by_ratios():
    design = sweeps.Design(speed=[1.0, 2.0], way={"x": 0, "y": 1})
    values = np.exp(np.random.default_rng(0).normal(0.0, 3.0, (2, 2, 50)))
    found = sweeps.Swept(design, 50, {"rmse.v_y": values})
    assert studies.figures.lines(found, "rmse.v_y", design.axis("speed")).axes[0].get_yscale() == "log"
    axis = studies.figures.violins(found, "rmse.v_y", design.axis("way")).axes[0]
    assert axis.yaxis.get_major_formatter()(2.0, None) == "100"
