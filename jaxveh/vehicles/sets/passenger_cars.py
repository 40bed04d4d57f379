"""Passenger cars from papers, completed by estimates that are marked as such."""

from __future__ import annotations

from typing import Any

from jaxveh.vehicles.sets.estimate import estimated_suspension
from jaxveh.vehicles.sets.numbers import CarNumbers, TyreNumbers


def passenger_car() -> CarNumbers:
    """The passenger car of Bao, Sabbioni et al. (2015) with its erratum corrected: `jaxveh.vehicles.passenger_car`.

    Mass, yaw inertia, distances of the axles and their Magic Formulas are those of the paper; the stiffness and friction of a
    wheel follow from the formulas. All other numbers (height, tracks, wheels, air, rolling resistance, suspension) are **our own
    estimate** of an ordinary car with front-wheel drive.
    """
    body: dict[str, Any] = {
        "mass": 1420.0, "yaw_inertia": 2124.0, "front_axle_to_cg": 0.96, "rear_axle_to_cg": 1.59,
        "cg_height": 0.54, "track_front": 1.5, "track_rear": 1.5, "wheel_radius": 0.3,
    }  # fmt: skip
    return CarNumbers(
        name="passenger_car",
        source="Bao, Sabbioni et al. 2015 (mass, yaw inertia, axles); our own estimate (all else)",
        **body,
        front=TyreNumbers(44075.0, friction=0.91, axle_formula=(6.9986, 1.6, 7872.0, -0.0542)),
        rear=TyreNumbers(63555.0, friction=1.07, axle_formula=(14.1636, 1.6, 5609.0, 1.0073)),
        wheel_inertia=1.0,
        drag=0.4,
        rolling_resistance=0.012,
        suspension=estimated_suspension(**body, unsprung_mass_front=40.0, unsprung_mass_rear=40.0),
    )


def ev() -> CarNumbers:
    """An electric car with a motor in each wheel, for the estimators of Ji, Li & Fan (federated cubature Kalman filters).

    The paper's table of the vehicle is lost: **all numbers are our own estimate** for a car of this kind.
    """
    body: dict[str, Any] = {
        "mass": 1230.0, "yaw_inertia": 1343.0, "front_axle_to_cg": 1.04, "rear_axle_to_cg": 1.56,
        "cg_height": 0.54, "track_front": 1.48, "track_rear": 1.48, "wheel_radius": 0.31,
    }  # fmt: skip
    tyre = TyreNumbers(35000.0, slip_stiffness=50000.0, friction=1.0)
    return CarNumbers(
        name="ev",
        source="our own estimate, for the paper of Ji, Li & Fan, whose table is lost",
        **body,
        front=tyre,
        rear=tyre,
        wheel_inertia=1.0,
        drag=0.35,
        rolling_resistance=0.01,
        front_drive=0.5,
        front_brake=0.6,
        four_motors=True,
        suspension=estimated_suspension(**body, unsprung_mass_front=35.0, unsprung_mass_rear=35.0),
    )
