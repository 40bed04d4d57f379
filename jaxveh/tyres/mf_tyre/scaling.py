"""User scaling factors: with 1 the tyre is as measured."""

from __future__ import annotations

import jax

from jaxveh._core.parameter import positive
from jaxveh.tyres.mf_tyre.formula import factor
from jaxveh.tyres.mf_tyre.section import AbstractSection


class Scaling(AbstractSection):
    """The section [SCALING_COEFFICIENTS].

    Factors of nominal load (`LFZO`); shape, friction, curvature, stiffness and shifts of F_x (`LCX` to `LVX`) and F_y (`LCY` to
    `LVY`); camber stiffness of F_y and M_z (`LKYC`, `LKZC`); pneumatic trail and residual torque (`LTR`, `LRES`); combined slip
    (`LXAL`, `LYKA`, `LVYKA`, moment arm `LS`); overturning (`LMX`, `LVMX`), rolling resistance (`LMY`) and parking moment
    (`LMP`); relaxation lengths of version 5.2 (`LSGKP`, `LSGAL`).
    """

    LFZO: jax.Array = positive(default=1.0)
    LCX: jax.Array = factor()
    LMUX: jax.Array = factor()
    LEX: jax.Array = factor()
    LKX: jax.Array = factor()
    LHX: jax.Array = factor()
    LVX: jax.Array = factor()
    LCY: jax.Array = factor()
    LMUY: jax.Array = factor()
    LEY: jax.Array = factor()
    LKY: jax.Array = factor()
    LHY: jax.Array = factor()
    LVY: jax.Array = factor()
    LKYC: jax.Array = factor()
    LKZC: jax.Array = factor()
    LTR: jax.Array = factor()
    LRES: jax.Array = factor()
    LXAL: jax.Array = factor()
    LYKA: jax.Array = factor()
    LVYKA: jax.Array = factor()
    LS: jax.Array = factor()
    LMX: jax.Array = factor()
    LVMX: jax.Array = factor()
    LMY: jax.Array = factor()
    LMP: jax.Array = factor()
    LSGKP: jax.Array = factor()
    LSGAL: jax.Array = factor()
