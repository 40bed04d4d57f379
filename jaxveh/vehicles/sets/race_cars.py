"""Race cars."""

from __future__ import annotations

from jaxveh.vehicles.sets.numbers import CarNumbers, SuspensionNumbers, TyreNumbers


def race_car() -> CarNumbers:
    """An autonomous race car, 1300 kg, after the open simulator of TUM (TUMFTM/sim_vehicle_dynamics, `parameters`).

    From the simulator: mass, inertias, wheelbase, tracks, height, drag (its aerodynamic lift is left out, because the vehicles
    here have none), springs and dampers (used as those at the wheel), anti-sway bars, shares of the brakes, the tyre's Magic
    Formula at 3000 N (B C D = 53 kN/rad, peak 1.5 times the load), wheel radius and inertia. **Our own estimate**: unsprung
    masses (30 kg per wheel) and the numbers that follow from them, the tyre's vertical stiffness, roll centres, rolling
    resistance.
    """
    return CarNumbers(
        name="race_car",
        source="TUMFTM/sim_vehicle_dynamics, parameters (all but our own estimate of unsprung masses and roll centres)",
        mass=1300.0,
        yaw_inertia=1500.0,
        front_axle_to_cg=1.6,
        rear_axle_to_cg=1.8,
        front=TyreNumbers(52900.0, slip_stiffness=56400.0, friction=1.5),
        rear=TyreNumbers(52900.0, slip_stiffness=56400.0, friction=1.5),
        cg_height=0.4,
        track_front=1.7,
        track_rear=1.7,
        wheel_radius=0.42,
        wheel_inertia=2.0,
        drag=0.86,
        rolling_resistance=0.015,
        front_drive=0.0,
        front_brake=0.6,
        suspension=SuspensionNumbers(
            sprung_mass=1180.0, unsprung_mass_front=30.0, unsprung_mass_rear=30.0,
            roll_inertia=300.0, pitch_inertia=1000.0, yaw_inertia=1060.0,
            front_axle_to_cg=1.59, rear_axle_to_cg=1.81, cg_height=0.398,
            spring_front=120000.0, spring_rear=80000.0, damper_front=2000.0, damper_rear=1200.0,
            tyre_stiffness=250000.0, anti_roll_front=31250.0, anti_roll_rear=26700.0,
            roll_centre_front=0.03, roll_centre_rear=0.05,
        ),
    )  # fmt: skip


def ferrari_250lm() -> CarNumbers:
    """The 1966 Ferrari 250 LM of the Revs Program (Stanford University, hd122pw0365), with mass, yaw inertia, axles and their
    cornering stiffnesses of MBDS/sideslip-angle-vehicle-estimation (doi:10.3390/s21165409). The friction of 1.1 is what its rear
    axle reaches in the recording. All other numbers are unknown, so that only cars on one track can be built."""
    return CarNumbers(
        name="ferrari_250lm",
        source="MBDS/sideslip-angle-vehicle-estimation, doi:10.3390/s21165409; friction from its recording",
        mass=982.0,
        yaw_inertia=1605.4,
        front_axle_to_cg=1.33,
        rear_axle_to_cg=1.07,
        front=TyreNumbers(35000.0, friction=1.1),
        rear=TyreNumbers(60000.0, friction=1.1),
        front_drive=0.0,
    )
