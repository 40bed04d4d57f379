"""What `simulate` is given: sensors and events that are none, cars with a road, few rows, stamps that are one in float32."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, manoeuvres, roads, sensors, simulation, vehicles
from jaxveh.simulation import simulate
from jaxveh.statespace import cast
from jaxveh.vehicles import Travelling

STEER = manoeuvres.step_steer(25.0, 0.02, start=0.1, duration=0.5)


def linear():
    return vehicles.linear_single_track(vehicles.passenger_car())


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ("esc", "'esc'"),
        ((sensors.IMU(rate=100.0),), "tuple"),
        (jax.random.key(0), "a key of jax.random"),
        (sensors.esc, "the function esc"),
    ],
)
def test_sensors_that_are_none_are_refused(given, shown):
    with pytest.raises(InputError, match=f"sensors = {shown}: must be a SensorSet .* a Suite .* one device, or None"):
        simulate(linear(), STEER, given)


def test_one_device_is_a_suite_of_one():
    imu = sensors.IMU(rate=20.0)
    alone, suite = (simulate(linear(), STEER, devices) for devices in (imu, sensors.Suite((imu,))))
    assert len(alone) == 11 and alone.names == suite.names
    np.testing.assert_array_equal(alone["yaw_rate"], suite["yaw_rate"])


@pytest.mark.parametrize("given", [{"duration": 1e9}, {"dt": 1e-9}, {"max_step": 1e-9}])
def test_a_drive_that_fits_into_no_memory_is_refused(given):
    drive = manoeuvres.step_steer(25.0, 0.02, **{name: given[name] for name in given if name == "duration"})
    with pytest.raises(InputError, match=r"duration = .*: must be at most 1e\+07 rows and 1e\+08 steps"):
        simulate(linear(), drive, **{name: given[name] for name in given if name != "duration"})


def test_an_event_that_is_none_is_refused():
    with pytest.raises(
        InputError, match=r"until = the function standstill: must be an Event such as simulation\.standstill\(\)"
    ):
        simulate(linear(), STEER, until=simulation.standstill)


def test_a_car_travels_on_one_road():
    car = Travelling(linear(), roads.Level(0.8))
    with pytest.raises(InputError, match="road = MuJump: the car already travels on a road, Level"):
        simulate(car, STEER, road=roads.MuJump(1.0, 0.4, 10.0))
    with pytest.raises(InputError, match="Travelling must be outermost"):
        simulate(vehicles.Steered(car, 16.0), STEER)
    placed = simulate(Travelling(linear()), STEER, road=roads.Level(0.8), dt=0.1)
    np.testing.assert_allclose(placed["true.friction_fl"], 0.8, atol=1e-12)


def test_a_device_that_speaks_once_makes_one_row():
    slow = manoeuvres.step_steer(25.0, 0.02, duration=2.0)
    drive = simulate(linear(), slow, sensors.Suite(sensors.GNSS(rate=0.1)))
    np.testing.assert_array_equal(drive.time, [0.0])
    np.testing.assert_allclose(drive["speed"], [25.0])


@pytest.mark.parametrize("duration", [5.7, pytest.param(6.2, marks=pytest.mark.full)])
@pytest.mark.usefixtures("float32")
def test_an_event_that_did_not_happen_cuts_nothing_in_float32(duration):
    """In float32 the last row's stamp lies beyond or before that of its double: neither may count as an early end."""
    steady = manoeuvres.step_steer(25.0, 0.02, duration=duration)
    drive = simulate(linear(), steady, until=simulation.standstill(), max_step=0.01)
    assert len(drive) == round(100 * duration) + 1
    assert "standstill" not in drive.source
    assert drive["true.yaw_rate"].dtype == np.float32 and np.all(np.isfinite(drive["true.yaw_rate"]))


def test_an_event_ends_the_rows_of_devices_too():
    slowing = manoeuvres.mu_jump_braking(5.0, brake_at=0.1, deceleration=5.0, duration=2.0)
    # The speed is 1.2 m/s where a step ends, within rounding.
    suite = sensors.Suite(sensors.GNSS(rate=20.0, delay=0.03))
    drive = simulate(linear(), slowing, suite, until=simulation.standstill(1.2))
    assert "standstill (below 1.2 m/s) at t = 1.0" in drive.source
    end = float(drive.source.split("t = ")[1].split(" ")[0])
    assert end - 0.05 < drive.time[-1] <= end
    assert np.all(np.isfinite(np.asarray(drive["true.v_x"])))


def test_an_event_in_float32_is_found():
    slowing = manoeuvres.mu_jump_braking(5.0, brake_at=0.1, deceleration=5.0, duration=2.0)
    drive = simulate(*cast((linear(), slowing), np.float32), until=simulation.standstill(1.3))
    assert "standstill (below 1.3 m/s) at t = 0.99" in drive.source
    assert drive.time[-1] == 0.99


def test_an_event_in_one_run_of_a_batch_leaves_the_others_whole():
    def last(deceleration):
        slowing = manoeuvres.mu_jump_braking(5.0, brake_at=0.1, deceleration=3.0, duration=1.5)
        slowing = eqx.tree_at(lambda m: m.deceleration, slowing, deceleration)
        return simulate(linear(), slowing, until=simulation.standstill(2.0), dt=0.1)["true.v_x"]

    speeds = jax.vmap(last)(jnp.asarray([4.0, 1.0]))
    assert np.isnan(speeds[0, -1]) and np.all(speeds[0, :8] > 2.0)
    np.testing.assert_allclose(speeds[1, -1], 5.0 - 1.25, atol=1e-6)


def test_stamps_that_are_one_in_float32_are_refused():
    car, long = cast((linear(), manoeuvres.step_steer(25.0, 0.02, duration=40.0)), np.float32)
    close = sensors.Suite((sensors.GNSS(rate=1.0), sensors.IMU(rate=1.0, phase=1e-6)))
    with pytest.raises(InputError, match=r"rows at t = \d+ s and 1e-06 s later coincide in float32"):
        simulate(car, long, close, max_step=0.1)


@pytest.mark.parametrize(
    ("car", "shown"),
    [
        (vehicles.SingleTrack, "the class SingleTrack"),
        (None, "None"),
        ("passenger_car", "'passenger_car'"),
        (roads.Level(0.8), "Level"),
    ],
)
def test_a_car_that_is_none_is_refused(car, shown):
    with pytest.raises(
        InputError, match=rf"simulate: car = {shown}.*: must be a car, such as vehicles\.passenger_car\(\)"
    ):
        simulate(car, STEER)


def several(leaf):
    return jnp.stack([leaf, 1.01 * leaf])


@pytest.mark.parametrize("make", [linear, vehicles.passenger_car, lambda: Travelling(linear(), roads.Level(0.8))])
def test_every_number_of_a_car_is_one(make):
    """Of several cars in one the drive would fail somewhere inside; in a batch each has its own."""
    leaves, tree = jax.tree.flatten(make())
    for i, leaf in enumerate(leaves):
        car = jax.tree.unflatten(tree, [*leaves[:i], several(leaf), *leaves[i + 1 :]])
        with pytest.raises(
            InputError, match=r"simulate: car: .* has shape \(2,\): must be one number each.* jax\.vmap"
        ):
            simulate(car, STEER, dt=0.1)


@pytest.mark.parametrize("leaf", ["speed", "steer"])
def test_every_number_of_a_manoeuvre_is_one(leaf):
    for values in (np.array([20.0, 21.0]), jnp.asarray([0.01, 0.02])):
        manoeuvre = eqx.tree_at(lambda m: getattr(m, leaf), STEER, jnp.asarray(values))
        with pytest.raises(
            InputError, match=rf"simulate: manoeuvre: .*{leaf} has shape \(2,\): must be one number each"
        ):
            simulate(linear(), manoeuvre, dt=0.1)


def test_a_start_is_one_state():
    with pytest.raises(InputError, match=r"simulate: start: yaw_rate has shape \(3,\): must be one number.* jax\.vmap"):
        simulate(linear(), STEER, start={"yaw_rate": np.zeros(3)})


def test_a_batch_of_cars_and_manoeuvres_drives():
    cars, manoeuvres_ = jax.tree.map(several, linear()), jax.tree.map(several, STEER)
    drives = jax.vmap(lambda car, manoeuvre: simulate(car, manoeuvre, dt=0.25)["true.yaw_rate"])(cars, manoeuvres_)
    alone = simulate(jax.tree.map(lambda leaf: leaf[1], cars), jax.tree.map(lambda leaf: leaf[1], manoeuvres_), dt=0.25)
    np.testing.assert_allclose(drives[1], alone["true.yaw_rate"], rtol=1e-6, atol=1e-9)


CARS_OF_BOTH_KINDS = {
    "told its speed": lambda: vehicles.Steered(vehicles.passenger_car(), 16.0),
    "driven": lambda: vehicles.named_car("van", "seven-dof"),
}


@pytest.mark.parametrize("kind", CARS_OF_BOTH_KINDS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_is_around_a_car_has_its_precision(kind, dtype):
    car, other = cast(CARS_OF_BOTH_KINDS[kind](), dtype), np.float64 if dtype == np.float32 else np.float32
    pedals = kind == "driven"
    drives = [
        (manoeuvres.named_manoeuvre(n, 20.0), None) for n, m in manoeuvres.MANOEUVRES.items() if pedals or not m.pedals
    ]
    drives += [(STEER, roads.named_road(name)) for name in roads.ROADS]
    for manoeuvre, road in cast(drives, other):
        driven = simulation.driven_car(car, manoeuvre, cast(sensors.esc(low_pass=sensors.LowPass(20.0)), other), road)
        start = driven.start(0.0, dtype)
        rates, (u, *seen) = jax.eval_shape(
            lambda x, d=driven: (d.derivatives(jnp.zeros((), dtype), x), d.see(0.0, x)), start
        )
        assert {leaf.dtype for leaf in jax.tree.leaves((start, rates, seen))} == {np.dtype(dtype)}, (manoeuvre, road, u)
