"""Basic functions of plain arrays: elementary functions, random numbers, resampling, small matrices.

All of them can be jitted, batched and differentiated.
"""

from jaxveh.numerics import polynomials, sigma_points
from jaxveh.numerics.angles import wrap_angle
from jaxveh.numerics.blocks import sum_in_blocks
from jaxveh.numerics.by_batch import RUNS, by_batch
from jaxveh.numerics.divisors import or_one
from jaxveh.numerics.elementary import arctan, arctan2, cos, hypot, log, sin, sqrt, tan
from jaxveh.numerics.extremes import largest, smallest
from jaxveh.numerics.fences import apart, fence, fence_blocks, fence_results
from jaxveh.numerics.harmonics import band_harmonics, gauss_markov_harmonics, sum_of_harmonics
from jaxveh.numerics.linear_algebra import (
    cholesky,
    inverse_psd,
    log_det,
    mahalanobis,
    solve_lower,
    solve_lower_transposed,
    solve_psd,
    symmetric,
)
from jaxveh.numerics.pieces import Piece, pieces_of, there_and_back
from jaxveh.numerics.platform import barriers_hold, on_cpu, pays_alone
from jaxveh.numerics.random import cauchy, exponential, normal, normals, student_t, uniform
from jaxveh.numerics.resampling import ess, multinomial, normalise, residual, stratified, systematic
from jaxveh.numerics.roots import secant
from jaxveh.numerics.scan_last import scan_batch_last
from jaxveh.numerics.scan_written_out import scan_written_out
from jaxveh.numerics.small_systems import solve_scalars
from jaxveh.numerics.smooth import smooth_bump, smooth_clip, smooth_ramp, smooth_step
from jaxveh.numerics.sums import total
from jaxveh.numerics.tables import interpolate_linear, interpolate_smooth
from jaxveh.numerics.tangents import derivative_alone
from jaxveh.numerics.triangular import lower_factor
from jaxveh.numerics.widths import as_wide_as
from jaxveh.numerics.written_out import as_entries, as_whole, from_entries, write_out

__all__ = [
    "RUNS",
    "Piece",
    "apart",
    "arctan",
    "arctan2",
    "as_entries",
    "as_whole",
    "as_wide_as",
    "band_harmonics",
    "barriers_hold",
    "by_batch",
    "cauchy",
    "cholesky",
    "cos",
    "derivative_alone",
    "ess",
    "exponential",
    "fence",
    "fence_blocks",
    "fence_results",
    "from_entries",
    "gauss_markov_harmonics",
    "hypot",
    "interpolate_linear",
    "interpolate_smooth",
    "inverse_psd",
    "largest",
    "log",
    "log_det",
    "lower_factor",
    "mahalanobis",
    "multinomial",
    "normal",
    "normalise",
    "normals",
    "on_cpu",
    "or_one",
    "pays_alone",
    "pieces_of",
    "polynomials",
    "residual",
    "scan_batch_last",
    "scan_written_out",
    "secant",
    "sigma_points",
    "sin",
    "smallest",
    "smooth_bump",
    "smooth_clip",
    "smooth_ramp",
    "smooth_step",
    "solve_lower",
    "solve_lower_transposed",
    "solve_psd",
    "solve_scalars",
    "sqrt",
    "stratified",
    "student_t",
    "sum_in_blocks",
    "sum_of_harmonics",
    "symmetric",
    "systematic",
    "tan",
    "there_and_back",
    "total",
    "uniform",
    "wrap_angle",
    "write_out",
]
