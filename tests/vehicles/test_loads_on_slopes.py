"""Wheel loads of every kind of load transfer on slopes, turning and under torques, beside the formulas computed in NumPy."""

import inspect

import numpy as np
import pytest

from jaxveh import tyres, vehicles
from jaxveh._core.names import record
from jaxveh.roads import Ground
from jaxveh.vehicles import GRAVITY

NUMBERS = dict(
    mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4, track_front=1.5, track_rear=1.52,
    cg_height=0.5,
)  # fmt: skip
TRANSFERS = {
    "StaticLoads": vehicles.StaticLoads(),
    "QuasiStatic": vehicles.QuasiStatic(),
    "LaggedLoads": vehicles.LaggedLoads(0.2),
    "MeasuredLoads": vehicles.MeasuredLoads(),
}
SPEED, YAW_RATE, DRIVE, BRAKE = 15.0, 0.2, 500.0, 200.0
LAGGED, MEASURED = (0.7, -1.1), (-0.4, 1.6)
SLOPES = [(0.06, 0.1), (-0.04, -0.12), (0.0, 0.1), (0.08, 0.0)]
"""Grade and bank, rad."""


def fall(grade, bank):
    """Free fall along the car's axes: the normal of the plane z = x tan(grade) + y tan(bank) is the third."""
    e_x = np.array([1.0, 0.0, np.tan(grade)]) / np.hypot(1.0, np.tan(grade))
    e_z = np.array([-np.tan(grade), -np.tan(bank), 1.0])
    e_z /= np.linalg.norm(e_z)
    down = np.array([0.0, 0.0, -GRAVITY])
    return down @ e_x, down @ np.cross(e_z, e_x), down @ e_z


def loads_of(a_x, a_y, g_z):
    """What accelerometers at the centre of gravity say moves load backwards, and to the right (the outside of a left turn)."""
    m, a, b, h = NUMBERS["mass"], NUMBERS["front_axle_to_cg"], NUMBERS["rear_axle_to_cg"], NUMBERS["cg_height"]
    front = m * (-g_z * b - a_x * h) / (a + b)
    rear = m * (-g_z * a + a_x * h) / (a + b)
    to_front = b / (a + b) * m * a_y * h / NUMBERS["track_front"]
    to_rear = a / (a + b) * m * a_y * h / NUMBERS["track_rear"]
    return front / 2 - to_front, front / 2 + to_front, rear / 2 - to_rear, rear / 2 + to_rear


def made(kind, transfer):
    tyre = tyres.Brush(80000.0, 60000.0, 1.0)
    return kind(**NUMBERS, front=tyre, rear=tyre, load_transfer=TRANSFERS[transfer])


def evaluated(car, ground):
    values = {
        "steer": 0.03, "v_x": SPEED, "drive_torque": DRIVE, "brake_torque": BRAKE, "a_x": MEASURED[0], "a_y": MEASURED[1],
    }  # fmt: skip
    u = record("Inputs", {name: np.asarray(values.get(name, 0.0)) for name in car.inputs})
    start = {"yaw_rate": YAW_RATE, "v_y": 0.1}
    x = car.start(0.0, u, **(start if "v_x" in car.inputs else start | {"v_x": SPEED}))
    if "a_x_felt" in x._fields:
        x = x._replace(a_x_felt=np.asarray(LAGGED[0]), a_y_felt=np.asarray(LAGGED[1]))
    return x, u, *car.evaluate(0.0, x, u, ground)


@pytest.mark.parametrize(("grade", "bank"), SLOPES)
@pytest.mark.parametrize("transfer", TRANSFERS)
@pytest.mark.parametrize(
    "kind", [vehicles.SevenDOF, vehicles.TwoTrack3DOF, vehicles.TwoTrack2DOF], ids=lambda k: k.__name__
)
def test_loads_are_those_of_what_the_car_feels(kind, transfer, grade, bank):
    car = made(kind, transfer)
    _, u, rates, outputs = evaluated(car, Ground(grade=np.asarray(grade), bank=np.asarray(bank)))
    g_x, g_y, g_z = fall(grade, bank)
    torque = sum(u._asdict().get(name, 0.0) * sign for name, sign in (("drive_torque", 1.0), ("brake_torque", -1.0)))
    if kind is vehicles.TwoTrack2DOF:
        # Its speed is told, and constant: an accelerometer says what turning and the slope leave.
        a_x = -0.1 * YAW_RATE - g_x
    else:
        a_x = torque / (NUMBERS["mass"] * 0.32)
    felt = {
        "StaticLoads": (0.0, 0.0),
        "QuasiStatic": (a_x, SPEED * YAW_RATE - g_y),
        "LaggedLoads": LAGGED,
        "MeasuredLoads": MEASURED,
    }[transfer]
    found = [getattr(outputs, f"load_{wheel}") for wheel in ("fl", "fr", "rl", "rr")]
    np.testing.assert_allclose(found, loads_of(*felt, g_z), rtol=2e-3)
    if transfer == "LaggedLoads":
        np.testing.assert_allclose(rates.a_y_felt, (outputs.a_y - LAGGED[1]) / 0.2, rtol=1e-9)


@pytest.mark.parametrize(("grade", "bank"), SLOPES)
@pytest.mark.parametrize(
    "kind", [vehicles.SevenDOF, vehicles.TwoTrack3DOF, vehicles.TwoTrack2DOF], ids=lambda k: k.__name__
)
def test_gravity_pulls_along_the_slope(kind, grade, bank):
    """Beside a level road with the same loads (told, so that tyres differ by the cosine alone) the rates differ by g."""
    car = made(kind, "MeasuredLoads")
    _, _, level, _ = evaluated(car, Ground())
    _, _, rates, _ = evaluated(car, Ground(grade=np.asarray(grade), bank=np.asarray(bank)))
    g_x, g_y, _ = fall(grade, bank)
    np.testing.assert_allclose(rates.v_y - level.v_y, g_y, atol=0.03)
    if "v_x" not in car.inputs:
        np.testing.assert_allclose(rates.v_x - level.v_x, g_x, atol=0.03)


def test_every_kind_of_load_transfer_is_here():
    kinds = [getattr(vehicles, name) for name in vehicles.__all__]
    concrete = [
        k for k in kinds
        if inspect.isclass(k) and issubclass(k, vehicles.AbstractLoadTransfer) and not inspect.isabstract(k)
    ]  # fmt: skip
    assert {k.__name__ for k in concrete} == set(TRANSFERS)


@pytest.mark.parametrize(("grade", "bank"), SLOPES)
@pytest.mark.parametrize("transfer", ["QuasiStatic", "MeasuredLoads", "LaggedLoads"])
@pytest.mark.parametrize("kind", [vehicles.Roll3DOF, vehicles.Roll4DOF], ids=lambda k: k.__name__)
def test_a_body_that_rolls_passes_on_what_its_roll_centres_hold(kind, transfer, grade, bank):
    """On each axle  (K phi + C p + share a_y (m_s h_rc + m_u h_u)) / track  moves to the right wheel (W. & D. Milliken)."""
    body = dict(
        sprung_mass=1350.0, roll_inertia=500.0, roll_stiffness_front=40e3, roll_stiffness_rear=30e3, roll_damping_front=2e3,
        roll_damping_rear=1.5e3, roll_centre_front=0.06, roll_centre_rear=0.14, unsprung_height=0.3,
    )  # fmt: skip
    tyre = tyres.Brush(80000.0, 60000.0, 1.0)
    car = kind(**NUMBERS, **body, front=tyre, rear=tyre, load_transfer=TRANSFERS[transfer])
    x, u, _, _ = evaluated(car, Ground())
    x = x._replace(roll=np.asarray(0.02), roll_rate=np.asarray(-0.1))
    ground = Ground(grade=np.asarray(grade), bank=np.asarray(bank))
    _, outputs = car.evaluate(0.0, x, u, ground)
    _, g_y, g_z = fall(grade, bank)
    a_y = {"QuasiStatic": SPEED * YAW_RATE - g_y, "MeasuredLoads": MEASURED[1], "LaggedLoads": LAGGED[1]}[transfer]
    a, b = NUMBERS["front_axle_to_cg"], NUMBERS["rear_axle_to_cg"]
    for axle, share, wheels in (("front", b / (a + b), ("fl", "fr")), ("rear", a / (a + b), ("rl", "rr"))):
        left, right = (float(getattr(outputs, f"load_{wheel}")) for wheel in wheels)
        spring = body[f"roll_stiffness_{axle}"] * 0.02 - body[f"roll_damping_{axle}"] * 0.1
        direct = share * a_y * (1350.0 * body[f"roll_centre_{axle}"] + 150.0 * 0.3)
        expected = (spring + direct) / NUMBERS[f"track_{axle}"]
        np.testing.assert_allclose(0.5 * (right - left), expected, rtol=5e-3, atol=0.5)
    total = sum(float(getattr(outputs, f"load_{wheel}")) for wheel in ("fl", "fr", "rl", "rr"))
    np.testing.assert_allclose(total, -1500.0 * g_z, rtol=1e-9)
