"""An SUV and a truck, after the open vehicle models of Project Chrono."""

from __future__ import annotations

from jaxveh.vehicles.sets.numbers import CarNumbers, SuspensionNumbers, TyreNumbers


def suv() -> CarNumbers:
    """A heavy off-road car, 2570 kg, after Project Chrono's SUV (`Nissan_Patrol`; projectchrono.org).

    From Chrono: mass, inertias and position of the chassis, the wheelbase, the masses of spindles, uprights, arms, rims and tyres
    (half of an arm is sprung), the positions of the wheels (wider than on the road car), the tyre's radius, vertical stiffness
    and damping, and its TMeasy slopes and peak at these loads. Mass, inertia and centre of gravity of the whole car follow from
    these. **Our own estimate**: springs (ride frequencies of 1.3 and 1.5 Hz), dampers, bars, roll centres, air, rolling
    resistance, shares of drive and brakes.
    """
    return CarNumbers(
        name="suv",
        source="Project Chrono, data/vehicle/Nissan_Patrol (masses, inertias, geometry, tyre); our own estimate (springs, air)",
        mass=2570.0,
        yaw_inertia=5210.0,
        front_axle_to_cg=1.573,
        rear_axle_to_cg=1.772,
        front=TyreNumbers(40400.0, slip_stiffness=124000.0, friction=0.77),
        rear=TyreNumbers(36000.0, slip_stiffness=112000.0, friction=0.77),
        cg_height=0.54,
        track_front=1.92,
        track_rear=2.02,
        wheel_radius=0.441,
        wheel_inertia=7.3,
        drag=0.8,
        rolling_resistance=0.015,
        front_drive=0.5,
        front_brake=0.6,
        suspension=SuspensionNumbers(
            sprung_mass=2138.0, unsprung_mass_front=105.4, unsprung_mass_rear=110.5,
            roll_inertia=1078.5, pitch_inertia=2955.7, yaw_inertia=3570.2,
            front_axle_to_cg=1.545, rear_axle_to_cg=1.8, cg_height=0.56,
            spring_front=38400.0, spring_rear=43900.0, damper_front=2540.0, damper_rear=2510.0,
            tyre_stiffness=411100.0, tyre_damping=3900.0, anti_roll_front=7700.0, anti_roll_rear=2200.0,
            roll_centre_front=0.05, roll_centre_rear=0.1,
        ),
    )  # fmt: skip


def truck() -> CarNumbers:
    """A two-axle truck, 9480 kg, after Project Chrono's MAN 5t (Kat 1; projectchrono.org).

    From Chrono: mass, inertias and position of the chassis, the wheelbase, the masses and springs of the rear axle (used for the
    front axle too, linearised at rest), its dampers (the secant at 0.3 m/s, mean of both directions), track, and masses and
    inertias of tyre and rim. Mass, inertia and centre of gravity of the whole truck follow from these. The rigid axle has its
    springs 0.62 m from the middle: the spring rates here, given at the wheel, are right for heave and too stiff for roll. **Our
    own estimate**: the tyre's stiffnesses and friction (for truck tyres the cornering stiffness is about 5 times the load per
    rad), roll centres, air, rolling resistance, shares of brakes.
    """
    return CarNumbers(
        name="truck",
        source="Project Chrono, src/chrono_models/vehicle/man (masses, geometry, springs); our own estimate (tyres, air)",
        mass=9480.0,
        yaw_inertia=43900.0,
        front_axle_to_cg=1.87,
        rear_axle_to_cg=2.63,
        front=TyreNumbers(140000.0, slip_stiffness=270000.0, friction=0.8),
        rear=TyreNumbers(105000.0, slip_stiffness=190000.0, friction=0.8),
        cg_height=1.16,
        track_front=2.07,
        track_rear=2.07,
        wheel_radius=0.629,
        wheel_inertia=35.0,
        drag=3.2,
        rolling_resistance=0.008,
        front_drive=0.5,
        front_brake=0.6,
        suspension=SuspensionNumbers(
            sprung_mass=7185.0, unsprung_mass_front=573.8, unsprung_mass_rear=573.8,
            roll_inertia=3441.0, pitch_inertia=28485.0, yaw_inertia=29395.0,
            front_axle_to_cg=1.748, rear_axle_to_cg=2.752, cg_height=1.344,
            spring_front=292600.0, spring_rear=256800.0, damper_front=34000.0, damper_rear=34000.0,
            tyre_stiffness=1.0e6, roll_centre_front=0.6, roll_centre_rear=0.6,
        ),
    )  # fmt: skip
