"""MF-Tyre: the Magic Formula in full, versions 5.2, 6.1 and 6.2, for pure and combined slip.

The equations are those of H. B. Pacejka, Tire and Vehicle Dynamics, 3rd edition (2012), section 4.3.2 ("4.E" numbers), with
the corrections of Besselink, Schmeitz & Pacejka, An improved Magic Formula/Swift tyre model that can handle inflation
pressure changes, Vehicle System Dynamics 48 (2010) ("A" numbers), where the reference evaluator MFeval follows them.
Coefficients have the names of property files. Inside this package axes and signs are those of ISO-W, where a positive slip
angle gives a negative force; `MFTyre` converts them. Each force and moment has its own module.
"""

from jaxveh.tyres.mf_tyre.aligning import AligningCoefficients
from jaxveh.tyres.mf_tyre.lateral import LateralCoefficients
from jaxveh.tyres.mf_tyre.longitudinal import LongitudinalCoefficients
from jaxveh.tyres.mf_tyre.overturning import OverturningCoefficients
from jaxveh.tyres.mf_tyre.ranges import Ranges
from jaxveh.tyres.mf_tyre.rolling import RollingCoefficients
from jaxveh.tyres.mf_tyre.scaling import Scaling
from jaxveh.tyres.mf_tyre.structure import Structure
from jaxveh.tyres.mf_tyre.turn_slip import TurnSlip
from jaxveh.tyres.mf_tyre.tyre import MFOutputs, MFTyre

__all__ = [
    "AligningCoefficients",
    "LateralCoefficients",
    "LongitudinalCoefficients",
    "MFOutputs",
    "MFTyre",
    "OverturningCoefficients",
    "Ranges",
    "RollingCoefficients",
    "Scaling",
    "Structure",
    "TurnSlip",
]
