"""Intervals of a tyre fitted to rig data hold the coefficients of the tyre that was measured."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from rig_sweeps import forces, measured_of, peak, plan, table, truth
from shared_data import shared

from jaxveh import fitting, io, tyres
from jaxveh.fitting.rig_data import leaf_of as leaf
from jaxveh.fitting.rig_problem import contact_of

CHANNELS = ("F_x", "F_y")
NOISE = 0.02
CURVED = ("PEX", "PEY", "REX", "REY")


def noisy_table(channels, seed, rows=slice(None)):
    """What a rig would measure of the reference tyre at the inputs of the shared table, with 2 % noise."""
    inputs = io.read_rig_table(shared("mfeval_mf61.csv")).take(rows)
    found, random = forces(truth(), contact_of(inputs)), np.random.default_rng(seed)
    measured = dict.fromkeys(("F_x", "F_y", "M_x", "M_y", "M_z"))
    for name in channels:
        clean = np.asarray(getattr(found, name))
        measured[name] = clean + NOISE * peak(clean) * random.standard_normal(clean.shape)
    return dataclasses.replace(inputs, **measured)


def ordinary():
    """A typical tyre with the load, pressure, speed and radius that the coefficients refer to, which comparing them needs."""
    known = truth().structure
    return tyres.typical_mf_tyre(known.FNOMIN, pressure=known.NOMPRES, speed=known.LONGVL, radius=known.UNLOADED_RADIUS)


def covered(fits, tyre=None):
    """Of 95 % intervals of what a fit says is identified, the share that hold the coefficient of the tyre that was measured, by
    name and pooled."""
    form = fitting.canonical(truth() if tyre is None else tyre)
    true = np.array([float(leaf(form, name)) for name in fits[0].names])
    values, std = (np.array([getattr(fit, name).array() for fit in fits]) for name in ("parameters", "parameters_std"))
    known, held = np.isfinite(std), np.abs(values - true) < 1.96 * std
    by_name = {name: held[known[:, i], i].mean() for i, name in enumerate(fits[0].names) if known[:, i].any()}
    return by_name, held[known].mean()


def test_intervals_of_pure_slip_cover():
    """A small one: three fits to the shared table's sweeps of slip angle. PKY4 stands at 2 where the tyre has 2.74."""
    pure = np.abs(io.read_rig_table(shared("mfeval_mf61.csv")).slip_ratio) < 1e-6
    fits = [fitting.fit_rig(ordinary(), noisy_table(("F_y",), seed, pure), throw=False) for seed in range(3)]
    by_name, pooled = covered(fits)
    assert "lateral.PKY4" not in by_name and all(fit.parameters["lateral.PKY4"] == 2.0 for fit in fits)
    assert pooled > 0.85
    start = ordinary()
    for fit in fits:
        for name in np.array(fit.names)[np.isnan(fit.parameters_std.array())]:
            assert float(leaf(fit.tyre, name)) == float(leaf(start, name))


@pytest.mark.full
def test_standard_errors_cover():
    """60 fits from a generic start to the shared table's 2,172 rows: 93 % of the 95 % intervals hold the file's coefficients.

    Least of PPY1 and PPY2 (80 and 37 %): with PKY4 at 2 the nearest tyre has other ones; of what the data hardly identify (PEY5,
    PKY3, PDY3: 57 to 88 %), which counts as known where noise makes it large.
    """
    fits = [fitting.fit_rig(ordinary(), noisy_table(CHANNELS, seed), throw=False) for seed in range(60)]
    by_name, pooled = covered(fits)
    print(pooled, {name: share for name, share in by_name.items() if share < 0.9})
    assert 0.92 < pooled < 0.98


def drawn(names, seed):
    """A tyre drawn around the reference: each of these coefficients by 15 %, curvatures below 0.9, PKY4 between 1.4 and 2.8."""
    random = np.random.default_rng(seed)
    factors, shape = 1 + 0.15 * random.standard_normal(len(names)), random.uniform(1.4, 2.8)
    values = [factor * leaf(truth(), name) for name, factor in zip(names, factors, strict=True)]
    values = [
        min(value, jnp.asarray(0.9)) if name[-4:-1] in CURVED else value
        for name, value in zip(names, values, strict=True)
    ]
    where = lambda law: [*(leaf(law, name) for name in names), law.lateral.PKY4]
    return eqx.tree_at(where, truth(), [*values, jnp.asarray(shape)])


@pytest.mark.full
def test_standard_errors_cover_on_tyres_drawn_at_random():
    """Three fits to each of twelve tyres: 92 % of the 95 % intervals hold the truth (85 to 97 % of one tyre's)."""
    columns, run = plan()
    as_rig = lambda tyre, seed: table(measured_of(tyre, columns, CHANNELS), columns, run, NOISE, seed)
    fitted = lambda data: fitting.fit_rig(ordinary(), data, throw=False)
    names = [name for name in fitted(as_rig(truth(), 0)).names if name != "lateral.PKY4"]
    shares = []
    for seed in range(12):
        tyre = drawn(names, 100 + seed)
        shares.append(covered([fitted(as_rig(tyre, 1000 * seed + again)) for again in range(3)], tyre)[1])
    print(np.mean(shares), shares)
    assert 0.90 < np.mean(shares) < 0.98 and min(shares) > 0.8


@pytest.mark.full
def test_coefficients_and_directions_cover_from_the_fit_s_end():
    """100 repetitions from one fit's end, PKY4 asked for, so that the measured tyre can be reached: of what data identify
    95 % intervals hold the truth in 90 to 98 %.

    Of each coefficient, and of each direction in which the information at the truth has its axes (a combination of coefficients
    that is chosen beforehand).
    """
    columns, run = plan(points=50)
    clean = measured_of(truth(), columns, CHANNELS)
    noisy = lambda seed: table(clean, columns, run, NOISE, seed)
    again = dict(free=("lateral.PKY4",), throw=False)
    first = fitting.fit_rig(ordinary(), noisy(0), **again)
    form = fitting.canonical(truth())
    true = np.array([float(leaf(form, name)) for name in first.names])
    size = np.maximum(np.abs(true), 0.05)
    axes = np.linalg.eigh(np.linalg.inv(at_truth(form, noisy(0), first) / np.outer(size, size)))
    seen = axes.eigenvalues > 1
    coefficients, directions = [], []
    for seed in range(1, 101):
        fit = fitting.fit_rig(first.tyre, noisy(seed), staged=False, **again)
        assert fit.names == first.names
        error = (fit.parameters.array() - true) / size
        known = np.isfinite(fit.parameters_std.array())
        coefficients.append(np.abs(error * size / fit.parameters_std.array())[known] < 1.96)
        spread = np.diag(axes.eigenvectors.T @ (fit.covariance / np.outer(size, size)) @ axes.eigenvectors)
        directions.append((np.abs(axes.eigenvectors.T @ error) < 1.96 * np.sqrt(spread))[seen])
    print("coefficients", np.mean(np.concatenate(coefficients)), "directions", np.mean(directions), seen.sum())
    assert 0.90 < np.mean(np.concatenate(coefficients)) < 0.98
    assert 0.90 < np.mean(directions) < 0.98


def at_truth(tyre, data, first):
    """The covariance of a fit that starts and stays at the truth."""
    where = lambda law: [leaf(law, name) for name in first.names]
    return fitting.fit_rig(tyre, data, where=where, staged=False, max_steps=1, throw=False).covariance
