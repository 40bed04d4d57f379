"""The file that describes a road."""

import pytest

from jaxveh import InputError, io
from jaxveh.io.road import ROAD_SCHEMA


def read(tmp_path, text):
    path = tmp_path / "road.toml"
    path.write_text(text)
    return io.read_road(path)


def test_the_schema_reads_as_it_stands(tmp_path):
    road = read(tmp_path, ROAD_SCHEMA)
    assert road.distance == (0.0, 100.0, 200.0) and road.friction == (1.0, 1.0, 0.4)
    assert road.grade == (0.0, 0.05, 0.0) and road.bank == 0.02
    assert road.name == "wet hill" and road.interpolation == "smooth"


def test_a_road_is_written_and_read_back_bit_for_bit(tmp_path):
    road = io.RoadSpecification(
        (0.0, 1 / 3, 200.0), (1.0, 0.1 + 0.2, 0.4), bank=1 / 7, name='a "b"', interpolation="linear"
    )
    io.write_road(road, tmp_path / "out.toml", note="one\ntwo")
    assert io.read_road(tmp_path / "out.toml") == road
    with pytest.raises(InputError, match="exists already"):
        io.write_road(road, tmp_path / "out.toml")


def test_numbers_alone_need_no_distance(tmp_path):
    assert read(tmp_path, "friction = 0.5") == io.RoadSpecification(friction=0.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("friction = [1.0, 0.5]", r"road\.toml: distance is missing: friction is a table"),
        ("distance = [0.0, 1.0]\nfriction = [1.0]", r"friction has 1 values: must have 2, as distance"),
        ("distance = [0.0, 0.0]", r"distance = \[0\.0, 0\.0\]: must increase"),
        ("distance = [0.0]", r"distance = .*: must be a list of at least two"),
        ("distance = 3.0", r"distance = .*: must be a list of at least two"),
        ("friction = -0.5", r"friction = -0\.5: must be between 0\.001 and 10"),
        ("grade = 5.0", r"grade = 5\.0: must be between -0\.5 and 0\.5 rad"),
        ("grade = 'x'", r"grade = 'x': must be a finite number"),
        ("distance = [0.0, true]", r"distance\[1\] = True: must be a finite number"),
        ("interpolation = 'cubic'", r"interpolation = 'cubic': must be one of 'smooth', 'linear'"),
        ("fricton = 0.5", r"fricton.*friction"),
        ("friction = ", r"road\.toml: broken TOML"),
    ],
)
def test_bad_files_raise_by_name_value_and_range(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)
