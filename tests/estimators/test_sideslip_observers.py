"""Observers and filters of sideslip on cars made by their own assumptions: errors die out with the poles that were placed."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from method_logs import CAR

from jaxveh import Recording, filters, tyres
from jaxveh._core.names import record
from jaxveh.estimators import sideslip
from jaxveh.estimators.sideslip_methods import motors, observers, single_track, stiffness, worst_case
from jaxveh.estimators.sideslip_methods.common import slowest_of
from jaxveh.statespace import Row

DT, V = 0.01, 20.0
POLES = [-6.0, -9.0]


def linear_model():
    return single_track.lateral_model(single_track.single_track(CAR, "linear"), slowest_of(CAR))


def nonlinear_model():
    return single_track.lateral_model(single_track.single_track(CAR), slowest_of(CAR))


def drive(model, count, inputs, start, disturb=lambda k, x: x):
    """The model's own rows without noise, each leaf (T,), and its states (T, n). `inputs(t)`: a mapping."""
    kind = type(model.prior.mean)

    def body(x, k):
        t = k * DT
        u = _record("Inputs", model.inputs, inputs(t))
        seen = model.observation(t, x, u)
        y = _record("Measurements", model.channels, {n: getattr(seen, n) for n in model.channels})
        moved = disturb(k, model.transition(t, t + DT, x, u))
        return moved, (Row(t, u, y), jnp.stack(x))

    x = kind(*[jnp.asarray(value, float) for value in start])
    return jax.jit(lambda x: jax.lax.scan(body, x, jnp.arange(float(count)))[1])(x)


def _record(kind, names, values):
    return record(kind, {name: jnp.asarray(values[name], float) for name in names})


def errors_of(filter, model, rows, truth, wrong):
    """What the estimate misses in each row, (T, n), from a start that is wrong by so much."""
    prior = [value + d for value, d in zip(truth[0], wrong, strict=True)]
    model = eqx.tree_at(lambda m: list(m.prior.mean), model, [jnp.asarray(value) for value in prior])
    first = jax.tree.map(lambda leaf: leaf[0], rows)
    rest = jax.tree.map(lambda leaf: leaf[1:], rows)

    def body(belief, row):
        belief, _ = filter.step(model, belief, row)
        return belief, belief.vector

    belief, _ = filter.init(model, first, None)
    later = jax.jit(lambda belief: jax.lax.scan(body, belief, rest)[1])(belief)
    return np.concatenate([[belief.vector], later]) - truth


def straight(t):
    return {"steer": 0.0 * t, "v_x": V + 0.0 * t, "a_y": 0.0 * t}


@pytest.mark.parametrize("kind", [observers.ConstantPoles, observers.ErrorLinearising])
def test_the_error_of_two_channels_dies_out_with_the_placed_poles_at_any_row(kind):
    model = linear_model()
    rows, truth = drive(model, 60, straight, (0.0, 0.0))
    found = errors_of(kind(POLES), model, rows, truth, (1e-3, 2e-3))
    t = DT * np.arange(60)[:, None]
    np.testing.assert_allclose(found, [1e-3, 2e-3] * np.exp(np.asarray(POLES) * t), rtol=1e-3, atol=1e-8)


@pytest.mark.full
def test_the_error_linearising_observer_s_error_obeys_its_linear_equation_where_the_tyres_bend():
    model = nonlinear_model()
    turning = lambda t: {"steer": 0.05 + 0.005 * jnp.sin(5.0 * t), "v_x": V + 0.0 * t}
    rows, truth = drive(model, 150, turning, (0.0, 0.0))
    late = jax.tree.map(lambda leaf: leaf[100:], (rows, truth))
    t = DT * np.arange(50)[:, None]
    expected = [1e-5, 2e-5] * np.exp(np.asarray(POLES) * t)
    found = errors_of(observers.ErrorLinearising(POLES), model, *late, (1e-5, 2e-5))
    np.testing.assert_allclose(found, expected, rtol=2e-2, atol=1e-8)
    # A gain of straight running has other poles here.
    other = errors_of(observers.ConstantPoles(POLES), model, *late, (1e-5, 2e-5))
    assert np.abs(other - expected).max() > 10.0 * np.abs(found - expected).max()


def test_ackermann_s_gain_of_the_yaw_rate_alone_places_both_poles():
    model = linear_model()
    rows, truth = drive(model, 60, straight, (0.0, 0.0))
    alone = rows._replace(y=_record("Measurements", ("yaw_rate",), rows.y._asdict()))
    model = eqx.tree_at(lambda m: m.measurement_noise, model, observers.Gaussian({"yaw_rate": 0.003}))
    found = errors_of(observers.StateDependentGain(POLES, 1e-6), model, alone, truth, (1e-3, 0.0))
    z = np.exp(np.asarray(POLES) * DT)
    # The error's characteristic equation.
    left = found[2:] - z.sum() * found[1:-1] + z.prod() * found[:-2]
    assert np.abs(left[2:]).max() < 1e-5 * np.abs(found).max()
    assert np.abs(found[-1]).max() < 0.2 * np.abs(found).max()


def test_a_neutral_car_s_yaw_rate_corrects_no_lateral_velocity_and_is_corrected_itself():
    model = linear_model()
    even = (
        single_track.single_track(CAR, "linear").front.cornering_stiffness * CAR.front_axle_to_cg / CAR.rear_axle_to_cg
    )
    model = eqx.tree_at(lambda m: m.system.car.rear.cornering_stiffness, model, even)
    F = jnp.asarray([[0.9, -0.2], [0.0, 0.92]])
    z = jnp.exp(jnp.asarray(POLES) * DT)
    row = Row(0.0, _record("Inputs", model.inputs, straight(jnp.asarray(0.0))), None)
    gain = observers.StateDependentGain(POLES, 1.0).gain(model, F, None, z, row)
    np.testing.assert_allclose(np.asarray(gain)[:, 0], [0.0, 1.0 - z[1] / 0.92], atol=1e-9)


def test_the_decoupled_observer_is_blind_to_whatever_the_front_axle_does():
    """The truth: the front axle pushes with any force, the rear as the file says; integrated finely by another method."""
    car = single_track.single_track(CAR)
    push = lambda t: 3e3 * jnp.sin(3.0 * t) + 1e3 * jnp.sign(jnp.sin(7.0 * t))
    fine = 40

    def rates(t, x, force):
        slip = -jnp.arctan2(x[0] - car.rear_axle_to_cg * x[1], V)
        F_r = car.rear.forces(tyres.Contact(slip_angle=slip, load=car.static_loads()[1])).F_y
        a_y = (force + F_r) / car.mass
        turning = (car.front_axle_to_cg * force - car.rear_axle_to_cg * F_r) / car.yaw_inertia
        return jnp.stack([a_y - V * x[1], turning]), a_y

    def row(x, k):
        t = k * DT
        # Held over a row, as the observer takes its accelerometer.
        force = push(t)
        a_y = rates(t, x, force)[1]

        def small(x, _):
            h = DT / fine
            middle = x + 0.5 * h * rates(t, x, force)[0]
            return x + h * rates(t, middle, force)[0], None

        moved, _ = jax.lax.scan(small, x, None, length=fine)
        return moved, (x, a_y)

    _, (truth, a_y) = jax.jit(lambda x: jax.lax.scan(row, x, jnp.arange(400.0)))(jnp.zeros(2))
    time = DT * np.arange(400)
    channels = {"v_x": V + 0 * time, "yaw_rate": truth[:, 1], "a_y": a_y}
    log = recording_of(time, channels)
    found = sideslip.estimate(CAR, log, method="decoupled")
    error = np.asarray(found["v_y"]) - np.asarray(truth[:, 0])
    assert np.abs(truth[:, 0]).max() > 0.2
    assert np.sqrt(np.mean(error**2)) < 0.03 * np.sqrt(np.mean(np.square(truth[:, 0])))
    # An observer that believes the steer, which stands straight, is not.
    with_steer = recording_of(time, channels | {"steer": 0 * time})
    other = sideslip.estimate(CAR, with_steer, method="luenberger")
    assert np.sqrt(np.mean((np.asarray(other["v_y"]) - truth[:, 0]) ** 2)) > 5.0 * np.sqrt(np.mean(error**2))


def recording_of(time, channels):
    return Recording(time, channels)


def test_eq_9_has_its_slope_and_its_bounds_and_the_sliding_gain_is_the_placed_one_for_small_errors():
    steep = jnp.asarray(7.0)
    assert jax.grad(observers.saturated_sign)(0.0, steep) == pytest.approx(2.0 * 7.0 / np.pi)
    np.testing.assert_allclose(observers.saturated_sign(jnp.asarray([-1e9, 1e9]), steep), [-1.0, 1.0], rtol=1e-6)
    K = jnp.asarray([[0.3, -0.1], [0.5, 0.02]])
    sliding = observers.ArctangentSliding(POLES, 0.25)
    small = jnp.asarray([1e-5, 1e-4])
    np.testing.assert_allclose(sliding.change(K, small), K @ small, rtol=1e-5)
    edge = np.asarray(observers.BOUNDARY)
    far = jnp.asarray([1e3, 1e5])
    np.testing.assert_allclose(sliding.change(K, far) - 0.25 * K @ far, 0.75 * np.pi / 2 * K @ edge, rtol=1e-3)


@pytest.mark.full
def test_rows_without_a_channel_correct_nothing():
    model = linear_model()
    rows, truth = drive(model, 5, straight, (0.0, 0.0))
    blank = rows._replace(y=rows.y._replace(a_y=jnp.full(5, jnp.nan)))
    found = errors_of(observers.ConstantPoles(POLES), model, blank, truth, (1e-3, 2e-3))
    F = jax.jacfwd(
        lambda x: jnp.stack(model.transition(0.0, DT, type(model.prior.mean)(*x), jax.tree.map(lambda a: a[0], rows.u)))
    )(jnp.zeros(2))
    np.testing.assert_allclose(found[3], np.linalg.matrix_power(np.asarray(F), 3) @ found[0], rtol=1e-4)


def test_an_observer_that_has_spun_begins_anew():
    model = linear_model()
    rows, truth = drive(model, 4, straight, (0.0, 0.0))
    found = errors_of(observers.ConstantPoles(POLES), model, rows, truth, (8.0, 2.0))
    # At the first row already: no lateral velocity, and the yaw rate that was measured.
    np.testing.assert_allclose(found, 0.0, atol=1e-9)


def test_the_worst_case_makes_the_predicted_variance_larger_by_the_share_and_no_further():
    model = nonlinear_model()
    belief, _ = filters.Extended().init(model, _blank_row(model), None)
    share = 0.4
    filter = worst_case.HInfinityShare(filters.Extended(), 1e9, {"v_y": 1.0}, share)
    widened, info = filter.init(model, _blank_row(model), None)
    P, wider = (np.asarray(one.factor @ one.factor.T) for one in (belief, widened))
    assert int(info.result) == 0
    np.testing.assert_allclose(wider[0, 0], P[0, 0] / (1.0 - share), rtol=1e-6)
    np.testing.assert_allclose(np.linalg.inv(wider)[1, 1], np.linalg.inv(P)[1, 1], rtol=1e-6)
    # A bound that is less than the share of what is possible is itself.
    filter = worst_case.HInfinityShare(filters.Extended(), 0.1, {"v_y": 1.0}, share)
    plain = filters.HInfinity(filters.Extended(), 0.1, {"v_y": 1.0})
    for a, b in zip(*[one.init(model, _blank_row(model), None)[0].factor for one in (filter, plain)], strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6)


def _blank_row(model):
    u = _record("Inputs", model.inputs, straight(jnp.asarray(0.0)))
    return Row(jnp.asarray(0.0), u, _record("Measurements", model.channels, dict.fromkeys(model.channels, np.nan)))


@pytest.mark.full
@pytest.mark.parametrize("name", ["adapted_stiffness", "adaptive"])
def test_stiffnesses_that_are_wrong_are_found_and_sideslip_with_them(name):
    truth_of = stiffness.linear_model(CAR)
    shares = lambda m: (m.system.car.front.share, m.system.car.rear.share)
    truth_of = eqx.tree_at(shares, truth_of, (jnp.asarray(0.8), jnp.asarray(0.7)))
    weave = lambda t: {"steer": 0.02 * jnp.sin(2.5 * t) + 0.01 * jnp.sin(6.0 * t), "v_x": V + 0.0 * t}
    rows, truth = drive(truth_of, 2000, weave, (0.0, 0.0))
    channels = rows.u._asdict() | rows.y._asdict()
    log = recording_of(np.asarray(rows.t), {name: np.asarray(values) for name, values in channels.items()})
    rms = lambda found: np.sqrt(np.mean(np.square(np.asarray(found["v_y"]) - truth[:, 0])[1000:]))
    adapted, fixed = (rms(sideslip.estimate(CAR, log, method=one)) for one in (name, "luenberger"))
    assert adapted < 0.5 * fixed


@pytest.mark.full
def test_a_moment_of_the_motors_turns_the_car_as_eq_10_says_and_the_filter_knows():
    model = motors.motor_model(CAR)
    none, torques = single_track.LateralState(jnp.asarray(0.0), jnp.asarray(0.0)), dict.fromkeys(
        ("torque_fl", "torque_fr", "torque_rl", "torque_rr"), 0.0
    )  # fmt: skip
    of = lambda steer=0.0, **given: _record("Inputs", model.inputs, {"steer": steer, "v_x": V} | torques | given)
    a_y, turning = model.system.accelerations(none, of(torque_fl=-100.0, torque_fr=100.0, torque_rr=50.0))
    radius = CAR.wheel_radius
    moment = 0.5 * CAR.track_front * 200.0 / radius + 0.5 * CAR.track_rear * 50.0 / radius
    np.testing.assert_allclose([a_y, turning], [0.0, moment / CAR.yaw_inertia], atol=1e-9)
    # The erratum: what drives the steered front wheels pushes aside with sin(delta).
    pushed = [
        np.asarray(model.system.accelerations(none, of(0.1, torque_fl=one, torque_fr=one))) for one in (0.0, 80.0)
    ]
    side = 160.0 / radius * np.sin(0.1)
    expected = [side / CAR.mass, side * CAR.front_axle_to_cg / CAR.yaw_inertia]
    np.testing.assert_allclose(pushed[1] - pushed[0], expected, rtol=1e-6)
    twist = lambda t: (
        {"steer": 0.0 * t, "v_x": V + 0.0 * t}
        | {at: sign * 300.0 * jnp.sin(3.0 * t) for at, sign in zip(torques, (-1.0, 1.0, -1.0, 1.0), strict=True)}
    )
    rows, truth = drive(model, 400, twist, (0.0, 0.0))
    log = recording_of(np.asarray(rows.t), {n: np.asarray(v) for n, v in (rows.u._asdict() | rows.y._asdict()).items()})
    rms = lambda name: np.sqrt(
        np.mean(np.square(np.asarray(sideslip.estimate(CAR, log, method=name)["v_y"]) - truth[:, 0]))
    )
    knows, does_not = rms("motor_moment"), rms("ekf")
    assert knows < 0.1 * does_not


@pytest.mark.parametrize("law", single_track.TYRES)
def test_each_tyre_law_has_the_file_s_stiffness_and_grip(law):
    plain = single_track.axles_of(single_track.single_track(CAR))
    car = single_track.single_track(CAR, law)
    for axle, tyre in zip(plain, (car.front, car.rear), strict=True):
        at = lambda slip, load=axle.load: tyres.Contact(slip_angle=jnp.asarray(slip), load=load)
        np.testing.assert_allclose(tyres.cornering_stiffness(tyre, at(0.0)), axle.stiffness, rtol=1e-6)
        most = float(tyre.forces(at(np.linspace(0.0, 1.2, 400))).F_y.max())
        if law != "linear":
            assert most == pytest.approx(float(axle.grip), rel=0.06)


def test_slow_rows_and_gaps_do_not_upset_a_single_track():
    model = nonlinear_model()
    crawl = lambda v: _record("Inputs", model.inputs, {"steer": 0.03, "v_x": v})
    move = eqx.filter_jit(lambda t0, t1, x, u: model.transition(t0, t1, x, u))
    for v, dt in ((3.2, 0.2), (20.0, 5.0), (0.5, 0.1), (-4.0, 0.1)):
        x = single_track.LateralState(jnp.asarray(0.3), jnp.asarray(0.2))
        for k in range(20):
            x = move(jnp.asarray(k * dt), jnp.asarray((k + 1) * dt), x, crawl(v))
        assert np.isfinite(np.asarray(x)).all() and np.abs(np.asarray(x)).max() < 5.0
        if v < 3.0:
            turning = v * 0.03 / CAR.wheelbase
            np.testing.assert_allclose(np.asarray(x), [CAR.rear_axle_to_cg * turning, turning], rtol=1e-6)
