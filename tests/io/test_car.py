"""The file that describes a car."""

import dataclasses
import re

import numpy as np
import pytest
from shared_data import shared

from jaxveh import InputError, io
from jaxveh.io.car import CAR_SCHEMA

PLAIN = """
mass = 1500
yaw_inertia = 2500.0
front_axle_to_cg = 1.2
rear_axle_to_cg = 1.5
front_cornering_stiffness = 9e4
rear_cornering_stiffness = 1.1e5
"""


@pytest.fixture
def toml(tmp_path):
    def write(text):
        (tmp_path / "car.toml").write_text(text)
        return tmp_path / "car.toml"

    return write


def test_plain_car(toml):
    car = io.read_car(toml(PLAIN))
    assert (car.mass, car.yaw_inertia) == (1500.0, 2500.0)
    assert isinstance(car.mass, float)
    assert car.wheelbase == pytest.approx(2.7)
    assert (car.front_cornering_stiffness, car.rear_cornering_stiffness) == (9e4, 1.1e5)
    optional = [entry.name for entry in dataclasses.fields(car)][6:]
    assert len(optional) == 32
    assert all(getattr(car, name) is None for name in optional)


def test_the_schema_is_a_car(toml):
    car = io.read_car(toml(CAR_SCHEMA))
    assert car.front == io.AxleTyre(10.0, 1.3, 8000.0, 0.2, 0.0, 0.0, 8175.0)
    assert car.rear == io.AxleTyre(12.0, 1.3, 6600.0, 0.2)
    assert car.sensor_position == (0.1, 0.0, 0.3)
    assert car.reference_position == (0.0, 0.0, 0.0)
    assert (car.low_pass, car.steer_offset, car.steering_ratio, car.name) == (20.0, 0.002, 15.0, "passenger car")
    keys = {entry.name for entry in dataclasses.fields(io.CarSpecification)} | {
        entry.name for entry in dataclasses.fields(io.AxleTyre)
    }
    # Paths are commented out, as the files that they name are not there.
    assert all(any(f"\n{start}" in CAR_SCHEMA for start in (f"{key} =", f"[{key}]", f'# {key} = "')) for key in keys)
    assert (car.wheel_radius, car.wheel_inertia, car.drag) == (0.32, 1.2, 0.4)
    assert (car.rolling_resistance, car.front_drive, car.front_brake) == (0.01, 1.0, 0.65)


def test_stiffness_from_the_tyre(toml):
    text = "\n".join(line for line in CAR_SCHEMA.splitlines() if "_cornering_stiffness =" not in line)
    car = io.read_car(toml(text))
    assert car.front_cornering_stiffness == pytest.approx(10.0 * 1.3 * 8000.0)
    assert car.rear_cornering_stiffness == pytest.approx(12.0 * 1.3 * 6600.0)


def test_tyre_files_are_found_from_the_folder_of_the_car(toml, tmp_path):
    car = io.read_car(toml(PLAIN + 'front_tyre = "tyres/front.tir"\nrear_tyre = "/data/rear.tir"\n'))
    assert (car.front_tyre, car.rear_tyre) == (str(tmp_path / "tyres/front.tir"), "/data/rear.tir")
    (tmp_path / "elsewhere").mkdir()
    io.write_car(car, tmp_path / "elsewhere" / "car.toml")
    assert io.read_car(tmp_path / "elsewhere" / "car.toml") == car


@pytest.mark.parametrize("source", [PLAIN, CAR_SCHEMA], ids=["plain", "full"])
def test_round_trip(toml, tmp_path, source):
    car = io.read_car(toml(source))
    odd = dataclasses.replace(car, mass=np.float32(1234.567), yaw_inertia=1e3 / 3, name='a "car"\\\n2')
    for number, given in enumerate((car, odd)):
        io.write_car(given, tmp_path / f"{number}.toml", note="fitted\nfrom 0:100 s")
        assert io.read_car(tmp_path / f"{number}.toml") == given
        assert (tmp_path / f"{number}.toml").read_text().startswith("# fitted\n# from 0:100 s\nmass =")
        with pytest.raises(InputError, match="exists already"):
            io.write_car(given, tmp_path / f"{number}.toml")


BROKEN = {
    "broken TOML": ("mass = \n", r"car.toml: broken TOML: .*line 1"),
    "negative mass": (PLAIN.replace("1500", "-1500"), r"car.toml: mass = -1500.0: must be between 0.1 and 1e\+06 kg"),
    "nan": (PLAIN.replace("1500", "nan"), r"mass = nan: must be a finite number"),
    "zero inertia": (PLAIN.replace("2500.0", "0"), r"yaw_inertia = 0.0: must be between"),
    "millimetres": (PLAIN.replace("1.2", "1200"), r"front_axle_to_cg = 1200.0: must be between 0.001 and 30 m"),
    "word": (PLAIN.replace("1500", "'heavy'"), r"mass = 'heavy': must be a finite number"),
    "true": (PLAIN.replace("1500", "true"), r"mass = True: must be a finite number"),
    "missing": (PLAIN.replace("mass = 1500", ""), r"missing key\(s\): mass"),
    "missing stiffness": (
        PLAIN.replace("front_cornering_stiffness = 9e4", ""),
        r"front_cornering_stiffness is missing",
    ),
    "a tyre's file alone": (
        'rear_tyre = "rear.tir"\n' + PLAIN.replace("rear_cornering_stiffness", "name = 'x' #"),
        r"rear_cornering_stiffness is missing: .*rear_tyre is a single wheel's",
    ),
    "unknown": ("yaw_inerta = 3\n" + PLAIN, r"no key 'yaw_inerta' \(did you mean 'yaw_inertia'\?\); there are: yaw_in"),
    "position": ("sensor_position = [1, 2]" + PLAIN, r"sensor_position = \[1, 2\]: must be \[x, y, z\]"),
    "far position": (
        "sensor_position = [1, 2, 300]" + PLAIN,
        r"sensor_position = \[.*300.*\]: must be between -30 and 30",
    ),
    "tyre no table": ("front = 3" + PLAIN, r"\[front\] = 3: must be a table"),
    "tyre key": (PLAIN + "[front]\nb = 3", r"\[front\]: no key 'b' \(did you mean 'B'\?\)"),
    "tyre incomplete": (PLAIN + "[front]\nB = 3", r"\[front\]: missing key\(s\): C, D, E"),
    "tyre value": (
        PLAIN + "[rear]\nB = -3\nC = 1\nD = 1\nE = 0",
        r"\[rear\]: B = -3.0: must be between 0.01 and 1000 1/rad",
    ),
    "name": ("name = 3" + PLAIN, r"name = 3: must be a string"),
    "tyre path": ("front_tyre = 3" + PLAIN, r"front_tyre = 3: must be a string"),
    "steering": (
        "steering = 'back'" + PLAIN,
        r"steering = 'back': must be one of 'front', 'ackermann', 'rear', 'four-wheel'",
    ),
    "steering number": ("steering = 3" + PLAIN, r"steering = 3: must be a string"),
    "no ratio": (
        "steering = 'four-wheel'" + PLAIN,
        r"rear_steer_ratio is missing: a car with steering = \"four-wheel\" needs it",
    ),
    "ratio alone": ("rear_steer_ratio = 0.2" + PLAIN, r"rear_steer_ratio = 0.2: only for steering = \"four-wheel\""),
    "ratio of others": (
        "steering = 'rear'\nrear_steer_ratio_fast = 0.2" + PLAIN,
        r"rear_steer_ratio_fast = 0.2: only for steering = \"four-wheel\"",
    ),
    "ratio": (
        "steering = 'four-wheel'\nrear_steer_ratio = 20" + PLAIN,
        r"rear_steer_ratio = 20.0: must be between -5 and 5",
    ),
    "share": ("front_drive = 60" + PLAIN, r"front_drive = 60.0: must be between 0 and 1"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_cars(toml, case):
    text, message = BROKEN[case]
    with pytest.raises(InputError, match=message) as caught:
        io.read_car(toml(text))
    assert "car.toml" in str(caught.value)


def test_who_steers_is_said_by_the_file(toml, tmp_path):
    car = io.read_car(toml(PLAIN + 'steering = "four-wheel"\nrear_steer_ratio = -0.2\nrear_steer_ratio_fast = 0.1\n'))
    assert (car.steering, car.rear_steer_ratio, car.rear_steer_ratio_fast, car.rear_steer_speed) == (
        "four-wheel",
        -0.2,
        0.1,
        None,
    )
    assert not car.steers_front_alone
    io.write_car(car, tmp_path / "again.toml")
    assert io.read_car(tmp_path / "again.toml") == car
    alone = [
        dataclasses.replace(io.read_car(toml(PLAIN)), steering=kind).steers_front_alone
        for kind in (None, "ackermann", "rear")
    ]
    assert alone == [True, True, False]


def test_a_car_made_in_python_is_checked_too():
    with pytest.raises(InputError, match="mass = 'heavy': must be a number between"):
        io.CarSpecification("heavy", 1.0, 1.0, 1.0, 1.0, 1.0)
    with pytest.raises(InputError, match="sensor_position"):
        io.CarSpecification(1e3, 1e3, 1.0, 1.0, 1e5, 1e5, sensor_position=(1.0, 2.0))


def test_the_shared_car_reads():
    car = io.read_car(shared("ferrari_250lm.toml"))
    assert (car.mass, car.yaw_inertia, car.front_axle_to_cg, car.rear_axle_to_cg) == (982.0, 1605.4, 1.33, 1.07)
    assert (car.front_cornering_stiffness, car.rear_cornering_stiffness) == (70e3, 120e3)


MISTYPED = [
    "mass = 1420,5",
    "mass = 1420 kg",
    "mass: 1420",
    "mass = ",
    "mass = 1420 // kg",
    "name = my car",
    "mass 1420",
]


@pytest.mark.parametrize("line", MISTYPED)
def test_a_mistyped_line_is_shown(tmp_path, line):
    path = tmp_path / "car.toml"
    path.write_text(f"# a car\nyaw_inertia = 2500.0\n{line}\nfront_axle_to_cg = 1.0\n")
    told = rf"broken TOML: .*line 3.*: {re.escape(repr(line.strip()))}; lines are `key = value`, with decimal points"
    with pytest.raises(InputError, match=told):
        io.read_car(path)
    path.write_bytes(f"{line}\n".encode("utf-16"))
    with pytest.raises(InputError, match="not UTF-8 text .*; save it as UTF-8"):
        io.read_car(path)


@pytest.mark.parametrize("suffix", [".yaml", ".xml", ".json", ".tir", ""])
def test_a_car_in_another_format_is_told_what_reads_it(tmp_path, suffix):
    path = tmp_path / f"car{suffix}"
    path.write_text("m: 1093.3\nI_z: 1791.6\n")
    with pytest.raises(
        InputError, match=rf"or no TOML at all, as {suffix or 'its name'} suggests: .* io.read_commonroad reads YAML"
    ):
        io.read_car(path)
