"""Simulations: order of convergence, references, noise, transformations, precision, failures."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import EXPLICIT_SOLVERS

from jaxveh import FilterError, InputError, manoeuvres, sensors, vehicles
from jaxveh.sensors import LowPass
from jaxveh.simulation import simulate
from jaxveh.statespace import cast
from jaxveh.tyres import AbstractTyre, Forces

CAR = vehicles.passenger_car
KEY = jax.random.key(7)


def lane_change(duration=2.0, steer=0.1):
    return manoeuvres.double_lane_change(25.0, steer, start=0.1, period=0.8, pause=0.1, duration=duration)


@pytest.fixture(scope="module")
def drive():
    return simulate(CAR(), lane_change(), sensors.esc(), KEY)


def test_channels_units_and_time(drive):
    np.testing.assert_allclose(drive.time, 0.01 * np.arange(201), rtol=1e-15)
    assert drive.names[:4] == ("steer", "v_x", "yaw_rate", "a_y")
    assert set(drive.truth.names) == {*vehicles.SingleTrackOutputs._fields, "x", "y"}
    units = [drive.unit(name) for name in ("steer", "v_x", "yaw_rate", "a_y", "true.F_yf", "true.sideslip")]
    assert units == ["rad", "m/s", "rad/s", "m/s^2", "N", "rad"]
    assert "SingleTrack, DoubleLaneChange" in drive.source
    np.testing.assert_allclose(drive["steer"], lane_change().inputs(drive.time).steer, atol=1e-15)


def reference(car, manoeuvre, **more):
    """An adaptive eighth-order solution at a tolerance of 1e-12."""
    controller = diffrax.PIDController(rtol=1e-12, atol=1e-12)
    return simulate(car, manoeuvre, solver=diffrax.Dopri8(), stepsize_controller=controller, **more)


def test_the_default_equals_a_fine_reference(drive):
    exact = reference(CAR(), lane_change())
    for name in ("true.v_y", "true.yaw", "true.yaw_rate", "true.a_y", "true.F_yr"):
        np.testing.assert_allclose(drive[name], exact[name], atol=1e-7 * float(jnp.max(jnp.abs(exact[name]))))


def test_rk4_converges_with_order_four():
    """On a smooth steer throughout: half the step, a sixteenth of the error."""
    car, drive = CAR(), manoeuvres.swept_sine(25.0, 0.1, 0.4, 0.8, 1.2, edge=0.6)
    exact = reference(car, drive, dt=0.4)
    errors = []
    for step in (0.05, 0.025):
        got = simulate(car, drive, dt=0.4, max_step=step)
        errors.append(float(jnp.max(jnp.abs(got["true.yaw_rate"] - exact["true.yaw_rate"]))))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(np.abs(orders - 4) < 0.4), orders


def test_a_linear_car_settles_to_the_closed_form():
    car = vehicles.linear(CAR())
    out = simulate(car, manoeuvres.step_steer(20.0, 0.01, duration=4.0), dt=0.1)
    m, a, b, length = car.mass, car.front_axle_to_cg, car.rear_axle_to_cg, car.wheelbase
    understeer = m / length * (b / car.front.cornering_stiffness - a / car.rear.cornering_stiffness)
    np.testing.assert_allclose(out["true.yaw_rate"][-1], 20 * 0.01 / (length + understeer * 400), rtol=1e-3)
    np.testing.assert_allclose(out["true.a_y"][-1], 20 * out["true.yaw_rate"][-1], rtol=1e-6)


def test_noise_has_the_stated_spread_and_comes_from_the_key():
    straight = manoeuvres.step_steer(25.0, 0.0, duration=20.0)
    out = simulate(CAR(), straight, sensors.esc(yaw_rate=0.02, a_y=0.3, v_x=0.1), KEY, max_step=0.01)
    for name, std in (("yaw_rate", 0.02), ("a_y", 0.3), ("v_x", 0.1)):
        residual = np.asarray(out[name] - out["true." + name])
        assert abs(residual.std() / std - 1) < 4 / np.sqrt(2 * residual.size)
        assert abs(residual.mean()) < 4 * std / np.sqrt(residual.size)
    other = simulate(CAR(), straight, sensors.esc(yaw_rate=0.02, a_y=0.3, v_x=0.1), jax.random.key(8), max_step=0.01)
    assert not np.allclose(out["a_y"], other["a_y"])


def test_without_a_key_measurements_carry_no_noise():
    out = simulate(CAR(), lane_change(), sensors.esc())
    for name in ("yaw_rate", "a_y"):
        np.testing.assert_array_equal(out[name], out["true." + name])


def test_a_low_pass_in_the_sensors_equals_the_low_pass_on_the_channel():
    out = simulate(CAR(), lane_change(), sensors.esc(low_pass=LowPass(5.0)), dt=0.002, max_step=0.001)
    felt = out.replace(yaw_rate=out["true.yaw_rate"], a_y=out["true.a_y"])
    after = sensors.low_pass(felt, ["yaw_rate", "a_y"], 5.0)
    np.testing.assert_allclose(out["yaw_rate"], after["yaw_rate"], atol=2e-4)
    np.testing.assert_allclose(out["a_y"], after["a_y"], atol=5e-3)
    assert np.max(np.abs(out["a_y"] - felt["a_y"])) > 1.0


def test_a_replayed_drive_is_the_drive(drive):
    again = simulate(CAR(), manoeuvres.replay(drive))
    np.testing.assert_allclose(again["true.yaw_rate"], drive["true.yaw_rate"], atol=1e-3)


def test_load_transfer_follows_the_speeds_rate_and_records_the_input():
    car = eqx.tree_at(lambda c: c.cg_height, CAR(), jnp.asarray(0.5), is_leaf=lambda leaf: leaf is None)
    out = simulate(car, lane_change(), sensors.esc())
    np.testing.assert_allclose(out["a_x"], -out["true.v_y"] * out["true.yaw_rate"], atol=1e-12)
    static = car.static_loads()[0]
    np.testing.assert_allclose(static - out["true.load_front"], 1420 * out["a_x"] * 0.5 / 2.55, atol=1e-8)


def test_start_replaces_fields_of_straight_running():
    out = simulate(CAR(), lane_change(), start={"yaw": 0.05})
    assert out["true.yaw"][0] == 0.05
    with pytest.raises(InputError, match=r"unknown name\(s\) speed"):
        simulate(CAR(), lane_change(), start={"speed": 1.0})


def test_a_batch_over_keys_and_cars_equals_single_runs(drive):
    def run(mass, key):
        return simulate(with_mass(mass), lane_change(), sensors.esc(), key)

    masses, keys = jnp.asarray([1420.0, 1600.0], float), jnp.stack([KEY, jax.random.key(3)])
    many = jax.jit(jax.vmap(run))(masses, keys)
    assert many["a_y"].shape == (2, 201)
    for i in range(2):
        single = run(masses[i], keys[i])
        for name in ("a_y", "yaw_rate", "true.v_y"):
            np.testing.assert_allclose(many[name][i], single[name], atol=1e-10)
    np.testing.assert_allclose(many["a_y"][0], drive["a_y"], atol=1e-10)
    assert not np.allclose(many["true.v_y"][0], many["true.v_y"][1])


def with_mass(mass):
    return eqx.tree_at(lambda c: c.mass, CAR(), mass)


def test_gradients_equal_finite_differences_in_both_modes():
    def miss(at, adjoint=None):
        car = eqx.tree_at(lambda c: c.front.B, CAR(), at[0])
        manoeuvre = eqx.tree_at(lambda m: m.steer, lane_change(), at[1])
        return jnp.sum(simulate(car, manoeuvre, sensors.esc(), adjoint=adjoint)["true.yaw_rate"] ** 2)

    # Values and gradients by one program.
    both = jax.jit(jax.value_and_grad(miss))
    at, steps = np.asarray([6.9986, 0.1]), np.asarray([1e-4, 1e-6])
    expected = [(both(at + side)[0] - both(at - side)[0]) / (2 * side.sum()) for side in np.diag(steps)]
    np.testing.assert_allclose(both(at)[1], expected, rtol=1e-6)
    forward = jax.jit(lambda z, way: jax.jvp(lambda z: miss(z, diffrax.ForwardMode()), (z,), (way,))[1])
    np.testing.assert_allclose(forward(at, np.asarray([1.0, 0.0])), expected[0], rtol=1e-6)


def test_float32_cars_make_float32_recordings(drive):
    args = cast((CAR(), lane_change(), sensors.esc()), np.float32)
    out = simulate(*args, KEY)
    assert {leaf.dtype for leaf in out.channels.values()} == {np.dtype(np.float32)}
    np.testing.assert_allclose(out["true.yaw_rate"], drive["true.yaw_rate"], atol=2e-5)


class CountingTyre(AbstractTyre):
    """A linear tyre that notes each time Python runs its law."""

    stiffness: jax.Array
    calls: list = eqx.field(static=True)

    def forces(self, contact, state=None):
        self.calls.append(1)
        return Forces(F_y=self.stiffness * contact.slip_angle)


def test_other_numbers_are_the_same_program():
    """Mass, steer and key are arrays: a second run traces nothing."""
    calls = Calls()
    car = eqx.tree_at(lambda c: c.rear, CAR(), CountingTyre(jnp.asarray(120e3, float), calls))
    simulate(car, lane_change(steer=0.05), sensors.esc(), KEY)
    traced = len(calls)
    assert traced > 0
    heavier = eqx.tree_at(lambda c: c.mass, car, jnp.asarray(1500.0, float))
    simulate(heavier, lane_change(steer=0.06), sensors.esc(), jax.random.key(1))
    assert len(calls) == traced


class Calls(list):
    """A list that is equal to itself alone, so that it may be static."""

    __hash__ = object.__hash__
    __eq__ = object.__eq__


class Failing(AbstractTyre):
    """A tyre whose law ends at a slip angle of 0.03 rad."""

    def forces(self, contact, state=None):
        return Forces(F_y=80e3 * contact.slip_angle * jnp.sqrt(0.03 - jnp.abs(contact.slip_angle)))


def test_a_motion_that_does_not_stay_finite_raises_with_time_and_advice():
    car = eqx.tree_at(lambda c: c.front, CAR(), Failing())
    message = r'simulation failed at t = 0\.[1-5]\d* s \(v_y.*yaw_rate\): .*diverged.*Try solver = "implicit" or'
    with pytest.raises(FilterError, match=message):
        simulate(car, lane_change(), sensors.esc())
    out = simulate(car, lane_change(), sensors.esc(), throw=False)
    assert np.isfinite(out["true.yaw_rate"][0])
    assert not np.isfinite(out["true.yaw_rate"][-1])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"dt": 0.0}, r"dt = 0\.0: must be positive"),
        ({"dt": 3.0}, r"dt = 3\.0: must be at most the manoeuvre's duration, 2 s"),
        ({"max_step": -1.0}, r"max_step = -1\.0: must be positive"),
    ],
)
def test_bad_options_raise_by_name_value_and_range(options, message):
    with pytest.raises(InputError, match=message):
        simulate(CAR(), lane_change(), **options)


def test_a_manoeuvre_without_an_input_of_the_car_raises(drive):
    car = eqx.tree_at(lambda c: c.cg_height, CAR(), jnp.asarray(0.5), is_leaf=lambda leaf: leaf is None)
    with pytest.raises(InputError, match=r"Replay gives steer, v_x, but SingleTrack needs a_x"):
        simulate(car, manoeuvres.replay(drive))


def test_equal_steps_are_diffrax_s_own_and_both_modes_differentiate():
    """A scan of the same steps: `adjoint` sends them through `diffeqsolve`."""
    names = ("v_y", "yaw_rate")

    def last(mass, **more):
        car = eqx.tree_at(lambda c: c.mass, CAR(), mass)
        drive = simulate(car, lane_change(), dt=0.05, max_step=0.01, throw=False, **more)
        return jnp.stack([drive[f"true.{name}"][-1] for name in names])

    @jax.jit
    def with_slopes(mass):
        value, along = jax.linearize(last, mass)
        against = jax.linear_transpose(along, mass)
        return value, along(jnp.ones(())), jax.vmap(against)(jnp.eye(2))[0]

    mass = np.asarray(1420.0)
    through = jax.jit(lambda mass: last(mass, adjoint=diffrax.RecursiveCheckpointAdjoint()))(mass)
    value, forward, reverse = with_slopes(mass)
    np.testing.assert_allclose(value, through, rtol=1e-12)
    np.testing.assert_allclose(forward, reverse, rtol=1e-9)
    np.testing.assert_allclose(forward, (with_slopes(mass + 1.0)[0] - with_slopes(mass - 1.0)[0]) / 2.0, rtol=1e-5)


SOME = (diffrax.Euler, diffrax.Tsit5)
"""One without a memory, one that keeps its last slopes."""


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=pytest.mark.thorough if k in SOME else pytest.mark.full) for k in EXPLICIT_SOLVERS]
)
def test_equal_steps_of_every_explicit_solver_of_diffrax_are_those_of_diffeqsolve(kind):
    """And differentiate in both modes; `diffeqsolve` does so in reverse mode, with its default adjoint."""

    def last(mass, adjoint=None):
        car = eqx.tree_at(lambda c: c.mass, vehicles.linear_single_track(CAR()), mass)
        steer = manoeuvres.step_steer(25.0, 0.05, start=0.1, duration=0.5)
        drive = simulate(car, steer, solver=kind(), dt=0.05, max_step=0.004, throw=False, adjoint=adjoint)
        return drive["true.yaw_rate"]

    mass = jnp.asarray(1420.0)
    with_slopes = jax.jit(
        lambda mass: (*jax.jvp(last, (mass,), (jnp.ones(()),)), jax.grad(lambda mass: last(mass)[-1])(mass))
    )
    value, slope, against = with_slopes(mass)
    np.testing.assert_allclose(value, jax.jit(lambda m: last(m, diffrax.DirectAdjoint()))(mass), rtol=1e-11, atol=1e-14)
    differences = (with_slopes(mass + 1.0)[0] - with_slopes(mass - 1.0)[0]) / 2.0
    np.testing.assert_allclose(slope, differences, rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(against, slope[-1], rtol=1e-10)
