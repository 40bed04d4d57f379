"""The chi-squared distribution, computed on the host in float64 whatever JAX's precision is."""

from __future__ import annotations

import functools
import math

from jaxveh._core.errors import check, check_positive
from jaxveh._core.host import on_host

TINY = 1e-300


@on_host
def chi_squared_tails(value: float, dof: float) -> tuple[float, float]:
    """Return P(X <= value) and P(X > value) of a chi-squared variable with `dof` > 0 degrees of freedom.

    The relative accuracy of both is about 1e-12 (1e-10 for 1e5 degrees of freedom).

    The regularised incomplete gamma functions are computed by a series below the mean, and by a continued fraction above it
    (M. Abramowitz & I. Stegun 1964, 6.5.29 and 6.5.31), so that neither tail is a difference.
    """
    check_positive("degrees of freedom", dof)
    a, x = 0.5 * dof, 0.5 * value
    if x <= 0:
        return 0.0, 1.0
    if math.isinf(x):
        return 1.0, 0.0
    # x^a e^-x / Gamma(a + 1)
    front = math.exp(a * math.log(x) - x - math.lgamma(a + 1))
    if x < a + 1:
        lower = min(front * _series(a, x), 1.0)
        return lower, 1.0 - lower
    upper = min(front * a * _fraction(a, x), 1.0)
    return 1.0 - upper, upper


def _series(a: float, x: float) -> float:
    """1 + x / (a + 1) + x^2 / ((a + 1) (a + 2)) + ..."""
    term = total = 1.0
    n = 0
    while term > 1e-17 * total:
        n += 1
        term *= x / (a + n)
        total += term
    return total


def _fraction(a: float, x: float) -> float:
    """1 / (x + 1 - a - 1 (1 - a) / (x + 3 - a - 2 (2 - a) / (x + 5 - a - ...))), by W. Lentz's method."""
    b = x + 1 - a
    c, d = 1 / TINY, 1 / (b or TINY)
    value, n = d, 0
    change = 0.0
    while abs(change - 1) > 1e-15 and n < 100_000:
        n += 1
        b += 2
        step = n * (a - n)
        d = 1 / ((step * d + b) or TINY)
        c = (b + step / c) or TINY
        change = c * d
        value *= change
    return value


@on_host
@functools.lru_cache(maxsize=1024)
def chi_squared_quantile(share: float, dof: float) -> float:
    """Return the quantile `share` of a chi-squared variable with `dof` degrees of freedom, by bisection.

    **Raises** `InputError` unless 0 < share < 1 and dof > 0.
    """
    check("share", share, lambda p: (p > 0) & (p < 1), "above 0 and below 1")
    check_positive("degrees of freedom", dof)
    # The smaller tail is used because it keeps its digits.
    below = share <= 0.5
    beyond = lambda x: chi_squared_tails(x, dof)[0] > share if below else chi_squared_tails(x, dof)[1] < 1 - share
    low, high = 0.0, float(dof)
    while not beyond(high):
        low, high = high, 2 * high
    while high - low > 1e-14 * high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (low, middle) if beyond(middle) else (middle, high)
    return 0.5 * (low + high)


@on_host
def chi_squared_band(dof: float, confidence: float = 0.95) -> tuple[float, float]:
    """Return the interval with equal tails that has probability `confidence` for `dof` degrees of freedom."""
    check("confidence", confidence, lambda p: (p > 0) & (p < 1), "above 0 and below 1")
    tail = 0.5 * (1 - confidence)
    return chi_squared_quantile(tail, dof), chi_squared_quantile(1 - tail, dof)


def two_sided(value: float, dof: float) -> float:
    """Return the two-sided p-value of a chi-squared variable: twice the smaller tail at `value`."""
    return min(1.0, 2 * min(chi_squared_tails(value, dof)))
