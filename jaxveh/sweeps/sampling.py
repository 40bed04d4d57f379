"""Points that fill a box, for designs where a grid of every combination would take too many runs."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_seed, check_whole
from jaxveh._core.host import on_host


class Samples(NamedTuple):
    """Points drawn together, as one axis of a design: (n,) numbers by name."""

    columns: dict[str, np.ndarray]


@on_host
def latin_hypercube(count: int, *, seed: int = 0, **ranges: tuple[float, float]) -> Samples:
    """`count` points: for each name, one lies in each of `count` equal parts of its range (M. D. McKay et al. 1979).

        Design(car=latin_hypercube(500, mass=(1200.0, 1800.0), friction=(0.3, 1.1)))     run sees point.car.mass

    `ranges`: (low, high) by name. The same `seed` gives the same points.

    **Raises** `InputError` for a name that Python does not allow, no range, a range that is not finite and increasing, or a count
    below one.
    """
    from scipy.stats import qmc

    check_seed("seed", seed)
    return _scaled(qmc.LatinHypercube(len(ranges) or 1, rng=seed), count, ranges)


@on_host
def sobol(count: int, *, seed: int = 0, **ranges: tuple[float, float]) -> Samples:
    """`count` points, a power of two, of a scrambled Sobol sequence (I. M. Sobol 1967, A. B. Owen 1998); otherwise like
    `latin_hypercube`. Averages over them have an error of about 1 / `count`, over random points of 1 / sqrt(`count`)."""
    from scipy.stats import qmc

    check_whole("count", count)
    check_seed("seed", seed)
    if count & (count - 1):
        below = 1 << (int(count).bit_length() - 1)
        raise InputError(
            f"count = {count}: Sobol points are balanced only for powers of two; take {below} or {2 * below}."
        )
    return _scaled(qmc.Sobol(len(ranges) or 1, rng=seed), count, ranges)


def check_field_names(what: str, names: Iterable[str]) -> None:
    """Raise `InputError` unless every name can be a field of the point that a run gets."""
    for name in names:
        if name.isidentifier() and not keyword.iskeyword(name) and not name.startswith("_"):
            continue
        word = re.sub(r"\W+", "_", name).strip("_")
        instead = f"{word}_" if keyword.iskeyword(word) else word if word.isidentifier() else f"x{word}"
        raise InputError(f"{what} {name!r}: must be a name that Python allows, as in point.{instead}; write {instead}.")


def _scaled(sampler, count: int, ranges: dict[str, tuple[float, float]]) -> Samples:
    check_whole("count", count)
    check_field_names("range", ranges)
    if not ranges:
        raise InputError("samples: give a range, (low, high), for at least one name.")
    unit = sampler.random(int(count))
    columns = {}
    for i, (name, ends) in enumerate(ranges.items()):
        low, high = _ends(name, ends)
        columns[name] = low + (high - low) * unit[:, i]
    return Samples(columns)


def _ends(name: str, ends: tuple[float, float]) -> tuple[float, float]:
    try:
        low, high = (float(end) for end in ends)
    except (TypeError, ValueError):
        low, high = np.nan, np.nan
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f"{name} = {ends!r}: must be (low, high), two finite numbers, the smaller one first.")
    return low, high
