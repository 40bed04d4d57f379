"""MF-Tyre 6.1 from rig data: the reference tyre's forces are found again from a generic start."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from rig_sweeps import measured_of, peak, plan, table, truth
from shared_data import shared

from jaxveh import fitting, io, tyres
from jaxveh.fitting.rig_data import leaf_of as leaf

CHANNELS = ("F_x", "F_y")
NOISE = 0.02

SIGNLESS = ("longitudinal.RBX2", "lateral.RBY2", "lateral.RVY4")
"""Coefficients of which either sign is the same tyre; that of RVY5 and RVY6 turns together."""


def start(rig):
    return fitting.starting_tyre("mf61", rig)


@pytest.mark.full
def test_a_generic_start_comes_to_the_truth_through_noise():
    columns, run = plan()
    clean = measured_of(truth(), columns, CHANNELS)
    data = table(clean, columns, run, NOISE, seed=1)
    fit = fitting.fit_rig(start(data), data)
    assert fit.stages[-1].converged and [stage.name for stage in fit.stages][-1] == "joint"
    found = measured_of(fit.tyre, columns, CHANNELS)
    for name in CHANNELS:
        error = np.sqrt(np.mean((found[name] - clean[name]) ** 2)) / peak(clean[name])
        assert error < 0.005 < NOISE < 0.05 < fit.start_rmse[name] / fit.peak[name]
        np.testing.assert_allclose(fit.noise[name] / peak(clean[name]), NOISE, rtol=0.05)
    # Camber and pressure never vary together here.
    assert np.isnan(fit.std[fit.names.index("lateral.PPY5")])
    assert 55 <= fit.identified < len(fit.names)


@pytest.mark.full
def test_a_fit_to_the_reference_s_own_rows():
    """Both modes of the reference, as if they were rig data: its forces to 1 % of their peak."""
    data = io.read_rig_table(shared("mfeval_mf61.csv"))
    assert {"in_alpha", "useMode"} <= set(pd.read_csv(shared("mfeval_mf61.csv"), nrows=1).columns)
    fit = fitting.fit_rig(start(data), data, measured=CHANNELS, throw=False)
    for name in CHANNELS:
        assert fit.rmse[name] < 0.01 * fit.peak[name] < 0.05 * fit.peak[name] < fit.start_rmse[name]


@pytest.mark.full
def test_standard_errors_cover():
    """100 repetitions from one fit's end: 95 % intervals, pooled over what data identify, hold the truth in 90 to 98 %.

    Of each coefficient, and of each direction in which the information at the truth has its axes (a combination of coefficients
    that is chosen beforehand).
    """
    columns, run = plan(points=50)
    clean = measured_of(truth(), columns, CHANNELS)
    noisy = lambda seed: table(clean, columns, run, NOISE, seed)
    # Coefficients are those of a nominal load and pressure, which whoever compares them must know.
    known = truth().structure
    first = fitting.fit_rig(tyres.typical_mf_tyre(known.FNOMIN, pressure=known.NOMPRES, speed=known.LONGVL), noisy(0))
    true = np.array([float(leaf(turned(truth(), first.tyre), name)) for name in first.names])
    size = np.maximum(np.abs(true), 0.05)
    axes = np.linalg.eigh(np.linalg.inv(at_truth(turned(truth(), first.tyre), noisy(0), first) / np.outer(size, size)))
    seen = axes.eigenvalues > 1
    coefficients, directions = [], []
    for seed in range(1, 101):
        fit = fitting.fit_rig(first.tyre, noisy(seed), staged=False)
        assert fit.names == first.names
        error = (fit.values - true) / size
        known = np.isfinite(fit.std)
        coefficients.append(np.abs(error * size / fit.std)[known] < 1.96)
        spread = np.diag(axes.eigenvectors.T @ (fit.covariance / np.outer(size, size)) @ axes.eigenvectors)
        directions.append((np.abs(axes.eigenvectors.T @ error) < 1.96 * np.sqrt(spread))[seen])
    print("coefficients", np.mean(np.concatenate(coefficients)), "directions", np.mean(directions), seen.sum())
    assert 0.90 < np.mean(np.concatenate(coefficients)) < 0.98
    assert 0.90 < np.mean(directions) < 0.98


def at_truth(tyre, data, first):
    """The covariance of a fit that starts and stays at the truth."""
    where = lambda law: [leaf(law, name) for name in first.names]
    return fitting.fit_rig(tyre, data, where=where, staged=False, max_steps=1, throw=False).covariance


def turned(tyre: tyres.MFTyre, like: tyres.MFTyre) -> tyres.MFTyre:
    """The same tyre in the signs of another, where either sign is the same tyre."""
    same = {name: jnp.sign(leaf(like, name)) * jnp.abs(leaf(tyre, name)) for name in SIGNLESS}
    flips = jnp.sign(tyre.lateral.RVY6) * jnp.sign(like.lateral.RVY6)
    same |= {name: flips * leaf(tyre, name) for name in ("lateral.RVY5", "lateral.RVY6")}
    for name, value in same.items():
        part, key = name.split(".")
        tyre = dataclasses.replace(tyre, **{part: dataclasses.replace(getattr(tyre, part), **{key: value})})
    return tyre
