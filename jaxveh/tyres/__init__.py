"""Tyre laws: the forces of one wheel (or one axle) at one instant as a function of its contact with the road."""

from jaxveh.tyres import kit, mf_tyre
from jaxveh.tyres.arctangent import Arctangent
from jaxveh.tyres.base import AbstractDynamicTyre, AbstractTyre, Contact, Forces, cornering_stiffness
from jaxveh.tyres.brush import Brush
from jaxveh.tyres.dugoff import Dugoff
from jaxveh.tyres.exponential import Exponential
from jaxveh.tyres.fiala import Fiala
from jaxveh.tyres.fiala_adams import FialaADAMS
from jaxveh.tyres.fiala_polynomial import FialaPolynomial
from jaxveh.tyres.friction_ellipse import FrictionEllipse
from jaxveh.tyres.hsri import HSRI
from jaxveh.tyres.isotropic import IsotropicMagicFormula
from jaxveh.tyres.linear import Linear
from jaxveh.tyres.linear_with_load import LinearWithLoad
from jaxveh.tyres.longitudinal import LongitudinalLaw
from jaxveh.tyres.lugre import LuGre
from jaxveh.tyres.magic_formula import MagicFormula
from jaxveh.tyres.mf_tyre import MFOutputs, MFTyre
from jaxveh.tyres.mirrored import Mirrored
from jaxveh.tyres.on_road import OnRoad
from jaxveh.tyres.parabolic import Parabolic
from jaxveh.tyres.parameters_file import read_parameters, write_parameters
from jaxveh.tyres.property_check import PropertyFinding, check_property_file
from jaxveh.tyres.property_file import from_property_file
from jaxveh.tyres.property_writer import to_property_file
from jaxveh.tyres.relaxed import Relaxed
from jaxveh.tyres.similarity import Similarity
from jaxveh.tyres.tmeasy import TMeasy, TMeasyCurve, TMeasyTrail
from jaxveh.tyres.typical import typical_mf_tyre
from jaxveh.tyres.unitire import UniTire

__all__ = [
    "HSRI",
    "AbstractDynamicTyre",
    "AbstractTyre",
    "Arctangent",
    "Brush",
    "Contact",
    "Dugoff",
    "Exponential",
    "Fiala",
    "FialaADAMS",
    "FialaPolynomial",
    "Forces",
    "FrictionEllipse",
    "IsotropicMagicFormula",
    "Linear",
    "LinearWithLoad",
    "LongitudinalLaw",
    "LuGre",
    "MFOutputs",
    "MFTyre",
    "MagicFormula",
    "Mirrored",
    "OnRoad",
    "Parabolic",
    "PropertyFinding",
    "Relaxed",
    "Similarity",
    "TMeasy",
    "TMeasyCurve",
    "TMeasyTrail",
    "UniTire",
    "check_property_file",
    "cornering_stiffness",
    "from_property_file",
    "kit",
    "mf_tyre",
    "read_parameters",
    "to_property_file",
    "typical_mf_tyre",
    "write_parameters",
]
