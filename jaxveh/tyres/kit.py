"""The building blocks for code that adds or reads tyre laws."""

from jaxveh.tyres.base import need_load, need_static
from jaxveh.tyres.evaluation import EVALUATION_INPUTS, evaluate
from jaxveh.tyres.generic import GENERIC_TYRE, GenericTyre
from jaxveh.tyres.mf_tyre.typical import TYPICAL_COEFFICIENTS
from jaxveh.tyres.mirrored import mirrored_contact
from jaxveh.tyres.two_stiffnesses import AbstractTwoStiffnesses

__all__ = [
    "EVALUATION_INPUTS",
    "GENERIC_TYRE",
    "TYPICAL_COEFFICIENTS",
    "AbstractTwoStiffnesses",
    "GenericTyre",
    "evaluate",
    "mirrored_contact",
    "need_load",
    "need_static",
]
