"""The linear single track: its closed forms against its own equations of motion, and against the nonlinear cars."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from planar_cars import linear, point

from jaxveh import InputError, vehicles
from jaxveh._core.names import record
from jaxveh.roads import Ground
from jaxveh.vehicles import GRAVITY

SPEEDS = (5.0, 15.0, 40.0)


def under():
    return linear()


def over():
    return linear(front_stiffness=120e3, rear_stiffness=70e3)


CARS = {"understeering": under, "oversteering": over}


@pytest.fixture(params=CARS, ids=str)
def car(request):
    return CARS[request.param]()


def jacobian(car, v):
    """d(rates of sideslip and yaw rate) / d(sideslip, yaw rate, steer) of the equations of motion."""
    return np.asarray(_jacobian(car, *point(car, v_x=v)))


@jax.jit
def _jacobian(car, x, u):
    def rates(z):
        rate = car.derivatives(0.0, x._replace(sideslip=z[0], yaw_rate=z[1]), u._replace(steer=z[2]))
        return jnp.stack([rate.sideslip, rate.yaw_rate])

    return jax.jacfwd(rates)(jnp.zeros(3))


@pytest.mark.parametrize("v", SPEEDS)
def test_the_system_is_the_jacobian_and_its_eigenvalues_are_the_matrix_ones(car, v):
    found, system = jacobian(car, v), car.system(jnp.asarray(v))
    np.testing.assert_allclose(
        [[system.a_11, system.a_12, system.b_1], [system.a_21, system.a_22, system.b_2]], found, rtol=1e-12
    )
    expected = np.sort_complex(np.linalg.eigvals(found[:, :2]))
    np.testing.assert_allclose(np.sort_complex(np.array(system.eigenvalues)), expected, rtol=1e-10)


@pytest.mark.parametrize("v", SPEEDS)
def test_gains_are_those_of_a_steady_turn(v):
    car = under()
    found = jacobian(car, v)
    sideslip, yaw_rate = np.linalg.solve(found[:, :2], -found[:, 2])
    np.testing.assert_allclose(car.sideslip_gain(v), sideslip, rtol=1e-10)
    np.testing.assert_allclose(car.yaw_rate_gain(v), yaw_rate, rtol=1e-10)
    np.testing.assert_allclose(car.lateral_acceleration_gain(v), v * yaw_rate, rtol=1e-10)


def test_a_long_step_steer_ends_in_the_gains():
    car, v, steer = under(), 25.0, 0.02
    x, u = point(car, v_x=v, steer=steer, sideslip=0.0, yaw_rate=0.0, yaw=0.0)
    rate = lambda x: car.derivatives(0.0, x, u)
    add = lambda x, k, h: jax.tree.map(lambda a, b: a + h * b, x, k)

    def step(x, _):
        return add(x, rate(add(x, rate(x), 0.005)), 0.01), None

    end, _ = jax.jit(lambda x: jax.lax.scan(step, x, length=1000))(x)
    np.testing.assert_allclose(end.yaw_rate, car.yaw_rate_gain(v) * steer, rtol=1e-10)
    np.testing.assert_allclose(end.sideslip, car.sideslip_gain(v) * steer, rtol=1e-10)
    np.testing.assert_allclose(car.outputs(0.0, end, u).a_y, car.lateral_acceleration_gain(v) * steer, rtol=1e-10)


def test_understeer_gradient_is_steer_over_lateral_acceleration_on_a_circle():
    car, radius = under(), 60.0
    v = np.array([8.0, 16.0])
    steer = v / radius / car.yaw_rate_gain(v)
    slope = (steer[1] - steer[0]) / (v[1] ** 2 / radius - v[0] ** 2 / radius)
    np.testing.assert_allclose(car.understeer_gradient, slope, rtol=1e-10)
    np.testing.assert_allclose(car.understeer_gradient_deg_per_g, np.rad2deg(slope) * GRAVITY, rtol=1e-10)
    assert 0.5 < float(car.understeer_gradient_deg_per_g) < 5.0


def test_the_yaw_rate_gain_is_greatest_at_the_characteristic_speed():
    car = under()
    v = car.characteristic_speed
    np.testing.assert_allclose(jax.grad(car.yaw_rate_gain)(v), 0.0, atol=1e-12)
    np.testing.assert_allclose(car.yaw_rate_gain(v), v / (2 * car.wheelbase), rtol=1e-12)
    assert np.isinf(car.critical_speed)


def test_an_eigenvalue_crosses_zero_at_the_critical_speed():
    car = over()
    v = float(car.critical_speed)
    assert np.isinf(car.characteristic_speed)
    fastest = lambda v: np.linalg.eigvals(jacobian(car, v)[:, :2]).real.max()
    np.testing.assert_allclose(fastest(v), 0.0, atol=1e-10)
    assert fastest(0.99 * v) < 0 < fastest(1.01 * v)
    assert np.isnan(car.system(jnp.asarray(1.01 * v)).damping_ratio)
    assert np.isnan(car.system(jnp.asarray(1.01 * v)).natural_frequency)
    assert car.system(jnp.asarray(0.5 * v)).damping_ratio > 1


@pytest.mark.parametrize("v", SPEEDS)
def test_frequency_and_damping_are_the_textbooks(v):
    car = under()
    m, J, C_f, C_r, L = car.mass, car.yaw_inertia, car.front_stiffness, car.rear_stiffness, car.wheelbase
    system = car.system(jnp.asarray(v))
    squared = C_f * C_r * L * (L + car.understeer_gradient * v**2) / (m * J * v**2)
    np.testing.assert_allclose(system.natural_frequency**2, squared, rtol=1e-12)
    first = np.array(system.eigenvalues)[0]
    swing = system.damping_ratio
    if swing < 1:
        np.testing.assert_allclose(abs(first), system.natural_frequency, rtol=1e-12)
        np.testing.assert_allclose(-first.real / abs(first), swing, rtol=1e-12)
    else:
        np.testing.assert_allclose(np.imag(np.array(system.eigenvalues)), 0.0)


def test_frequency_response_is_that_of_the_matrices():
    car, v = under(), 30.0
    found = jacobian(car, v)
    omega = np.array([0.0, 0.5, 3.0, 20.0])
    response = car.system(jnp.asarray(v)).frequency_response(jnp.asarray(omega))
    for i, w in enumerate(omega):
        expected = np.linalg.solve(1j * w * np.eye(2) - found[:, :2], found[:, 2])
        np.testing.assert_allclose([response.sideslip[i], response.yaw_rate[i]], expected, rtol=1e-10)
        np.testing.assert_allclose(response.a_y[i], v * (1j * w * expected[0] + expected[1]), rtol=1e-10)
    np.testing.assert_allclose(response.yaw_rate[0], car.yaw_rate_gain(v), rtol=1e-12)
    np.testing.assert_allclose(response.sideslip[0], car.sideslip_gain(v), rtol=1e-12)


def test_closed_forms_keep_float32_and_have_finite_gradients():
    from jaxveh.statespace import cast

    car, v = cast(under(), np.float32), jnp.float32(20.0)

    def everything(car):
        system = car.system(v)
        response = system.frequency_response(jnp.float32(3.0))
        first, second = system.eigenvalues
        return [
            car.understeer_gradient, car.characteristic_speed, car.understeer_gradient_deg_per_g, car.yaw_rate_gain(v),
            car.sideslip_gain(v), car.lateral_acceleration_gain(v), system.natural_frequency, system.damping_ratio,
            jnp.abs(response.a_y), jnp.abs(response.yaw_rate), jnp.real(first), jnp.imag(second),
        ]  # fmt: skip

    values, slopes = jax.jit(lambda car: (everything(car), jax.jacrev(everything)(car)))(car)
    assert {value.dtype for value in values} == {np.dtype(np.float32)}
    for leaf in jax.tree.leaves(slopes):
        assert np.all(np.isfinite(leaf))


def test_axle_loads_scale_the_stiffnesses():
    car = linear(cg_height=0.6)
    assert car.inputs == ("steer", "v_x", "v_x_rate")
    x, u = point(car, v_x_rate=-4.0)
    out, plain = car.outputs(0.0, x, u), linear().outputs(0.0, *point(linear()))
    moved = 1500.0 * -4.0 * 0.6 / 2.7
    static = 1500.0 * GRAVITY / 2.7
    np.testing.assert_allclose(
        [out.load_front, out.load_rear], [1.5 * static - moved, 1.2 * static + moved], rtol=1e-12
    )
    np.testing.assert_allclose(out.F_yf / plain.F_yf, 1 - moved / (1.5 * static), rtol=1e-12)
    np.testing.assert_allclose(out.F_yr / plain.F_yr, 1 + moved / (1.2 * static), rtol=1e-12)
    # On a slope the accelerometer's reading moves the load, not the change of speed.
    uphill = Ground(grade=jnp.asarray(0.1))
    out = car.outputs(0.0, x, u._replace(v_x_rate=jnp.asarray(-GRAVITY * np.sin(0.1))), uphill)
    np.testing.assert_allclose(out.a_x, 0.0, atol=1e-12)
    np.testing.assert_allclose(out.load_front, 1.5 * static * np.cos(0.1), rtol=1e-12)
    with pytest.raises(InputError, match="needs v_x_rate"):
        car.derivatives(0.0, x, point(linear())[1])


def test_sliding_loses_energy_forwards_and_backwards():
    car = linear()
    for v in (12.0, -12.0):
        x, u = point(car, v_x=v, sideslip=0.1, yaw_rate=0.0, steer=0.0)
        out = car.outputs(0.0, x, u)
        assert out.F_yf * out.v_y < 0
        assert out.F_yr * out.v_y < 0
        # A front wheel that points to the left and rolls backwards slides to its left: it is pushed to the right.
        turned = car.outputs(0.0, *point(car, v_x=v, sideslip=0.0, yaw_rate=0.0, steer=0.1))
        assert turned.F_yf * v > 0


def test_it_is_the_linearised_single_track():
    car = vehicles.passenger_car()
    same = vehicles.linear_single_track(car)
    flat = vehicles.linear(car)
    assert float(same.front_stiffness) == float(flat.front.cornering_stiffness)
    x, u = point(flat, v_y=1e-4, yaw_rate=2e-4, steer=3e-4, v_x=20.0)
    linear_x, _ = point(same, sideslip=1e-4 / 20.0, yaw_rate=2e-4)
    one, other = flat.outputs(0.0, x, u), same.outputs(0.0, linear_x, u)
    np.testing.assert_allclose(other.a_y, one.a_y, rtol=1e-7)
    np.testing.assert_allclose(other.yaw_acceleration, one.yaw_acceleration, rtol=1e-7)


def test_the_axles_of_a_car_with_tracks_have_two_tyres():
    numbers = vehicles.sets.ev()
    seven = vehicles.build(numbers, vehicles.SevenDOF)
    same = vehicles.linear_single_track(seven, cg_height=0.5)
    np.testing.assert_allclose([same.front_stiffness, same.rear_stiffness], 70e3, rtol=1e-8)
    assert float(same.cg_height) == 0.5


@pytest.mark.parametrize("name", [name for name, numbers in vehicles.kit.CARS.items() if numbers().suspension])
def test_the_linear_car_of_fourteen_degrees_of_freedom_is_the_whole_car(name):
    """The sets' mass and inertia are those of the whole car. Its weight is divided between the axles as that of the car at rest
    on its springs, whose centre of gravity is not that of the body alone."""
    numbers, car = vehicles.kit.CARS[name](), vehicles.named_car(name, "fourteen-dof")
    plain = vehicles.linear_single_track(car)
    np.testing.assert_allclose([plain.mass, plain.yaw_inertia], [numbers.mass, numbers.yaw_inertia], rtol=5e-3)
    u = record("Inputs", {name: jnp.zeros(()) for name in car.inputs})
    at_rest = car.outputs(0.0, car.start(0.0, u), u)
    front = (at_rest.load_fl + at_rest.load_fr) / (
        at_rest.load_fl + at_rest.load_fr + at_rest.load_rl + at_rest.load_rr
    )
    a, b = plain.front_axle_to_cg, plain.rear_axle_to_cg
    np.testing.assert_allclose(b / (a + b), front, rtol=1e-6)
    np.testing.assert_allclose(a + b, numbers.front_axle_to_cg + numbers.rear_axle_to_cg, rtol=1e-6)


def test_a_tyre_with_states_counts_as_settled():
    from jaxveh.tyres import Brush, Relaxed

    brush = Brush(60e3, 70e3)
    car = vehicles.SingleTrack(
        mass=1500.0, yaw_inertia=2600.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.5,
        front=Relaxed(brush, 0.3, 0.5), rear=brush,
    )  # fmt: skip
    found = vehicles.linear_single_track(car)
    np.testing.assert_allclose([found.front_stiffness, found.rear_stiffness], 70e3, rtol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: linear(front_stiffness=-1.0), r"LinearSingleTrack\.front_stiffness = -1\.0: must be positive"),
        (lambda: linear(cg_height=0.0), r"LinearSingleTrack\.cg_height = 0\.0"),
        (lambda: linear(crawl_speed=0.0), r"LinearSingleTrack\.crawl_speed = 0\.0"),
        (lambda: linear().system(0.0), r"speed = 0\.0: must be positive"),
        (
            lambda: vehicles.linear_single_track(vehicles.Kinematic(2.7)),
            "car = Kinematic: must be an object with .*; it has no mass, yaw_inertia",
        ),
    ],
)
def test_bad_input_raises(make, message):
    with pytest.raises(InputError, match=message):
        make()
