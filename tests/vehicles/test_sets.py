"""Cars as numbers: one record feeds every fidelity, and the records hold together."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from planar_cars import point

from jaxveh import InputError, vehicles
from jaxveh._core.names import record
from jaxveh.io import AxleTyre, CarSpecification
from jaxveh.tyres import Brush, Contact, MFTyre
from jaxveh.vehicles import GRAVITY, CarNumbers, SuspensionNumbers, TyreNumbers, sets
from jaxveh.vehicles.load_transfer import planar_loads
from jaxveh.vehicles.rolling_body import roll_geometry, roll_loads

pytestmark = pytest.mark.product

WITH_MASS = [name for name in sets.CARS if name != "semi_trailer"]
WITH_SUSPENSION = [name for name in WITH_MASS if name != "ferrari_250lm"]
COMMONROAD = ("compact_car", "sedan", "van")


@pytest.mark.parametrize("name", sets.CARS)
def test_each_record_names_its_source_and_itself(name):
    numbers = sets.CARS[name]()
    assert numbers.name == name
    assert len(numbers.source) > 30
    assert numbers == sets.CARS[name]()


def test_cars_of_commonroad_name_its_vehicle():
    for number, name in enumerate(("compact_car", "sedan", "van", "semi_trailer"), 1):
        assert f"CommonRoad vehicle {number} (" in sets.CARS[name]().source


@pytest.mark.parametrize("name", WITH_MASS)
def test_no_car_oversteers_on_its_linear_tyres_and_the_single_track_has_the_same_slopes(name):
    numbers = sets.CARS[name]()
    linear = vehicles.build(numbers, vehicles.LinearSingleTrack)
    # CommonRoad's cars are neutral; all others understeer, by less than 5 degrees a g.
    gradient = float(linear.understeer_gradient_deg_per_g)
    assert -1e-6 < gradient < 5.0
    same = vehicles.linear_single_track(vehicles.build(numbers, vehicles.SingleTrack))
    stiffnesses = [same.front_stiffness, same.rear_stiffness]
    np.testing.assert_allclose(stiffnesses, [linear.front_stiffness, linear.rear_stiffness], rtol=1e-3)
    for load, tyre in zip(numbers.wheel_loads(), (numbers.front, numbers.rear), strict=True):
        # Of all car tyres there are, from a truck's to a racing one's.
        assert 4.0 < tyre.cornering_stiffness / load < 25.0
        assert 0.6 < tyre.friction < 1.6


@pytest.mark.parametrize("name", WITH_SUSPENSION)
def test_sprung_and_unsprung_masses_make_the_car(name):
    numbers = sets.CARS[name]()
    s, a, b = numbers.suspension, numbers.front_axle_to_cg, numbers.rear_axle_to_cg
    front, rear = 2 * s.unsprung_mass_front, 2 * s.unsprung_mass_rear
    np.testing.assert_allclose(s.sprung_mass + front + rear, numbers.mass, rtol=1e-4)
    np.testing.assert_allclose(s.front_axle_to_cg + s.rear_axle_to_cg, numbers.wheelbase, rtol=1e-9)
    outside = front * (a**2 + numbers.track_front**2 / 4) + rear * (b**2 + numbers.track_rear**2 / 4)
    moved = s.sprung_mass * (a - s.front_axle_to_cg) ** 2
    np.testing.assert_allclose(s.yaw_inertia + outside + moved, numbers.yaw_inertia, rtol=5e-3)
    # CommonRoad's planar cars take the sprung mass' place for the car's.
    centre = (s.sprung_mass * s.front_axle_to_cg + rear * numbers.wheelbase) / numbers.mass
    np.testing.assert_allclose(centre, a, atol=0.04 if name in COMMONROAD else 1e-3)
    height = (s.sprung_mass * s.cg_height + (front + rear) * numbers.wheel_radius) / numbers.mass
    np.testing.assert_allclose(height, numbers.cg_height, atol=0.015)
    # Inertias of a body: none is greater than the other two together.
    inertias = sorted((s.roll_inertia, s.pitch_inertia, s.yaw_inertia))
    assert inertias[2] < inertias[0] + inertias[1]
    for spring, damper, share in (
        (s.spring_front, s.damper_front, s.rear_axle_to_cg),
        (s.spring_rear, s.damper_rear, s.front_axle_to_cg),
    ):
        mass = 0.5 * s.sprung_mass * share / numbers.wheelbase
        assert 1.0 < np.sqrt(spring / mass) / (2 * np.pi) < 3.3
        # A truck damps harder than a car.
        assert 0.1 < damper / (2 * np.sqrt(spring * mass)) < (1.0 if name == "truck" else 0.5)
        assert s.tyre_stiffness > 2 * spring


@eqx.filter_jit
def tyre_forces(tyre, slip_angle, slip_ratio, load):
    found = tyre.forces(Contact(slip_angle, slip_ratio, load, speed=jnp.full_like(load, 20.0)))
    return found.F_x, found.F_y


@pytest.mark.parametrize("name", WITH_SUSPENSION)
def test_the_wheels_tyres_have_the_records_slopes_and_friction(name):
    numbers = sets.CARS[name]()
    car = vehicles.build(numbers, vehicles.SevenDOF)
    sweep = np.linspace(0.0, 0.6, 300)
    for tyre, load, given in zip(
        (car.front, car.rear), numbers.wheel_loads(), (numbers.front, numbers.rear), strict=True
    ):
        # Little slip angle, little slip ratio, much slip under more load, and all slip angles.
        slip_angle = jnp.asarray([1e-5, 0.0, 0.3, 0.3, *sweep])
        slip_ratio = jnp.asarray([0.0, 1e-5, 0.0, 0.0, *np.zeros_like(sweep)])
        loads = load * jnp.asarray([1.0, 1.0, 1.3, 1.0, *np.ones_like(sweep)])
        F_x, F_y = (np.asarray(force) for force in tyre_forces(tyre, slip_angle, slip_ratio, loads))
        np.testing.assert_allclose(F_y[0] / 1e-5, given.cornering_stiffness, rtol=1e-3)
        along = given.cornering_stiffness if given.slip_stiffness is None else given.slip_stiffness
        np.testing.assert_allclose(F_x[1] / 1e-5, along, rtol=1e-3)
        np.testing.assert_allclose(np.max(F_y[4:]), given.friction * load, rtol=0.02)
        assert 1.1 < F_y[2] / F_y[3] < 1.31
    np.testing.assert_allclose(2 * sum(numbers.wheel_loads()), numbers.mass * GRAVITY, rtol=1e-12)


def test_the_record_of_the_passenger_car_is_the_papers_car():
    built = vehicles.build(sets.passenger_car(), vehicles.SingleTrack)
    assert eqx.tree_equal(built, vehicles.passenger_car())


def test_every_fidelity_of_a_named_car():
    x = {name: vehicles.named_car("compact_car", name) for name in sets.FIDELITIES if name != "kinematic-trailer"}
    assert {name: type(vehicle) for name, vehicle in x.items()} == {name: sets.FIDELITIES[name] for name in x}
    assert float(x["kinematic"].wheelbase) == pytest.approx(0.88392 + 1.50876)
    assert float(x["longitudinal"].wheel_inertia) == 1.7
    assert x["seven-dof"].drive.inputs == ("drive_torque", "brake_torque")
    assert float(x["seven-dof"].drive.front_brake) == 0.76
    assert vehicles.named_car("ev", "seven-dof").inputs[1] == "torque_fl"
    assert float(vehicles.named_car("semi_trailer", "kinematic-trailer").trailer_length) == 8.1


def test_options_replace_numbers_and_switch_on_what_is_off():
    tyre = Brush(60e3, 50e3)
    numbers = sets.compact_car()
    car = vehicles.build(numbers, vehicles.SevenDOF, front=tyre, rear=tyre, mass=1300.0)
    assert (car.front is tyre, float(car.mass)) == (True, 1300.0)
    assert vehicles.build(numbers, vehicles.SingleTrack).cg_height is None
    high = vehicles.build(numbers, vehicles.SingleTrack, cg_height=numbers.cg_height)
    assert high.inputs == ("steer", "v_x", "a_x")


def test_a_class_without_a_mass_gets_the_sprung_one():
    numbers = sets.passenger_car()
    sprung, whole = numbers.values(sprung=True), numbers.values()
    for name in ("yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg", "cg_height"):
        assert sprung[name] == getattr(numbers.suspension, name)
        assert whole[name] == getattr(numbers, name)
    assert whole["spring_front"] == sprung["spring_front"] == numbers.suspension.spring_front
    assert "trailer_length" not in whole


class Sprung(vehicles.AbstractVehicle):
    """Only the fields of a car on springs."""

    sprung_mass: float
    front_axle_to_cg: float
    anti_roll_front: float
    track_front: float
    front: object

    inputs = state_type = units = property(lambda self: ())

    def start(self, t, u, **values):
        raise NotImplementedError

    def evaluate(self, t, x, u, ground=None):
        raise NotImplementedError

    def motion(self, x, u):
        raise NotImplementedError


def test_build_serves_classes_that_it_does_not_know():
    built = vehicles.build(sets.compact_car(), Sprung)
    assert (built.sprung_mass, built.front_axle_to_cg) == (1094.5, 0.88392)
    assert built.anti_roll_front == pytest.approx(12880.0 / 1.3899**2)
    assert vehicles.build(sets.suv(), Sprung).front_axle_to_cg == 1.545
    assert sets.suv().front_axle_to_cg == 1.573
    assert isinstance(built.front, MFTyre)


SPECIFICATION = {
    "mass": 1500.0, "yaw_inertia": 2500.0, "front_axle_to_cg": 1.2, "rear_axle_to_cg": 1.5,
    "front_cornering_stiffness": 90e3, "rear_cornering_stiffness": 110e3,
}  # fmt: skip
FOUR_WHEELS = {
    "cg_height": 0.55, "track_front": 1.55, "track_rear": 1.56, "wheel_radius": 0.31, "wheel_inertia": 1.1, "drag": 0.38,
    "rolling_resistance": 0.011, "front_drive": 0.0, "front_brake": 0.6,
}  # fmt: skip


def test_a_car_on_four_wheels_out_of_a_cars_file():
    spec = CarSpecification(**SPECIFICATION, **FOUR_WHEELS)
    assert vehicles.numbers_of(spec).name == "car"
    assert vehicles.numbers_of(dataclasses.replace(spec, name="estate")).name == "estate"
    car = vehicles.build(vehicles.numbers_of(spec), vehicles.SevenDOF)
    for name in ("mass", "track_front", "track_rear", "cg_height", "wheel_radius", "wheel_inertia", "drag"):
        assert float(getattr(car, name)) == getattr(spec, name)
    assert (float(car.drive.front_drive), float(car.drive.front_brake)) == (0.0, 0.6)
    same = vehicles.linear_single_track(car)
    np.testing.assert_allclose([same.front_stiffness, same.rear_stiffness], [90e3, 110e3], rtol=1e-8)
    x, u = point(vehicles.Longitudinal(1e3))
    assert vehicles.build(vehicles.numbers_of(spec), vehicles.Longitudinal).derivatives(0.0, x, u).v_x != 0


def test_the_axles_peak_in_a_cars_file_is_the_tyres_friction():
    tyre = AxleTyre(B=10.0, C=1.3, D=8000.0, E=0.2, nominal_load=10000.0)
    numbers = vehicles.numbers_of(CarSpecification(**SPECIFICATION, front=tyre, steer_offset=0.01))
    assert (numbers.front.friction, numbers.rear.friction) == (0.8, 1.0)
    assert numbers.steer_offset == -0.01
    own = AxleTyre(B=10.0, C=1.3, D=8000.0, E=0.2)
    numbers = vehicles.numbers_of(CarSpecification(**SPECIFICATION, front=own))
    np.testing.assert_allclose(numbers.front.friction, 8000.0 / (1500 * GRAVITY * 1.5 / 2.7), rtol=1e-12)


def test_tyre_files_of_a_cars_file_are_read(tmp_path):
    from jaxveh.io import write_property_file
    from jaxveh.tyres import to_property_file, typical_mf_tyre

    path = tmp_path / "front.tir"
    write_property_file(to_property_file(typical_mf_tyre(3500.0)), path)
    spec = CarSpecification(**SPECIFICATION, **FOUR_WHEELS, front_tyre=str(path))
    car = vehicles.build(vehicles.numbers_of(spec), vehicles.SevenDOF)
    assert float(car.front.structure.FNOMIN) == 3500.0
    assert float(car.rear.structure.FNOMIN) != 3500.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: vehicles.named_car("compact_cra"), r"no car 'compact_cra' \(did you mean 'compact_car'\?\)"),
        (lambda: vehicles.named_car("suv", "six-dof"), r"no fidelity 'six-dof' \(did you mean 'seven-dof'"),
        (
            lambda: vehicles.named_car("ferrari_250lm", "seven-dof"),
            "ferrari_250lm: SevenDOF needs track_front, track_rear, cg_height, missing from its numbers",
        ),
        (lambda: vehicles.named_car("semi_trailer", "linear"), "semi_trailer: LinearSingleTrack needs mass, yaw_inertia"),
        (lambda: vehicles.named_car("sedan", "linear", height=1.0), r"unknown name\(s\) height"),
        (
            lambda: vehicles.build(
                vehicles.numbers_of(CarSpecification(**SPECIFICATION)), vehicles.SevenDOF
            ),
            "car: SevenDOF needs track_front, track_rear, cg_height",
        ),
        (lambda: CarNumbers("x", "y", 1.2, -1.5), r"x: rear_axle_to_cg = -1\.5: must be positive"),
        (lambda: CarNumbers("x", "y", 1.2, 1.5, front_drive=60.0), r"x: front_drive = 60\.0: must be between 0 and 1"),
        (lambda: CarNumbers("x", "y", 1.2, 1.5).wheel_loads(), "x: the mass is missing, which the loads need"),
        (lambda: TyreNumbers(-5.0), r"TyreNumbers\.cornering_stiffness = -5\.0"),
        (
            lambda: dataclasses.replace(sets.sedan().suspension, anti_roll_front=-1.0),
            r"SuspensionNumbers\.anti_roll_front = -1\.0: must be at least 0",
        ),
        (
            lambda: dataclasses.replace(sets.sedan().suspension, spring_rear=0.0),
            r"SuspensionNumbers\.spring_rear = 0\.0: must be positive",
        ),
    ],
)  # fmt: skip
def test_bad_input_raises(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_suspensions_are_records_of_numbers():
    assert isinstance(sets.suv().suspension, SuspensionNumbers)
    assert all(isinstance(value, float) for value in dataclasses.astuple(sets.suv().suspension))


def test_numbers_that_a_body_on_springs_leaves_to_others():
    numbers = sets.suv()
    s, rigid, rolling = (
        numbers.suspension,
        *(vehicles.build(numbers, k) for k in (vehicles.SevenDOF, vehicles.Roll4DOF)),
    )
    truth = vehicles.build(numbers, vehicles.FourteenDOF)
    # The sprung mass stands where it stands in the record, and the transfers of both cars are one.
    np.testing.assert_allclose(roll_geometry(rolling).sprung_height, s.cg_height, rtol=0.01)
    a, b = numbers.front_axle_to_cg, numbers.rear_axle_to_cg
    axis = (b * s.roll_centre_front + a * s.roll_centre_rear) / (a + b)
    ahead = s.sprung_mass * (a - s.front_axle_to_cg) * (s.cg_height - axis)
    np.testing.assert_allclose(rolling.roll_yaw_product, s.roll_yaw_product + ahead, rtol=1e-12)
    np.testing.assert_allclose(truth.roll_yaw_product, s.roll_yaw_product, rtol=1e-12)
    stiff, a_y = rolling.roll_stiffness_front + rolling.roll_stiffness_rear, 1e-3
    # Rolled by its springs alone, little and steadily.
    roll = s.sprung_mass * (s.cg_height - axis) * a_y / stiff
    zeros = rolling.state_type(*[0.0] * len(rolling.state_type._fields))
    loads = roll_loads(rolling, zeros._replace(roll=roll), 0.0, a_y, -GRAVITY)
    planar = planar_loads(rigid, 0.0, a_y, -GRAVITY)
    np.testing.assert_allclose(planar.fr - planar.fl, loads.fr - loads.fl, rtol=0.03)


@pytest.mark.parametrize("kind", [vehicles.SevenDOF, vehicles.FourteenDOF])
def test_a_cars_rolling_resistance_counts_once(kind):
    numbers = sets.suv()
    car = vehicles.build(numbers, kind, drag=0.0)
    u = record("Inputs", {name: jnp.asarray(0.0) for name in car.inputs})
    x = car.start(0.0, u, v_x=25.0)
    # A wheel that is held back takes the body with it only once it slips: what slows the spins says it at once.
    # Of one wheel: nothing else is compiled.
    rate = eqx.filter_jit(lambda car, x, u: car.derivatives(0.0, x, u).omega_fl)(car, x, u)
    asked = numbers.rolling_resistance * numbers.wheel_loads()[0] * numbers.wheel_radius
    np.testing.assert_allclose(-rate * numbers.wheel_inertia, asked, rtol=0.05)


@pytest.mark.parametrize("name", WITH_MASS)
def test_a_file_would_say_the_same_of_a_car_on_one_track(name):
    numbers = sets.CARS[name]()
    told = vehicles.specification_of(numbers)
    again = vehicles.numbers_of(told)
    for field in (
        "mass",
        "yaw_inertia",
        "front_axle_to_cg",
        "rear_axle_to_cg",
        "cg_height",
        "drag",
        "wheel_radius",
        "front_drive",
    ):
        assert getattr(again, field) == getattr(numbers, field), field
    of_file, of_numbers = vehicles.specified_car(told), vehicles.named_car(name)
    for axle in ("front", "rear"):
        for part in "BCDE":
            pair = getattr(getattr(of_file, axle), part), getattr(getattr(of_numbers, axle), part)
            np.testing.assert_allclose(*pair, rtol=1e-6)


@pytest.mark.parametrize("name", WITH_MASS)
def test_numbers_of_float32_are_written_with_the_digits_that_they_have(name, float32):
    told = vehicles.specification_of(sets.CARS[name]())
    for axle in (told.front, told.rear):
        for part in (axle.B, axle.C, axle.D, axle.E):
            assert len(repr(part)) <= 11 and np.float32(part) == np.float32(repr(part))
    assert told.front.C in (1.3, 1.6)


def test_what_has_no_mass_has_no_file():
    with pytest.raises(InputError, match="semi_trailer: a car's file needs mass, yaw_inertia, front, rear"):
        vehicles.specification_of(sets.CARS["semi_trailer"]())
