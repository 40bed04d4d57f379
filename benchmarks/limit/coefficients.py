"""Polynomial coefficients of the C++ limit's elementary functions.

Each function is written as a power series in the variable that its code in ``elementary.hpp`` uses (``z = t^2`` for the
odd and even ones) and fitted on the interval that its range reduction leaves, by interpolation in Chebyshev points. That
is within a small factor of the best uniform fit, and the number of terms is chosen so that the fit error is below
rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

__all__ = ["FITS", "Fit", "header", "power_series"]


class Fit(NamedTuple):
    """One polynomial: its C++ name, function, interval and number of terms in single and double precision."""

    name: str
    function: Callable[[np.ndarray], np.ndarray]
    upper: float
    lower: float
    single: int
    double: int


def _odd(function: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda z: function(np.sqrt(z)) / np.sqrt(z)


def _two_arctanh(t: np.ndarray) -> np.ndarray:
    return 2 * np.arctanh(t)


_TAN_8 = math.tan(math.pi / 8)
_LOG_RANGE = (math.sqrt(2) - 1) / (math.sqrt(2) + 1)

FITS = (
    Fit("arctan_single", _odd(np.arctan), 1.0, 0.0, 9, 0),
    Fit("arctan_double", _odd(np.arctan), _TAN_8**2, 0.0, 0, 11),
    Fit("sine", _odd(np.sin), (math.pi / 2) ** 2, 0.0, 5, 9),
    Fit("small_sine", _odd(np.sin), (math.pi / 4) ** 2, 0.0, 4, 7),
    Fit("small_cosine", lambda z: np.cos(np.sqrt(z)), (math.pi / 4) ** 2, 0.0, 5, 7),
    Fit("exponential", np.exp, math.log(2) / 2, -math.log(2) / 2, 7, 12),
    Fit("logarithm", _odd(_two_arctanh), _LOG_RANGE**2, 0.0, 4, 8),
)


def power_series(fit: Fit, terms: int) -> np.ndarray:
    """Return coefficients of 1, x, x^2, ... that interpolate ``fit.function`` in ``terms`` Chebyshev points of its interval.

    The interpolation runs in extended precision, because the change from Chebyshev to power basis amplifies rounding.
    """
    angle = np.pi * (np.arange(terms) + 0.5) / terms
    half = np.longdouble(fit.upper - fit.lower) / 2
    points = np.longdouble(fit.lower) + half * (1 + np.cos(angle.astype(np.longdouble)))
    # Newton's divided differences, then the nested product written out in powers.
    differences = fit.function(points).astype(np.longdouble)
    for order in range(1, terms):
        gaps = points[order:] - points[:-order]
        differences[order:] = (differences[order:] - differences[order - 1 : -1]) / gaps
    powers = np.zeros(terms, np.longdouble)
    for difference, point in zip(differences[::-1], points[::-1], strict=True):
        shifted = np.concatenate([[np.longdouble(0)], powers[:-1]])
        powers = shifted - point * powers
        powers[0] += difference
    return powers.astype(np.float64)


def header() -> str:
    """Return the text of ``coefficients.hpp``."""
    lines = ["// Written by coefficients.py when the library is built.", "#pragma once", "namespace coefficients {"]
    for fit in FITS:
        for suffix, terms in (("single", fit.single), ("double", fit.double)):
            if terms:
                name = fit.name if fit.name.endswith(suffix) else f"{fit.name}_{suffix}"
                values = ", ".join(f"{c:.17g}" for c in power_series(fit, terms))
                lines.append(f"inline constexpr double {name}[] = {{{values}}};")
    return "\n".join([*lines, "}", ""])
