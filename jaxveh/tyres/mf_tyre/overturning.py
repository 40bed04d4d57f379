"""Overturning moment (4.E69, in the form of the MF-Tyre manual)."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.mf_tyre.formula import coefficient
from jaxveh.tyres.mf_tyre.section import AbstractSection


class OverturningCoefficients(AbstractSection):
    """The section [OVERTURNING_COEFFICIENTS]: `QSX1` to `QSX14`, pressure `PPMX1`."""

    QSX1: jax.Array = coefficient(scale=0.01)
    QSX2: jax.Array = coefficient()
    QSX3: jax.Array = coefficient(scale=0.1)
    QSX4: jax.Array = coefficient()
    QSX5: jax.Array = coefficient()
    QSX6: jax.Array = coefficient()
    QSX7: jax.Array = coefficient()
    QSX8: jax.Array = coefficient()
    QSX9: jax.Array = coefficient()
    QSX10: jax.Array = coefficient()
    QSX11: jax.Array = coefficient()
    QSX12: jax.Array = coefficient()
    QSX13: jax.Array = coefficient(scale=0.1)
    QSX14: jax.Array = coefficient()
    PPMX1: jax.Array = coefficient()

    def moment(self, at, scaling, structure, least_load, F_y):
        """M_x, N m; below `least_load` (N) the load in it is replaced by load^3 / least_load^2."""
        c, camber = self, at.camber
        load = jnp.where(at.load < least_load, at.load**3 / numerics.or_one(least_load, least_load > 0) ** 2, at.load)
        share, side = load / structure.FNOMIN, F_y / structure.FNOMIN
        level = numerics.cos(c.QSX5 * numerics.arctan((c.QSX6 * share) ** 2))
        lean = numerics.sin(c.QSX7 * camber + c.QSX8 * numerics.arctan(c.QSX9 * side))
        with_load = (
            c.QSX1 * scaling.LVMX - c.QSX2 * camber * (1 + c.PPMX1 * at.dp_i) + c.QSX3 * side + c.QSX4 * (level * lean)
        )
        with_load = with_load + c.QSX10 * numerics.arctan(c.QSX11 * share) * camber
        rest = F_y * (c.QSX13 + c.QSX14 * jnp.abs(camber)) - load * c.QSX12 * camber * jnp.abs(camber)
        return structure.UNLOADED_RADIUS * scaling.LMX * (load * with_load + rest)
