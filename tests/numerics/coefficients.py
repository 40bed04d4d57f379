"""Recipe of the polynomials in `jaxveh.numerics.polynomials`; `python tests/numerics/coefficients.py` prints them.

Each elementary function is odd in its reduced argument r, f(r) = r + r t q(t) with t = r^2, so that small arguments
keep their relative accuracy. q is interpolated at Chebyshev nodes of [0, bound], in extended precision, and converted
to powers of t; at these degrees that is within a small factor of the minimax polynomial.
"""

from collections.abc import Callable

import numpy as np

Array = np.ndarray


def sine_remainder(t: Array) -> Array:
    """(sin r / r - 1) / r^2 by its Taylor series, which converges fast for r^2 <= 2.5 and cancels nothing."""
    term = np.full_like(t, -1 / np.longdouble(6))
    total = term.copy()
    for n in range(2, 20):
        term = -term * t / ((2 * n) * (2 * n + 1))
        total += term
    return total


def arctangent_remainder(t: Array) -> Array:
    """(arctan r / r - 1) / r^2 by its Taylor series, for r^2 <= 0.18."""
    return np.polynomial.polynomial.polyval(t, [(-1) ** n / np.longdouble(2 * n + 1) for n in range(1, 40)])


def hyperbolic_arctangent_remainder(t: Array) -> Array:
    """(artanh r / r - 1) / r^2 by its Taylor series, for r^2 <= 0.18."""
    return np.polynomial.polynomial.polyval(t, [1 / np.longdouble(2 * n + 1) for n in range(1, 40)])


def cosine_remainder(t: Array) -> Array:
    """(cos r - 1) / r^2 by its Taylor series."""
    term = np.full_like(t, -1 / np.longdouble(2))
    total = term.copy()
    for n in range(2, 20):
        term = -term * t / ((2 * n - 1) * (2 * n))
        total += term
    return total


def chebyshev_interpolant(
    function: Callable[[Array], Array], bound: float, degree: int, through_end: bool = False
) -> Array:
    """Coefficients in ascending powers of t of the interpolant of `function` on [0, bound]; `through_end`: its last node is the
    bound, otherwise it lies a little below."""
    count = degree + 1
    if through_end:
        bound = 2 * np.longdouble(bound) / (1 + np.cos(np.longdouble(np.pi) / (2 * count)))
    angle = 4 * np.arctan(np.longdouble(1)) * (np.arange(count, dtype=np.longdouble) + 0.5) / count
    values = function(np.longdouble(bound) / 2 * (1 + np.cos(angle)))
    series = [2 / np.longdouble(count) * np.sum(values * np.cos(k * angle)) for k in range(count)]
    series[0] /= 2
    # T_k of the mapped argument 2 t / bound - 1, as powers of t.
    linear = np.array([-1, 2 / np.longdouble(bound)], np.longdouble)
    previous, current = np.array([1], np.longdouble), linear
    total = np.zeros(count, np.longdouble)
    total[0] = series[0]
    for coefficient in series[1:]:
        total[: current.size] += coefficient * current
        following = 2 * np.convolve(linear, current)
        following[: previous.size] -= previous
        previous, current = current, following
    return total


SINE_BOUND = (np.pi / 2) ** 2
OCTANT_BOUND = (np.pi / 4) ** 2
TANGENT_BOUND = np.tan(np.pi / 8) ** 2
LOGARITHM_BOUND = (3 - 2 * np.sqrt(2)) ** 2  # of s = (m - 1) / (m + 1) for m between sqrt(1/2) and sqrt(2)

RECIPES = {
    # Through the end, so that sin(pi / 2) and cos(0) are exactly 1, with multiplications and additions fused or not.
    "SINE_32": (sine_remainder, SINE_BOUND, 3, True),
    "SINE_64": (sine_remainder, SINE_BOUND, 7),
    "COSINE_32": (cosine_remainder, SINE_BOUND, 4),
    "COSINE_64": (cosine_remainder, SINE_BOUND, 7),
    "ARCTANGENT_32": (arctangent_remainder, TANGENT_BOUND, 3),
    "ARCTANGENT_64": (arctangent_remainder, TANGENT_BOUND, 9),
    "LOGARITHM_32": (hyperbolic_arctangent_remainder, LOGARITHM_BOUND, 2),
    "LOGARITHM_64": (hyperbolic_arctangent_remainder, LOGARITHM_BOUND, 6),
    "OCTANT_SINE_32": (sine_remainder, OCTANT_BOUND, 2),
    "OCTANT_SINE_64": (sine_remainder, OCTANT_BOUND, 5),
    "OCTANT_COSINE_32": (cosine_remainder, OCTANT_BOUND, 3),
    "OCTANT_COSINE_64": (cosine_remainder, OCTANT_BOUND, 6),
}


def main() -> None:
    for name, recipe in RECIPES.items():
        coefficients = chebyshev_interpolant(*recipe)
        print(f"{name} = (\n" + "".join(f"    {float(c)!r},\n" for c in coefficients) + ")")


if __name__ == "__main__":
    main()
