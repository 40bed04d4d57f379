"""Polynomials of the elementary functions, and their evaluation.

An odd function of the reduced argument r is written f(r) = r + r t q(t), with t = r^2: small arguments then keep
their relative accuracy. Coefficients are those of q, ascending; `tests/numerics/coefficients.py` computes them.
"""

import jax.numpy as jnp
from jax import Array


def evaluate(coefficients: tuple[float, ...], t: Array) -> Array:
    """Polynomial with ascending `coefficients` at `t`, any shape, split into even and odd powers.

    The two halves are independent chains of multiply-adds, which hides half of their latency.
    """
    if len(coefficients) < 4:
        return _horner(coefficients, t)
    square = t * t
    return _horner(coefficients[0::2], square) + t * _horner(coefficients[1::2], square)


def of_dtype(value: Array, single: tuple[float, ...], double: tuple[float, ...]) -> tuple[float, ...]:
    """The coefficients for the precision of `value`: `single` for float32, `double` for float64."""
    return single if value.dtype == jnp.float32 else double


def _horner(coefficients: tuple[float, ...], t: Array) -> Array:
    total = jnp.full_like(t, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = total * t + coefficient
    return total


SINE_32 = (
    -0.16666665846834117,
    0.008333231002090012,
    -0.0001982126662316618,
    2.630077361239679e-06,
)
SINE_64 = (
    -0.16666666666666666,
    0.00833333333333332,
    -0.00019841269841256682,
    2.7557319219430714e-06,
    -2.5052107636214893e-08,
    1.605897794524133e-10,
    -7.643977503530688e-13,
    2.7314239508690378e-15,
)
COSINE_32 = (
    -0.49999999963953023,
    0.04166665936002493,
    -0.0013888651647261437,
    2.4774579745197616e-05,
    -2.6297517416542946e-07,
)
COSINE_64 = (
    -0.5,
    0.04166666666666635,
    -0.001388888888886137,
    2.4801587292563314e-05,
    -2.755731777741382e-07,
    2.087663131566023e-09,
    -1.146469965891482e-11,
    4.6277576013261913e-14,
)
ARCTANGENT_32 = (
    -0.33333286563942743,
    0.19991237743030146,
    -0.14024142841863957,
    0.0852049203588126,
)
ARCTANGENT_64 = (
    -0.3333333333333325,
    0.1999999999989843,
    -0.14285714266099817,
    0.11111109636715759,
    -0.09090852562339267,
    0.07691055241123645,
    -0.06649614476350313,
    0.05736336478754716,
    -0.04483347510981751,
    0.022750688037925015,
)
LOGARITHM_32 = (
    0.3333334251978793,
    0.1999439028301099,
    0.14789974695986374,
)
LOGARITHM_64 = (
    0.3333333333333335,
    0.19999999999949694,
    0.14285714313011633,
    0.1111110556395306,
    0.09091444785808497,
    0.07665854143798584,
    0.07308299287583819,
)
OCTANT_SINE_32 = (
    -0.1666666466231438,
    0.00833274827062975,
    -0.00019587890880412402,
)
OCTANT_SINE_64 = (
    -0.16666666666666666,
    0.008333333333330945,
    -0.00019841269836752716,
    2.755731610004253e-06,
    -2.5051131403777088e-08,
    1.5918101939095907e-10,
)
OCTANT_COSINE_32 = (
    -0.49999999969119313,
    0.04166665064451703,
    -0.0013887589155600385,
    2.446378829324601e-05,
)
OCTANT_COSINE_64 = (
    -0.5,
    0.041666666666666685,
    -0.0013888888888889633,
    2.4801587299714295e-05,
    -2.755731741576507e-07,
    2.087614912006645e-09,
    -1.1381987459967335e-11,
)
