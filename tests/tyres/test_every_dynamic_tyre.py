"""What holds for every tyre with states of its own, each in turn."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import left_out
from hypothesis import given, settings
from hypothesis import strategies as st
from shared_data import shared

from jaxveh import statespace, tyres, vehicles
from jaxveh._core.errors import InputError
from jaxveh._core.names import record
from jaxveh.tyres import Contact

pytestmark = pytest.mark.product

LOAD = 4000.0


def brush():
    return tyres.Brush(80000.0, 60000.0, 0.9)


def own_lengths():
    """A tyre whose relaxation lengths are its law's; it takes long to compile, so that it has tests of its own."""
    return tyres.Relaxed(tyres.from_property_file(shared("tyres") / "mfeval__PacejkaBook_Defaults.tir"))


TYRES = {
    "Relaxed Brush": lambda: tyres.Relaxed(brush(), 0.2, 0.4),
    "Relaxed Brush, force": lambda: tyres.Relaxed(brush(), 0.2, 0.4, of="force"),
    "Relaxed Linear, across": lambda: tyres.Relaxed(tyres.Linear(60000.0), sigma_y=0.4),
    "LuGre": lambda: tyres.LuGre(200.0, 150.0, 1.1, 0.8, 6.0),
    "LuGre, damped": lambda: tyres.LuGre(200.0, 150.0, 1.1, 0.8, 6.0, 0.15, 0.2, 0.3, 1e-3, 0.5),
}


def test_every_tyre_with_states_of_the_package_is_here():
    assert not left_out("tyres", tyres.AbstractDynamicTyre, [make() for make in TYRES.values()], {})


RELAXED = [name for name in TYRES if name.startswith("Relaxed")]
LUGRE = [name for name in TYRES if name.startswith("LuGre")]


@pytest.fixture(params=TYRES)
def tyre(request):
    return TYRES[request.param]()


def contact(slip_angle=0.0, slip_ratio=0.0, load=LOAD, speed=20.0, friction=1.0, dtype=jnp.float64):
    number = lambda value: value if isinstance(value, jax.Array) else np.asarray(value, dtype)
    return Contact(number(slip_angle), number(slip_ratio), number(load), number(0.0), number(friction), number(speed))


def stacked(values, like):
    return jnp.stack([jnp.asarray(value, like.load.dtype) for value in values])


@jax.jit
def settled(tyre, at):
    """The settled state, its derivative and the forces, each as a vector."""
    state = tyre.start(at)
    return stacked(state, at), stacked(tyre.derivatives(at, state), at), stacked(tyre.forces(at, state), at)


static = jax.jit(lambda law, at: stacked(law.forces(at), at))
started = jax.jit(lambda tyre, at: tyre.start(at))
rates = jax.jit(lambda tyre, at, state: tyre.derivatives(at, state))
forces_beside = jax.jit(lambda tyre, at, state: tyre.forces(at, state))


@jax.jit
def everything(tyre, at, deflected):
    """Derivatives and forces beside the settled state, and that state."""
    state = jax.tree.map(lambda value: value + deflected, tyre.start(at))
    return jnp.concatenate([stacked(v, at) for v in (state, tyre.derivatives(at, state), tyre.forces(at, state))])


@jax.jit
def with_slopes(*args):
    """What `everything` gives, its derivative along all arguments at once, and that of its sum by each of them."""
    value, along = jax.linearize(everything, *args)
    against = jax.linear_transpose(along, *args)
    return value, along(*jax.tree.map(jnp.ones_like, args)), against(jnp.ones_like(value))


slopes = jax.jit(jax.jacfwd(lambda x, tyre, deflected: everything(tyre, contact(*x), deflected)))

STEP = statespace.Propagate(lambda tyre, t, x, at: tyre.derivatives(at, x))


@eqx.filter_jit
def drive(tyre, at, state, step, count):
    """The state after `count` RK4 steps at a constant contact, and the states on the way as rows."""

    def advance(x, _):
        x = STEP(tyre, jnp.zeros_like(step), step, x, at)
        return x, stacked(x, at)

    return jax.lax.scan(advance, state, length=count)


POINTS = [(0.0, 0.0), (0.1, 0.0), (0.0, 0.1), (0.0, -1.0), (0.2, -1.0), (1.2, 2.0)]


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("load", [LOAD, 0.0, -100.0])
@pytest.mark.parametrize("speed", [0.0, 20.0])
def test_values_and_gradients_are_finite(tyre, point, load, speed, dtype):
    tyre, at = statespace.cast(tyre, dtype), contact(*point, load, speed, dtype=dtype)
    for deflected in np.asarray([0.0, 0.001], dtype):
        value, along, gradient = with_slopes(tyre, at, deflected)
        assert value.dtype == dtype and np.isfinite(value).all()
        assert np.isfinite(along).all()
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradient))


def test_nothing_moves_without_speed(tyre):
    """A contact without a speed of its slips slides by slip times speed: not at all."""
    at = contact(0.1, 0.05, speed=0.0)
    state = jax.tree.map(lambda value: np.asarray(value) + 0.003, started(tyre, at))
    assert all(rate == 0 for rate in rates(tyre, at, state))


@pytest.mark.parametrize("load", [0.0, -100.0])
def test_forces_vanish_with_the_load(load):
    # The linear tyre and lagged forces do not know the load of this instant.
    for name in ("Relaxed Brush", *LUGRE):
        tyre = TYRES[name]()
        forces = forces_beside(tyre, contact(0.2, 0.1, load), started(tyre, contact(0.2, 0.1)))
        assert forces.F_x == forces.F_y == 0, name


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-1.2, 1.2), st.floats(-1.0, 1.0), st.floats(0.1, 60.0), st.sampled_from(sorted(TYRES)))
def test_the_settled_state_stands_still(angle, ratio, speed, name):
    tyre = TYRES[name]()
    state, rate, _ = settled(tyre, contact(angle, ratio, speed=speed))
    drive = speed * np.maximum(np.abs(state), 1e-3) * 1e4
    assert np.all(np.abs(rate) <= 1e-12 * drive)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-1.2, 1.2), st.floats(-1.0, 1.0), st.floats(0.0, 9000.0), st.sampled_from(RELAXED))
def test_settled_relaxation_is_the_static_law(angle, ratio, load, name):
    tyre, at = TYRES[name](), contact(angle, ratio, load)
    np.testing.assert_allclose(settled(tyre, at)[2], static(tyre.tyre, at), rtol=1e-9, atol=1e-7)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.floats(-1.2, 1.2), st.floats(-0.95, 1.0), st.floats(0.1, 60.0), st.sampled_from(LUGRE))
def test_settled_lugre_is_the_distributed_one(angle, ratio, speed, name):
    """Bristles enter straight and bend along the contact: `omega r dz/dx = v_r - c z`, averaged over the length."""
    tyre, at = TYRES[name](), contact(angle, ratio, speed=speed)
    v_r = speed * np.array([ratio, np.tan(angle)])
    slides, rolls = np.hypot(*v_r), speed * (1 + ratio)
    g = 0.8 + 0.3 * np.exp(-((slides / 6.0) ** tyre.exponent))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    # Panels that grow from the entry, where the deflection changes fastest.
    edges = tyre.contact_length * np.concatenate([[0.0], np.geomspace(1e-5, 1.0, 24)])
    x = (edges[:-1, None] + np.diff(edges)[:, None] * (nodes + 1) / 2).ravel()
    w = (np.diff(edges)[:, None] * weights / 2).ravel()
    for i, sigma in enumerate((200.0, 150.0)):
        c = sigma * slides / g
        z = v_r[i] * (-np.expm1(-c * x / rolls) / c if c > 1e-9 else x / rolls)
        mean = np.sum(w * z) / tyre.contact_length
        force = LOAD * (sigma * mean + float(tyre.viscous) * v_r[i])
        state, _, forces = settled(tyre, at)
        np.testing.assert_allclose(state[i], mean, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(forces[i], force, rtol=1e-9, atol=1e-8)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    st.floats(-0.4, 0.4), st.floats(-0.3, 0.3), st.sampled_from([1.0, 5.0, 20.0, 60.0]), st.sampled_from(sorted(TYRES))
)
def test_every_start_settles_under_rk4_at_1_ms(angle, ratio, speed, name):
    """Within the docstring's limit of the step; sliding at 60 m/s is beyond that of LuGre."""
    if name in LUGRE:
        angle, ratio = (value * min(1.0, 8.0 / (0.55 * speed)) for value in (angle, ratio))
    tyre, at = TYRES[name](), contact(angle, ratio, speed=speed)
    end, _ = settled(tyre, at)[:2]
    lost = started(tyre, contact(-angle, 0.1, speed=speed))
    last, path = drive(tyre, at, lost, np.asarray(1e-3), 8000 if speed < 5 else 3000)
    size = np.max(np.abs(path), axis=0)
    assert np.all(size <= 1.0001 * np.maximum(np.abs(lost), np.abs(end)) + 1e-12)
    np.testing.assert_allclose(last, end, rtol=1e-5, atol=1e-6 * np.max(size))


def test_relaxation_is_exponential_over_the_way():
    tyre, at = TYRES["Relaxed Brush"](), contact(0.1, 0.05, speed=10.0)
    last, _ = drive(tyre, at, started(tyre, contact(0.0, 0.0)), np.asarray(1e-4), 400)  # 0.4 m of road
    np.testing.assert_allclose(last.deflection_x, 0.2 * 0.05 * (1 - np.exp(-2.0)), rtol=1e-9)
    np.testing.assert_allclose(last.deflection_y, 0.4 * np.tan(0.1) * (1 - np.exp(-1.0)), rtol=1e-9)


def test_the_limits_of_the_step_are_those_of_the_docstrings():
    lugre, at = TYRES["LuGre"](), contact(0.0, -0.5)
    of_deflection = jax.jacfwd(lambda z: lugre.derivatives(at, lugre.start(at)._replace(z_x=z)).z_x)
    fastest = -float(jax.jit(of_deflection)(np.asarray(0.0)))
    g = 0.8 + 0.3 * np.exp(-((10 / 6) ** 2))
    slowest, quickest = 200 * 10 / g, 200 * 10 / g + 2 * 10 / 0.2
    assert slowest < fastest < quickest
    for tyre, step in ((lugre, 2.78 / fastest), (TYRES["Relaxed Brush"](), 2.78 * 0.2 / 20)):
        settled_state = jax.tree.map(np.asarray, started(tyre, at))
        start = jax.tree.map(lambda value: value + 1e-3, settled_state)
        end = float(settled_state[0])
        near, _ = drive(tyre, at, start, np.asarray(0.9 * step), 400)
        far, _ = drive(tyre, at, start, np.asarray(1.1 * step), 400)
        assert abs(float(near[0]) - end) < 1e-9 < 1.0 < abs(float(far[0]) - end)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-1.2, 1.2), st.floats(-1.0, 1.0), st.floats(0.0, 60.0), st.sampled_from(sorted(TYRES)))
def test_a_mirror_turns_states_and_forces(angle, ratio, speed, name):
    tyre = TYRES[name]()
    across = np.array([-1.0 if name.endswith("y") else 1.0 for name in tyre.state_names])
    there, here = (
        jax.tree.map(np.asarray, settled(tyre, contact(sign * angle, ratio, speed=speed))) for sign in (-1, 1)
    )
    np.testing.assert_allclose(there[0], across * here[0], atol=1e-12 * (1 + np.max(np.abs(here[0]))))
    np.testing.assert_allclose(there[2], here[2] * np.array([1.0, -1.0, -1.0, 1.0, -1.0]), atol=1e-8)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-1.2, 1.2), st.floats(-1.0, 1.0), st.floats(0.0, 60.0), st.floats(0.1, 1.0))
def test_friction_bounds_the_settled_force_of_lugre(angle, ratio, speed, friction):
    at = contact(angle, ratio, speed=speed, friction=friction)
    F_x, F_y = np.asarray(settled(TYRES["LuGre"](), at)[2])[:2]
    assert np.hypot(F_x, F_y) <= 1.1 * friction * LOAD * (1 + 1e-12)


def test_lugre_knows_its_limits():
    tyre = TYRES["LuGre"]()
    slope = jax.jit(jax.grad(lambda a: tyre.forces(contact(), tyre.start(contact()._replace(slip_angle=a))).F_y))
    np.testing.assert_allclose(slope(np.asarray(0.0)), LOAD * 150 * 0.2 / 2, rtol=1e-12)
    locked = np.asarray(settled(tyre, contact(0.3, -1.0, speed=40.0))[2])
    v_r = 40 * np.array([-1.0, np.tan(0.3)])
    np.testing.assert_allclose(locked[:2], 0.8 * LOAD * v_r / np.hypot(*v_r), rtol=1e-12)
    ice = [np.asarray(settled(tyre, contact(0.3, 0.1, friction=mu))[2])[1] for mu in (0.0, 1e-3)]
    assert 0 < ice[0] == ice[1] < 1.1e-3 * LOAD


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(500.0, 9000.0), st.floats(0.5, 60.0), st.floats(0.2, 1.0),
    st.sampled_from(sorted(TYRES)),
)  # fmt: skip
def test_gradients_equal_differences(angle, ratio, load, speed, friction, name):
    tyre = TYRES[name]()
    number = np.asarray(0.0 if "force" in name else 1e-4)
    f = lambda x: everything(tyre, contact(*x), number)
    x = np.array([angle, ratio, load, speed, friction])
    steps = np.array([1e-7, 1e-7, 1e-3, 1e-5, 1e-6])
    exact = np.asarray(slopes(x, tyre, number))
    here = np.asarray(f(x))
    ahead = np.stack([f(x + h) for h in np.diag(steps)], axis=1)
    behind = np.stack([f(x - h) for h in np.diag(steps)], axis=1)
    sides = [(ahead - here[:, None]) / steps, (here[:, None] - behind) / steps, (ahead - behind) / (2 * steps)]
    scale = np.array([1.0, 1.0, 1e-4, 1e-2, 0.1]) * np.maximum(
        np.abs(here[:, None]), np.max(np.abs(exact), axis=1)[:, None]
    )
    # At a kink (the limit of friction) the derivative is that of one side.
    error = np.min([np.abs(exact - side) / (scale + 1e-3) for side in sides], axis=0)
    assert np.max(error) < 1e-4


def test_a_sudden_load_does_not_move_the_force_of_a_tyre_whose_length_goes_with_the_load():
    """Cornering stiffness and relaxation length of the 6.1 tyre make the same carcass stiffness at every load."""
    tyre = own_lengths()
    state = tyre.start(contact(0.0, 0.0))._replace(deflection_y=jnp.asarray(1e-4))
    low, high = (tyre.forces(contact(load=load), state).F_y for load in (4000.0, 5000.0))
    straight = [tyre.tyre.forces(contact(load=load)).F_y for load in (4000.0, 5000.0)]
    stiffness = [tyre.tyre.outputs(contact(load=load)).C_y for load in (4000.0, 5000.0)]
    carcass = [(low - straight[0]) / 1e-4, (high - straight[1]) / 1e-4]
    np.testing.assert_allclose(carcass, stiffness, rtol=1e-2)


def test_own_lengths_settle_to_the_static_law_and_vanish_with_the_load():
    tyre = own_lengths()
    for at in (contact(0.1, 0.05), contact(-0.02, 0.0, 6000.0), contact(0.0, -0.1, 2000.0, 1.0)):
        state, rate, forces = jax.tree.map(np.asarray, settled(tyre, at))
        assert np.all(np.abs(rate) <= 1e-12 * float(at.speed) * np.maximum(np.abs(state), 1e-3) * 1e4)
        np.testing.assert_allclose(forces, static(tyre.tyre, at), rtol=1e-9, atol=1e-7)
    state = tyre.start(contact(0.2, 0.1))
    for load in (0.0, -100.0):
        forces = tyre.forces(contact(0.2, 0.1, load), state)
        assert forces.F_x == forces.F_y == 0


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_own_lengths_are_finite_and_have_their_derivatives(dtype):
    tyre, exact = statespace.cast(own_lengths(), dtype), dtype == jnp.float64

    def rate(tyre, x):
        at = contact(0.05, 0.0, *x, dtype=dtype)
        state = jax.tree.map(lambda value: jnp.full_like(value, 1e-3), tyre.start(at))
        return tyre.derivatives(at, state).deflection_y

    both = jax.jit(jax.value_and_grad(rate, argnums=(0, 1)))
    for x in ((4000.0, 20.0), (4000.0, 0.0), (0.0, 20.0), (-100.0, 20.0)):
        _, found = both(tyre, np.asarray(x, dtype))
        assert all(np.isfinite(leaf).all() and leaf.dtype == dtype for leaf in jax.tree.leaves(found))
        if exact and x[0] > 0:
            for i, step in enumerate(([1e-2, 0.0], [0.0, 1e-6])):
                ends = [float(both(tyre, np.add(x, sign * np.asarray(step)))[0]) for sign in (-1, 1)]
                if x[1] == 0 and i == 1:
                    continue  # a kink: the speed's size
                np.testing.assert_allclose(found[1][i], (ends[1] - ends[0]) / (2 * max(step)), rtol=1e-6, atol=1e-9)


def test_a_vehicle_carries_the_states():
    """A turn after a step of steer: the relaxed car lags behind the static one and ends in the same circle."""
    plain = vehicles.passenger_car()
    wrap = lambda tyre: tyres.Relaxed(tyre, sigma_y=0.5)
    car = eqx.tree_at(lambda c: (c.front, c.rear), plain, (wrap(plain.front), wrap(plain.rear)))
    assert car.state_type._fields == ("v_y", "yaw", "yaw_rate", "front_deflection_y", "rear_deflection_y")
    u = record("u", {"steer": jnp.asarray(0.02), "v_x": jnp.asarray(20.0), "a_x": jnp.asarray(0.0)})
    turn = statespace.Propagate(lambda vehicle, t, x, u: vehicle.derivatives(t, x, u))

    @eqx.filter_jit
    def run(vehicle):
        start = vehicle.start(0.0, u._replace(steer=jnp.asarray(0.0)))
        step = lambda x, _: (turn(vehicle, 0.0, 0.005, x, u),) * 2
        return jax.lax.scan(step, start, length=1000)[1].yaw_rate

    with_lag, without = run(car), run(plain)
    assert with_lag[9] < 0.8 * without[9]
    np.testing.assert_allclose(with_lag[-1], without[-1], rtol=1e-4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tyres.Relaxed(brush(), 0.2, -0.4), r"Relaxed.sigma_y = -0.4: must be positive"),
        (lambda: tyres.Relaxed(brush()), r"Relaxed.sigma_x, sigma_y = None: Brush has no relaxation lengths"),
        (lambda: tyres.Relaxed(brush(), 0.2, of="time"), r"Relaxed.of = 'time': must be one of 'slip', 'force'"),
        (lambda: tyres.Relaxed(TYRES["LuGre"](), 0.2), r"Relaxed.tyre = LuGre: must be a tyre without states"),
        (lambda: tyres.Relaxed(3.0, 0.2), r"Relaxed.tyre = [0-9.]+: must be a tyre"),
        (lambda: tyres.LuGre(-1.0, 1.0, 1.0, 0.8, 6.0), r"LuGre.stiffness_x = -1.0: must be positive"),
        (lambda: tyres.LuGre(1.0, 1.0, 1.0, 0.8, 6.0, viscous=-1.0), r"LuGre.viscous = -1.0: must be at least 0"),
        (lambda: tyres.LuGre(1.0, 1.0, 1.0, 0.8, 6.0, exponent=0.0), r"LuGre.exponent = 0.0: must be positive"),
    ],
)
def test_bad_parameters_are_named(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_contact_without_a_speed_and_forces_without_a_state_are_errors(tyre):
    silent = contact(0.1)._replace(speed=None)
    state = tyre.start(contact(0.1))
    with pytest.raises(InputError, match="contact.speed = None"):
        tyre.derivatives(silent, state)
    with pytest.raises(InputError, match="state = None"):
        tyre.forces(contact(0.1))


def test_lengths_stay_parameters():
    tyre = TYRES["Relaxed Linear, across"]()
    assert len(jax.tree.leaves(tyre)) == 2
    # A length that is being estimated is taken out of the model; the states stay.
    without = eqx.tree_at(lambda t: t.sigma_y, tyre, None)
    assert without.state_names == tyre.state_names == ("deflection_y",)
