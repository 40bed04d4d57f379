"""Axes of samples: points that fill their box, seen by runs under their names, with and without a store."""

import jax
import numpy as np
import pytest
import xarray

from jaxveh import InputError, sweeps

RANGES = {"mass": (1200.0, 1800.0), "friction": (0.3, 1.1)}


@pytest.mark.parametrize("make", [sweeps.latin_hypercube, sweeps.sobol])
def test_each_part_of_each_range_has_one_point(make):
    found = make(64, seed=3, **RANGES).columns
    assert list(found) == list(RANGES)
    for name, (low, high) in RANGES.items():
        parts = np.floor(64 * (found[name] - low) / (high - low)).astype(int)
        assert sorted(parts) == list(range(64))
    assert all((make(64, seed=3, **RANGES).columns[name] == found[name]).all() for name in found)
    assert not (make(64, seed=4, **RANGES).columns["mass"] == found["mass"]).any()


def test_averages_over_sobol_points_err_less():
    value = lambda s: np.mean(np.sin(s.columns["x"]) * np.exp(s.columns["y"]))
    exact = (1 - np.cos(1)) * (np.e - 1)
    errors = [abs(value(sweeps.sobol(1024, seed=seed, x=(0, 1), y=(0, 1))) - exact) for seed in range(8)]
    # Random points err by 0.35 / sqrt(1024) = 0.011.
    assert np.median(errors) < 1e-3


def run(point, key):
    return {"value": point.gain * point.car.mass + point.car.friction, "drawn": jax.random.normal(key)}


@pytest.mark.parametrize("stored", [False, True], ids=["in memory", "stored"])
def test_a_run_gets_its_own_sample(stored, tmp_path):
    samples = sweeps.sobol(8, **RANGES)
    design = sweeps.Design(gain=[1.0, 2.0], car=samples)
    more = {"store": tmp_path / "s.zarr", "batch": 5} if stored else {}
    found = sweeps.sweep(run, design, 3, jax.random.key(0), **more)
    mass, friction = samples.columns["mass"], samples.columns["friction"]
    wanted = np.array([1.0, 2.0])[:, None] * mass + friction
    np.testing.assert_allclose(found["value"], np.broadcast_to(wanted[..., None], (2, 8, 3)), rtol=1e-15)
    np.testing.assert_array_equal(found.design.axis("car").columns["mass"], mass)
    np.testing.assert_array_equal(found.at("value", car=2), found["value"][:, 2])
    if stored:
        data = xarray.open_zarr(tmp_path / "s.zarr")
        np.testing.assert_array_equal(data["car.friction"], friction)
        assert data["car.friction"].dims == ("car",) and data["car"].values.tolist() == list(range(8))
        with pytest.raises(InputError, match="begun with axis car"):
            sweeps.sweep(
                run, sweeps.Design(gain=[1.0, 2.0], car=sweeps.sobol(8, seed=1, **RANGES)), 3, jax.random.key(0), **more
            )


MISTAKES = [
    (lambda: sweeps.latin_hypercube(0, x=(0, 1)), "count = 0"),
    (lambda: sweeps.latin_hypercube(4), "give a range"),
    (lambda: sweeps.latin_hypercube(4, x=(1, 1)), r"x = \(1, 1\): must be \(low, high\)"),
    (lambda: sweeps.sobol(4, x=(0, np.inf)), "x = "),
    (lambda: sweeps.sobol(4, **{"front.B": (0, 1)}), r"range 'front\.B': must be a name .* write front_B\."),
    (lambda: sweeps.latin_hypercube(4, **{"class": (0, 1)}), r"range 'class': .* write class_\."),
    (lambda: sweeps.sobol(4, x=3.0), "x = 3.0"),
    (lambda: sweeps.sobol(600, x=(0, 1)), "count = 600: .* take 512 or 1024"),
]


@pytest.mark.parametrize(("call", "message"), MISTAKES)
def test_mistakes_are_named(call, message):
    with pytest.raises(InputError, match=message):
        call()
