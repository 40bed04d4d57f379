"""A warning points at the line of the user's own code, however deep in jaxveh it was noticed."""

import ast
import warnings
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxveh
from jaxveh import JaxvehWarning, Recording, estimators, filters, io, sensors, vehicles
from jaxveh._core.errors import warn

ROOT = Path(jaxveh.__file__).parent


def test_no_module_warns_by_itself():
    found = {
        path.relative_to(ROOT).as_posix()
        for path in ROOT.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func).startswith("warnings.warn")
    }
    assert found == {"_core/errors.py"}


def a_log_with_a_short_row(tmp_path):
    (tmp_path / "log.csv").write_text("time,v_x,a_y\n0.0,1.5,0.0\n0.1,1.6,0.0\n0.2,1.7\n")
    return io.read_recording(tmp_path / "log.csv")


def rows_that_are_far_apart(tmp_path):
    del tmp_path
    model = estimators.state_space(vehicles.passenger_car(), sensors.esc(0.005, 0.1))
    still = dict.fromkeys(("yaw_rate", "a_y", "steer"), np.zeros(4))
    return jaxveh.run(filters.Extended(), model, Recording(np.arange(4.0), {"v_x": np.full(4, 20.0), **still}))


def inside_a_transformation(tmp_path):
    del tmp_path
    return jax.jit(jax.vmap(lambda x: (warn("traced"), x)[1]))(np.ones(3))


@pytest.mark.parametrize("work", [a_log_with_a_short_row, rows_that_are_far_apart, inside_a_transformation])
def test_it_points_at_the_users_line(work, tmp_path):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        work(tmp_path)
    own = [one for one in told if issubclass(one.category, JaxvehWarning)]
    assert own and {one.filename for one in own} == {__file__}
