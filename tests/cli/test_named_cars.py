"""Cars by name in the programs that read logs, and fidelities that a car has no numbers for."""

from pathlib import Path

import pytest
from programs import error_line, run, write_log

from jaxveh import InputError, io, vehicles
from jaxveh.cli.vehicle import car_of, vehicle_of
from jaxveh.vehicles import kit

WITH_FILES = [name for name, make in kit.CARS.items() if make().mass is not None]


@pytest.mark.parametrize("name", WITH_FILES)
def test_a_car_by_name_is_the_car_of_its_file(name, tmp_path):
    car = car_of(Path(name))
    io.write_car(car, tmp_path / "car.toml")
    assert car_of(tmp_path / "car.toml") == car
    assert car.mass == kit.CARS[name]().mass


def test_a_file_without_a_suffix_comes_before_a_name(tmp_path, monkeypatch):
    io.write_car(vehicles.specification_of(kit.CARS["van"]()), tmp_path / "van.toml")
    (tmp_path / "van.toml").rename(tmp_path / "sedan")
    monkeypatch.chdir(tmp_path)
    assert car_of(Path("sedan")).name == "van"


def test_a_name_that_no_car_has():
    with pytest.raises(InputError, match=r"--vehicle trcuk: must be the path of a car's file .* Did you mean truck\?"):
        car_of(Path("trcuk"))


@pytest.mark.parametrize("arguments", [
    ("check",), ("estimate", "-o", "out.csv"), ("fit", "-o", "out.toml"), ("estimate", "-o", "out.csv", "--what", "grade"),
])  # fmt: skip
def test_every_program_knows_the_names(arguments, tmp_path):
    """A trailer's truck has no tyres, so that nothing runs: the car has been looked up by its name."""
    log = write_log(tmp_path)
    program, *more = arguments
    more = [tmp_path / one if one.startswith("out") else one for one in more]
    line = error_line(run(program, log, "--vehicle", "semi_trailer", *more))
    assert line.startswith("error: semi_trailer: a car's file needs mass, yaw_inertia, front, rear")


def test_a_car_without_the_numbers_of_a_fidelity_names_others_that_can_be_made():
    with pytest.raises(InputError, match=r"needs mass.* The car has the numbers for --fidelity (.*)\.$") as caught:
        vehicle_of("semi_trailer")
    others = str(caught.value).rpartition("--fidelity ")[2].rstrip(".").split(", ")
    assert "kinematic-trailer" in others and "single-track" not in others
    for other in others:
        vehicle_of("semi_trailer", other)
