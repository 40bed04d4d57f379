"""The sections of a property file."""

from __future__ import annotations

import equinox as eqx

from jaxveh._core.parameter import check_parameters


class AbstractSection(eqx.Module):
    """A section of a property file, or several sections together; the fields are their coefficients.

    **Raises** `InputError` for a coefficient that is not finite, or not positive where it must be.
    """

    def __check_init__(self):
        check_parameters(self)
