"""Every vehicle with every set of sensors: a state space that runs, or a refusal that says what to do.

Models are traced only: what a filter does with them is that of `transition`, `observation`, `report` and `prior`, in each of
which an error would come up.
"""

import dataclasses

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import members, wanting

from jaxveh import InputError, Recording, estimators, filters, sensors, tyres, vehicles
from jaxveh._core.names import record
from jaxveh.statespace import Gaussian, Heun, RolledRK4, StateDependent


def named(fidelity):
    """The first car whose numbers reach for this fidelity."""
    for name in ("sedan", "semi_trailer", "passenger_car"):
        try:
            return vehicles.named_car(name, fidelity)
        except InputError:
            continue
    raise AssertionError(fidelity)


def steered(fidelity, name):
    """A car of a steering by name."""
    ratio = {"rear_ratio": 0.2} if name == "four-wheel" else {}
    return dataclasses.replace(named(fidelity), steering=vehicles.kit.STEERINGS[name](**ratio))


CARS = {fidelity: (lambda fidelity=fidelity: named(fidelity)) for fidelity in vehicles.sets.FIDELITIES} | {
    "anti-lock": lambda: vehicles.AntiLock(named("seven-dof")),
    "commanded": lambda: vehicles.Commanded(vehicles.passenger_car()),
    "crawling": lambda: vehicles.KinematicCrawl(named("linear")),
    "steered": lambda: vehicles.Steered(named("two-track-3dof"), 16.0, 2e-5, trail=0.02),
    **{
        f"{fidelity}, {name}": lambda fidelity=fidelity, name=name: steered(fidelity, name)
        for fidelity in ("kinematic", "single-track", "two-track-3dof")
        for name in vehicles.kit.STEERINGS
        if name != "front"
    },
    "travelling": lambda: vehicles.Travelling(named("seven-dof")),
    "relaxed": lambda: eqx.tree_at(
        lambda c: c.front, vehicles.passenger_car(), tyres.Relaxed(tyres.Linear(8e4), None, 0.4)
    ),
}
SENSORS = {
    "esc": sensors.esc(),
    "all": sensors.esc(0.005, 0.1, 0.1, 0.1, 0.1, position=(1.0, 0.2, 0.3)),
    "low pass": sensors.esc(low_pass=sensors.LowPass(20.0)),
    "speed": sensors.esc(None, None, 0.1, 0.1),
    "spins": sensors.SensorSet(Gaussian({"omega_fl": 0.1})),
    "suite": sensors.production_car(),
}


def start_of(car):
    return None if "v_x" in car.inputs else {"v_x": 15.0}


def traced(model):
    """Shapes of a moved state, of measurements and of a report, as a filter would ask for them."""
    dtype = model.prior.mean[0].dtype
    number = jax.ShapeDtypeStruct((), dtype)
    u = record("Inputs", dict.fromkeys(model.inputs, number))

    def look(t, u):
        x = model.transition(t, t + 0.01, model.prior.mean, u)
        return x, model.observation(t, x, u), model.report(t, x, u)

    return eqx.filter_eval_shape(look, number, u)


@pytest.mark.product
@pytest.mark.whole
@pytest.mark.parametrize("suite", SENSORS)
@pytest.mark.parametrize("name", CARS)
def test_a_state_space_runs_or_says_what_to_do(name, suite):
    car, chosen = CARS[name](), SENSORS[suite]
    try:
        model = estimators.state_space(car, chosen, start=start_of(car), solver=Heun())
    except InputError as refusal:
        text = str(refusal)
        lacking = "sensors measure a channel the vehicle does not have" in text and "there are:" in text
        assert lacking or (suite == "suite" and "must be a SensorSet" in text), text
        return
    moved, seen, shown = traced(model)
    assert moved._fields == model.states
    assert set(model.channels) <= set(seen._fields)
    assert set(model.states) <= set(shown._fields)
    assert {leaf.dtype for leaf in jax.tree.leaves((moved, seen, shown))} == {np.dtype("float64")}


def test_the_table_has_every_vehicle_of_the_package():
    listed = members("vehicles", vehicles.AbstractVehicle)
    assert not wanting(listed, listed & {type(make()).__name__ for make in CARS.values()}, {})


def test_an_accelerometer_of_a_car_that_does_not_say_its_yaw_acceleration():
    """One that goes straight feels the same everywhere; one without slip, its inputs held, what turning makes of its place."""
    mounted = sensors.esc(None, 0.1, 0.1, position=(1.0, 0.2, 0.0))
    car = vehicles.Kinematic(2.6, 1.4)
    u = record("Inputs", {"steer": jnp.asarray(0.1), "v_x": jnp.asarray(8.0)})
    outputs = car.outputs(0.0, car.start(0.0, u), u)
    seen = mounted.measure(outputs)
    turning = 8.0 * np.tan(0.1) / 2.6
    np.testing.assert_allclose(seen.a_y, 8.0 * turning - turning**2 * 0.2, rtol=1e-12)
    np.testing.assert_allclose(seen.a_x, -1.4 * turning**2 - turning**2 * 1.0, rtol=1e-12)
    straight = vehicles.Longitudinal(1500.0)
    u = record("Inputs", {"drive_torque": jnp.asarray(300.0), "brake_torque": jnp.asarray(0.0)})
    outputs = straight.outputs(0.0, straight.start(0.0, u, v_x=10.0), u)
    found = sensors.esc(None, None, 0.1, position=(1.0, 0.2, 0.0)).measure(outputs)
    np.testing.assert_allclose(found.a_x, outputs.a_x, rtol=1e-12)


@pytest.mark.parametrize("name", ["longitudinal", "seven-dof", "two-track-3dof", "commanded", "travelling"])
def test_a_car_whose_speed_is_a_state_asks_for_it(name):
    with pytest.raises(InputError, match=r'v_x, which needs a mean: give the speed in the.*start=\{"v_x": 20.0\}'):
        estimators.state_space(CARS[name](), SENSORS["speed"])


def test_a_car_of_seven_degrees_of_freedom_is_followed():
    """Speed and spins among the states, torques as inputs: no longer an AttributeError in `run`."""
    car = CARS["seven-dof"]()
    devices = sensors.esc(v_x=0.1)
    model = estimators.state_space(car, devices, start={"v_x": 20.0}, solver=diffrax.Euler())
    assert float(model.prior.mean.omega_rr) == pytest.approx(20.0 / float(car.wheel_radius))
    rows, dt = 24, 0.005
    time = dt * np.arange(rows)
    inputs = {name: np.zeros(rows) for name in model.inputs} | {"steer": 0.02 * np.ones(rows)}
    schedule = Recording(time, {**inputs, **{name: np.zeros(rows) for name in model.channels}})

    def drive(x, row):
        rates, outputs = car.evaluate(row.t, x, row.u)
        seen = devices.measure(outputs)
        return jax.tree.map(lambda x, rate: x + dt * rate, x, rates), (x, {n: getattr(seen, n) for n in model.channels})

    _, (truth, seen) = jax.lax.scan(drive, model.prior.mean, model.rows(schedule))
    found = filters.run(filters.Cubature(), model, schedule.replace(**{n: np.array(v) for n, v in seen.items()}))
    np.testing.assert_allclose(found.mean.yaw_rate, truth.yaw_rate, atol=2e-3)
    np.testing.assert_allclose(found.mean.v_x, truth.v_x, atol=0.02)
    np.testing.assert_allclose(found.mean.sideslip, np.arctan2(truth.v_y, truth.v_x), atol=2e-3)


def test_a_filter_hears_the_angle_of_the_rear_wheels():
    """A crab: told both angles it knows that the car goes aside; told the front one alone it believes in a turn."""
    car = dataclasses.replace(vehicles.passenger_car(), steering=vehicles.RearSteering())
    rows, dt, angle = 40, 0.05, 0.02
    time, some = dt * np.arange(rows), np.full(rows, angle)
    told = {"steer": some, "steer_rear": some, "v_x": np.full(rows, 15.0)}
    seen = {"yaw_rate": np.zeros(rows)}
    drive, found = Recording(time, {**told, **seen}), {}
    for name, own in (("both", car), ("front", vehicles.passenger_car())):
        model = estimators.state_space(own, sensors.esc(yaw_rate=0.005, a_y=None), process_noise={"yaw_rate": 1e-4})
        assert model.inputs == (*own.steering.inputs, "v_x")
        found[name] = filters.run(filters.Extended(), model, drive).mean
    np.testing.assert_allclose(found["both"].sideslip[-1], angle, rtol=1e-2)
    assert abs(float(found["front"].sideslip[-1]) - angle) > 0.01
    model = estimators.state_space(car, sensors.esc(yaw_rate=0.005, a_y=None))
    with pytest.raises(InputError, match="steer_rear"):
        filters.run(filters.Extended(), model, drive.without("steer_rear"))


def test_a_sensor_that_is_worse_in_slip():
    """Noise that depends on an output of the car, with parameters of the car as states."""

    def worse(system, t, x, u):
        slip = system.outputs(t, x, u).slip_angle_front
        return {"yaw_rate": 0.005 + 0.1 * jnp.abs(slip), "a_y": jnp.asarray(0.1, slip.dtype)}

    car = vehicles.passenger_car()
    noise = StateDependent(worse, ("yaw_rate", "a_y"))
    model = estimators.state_space(
        car, sensors.esc(), estimate=lambda car: (car.front.D,), measurement_noise=noise, minimum_speed=0.0
    )
    u = record("Inputs", {"steer": jnp.asarray(0.05), "v_x": jnp.asarray(20.0)})
    law = model.measurement_law(jnp.asarray(0.0), model.prior.mean, u)
    np.testing.assert_allclose(law.std.yaw_rate, 0.005 + 0.1 * 0.05, rtol=1e-2)
    with pytest.raises(InputError, match="measurement_noise is of yaw_rate: must be of the sensors' channels"):
        estimators.state_space(car, sensors.esc(), measurement_noise=Gaussian({"yaw_rate": 0.1}))


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "seven-dof" else pytest.mark.full) for name in CARS]
)
def test_the_usual_step_from_row_to_row_holds_from_four_metres_per_second_on(name):
    """It ends where many short steps end, also if a state is off its balance."""
    car = CARS[name]()
    told = "v_x" in car.inputs
    suite = SENSORS["esc"] if name not in ("longitudinal", "kinematic", "kinematic-trailer") else SENSORS["speed"]
    usual, fine = (
        estimators.state_space(car, suite, start=start_of(car), minimum_speed=0.0, **options)
        for options in ({}, {"solver": RolledRK4()})
    )

    @jax.jit
    def ends(speed):
        u = record("Inputs", {n: jnp.asarray(0.0) for n in usual.inputs} | ({"v_x": speed} if told else {}))
        u = u._replace(steer=0.05) if "steer" in u._fields else u
        rolling = car.start(0.0, u, **({} if told else {"v_x": speed}))
        off = jax.tree.map(lambda leaf: 1.02 * leaf + 0.002, rolling)
        mean = usual.prior.mean._replace(**off._asdict())
        short = lambda i, x: fine.transition(0.01 * i / 60, 0.01 * (i + 1) / 60, x, u)
        return usual.transition(0.0, 0.01, mean, u), jax.lax.fori_loop(0, 60, short, mean)

    for speed in (4.0, 25.0):
        one, many = ends(speed)
        for field in one._fields:
            found, expected = float(getattr(one, field)), float(getattr(many, field))
            near = 4e-3 if field.startswith("a_") else 2e-3
            assert found == pytest.approx(expected, rel=0.02, abs=near), (speed, field)
