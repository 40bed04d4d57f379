"""Tables of similar length share the programs of a fit, for every law that `starting_tyre` knows by name."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rig_sweeps import brush, measured_of, small_plan, table

from jaxveh import fitting
from jaxveh._core.lengths import common_length
from jaxveh.fitting.rig_problem import SHARED, loss, normal_equations, of_common_length, rows_of_common_length
from jaxveh.fitting.rig_start import RIG_STARTS

COLUMNS, RUN = small_plan()
FORCES = measured_of(brush(), COLUMNS, ("F_x", "F_y", "M_z"))
ROWS = RUN.size


def rig(rows, seed):
    """The first rows of noisy sweeps; some have no F_y."""
    full = table(FORCES, COLUMNS, RUN, 0.02, seed)
    return dataclasses.replace(full, F_y=np.where(np.arange(ROWS) % 7 == 3, np.nan, full.F_y)).take(np.arange(rows))


def test_a_second_table_compiles_nothing():
    programs = []
    hear = lambda event, duration, **more: (
        programs.append(event) if event.endswith("backend_compile_duration") else None
    )
    jax.monitoring.register_event_duration_secs_listener(hear)
    assert common_length(ROWS) == common_length(ROWS - 9)
    for rows, seed in ((ROWS, 1), (ROWS - 9, 2)):
        before, data = len(programs), rig(rows, seed)
        fit = fitting.fit_rig(fitting.starting_tyre("brush", data), data, folds=2)
        assert fit.problem.units() == rows and fit.residuals["F_x"].shape == (rows,)
    assert len(programs) == before


@pytest.mark.parametrize(("name", "robust"), [*((name, False) for name in RIG_STARTS), ("brush", True)])
def test_rows_that_fill_up_have_no_weight(name, robust, monkeypatch):
    """In several blocks, of which the last is filled up, too."""
    monkeypatch.setattr("jaxveh.fitting.rig_problem.BLOCK", 50)
    data = rig(ROWS - 9, 3)
    problem = fitting.pose_rig(fitting.starting_tyre(name, data), data, robust=robust, measured=("F_y",))
    longer = of_common_length(problem)
    assert problem.units() == ROWS - 9 < longer.units() == common_length(ROWS - 9)
    z = 0.01 * jnp.ones_like(problem.origin)
    for found, wanted in zip(
        jax.tree.leaves((normal_equations(z, longer), loss(z, longer))),
        jax.tree.leaves((normal_equations(z, problem), loss(z, problem))),
        strict=True,
    ):
        np.testing.assert_allclose(found, wanted, 1e-9, 1e-9 * np.abs(wanted).max())


def test_a_long_table_is_not_filled_up():
    rows = SHARED + 1
    data = rig(ROWS, 1).take(np.arange(rows) % ROWS)
    law = fitting.starting_tyre("brush", data)
    problem = fitting.pose_rig(law, data)
    assert of_common_length(problem).units() == rows < common_length(rows)
    assert rows_of_common_length(problem.contact, problem.measured)[1].shape[1] == rows
