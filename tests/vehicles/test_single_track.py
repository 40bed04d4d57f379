"""The single track: closed forms of the linear car, symmetry, loads, standstill, gradients, precision."""

from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, vehicles
from jaxveh._core.parameter import positive
from jaxveh.statespace import RK4, cast
from jaxveh.tyres import AbstractDynamicTyre, Contact, Forces
from jaxveh.vehicles import GRAVITY, SingleTrackState

pytestmark = pytest.mark.product


class Inputs(NamedTuple):
    steer: Any
    v_x: Any


class AcceleratedInputs(NamedTuple):
    steer: Any
    v_x: Any
    a_x: Any


class DrivenInputs(NamedTuple):
    steer: Any
    v_x: Any
    v_x_rate: Any


def state(v_y=0.0, yaw=0.0, yaw_rate=0.0, dtype=float):
    return SingleTrackState(*[jnp.asarray(value, dtype) for value in (v_y, yaw, yaw_rate)])


def inputs(steer=0.0, v_x=25.0, dtype=float):
    return Inputs(jnp.asarray(steer, dtype), jnp.asarray(v_x, dtype))


CARS = {
    "magic": vehicles.passenger_car,
    "linear": lambda: vehicles.linear(vehicles.passenger_car()),
}


@pytest.fixture(params=CARS, ids=str)
def car(request):
    return CARS[request.param]()


def linear_matrix(car, v):
    """A of the textbook's linear single track, d[v_y, r]/dt = A [v_y, r] + ..., for small angles."""
    m, J, a, b = car.mass, car.yaw_inertia, car.front_axle_to_cg, car.rear_axle_to_cg
    C_f, C_r = car.front.cornering_stiffness, car.rear.cornering_stiffness
    return np.array(
        [
            [-(C_f + C_r) / (m * v), -(a * C_f - b * C_r) / (m * v) - v],
            [-(a * C_f - b * C_r) / (J * v), -(a**2 * C_f + b**2 * C_r) / (J * v)],
        ]
    )


@eqx.filter_jit
def slopes(car, v):
    """d(rates of v_y and yaw rate) / d(v_y, yaw rate, steer) of straight running, (2, 3)."""

    def rates(z):
        rate = car.derivatives(0.0, state(z[0], 0.0, z[1]), inputs(z[2], v))
        return jnp.stack([rate.v_y, rate.yaw_rate])

    return jax.jacfwd(rates)(jnp.zeros(3))


def numerical_matrix(car, v):
    return np.asarray(slopes(car, np.asarray(v)))[:, :2]


@pytest.mark.parametrize("v", [5.0, 25.0, 60.0])
def test_poles_are_those_of_the_linear_single_track(car, v):
    expected = np.linalg.eigvals(linear_matrix(car, v))
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(numerical_matrix(car, v))), np.sort(expected), rtol=1e-10)


def steady(car, steer, v):
    """(v_y, r) of steady cornering for a small steer, from the linearised right-hand side."""
    jacobian = np.asarray(slopes(car, np.asarray(v)))
    return np.linalg.solve(jacobian[:, :2], -jacobian[:, 2] * steer)


@pytest.mark.parametrize("v", [10.0, 25.0, 40.0])
def test_steady_yaw_rate_and_sideslip_gains_and_understeer_gradient(v):
    car = vehicles.passenger_car()
    m, a, b, length = car.mass, car.front_axle_to_cg, car.rear_axle_to_cg, car.wheelbase
    C_f, C_r = car.front.cornering_stiffness, car.rear.cornering_stiffness
    understeer = m / length * (b / C_f - a / C_r)
    v_y, yaw_rate = steady(car, 1.0, v)
    np.testing.assert_allclose(yaw_rate, v / (length + understeer * v**2), rtol=1e-10)
    sideslip = (b - a * m * v**2 / (length * C_r)) / (length + understeer * v**2)
    np.testing.assert_allclose(v_y / v, sideslip, rtol=1e-9)
    assert understeer > 0


def test_characteristic_speed_has_half_the_gain_of_a_neutral_car():
    car = vehicles.passenger_car()
    understeer = (
        car.mass
        / car.wheelbase
        * (car.rear_axle_to_cg / car.front.cornering_stiffness - car.front_axle_to_cg / car.rear.cornering_stiffness)
    )
    v = float(jnp.sqrt(car.wheelbase / understeer))
    np.testing.assert_allclose(steady(car, 1.0, v)[1], v / (2 * car.wheelbase), rtol=1e-10)


def test_the_car_as_printed_loses_stability_at_its_critical_speed():
    car = vehicles.passenger_car_as_printed()
    understeer = (
        car.mass
        / car.wheelbase
        * (car.rear_axle_to_cg / car.front.cornering_stiffness - car.front_axle_to_cg / car.rear.cornering_stiffness)
    )
    assert understeer < 0
    critical = float(jnp.sqrt(car.wheelbase / -understeer))
    assert np.linalg.eigvals(numerical_matrix(car, 0.99 * critical)).real.max() < 0
    assert np.linalg.eigvals(numerical_matrix(car, 1.01 * critical)).real.max() > 0


def test_the_passenger_car_has_the_papers_numbers():
    car = vehicles.passenger_car()
    assert (float(car.mass), float(car.yaw_inertia)) == (1420.0, 2124.0)
    assert (float(car.front_axle_to_cg), float(car.rear_axle_to_cg)) == (0.96, 1.59)
    printed = vehicles.passenger_car_as_printed()
    assert (float(printed.front_axle_to_cg), float(printed.rear_axle_to_cg)) == (1.59, 0.96)


def test_newton_and_euler_balance_in_every_state():
    car = vehicles.passenger_car()
    x, u = state(0.7, 0.3, 0.4), inputs(0.11, 22.0)
    rates, out = car.evaluate(0.0, x, u)
    across = out.F_yf * np.cos(0.11) + out.F_yr
    np.testing.assert_allclose(car.mass * (rates.v_y + 22.0 * 0.4), across, rtol=1e-12)
    np.testing.assert_allclose(out.a_y, across / car.mass, rtol=1e-12)
    moment = 0.96 * out.F_yf * np.cos(0.11) - 1.59 * out.F_yr
    np.testing.assert_allclose(car.yaw_inertia * rates.yaw_rate, moment, rtol=1e-12)
    assert rates.yaw == x.yaw_rate
    assert out.yaw_acceleration == rates.yaw_rate
    np.testing.assert_allclose(out.a_x, -0.7 * 0.4, rtol=1e-14)


def test_slip_angles_are_the_papers_above_the_crawl_speed():
    out = vehicles.passenger_car().outputs(0.0, state(0.7, 0.0, 0.4), inputs(0.11, 22.0))
    np.testing.assert_allclose(out.slip_angle_front, 0.11 - np.arctan2(0.7 + 0.96 * 0.4, 22.0), rtol=1e-12)
    np.testing.assert_allclose(out.slip_angle_rear, -np.arctan2(0.7 - 1.59 * 0.4, 22.0), rtol=1e-12)
    np.testing.assert_allclose(out.sideslip, np.arctan2(0.7, 22.0), rtol=1e-12)


def test_the_mirrored_car_turns_the_mirrored_way(car):
    x, u = state(0.4, 0.1, 0.3), inputs(0.08, 20.0)
    left = car.derivatives(0.0, x, u)
    right = car.derivatives(0.0, jax.tree.map(jnp.negative, x), u._replace(steer=-u.steer))
    np.testing.assert_allclose(right, jax.tree.map(jnp.negative, left), rtol=1e-13)


def test_lateral_sliding_only_loses_energy(car):
    """With straight wheels the axle forces brake the lateral motion of their axles."""
    for v_y, yaw_rate in ((1.0, 0.0), (-2.0, 0.5), (0.3, -0.8), (3.0, 1.0)):
        out = car.outputs(0.0, state(v_y, 0.0, yaw_rate), inputs(0.0, 20.0))
        at_front = v_y + float(car.front_axle_to_cg) * yaw_rate
        at_rear = v_y - float(car.rear_axle_to_cg) * yaw_rate
        assert out.F_yf * at_front + out.F_yr * at_rear < 0


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_values_and_gradients_are_finite_at_any_speed(car, dtype):
    """Reverse mode sums over all outputs, forward mode over all arguments: a NaN or an infinity survives either sum."""
    car = cast(car, dtype)
    points = [(v, *pair) for v in (0.0, 1e-3, 1.0, 3.0, -3.0, 25.0) for pair in ((0.0, 0.0), (0.2, -0.1))]

    @jax.jit
    @jax.vmap
    def everything(point):
        arguments = (car, state(point[1], 0.0, point[2], dtype), inputs(0.1, point[0], dtype))
        evaluate = lambda c, x, u: c.evaluate(0.0, x, u)
        values, tangents = jax.jvp(evaluate, arguments, jax.tree.map(jnp.ones_like, arguments))
        total = lambda *args: sum(jax.tree.leaves(evaluate(*args)))
        return values, tangents, jax.grad(total, (0, 1, 2))(*arguments)

    for leaf in jax.tree.leaves(everything(np.array(points, dtype))):
        assert leaf.dtype == dtype
        assert jnp.all(jnp.isfinite(leaf))


def test_rk4_at_100_hz_is_stable_at_standstill(car):
    """The regularised slip keeps the poles within reach: a car pushed sideways comes to rest."""
    term = diffrax.ODETerm(car.derivatives)

    def push(x, _):
        return RK4().step(term, 0.0, 0.01, x, inputs(0.0, 0.0), None, False)[0], None

    x, _ = jax.jit(lambda x: jax.lax.scan(push, x, length=500))(state(0.3, 0.0, 0.2))
    np.testing.assert_allclose([x.v_y, x.yaw_rate], 0.0, atol=1e-6)


def test_reversing_pushes_a_sliding_wheel_back_all_the_same():
    out = vehicles.passenger_car().outputs(0.0, state(0.5), inputs(0.0, -10.0))
    assert out.slip_angle_front < 0
    assert out.F_yr < 0


def test_regularised_speed_joins_twice_differentiable():
    v = np.asarray([0.0, 0.5, 1.9999999, 2.0, 2.0000001, 7.0, -0.5, -7.0])
    speed = lambda x: vehicles.regularised_speed(x, 2.0)
    all_three = jax.jit(jax.vmap(lambda v: (speed(v), jax.grad(speed)(v), jax.grad(jax.grad(speed))(v))))
    values, slope, curvature = (np.asarray(found) for found in all_three(v))
    np.testing.assert_allclose(values[:1], 0.75)
    np.testing.assert_allclose(values[3:6], [2.0, 2.0000001, 7.0], rtol=1e-15)
    np.testing.assert_allclose(values[6:], [values[1], 7.0])
    np.testing.assert_allclose(slope[2:5], 1.0, atol=1e-6)
    np.testing.assert_allclose(curvature[2:5], 0.0, atol=1e-6)


def test_gradients_equal_finite_differences(car):
    x, u = state(0.4, 0.0, 0.35), inputs(0.09, 18.0)
    leaves, tree = jax.tree.flatten((car, x, u))
    start = np.array([float(leaf) for leaf in leaves])

    # Values and gradients by one program.
    @jax.jit
    @jax.value_and_grad
    def rate(values):
        c, x, u = jax.tree.unflatten(tree, list(values))
        rates = c.derivatives(0.0, x, u)
        return rates.v_y + 3 * rates.yaw_rate

    gradient = np.asarray(rate(start)[1])
    for i, value in enumerate(start):
        step = 1e-6 * max(abs(value), 0.1)
        up, down = (float(rate(start + sign * step * np.eye(len(start))[i])[0]) for sign in (1, -1))
        np.testing.assert_allclose(gradient[i], (up - down) / (2 * step), rtol=1e-5, atol=1e-7)


def test_batches_of_states_and_of_cars_equal_single_ones(car):
    v_y = np.linspace(-1.0, 1.0, 5)
    batch = jax.jit(lambda x: car.derivatives(0.0, x, inputs(0.05)))(SingleTrackState(v_y, 0 * v_y, 0.2 + v_y))
    batch = jax.tree.map(np.asarray, batch)
    for i, v in enumerate(v_y):
        single = car.derivatives(0.0, state(v, 0.0, 0.2 + v), inputs(0.05))
        np.testing.assert_allclose([batch.v_y[i], batch.yaw_rate[i]], [single.v_y, single.yaw_rate], rtol=1e-12)
    masses = np.asarray([1300.0, 1500.0])
    of_mass = lambda m: eqx.tree_at(lambda c: c.mass, car, m).derivatives(0.0, state(0.3), inputs(0.05))
    heavy = jax.tree.map(np.asarray, jax.jit(jax.vmap(of_mass))(masses))
    assert heavy.v_y.shape == (2,)
    np.testing.assert_allclose(heavy.v_y[0] * 1300, heavy.v_y[1] * 1500, rtol=1e-12)


def test_steer_offset_adds_to_the_steer():
    car = vehicles.passenger_car()
    offset = eqx.tree_at(lambda c: c.steer_offset, car, jnp.asarray(0.02))
    np.testing.assert_allclose(
        offset.derivatives(0.0, state(0.1, 0.0, 0.2), inputs(0.05)),
        car.derivatives(0.0, state(0.1, 0.0, 0.2), inputs(0.07)), rtol=1e-12,
    )  # fmt: skip


def with_height(height=0.55):
    return eqx.tree_at(
        lambda c: c.cg_height, vehicles.passenger_car(), jnp.asarray(height), is_leaf=lambda x: x is None
    )


def test_load_moves_to_the_rear_when_accelerating():
    car = with_height()
    assert car.inputs == ("steer", "v_x", "a_x")
    u = AcceleratedInputs(jnp.asarray(0.0), jnp.asarray(25.0), jnp.asarray(3.0))
    out = car.outputs(0.0, state(), u)
    static = 1420 * GRAVITY / 2.55
    moved = 1420 * 3.0 * 0.55 / 2.55
    np.testing.assert_allclose(
        [out.load_front, out.load_rear], [1.59 * static - moved, 0.96 * static + moved], rtol=1e-13
    )
    np.testing.assert_allclose(sum(car.static_loads()), 1420 * GRAVITY, rtol=1e-14)
    driven = car.outputs(0.0, state(0.5, 0.0, 0.4), DrivenInputs(jnp.asarray(0.0), jnp.asarray(25.0), jnp.asarray(3.0)))
    np.testing.assert_allclose(driven.a_x, 3.0 - 0.5 * 0.4, rtol=1e-14)


def test_load_transfer_without_an_acceleration_raises():
    with pytest.raises(InputError, match="needs a_x"):
        with_height().derivatives(0.0, state(), inputs())


def test_start_is_straight_running_with_fields_replaced():
    car = vehicles.passenger_car()
    x = car.start(0.0, inputs(), yaw=0.05)
    assert x == SingleTrackState(0.0, 0.05, 0.0)
    with pytest.raises(InputError, match=r"unknown name\(s\) speed"):
        car.start(0.0, inputs(), speed=3.0)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("mass", -1420.0, r"SingleTrack\.mass = -1420\.0: must be positive"),
        ("yaw_inertia", 0.0, r"SingleTrack\.yaw_inertia = 0\.0"),
        ("rear_axle_to_cg", float("nan"), r"SingleTrack\.rear_axle_to_cg = nan"),
        ("cg_height", -0.5, r"SingleTrack\.cg_height = -0\.5"),
        ("steer_offset", 7.0, r"SingleTrack\.steer_offset = 7\.0: must be within 1 rad"),
        ("crawl_speed", 0.0, r"SingleTrack\.crawl_speed = 0\.0"),
        ("front", 80e3, r"SingleTrack\.front = [0-9.]+: must be a tyre"),
    ],
)
def test_bad_parameters_raise_by_name_value_and_range(field, value, message):
    car = vehicles.passenger_car()
    good = {name: getattr(car, name) for name in ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg")}
    with pytest.raises(InputError, match=message):
        vehicles.SingleTrack(**{**good, "front": car.front, "rear": car.rear, field: value})


class Lagging(AbstractDynamicTyre):
    """A linear tyre whose slip angle lags behind by a length: the smallest dynamic tyre, to hold the contract."""

    stiffness: jax.Array = positive("N/rad")
    length: jax.Array = positive("m")
    state_names: ClassVar[tuple[str, ...]] = ("slip",)

    def forces(self, contact, state=None):
        return Forces(F_y=self.stiffness * state.slip)

    def start(self, contact):
        return (contact.slip_angle,)

    def derivatives(self, contact, state):
        return (contact.speed / self.length * (contact.slip_angle - state.slip),)


def test_a_dynamic_tyre_brings_its_states_into_the_vehicle():
    plain = vehicles.linear(vehicles.passenger_car())
    lagging = eqx.tree_at(lambda c: c.rear, plain, Lagging(plain.rear.cornering_stiffness, 0.4))
    assert lagging.state_type._fields == ("v_y", "yaw", "yaw_rate", "rear_slip")
    x = lagging.start(0.0, inputs(), v_y=0.5)
    np.testing.assert_allclose(x.rear_slip, -np.arctan2(0.5, 25.0), rtol=1e-14)
    settled, rates = plain.derivatives(0.0, state(0.5), inputs()), lagging.derivatives(0.0, x, inputs())
    np.testing.assert_allclose(rates[:3], settled, rtol=1e-12)
    assert rates.rear_slip == 0
    behind = lagging.derivatives(0.0, x._replace(rear_slip=jnp.asarray(0.0)), inputs())
    np.testing.assert_allclose(behind.rear_slip, 25.0 / 0.4 * x.rear_slip, rtol=1e-12)
    assert Contact().speed is None
