"""The numbers of cars: records with their sources, from which vehicles of every fidelity are built.

`build(sets.compact_car(), SevenDOF)` is a car. The records are returned by functions, so that importing creates nothing.
"""

from jaxveh.vehicles.sets.build import build
from jaxveh.vehicles.sets.commonroad_cars import compact_car, sedan, semi_trailer, van
from jaxveh.vehicles.sets.estimate import estimated_suspension
from jaxveh.vehicles.sets.from_commonroad import commonroad_limits, from_commonroad
from jaxveh.vehicles.sets.heavy_cars import suv, truck
from jaxveh.vehicles.sets.named import CARS, FIDELITIES, named_car, specified_car
from jaxveh.vehicles.sets.numbers import CarNumbers, SuspensionNumbers, TyreNumbers
from jaxveh.vehicles.sets.passenger_cars import ev, passenger_car
from jaxveh.vehicles.sets.race_cars import ferrari_250lm, race_car
from jaxveh.vehicles.sets.specification import numbers_of, specification_of
from jaxveh.vehicles.sets.tyres import axle_tyre, wheel_tyre

__all__ = [
    "CARS",
    "FIDELITIES",
    "CarNumbers",
    "SuspensionNumbers",
    "TyreNumbers",
    "axle_tyre",
    "build",
    "commonroad_limits",
    "compact_car",
    "estimated_suspension",
    "ev",
    "ferrari_250lm",
    "from_commonroad",
    "named_car",
    "numbers_of",
    "passenger_car",
    "race_car",
    "sedan",
    "semi_trailer",
    "specification_of",
    "specified_car",
    "suv",
    "truck",
    "van",
    "wheel_tyre",
]
