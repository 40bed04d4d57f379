"""What those who add a tyre law, or read one, build with."""

from jaxveh.tyres.evaluation import EVALUATION_INPUTS, evaluate
from jaxveh.tyres.mf_tyre.typical import TYPICAL_COEFFICIENTS
from jaxveh.tyres.mirrored import mirrored_contact

__all__ = [
    "EVALUATION_INPUTS",
    "TYPICAL_COEFFICIENTS",
    "evaluate",
    "mirrored_contact",
]
