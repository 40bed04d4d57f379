"""CommonRoad's vehicle files."""

import jax
import numpy as np
import pytest

from jaxveh import InputError, io, vehicles
from jaxveh.vehicles import GRAVITY, sets

pytest.importorskip("yaml")

CAR = """
# a car
l: 4.508
a: 1.1562
b: 1.4227
m: 1093.3
I_z: 1791.6
h_cg: 0.57487
T_f: 1.3868
T_r: 1.3640
R_w: 0.344
I_y_w: 1.7
T_sb: 0.66
T_se: 0
steering:
  min: -1.066
  max: 1.066
  v_min: -0.4
  v_max: 0.4
  kappa_dot_max: 0.4
longitudinal:
  a_max: 11.5
  j_max: 10.0e+3
  j_dot_max: 10.0e3
  v_min: -13.9
  v_max: 50.8
  v_switch: 7.319
"""
TYRE = """
tire:
  p_cx1: 1.6411
  p_dx1: 1.1739
  p_kx1: 22.303
  p_cy1: 1.3507
  p_dy1: 1.0489
  p_ky1: -21.92
"""


@pytest.fixture
def files(tmp_path):
    def write(car=CAR, tyre=TYRE):
        (tmp_path / "car.yaml").write_text(car)
        (tmp_path / "tyre.yaml").write_text(tyre)
        return tmp_path / "car.yaml", tmp_path / "tyre.yaml"

    return write


def test_a_car_and_its_tyres(files):
    spec = io.read_commonroad(*files())
    assert (spec.front_axle_to_cg, spec.mass, spec.front_drive, spec.steer_min) == (1.1562, 1093.3, 0.0, -1.066)
    # A number that YAML takes for a text.
    assert (spec.jerk_max, spec.jerk_rate_max) == (1e4, 1e4)
    assert spec.sprung_mass is None
    assert spec.tyre["p_ky1"] == -21.92
    assert io.read_commonroad(files()[0]).tyre is None


def test_it_becomes_vehicles(files):
    spec = io.read_commonroad(*files())
    numbers = vehicles.from_commonroad(spec)
    car = vehicles.build(numbers, vehicles.LinearSingleTrack)
    load = 1093.3 * GRAVITY * 1.4227 / (1.1562 + 1.4227)
    np.testing.assert_allclose(car.front_stiffness, 21.92 * load, rtol=1e-12)
    seven = vehicles.build(numbers, vehicles.SevenDOF)
    front_stiffness = jax.jit(lambda car: vehicles.linear_single_track(car).front_stiffness)
    np.testing.assert_allclose(front_stiffness(seven), 21.92 * load, rtol=1e-6)
    assert float(seven.drive.front_drive) == 0.0
    steer, drive = vehicles.commonroad_limits(spec)
    assert (float(steer.largest), float(steer.slowest)) == (1.066, -0.4)
    assert (float(drive.largest), float(drive.switching_speed), float(drive.backwards)) == (11.5, 7.319, -13.9)
    assert numbers.suspension is None


def test_the_suspension_in_our_terms():
    spec = sets.commonroad_cars.bmw_320i()
    found = vehicles.from_commonroad(spec).suspension
    assert (found.unsprung_mass_front, found.spring_rear, found.cg_height) == (63.792 / 2, 19636.0, 0.61373)
    # The bar's moment at a roll angle phi: each side's force k T phi times half the track, twice.
    np.testing.assert_allclose(found.anti_roll_front * 1.3868**2, 6914.9, rtol=1e-12)
    axles = 63.792 * (1.1562**2 + (1.3868 / 2) ** 2) + 63.792 * (1.4227**2 + (1.364 / 2) ** 2)
    np.testing.assert_allclose(found.yaw_inertia, 1791.6 - axles, rtol=1e-12)


BROKEN = {
    "broken YAML": ("a: [1", TYRE, r"car.yaml: broken YAML: .*line"),
    "no mapping": ("- 1", TYRE, r"car.yaml: must be a mapping"),
    "unknown": (CAR + "I_zz: 3\n", TYRE, r"car.yaml: no key 'I_zz' \(did you mean 'I_z'\?\)"),
    "unknown inside": (CAR + "trailer:\n  l_bw: 3\n", TYRE, r"no key 'trailer.l_bw' \(did you mean 'trailer.l_wb'"),
    "missing": (CAR.replace("b: 1.4227", ""), TYRE, r"car.yaml: missing key\(s\): b"),
    "millimetres": (
        CAR.replace("1.1562", "1156"),
        TYRE,
        r"a \(front_axle_to_cg\) = 1156: must be between 0.001 and 30 m",
    ),
    "word": (CAR.replace("1093.3", "heavy"), TYRE, r"m \(mass\) = 'heavy': must be between"),
    "true": (CAR.replace("1093.3", "true"), TYRE, r"m \(mass\) = True: must be between"),
    "sign": (
        CAR.replace("min: -1.066", "min: 1.066"),
        TYRE,
        r"steering.min \(steer_min\) = 1.066: must be between -2 and 0",
    ),
    "tyre": (CAR, TYRE.replace("p_ky1", "p_kz1"), r"tyre.yaml: no key 'tire.p_kz1'"),
    "tyre nan": (CAR, TYRE.replace("-21.92", ".nan"), r"tire.p_ky1 = nan: must be a finite number"),
    "twice": (CAR + TYRE, TYRE, r"tyre.yaml: tire.p_cx1 is given twice"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files(files, case):
    car, tyre, message = BROKEN[case]
    with pytest.raises(InputError, match=message):
        io.read_commonroad(*files(car, tyre))


def test_a_file_that_is_not_there():
    with pytest.raises(InputError, match="no-such.yaml"):
        io.read_commonroad("no-such.yaml")


def test_what_builders_miss_is_named(files):
    half = io.read_commonroad(*files(CAR, TYRE.replace("  p_ky1: -21.92\n", "")))
    with pytest.raises(InputError, match="p_ky1 missing"):
        vehicles.from_commonroad(half)
    unlimited = io.read_commonroad(files(CAR.replace("  v_switch: 7.319\n", ""))[0])
    with pytest.raises(InputError, match="switching_speed missing"):
        vehicles.commonroad_limits(unlimited)
