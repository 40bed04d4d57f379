"""Settings of rig fits that are told before the work, and starts that keep to their bounds."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import FilterError, InputError, tyres
from jaxveh.fitting import fit_rig
from jaxveh.fitting.rig_data import starts_of
from jaxveh.fitting.rig_stages import CURVATURES, Stage, stages_of
from jaxveh.io import RigTable

STAGE = Stage("F_y, pure", ("F_y",), ("lateral.PEY1",), np.ones(1, bool), (("lateral.PEY1", CURVATURES),))


def test_starts_stay_within_bounds():
    law = tyres.typical_mf_tyre(4000.0)
    curvatures = lambda bounds: [float(one.lateral.PEY1) for one in starts_of(law, STAGE, bounds)]
    assert curvatures({}) == list(CURVATURES)
    assert curvatures({"lateral.PEY1": (-2.0, 0.8)}) == [one for one in CURVATURES if -2 < one < 0.8]


def test_starts_are_every_combination():
    law = tyres.typical_mf_tyre(4000.0)
    stage = STAGE._replace(starts=(("lateral.REY1", (-1.0, 0.5)), ("lateral.RCY1", (0.9,))))
    found = {(float(one.lateral.REY1), float(one.lateral.RCY1)) for one in starts_of(law, stage, {})}
    own = float(law.lateral.REY1), float(law.lateral.RCY1)
    assert found == {(-1.0, own[1]), (0.5, own[1]), (own[0], 0.9), (-1.0, 0.9), (0.5, 0.9)}


def test_bad_folds_are_told_before_the_fit():
    told = []
    slip = np.linspace(-0.1, 0.1, 30)
    rig = RigTable(slip_angle=slip, slip_ratio=0 * slip, load=0 * slip + 4e3, F_y=6e4 * slip)
    for folds, message in ((1, "folds = 1: must be at least 2"), (9, "rows for 9 folds = 30: must be at least 36")):
        with pytest.raises(InputError, match=message):
            fit_rig(tyres.Brush(8e4, 6e4), rig, folds=folds, progress=lambda *stage: told.append(stage))
    assert told == []


def test_a_fit_has_converged_where_its_residuals_have_settled():
    truth = tyres.Brush(8e4, 6e4, 0.9)
    slip, load = np.linspace(-0.15, 0.15, 30), np.full(30, 4e3)
    forces = truth.forces(
        tyres.Contact(slip_angle=jnp.asarray(slip), slip_ratio=jnp.asarray(slip), load=jnp.asarray(load))
    )
    noise = 20 * np.random.default_rng(0).standard_normal((2, 30))
    rig = RigTable(
        slip_angle=slip, slip_ratio=slip, load=load, F_x=np.asarray(forces.F_x) + noise[0], F_y=np.asarray(forces.F_y) + noise[1]
    )  # fmt: skip
    # A step that cannot meet its tolerance: at the best tyre nothing is left to gain, at another one much.
    hasty = {"max_steps": 2, "tolerance": 1e-30}
    best = fit_rig(truth, rig)
    assert fit_rig(best.tyre, rig, **hasty).stages[-1].converged
    with pytest.raises(FilterError, match=r"stopped after \d steps"):
        fit_rig(tyres.Brush(2e4, 2e4, 0.4), rig, **hasty)


def lateral(**changed):
    slip = np.linspace(-0.1, 0.1, 30)
    return RigTable(
        **{"slip_angle": slip, "slip_ratio": 0 * slip, "load": 4e3 * (1 + slip), "F_y": 6e4 * slip} | changed
    )


def test_version_52_is_fitted_with_its_own_coefficients():
    varied = lateral(
        pressure=np.linspace(2e5, 3e5, 30), camber=np.linspace(-0.1, 0.1, 30), M_z=np.ones(30), M_x=np.ones(30)
    )
    channels = ("F_y", "M_z", "M_x")
    names = lambda version: {
        name.partition(".")[2]
        for stage in stages_of(tyres.typical_mf_tyre(4e3, version=version), varied, channels, None)
        for name in stage.coefficients
    }
    newer = {"PPY1", "PPZ1", "PPMX1", "QDZ10", "QDZ11", "QSX4", "QSX8", "PKY5", "PKY6"}
    assert newer <= names(61) and not newer & names(52)
    assert {"PKY3", "QDZ9", "QSX1", "QSX2", "QSX3"} <= names(52)


def test_rows_without_a_sweep_are_refused():
    still = lateral(slip_angle=np.full(30, 0.05))
    with pytest.raises(InputError, match="neither slip angle nor slip ratio varies enough"):
        fit_rig(tyres.typical_mf_tyre(4e3), still)


def test_a_stage_takes_rows_that_were_measured():
    """Free rolling that was measured at a slip ratio of its own still shows the lateral coefficients."""
    law = tyres.typical_mf_tyre(4e3)
    dragged = stages_of(law, lateral(slip_ratio=np.full(30, 0.015)), ("F_y",), None)
    assert [stage.name for stage in dragged] == ["F_y, pure"] and dragged[0].rows.all()
    force = 6e4 * np.linspace(-0.1, 0.1, 30)
    gaps = np.where(np.arange(30) % 3 == 0, np.nan, force)
    stage = stages_of(law, lateral(F_y=gaps), ("F_y",), None)[0]
    np.testing.assert_array_equal(stage.rows, np.isfinite(gaps))
