"""The 7-DOF car of the benchmarks: the library and the C++ limit drive alike, together, alone, and in gradients."""

import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

from benchmarks import limit, simulation
from benchmarks.seven_dof_problem import STATES, drives
from jaxveh import statespace

needs_limit = pytest.mark.skipif(limit.unavailable() is not None, reason=str(limit.unavailable()))


def ours(problem, dtype=np.float64, solver=None):
    cars, speed = simulation._arguments(problem, np.dtype(dtype))
    x = jax.jit(lambda cars, speed: simulation.simulate(problem, cars, speed, solver))(cars, speed)
    assert x._fields == STATES
    return np.stack(x)


@pytest.mark.studies
@needs_limit
# 13 leave the last pack short; a single run is computed in scalars.
@pytest.mark.parametrize("runs", [1, 13, 200])
def test_library_and_limit_agree(runs):
    problem = drives(runs, rows=40, seed=3)
    x, expected = ours(problem).reshape(8, 41, runs), limit.seven_dof(problem)()
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.abs((x[:, 1:] - expected) / scale).max() < 1e-9
    # It is a drive worth measuring: tyres work both ways, wheels slip.
    assert np.abs(x[3]).max() > 0.1 and np.abs(x[4, -1] * problem.body["wheel_radius"] - x[0, -1]).max() > 1e-2


@pytest.mark.studies
@needs_limit
def test_single_precision_follows_double():
    problem = drives(40, rows=40, seed=4)
    double = limit.seven_dof(problem)().copy()
    scale = np.abs(double).max(axis=(1, 2), keepdims=True)
    with jax.enable_x64(False):
        x = ours(problem, np.float32)
    assert x.dtype == np.float32
    for single in (limit.seven_dof(problem, dtype=np.float32)(), x[:, 1:]):
        assert np.abs((single - double) / scale).max() < 1e-4


def test_the_limit_names_what_it_cannot_do():
    with pytest.raises(ValueError, match="one run is computed in float64 alone"):
        limit.seven_dof(drives(1, 2), dtype=np.float32)


def test_rolled_stages_are_the_same_method():
    problem = drives(3, rows=10)
    np.testing.assert_allclose(ours(problem), ours(problem, solver=statespace.RolledRK4()), rtol=1e-12, atol=1e-12)


@pytest.mark.full
def test_gradient_follows_finite_differences():
    problem = drives(2, rows=30)
    chosen, *rest = simulation.gradient_arguments(problem)
    loss = jax.jit(lambda chosen: simulation.mean_square(problem, chosen, *rest))
    gradient = jax.grad(loss)(chosen)
    for leaf, (path, slope) in enumerate(jax.tree_util.tree_leaves_with_path(gradient)):
        leaves, tree = jax.tree.flatten(chosen)
        step = 1e-4 * leaves[leaf]
        up, down = (
            jax.tree.unflatten(tree, [*leaves[:leaf], leaves[leaf] + s, *leaves[leaf + 1 :]]) for s in (step, -step)
        )
        difference = loss(up) - loss(down)
        np.testing.assert_allclose(difference, 2 * np.sum(slope * step), rtol=1e-4, err_msg=jax.tree_util.keystr(path))


@pytest.mark.studies
def test_two_devices_give_what_one_gives():
    command = [sys.executable, "-m", "benchmarks.two_cores", "--runs", "4", "--rows", "1", "--rounds", "1"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[2], check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert "two cores:" in done.stdout
