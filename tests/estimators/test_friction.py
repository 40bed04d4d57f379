"""Friction: each method on a signal of which the answer is known, and the recommended one on a simulated car."""

import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
from banked_drives import follow_all

from jaxveh import InputError, Recording, manoeuvres, roads, sensors, simulate, vehicles
from jaxveh.estimators import friction, misfit
from jaxveh.estimators.friction import brush_curve
from jaxveh.estimators.friction.laws import planar_car
from jaxveh.tyres import Brush, Contact

CAR = dataclasses.replace(
    method_logs.CAR, front_cornering_stiffness=9e4, rear_cornering_stiffness=1.1e5, rolling_resistance=0.0
)
PLANAR = planar_car(CAR)
RADIUS, INERTIA = 0.32, 1.2  # as in the file
DT, SPEED = 0.01, 20.0
T = np.arange(0.0, 16.0, DT)
CORNERS = ("fl", "fr", "rl", "rr")


def brush_axles(mu, slip, k):
    """Both axles' brush forces."""
    curve = (PLANAR.front, PLANAR.rear)[k]
    return brush_curve.force(slip, curve.stiffness, mu * curve.peak)


def similar_axles(mu, slip, k):
    """Both axles' forces of the similar curve."""
    return (PLANAR.front, PLANAR.rear)[k].force(slip, mu)


@functools.partial(jax.jit, static_argnums=0)
def driven(forces, mu, steer):
    """Of a single track, by the midpoint rule: its last state, and yaw rate, lateral acceleration and front force (T,)."""

    def body(x, row):
        mu, steer = row

        def rates(x):
            slips = PLANAR.slip_angles(steer, SPEED, x[0], x[1])
            front, rear = forces(mu, slips[0], 0), forces(mu, slips[1], 1)
            turn = (PLANAR.front_axle_to_cg * front - PLANAR.rear_axle_to_cg * rear) / PLANAR.yaw_inertia
            return jnp.stack([(front + rear) / PLANAR.mass - SPEED * x[1], turn]), (front, rear)

        middle = x + 0.5 * DT * rates(x)[0]
        _, (front, rear) = rates(x)
        said = (x[1], (front + rear) / PLANAR.mass, front)
        return x + DT * rates(middle)[0], said

    return jax.lax.scan(body, jnp.zeros(2), (mu, steer))


def lateral_drive(mu, steer, forces=similar_axles, lean=True):
    """A single track on these axle forces, as sensors without errors show it; everything in one age."""

    _, (yaw_rate, a_y, front) = driven(forces, jnp.broadcast_to(jnp.asarray(mu, float), T.shape), jnp.asarray(steer))
    shows = 1.0 + float(PLANAR.lean) * lean
    # Inertial sensors are later than the steer by what the methods allow for.
    late = lambda values: np.interp(T - float(PLANAR.late), T, np.asarray(values))
    return {
        "v_x": np.full(T.shape, SPEED), "steer": np.asarray(steer), "yaw_rate": late(yaw_rate), "a_y": shows * late(a_y),
        "front": late(front),
    }  # fmt: skip


def estimated(name, channels, car=CAR):
    method = friction.METHODS[name].make(car)
    units = {need.channel: need.unit for need in method.needs}
    channels = {n: v for n, v in channels.items() if n in units}
    return friction.estimate(car, Recording(T, channels, {n: units[n] for n in channels}), method=name)


def follow(method, drive):
    """What a method says, (1, T) in each field; compiled once for methods of one structure."""
    return follow_all(lambda made: made, [(method, drive)], T)


def active(level, frequency=0.5):
    """Steer that uses what there is of a friction: growing swings."""
    return level * np.sin(2.0 * np.pi * frequency * T) * np.minimum(T / 2.0, 1.0)


def test_what_a_force_tells_is_its_slope_over_the_logarithm_of_friction_and_nothing_in_the_linear_range():
    curve = PLANAR.front
    slip, mu, step = jnp.asarray(0.05), 0.6, 1e-6
    difference = (curve.force(slip, mu * np.exp(step)) - curve.force(slip, mu * np.exp(-step))) / (2 * step)
    np.testing.assert_allclose(curve.sensitivity(slip, mu), difference, rtol=1e-6)
    np.testing.assert_allclose(curve.force(1e-7, mu) / 1e-7, curve.stiffness, rtol=1e-6)
    assert abs(curve.sensitivity(jnp.asarray(0.002), 1.0)) < 0.01 * curve.force(0.002, 1.0)
    # All slides: the force is the friction.
    brush = lambda log_mu: brush_curve.force(0.5, curve.stiffness, jnp.exp(log_mu) * curve.peak)
    np.testing.assert_allclose(jax.grad(brush)(jnp.log(0.5)), 0.5 * curve.peak, rtol=1e-12)


def test_the_brush_curve_is_that_of_the_tyre_and_its_inverse():
    tyre = Brush(slip_stiffness=9e4, cornering_stiffness=9e4, friction=1.0, half_length=0.06)
    slips = jnp.asarray([-0.08, -0.01, 0.0, 0.004, 0.03, 0.06])
    expected = tyre.forces(Contact(slip_angle=jnp.arctan(slips), load=5000.0, friction=0.7))
    np.testing.assert_allclose(brush_curve.force(slips, 9e4, 3500.0), expected.F_y, rtol=1e-9, atol=1e-9)
    forces = brush_curve.force(slips[1:5], 9e4, 3500.0)
    np.testing.assert_allclose(brush_curve.slip_of(forces, 9e4, 3500.0), slips[1:5], atol=1e-12)
    np.testing.assert_allclose(
        0.02 * brush_curve.trail_share(forces, 3500.0) * forces, -expected.M_z[1:5], rtol=1e-7, atol=1e-9
    )


@pytest.mark.parametrize("mu", [0.3, 0.7])
@pytest.mark.parametrize("name", ["bank", "augmented", "lateral_curve", "hybrid"])
def test_near_the_limit_lateral_methods_find_the_friction_and_in_the_linear_range_they_say_that_they_do_not(name, mu):
    brush = name in ("lateral_curve", "hybrid")
    forces = brush_axles if brush else similar_axles
    said = estimated(name, lateral_drive(mu, active(0.13 * mu, 0.25 if brush else 0.5), forces))
    late = T > 6.0
    assert said.known.friction[late].mean() > 0.3
    right = late & np.asarray(said.known.friction)
    np.testing.assert_allclose(said["friction"][right], mu, rtol=0.1)
    gentle = estimated(name, lateral_drive(mu, active(0.01 * mu), forces))
    assert not np.asarray(gentle.known.friction).any()


def test_below_the_limit_no_friction_is_known_that_depends_on_the_curve_and_at_it_both_curves_know_it():
    """At the limit on roads of the file's curve and of the brush model's; below it the file's curve alone is right on roads of
    its own, and sure of a friction that is 12 to 20 % off on the others."""
    bank, late = friction.METHODS["bank"].make(CAR), T > 6.0

    def sure_and_right(method, level, mu, forces):
        said = follow(method, lateral_drive(mu, active(level * mu), forces))
        return said.known.friction[0, late], np.abs(said.mean.friction[0, late] / mu - 1.0) < 0.1

    for mu in (0.5, 0.8):
        for forces in (similar_axles, brush_axles):
            sure, right = sure_and_right(bank, 0.13, mu, forces)
            assert sure.mean() > 0.3 and right[sure].all(), (mu, forces)
        for level in (0.08, 0.1):
            sure, right = sure_and_right(bank, level, mu, brush_axles)
            assert right[sure].all(), (mu, level)
            sure, right = sure_and_right(bank.inner, level, mu, brush_axles)
            assert np.mean(sure & ~right) > 0.1, (mu, level)


def test_a_friction_beyond_those_of_the_bank_is_not_known():
    bank = friction.METHODS["bank"].make(CAR).inner
    fewer = jnp.geomspace(bank.frictions[0], 0.54, len(bank.frictions))
    drive = lateral_drive(0.6, active(0.13 * 0.6))
    few = dataclasses.replace(bank, frictions=fewer, prior=fewer)
    answers = [follow(made, drive) for made in (bank, few)]
    late = T > 6.0
    assert np.mean(answers[0].known.friction[0, late]) > 0.3
    assert not np.asarray(answers[1].known.friction[0, late]).any()


def test_a_jump_is_followed_within_a_second_where_there_is_excitation():
    mu = np.where(T < 8.0, 0.9, 0.35)
    said = estimated("bank", lateral_drive(mu, active(0.07)))
    friction_said = np.asarray(said["friction"])
    assert friction_said[T < 7.9][-1] > 0.55
    found = np.abs(friction_said / 0.35 - 1.0) < 0.2
    assert found[T >= 9.0].all()
    # And the spread says it.
    assert np.asarray(said.known.friction)[T >= 10.0].mean() > 0.7


@pytest.mark.parametrize("softness", [(0.8, 0.8), (1.25, 1.25), (0.8, 1.2), (1.2, 0.9)])
def test_a_jump_is_found_as_soon_on_axles_of_another_stiffness_once_the_drive_has_shown_it(softness):
    """Front and rear are softer or stiffer than in the file: gentle swings show by how much, before the friction
    falls. With errors that last for 3 s it takes up to 2.1 s."""
    softer = lambda mu, slip, k: (PLANAR.front, PLANAR.rear)[k].force(slip, mu, factor=softness[k])
    drive = lateral_drive(np.where(T < 8.0, 0.9, 0.35), active(0.06), softer)
    bank = friction.METHODS["bank"].make(CAR).inner
    said = follow(bank, drive).mean.friction[0]
    assert T[np.flatnonzero(np.abs(said / 0.35 - 1.0) > 0.2)[-1]] < 8.6


def test_a_friction_is_known_once_it_has_been_certain_for_half_a_second():
    drive = lateral_drive(np.where(T < 8.0, 0.9, 0.35), active(0.07))
    bank = friction.METHODS["bank"].make(CAR).inner
    at_once = dataclasses.replace(bank, certain_time=jnp.asarray(1e-9))
    after, certain = (follow(made, drive).known.friction[0] for made in (bank, at_once))
    lasted = lambda rows: np.asarray([certain[max(k - rows + 1, 0) : k + 1].all() and k >= rows for k in range(len(T))])
    assert (lasted(51) <= after).all() and (after <= lasted(49)).all()
    assert 0.2 < after.mean() < certain.mean() - 0.02


@pytest.mark.parametrize("degrees", [0.6, 1.0])
def test_a_steer_that_is_off_makes_no_friction_known_on_a_dry_road(degrees):
    """By so much at the road wheels, which the file does not say: no row looks slippery."""
    drive = lateral_drive(1.0, active(0.02))
    drive = drive | {"steer": drive["steer"] + np.radians(degrees)}
    said = estimated("bank", drive)
    assert not np.asarray(said.known.friction).any() and np.min(said["friction"]) > 0.68
    # The filter without the offset as a state is misled.
    method = dataclasses.replace(friction.METHODS["bank"].make(CAR).inner, offset_spread=jnp.asarray(1e-6))
    units = {need.channel: need.unit for need in method.needs if need.channel in drive}
    misled = friction.estimate(method, Recording(T, {n: drive[n] for n in units}, units))
    assert np.min(misled["friction"]) < (0.5 if degrees == 1.0 else np.min(said["friction"]))


@pytest.mark.parametrize("along", [True, False])
def test_a_friction_that_could_not_carry_the_acceleration_is_not_possible(along):
    """Straight ahead with 5 m/s^2, and in a bend that the steer does not explain."""
    drive = lateral_drive(1.0, 0.0 * T)
    drive = drive | ({"a_x": np.full(T.shape, 5.0)} if along else {"a_y": np.full(T.shape, 5.0)})
    method = friction.METHODS["bank"].make(CAR).inner
    row = lambda k: {n.channel: jnp.asarray(drive.get(n.channel, T * np.nan)[k]) for n in method.needs}
    memory, _ = method.first(jnp.asarray(0.0), row(0))
    low, step = np.asarray(method.frictions) < 0.3, eqx.filter_jit(lambda *given: method.next(*given))
    for k in range(1, 60):
        memory, _ = step(memory, jnp.asarray(T[k]), row(k))
    assert np.exp(np.asarray(memory.bank.weights))[low].sum() < 0.01 < 0.1 < np.asarray(method._prior())[low].sum()


@functools.cache
def to_the_end(outlier):
    """A method's last memory, and friction, its standard deviation and `known` (n,), as a function of the method and its rows;
    compiled once for an `OUTLIER` of the misfit."""

    def of(method, t, rows):
        def step(memory, row):
            memory, said = method.next(memory, *row)
            return memory, (said.mean.friction, said.std.friction, said.known.friction)

        memory, _ = method.first(t[0], {name: row[0] for name, row in rows.items()})
        return jax.lax.scan(step, memory, (t[1:], {name: row[1:] for name, row in rows.items()}))

    return eqx.filter_jit(of)


def friction_of_noisy_sensors(times, outlier=misfit.OUTLIER):
    """What `to_the_end` says on a dry road, below the limit; `times` is the standard deviation of the sensors' errors over the
    method's (2,), for yaw rate and a_y."""
    drive, errors = lateral_drive(1.0, active(0.03)), np.random.default_rng(1).standard_normal((2, len(T)))
    method = friction.METHODS["bank"].make(CAR).inner
    for name, error, more, sigma in zip(
        ("yaw_rate", "a_y"), errors, times, (method.yaw_rate_noise, method.a_y_noise), strict=True
    ):
        drive[name] = drive[name] + more * float(sigma) * error
    rows = {n.channel: jnp.asarray(np.broadcast_to(drive.get(n.channel, np.nan), T.shape)) for n in method.needs}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(misfit, "OUTLIER", outlier)
        memory, said = to_the_end(outlier)(method, jnp.asarray(T), rows)
    return memory, *map(np.asarray, said)


@pytest.mark.parametrize("times", [(5.0, 5.0), (8.0, 0.0), (0.0, 8.0)])
def test_sensors_noisier_than_the_method_expects_make_no_friction_known(times):
    memory, said, std, known = friction_of_noisy_sensors(times)
    assert not known.any()
    assert np.mean(np.square((said - 1.0) / std)[T[1:] > 3.0]) < 1.0
    # The misfit is the ratio of the variances, of a_y less what the filters' own variance explains, and one without noise.
    for learnt, more in zip(np.asarray(memory.misfit.times), times, strict=True):
        assert 0.6 * more**2 < learnt < 1.1 * more**2 if more > 1.0 else learnt == 1.0
    # Without it, the noise is taken for a slippery road.
    _, said, std, _ = friction_of_noisy_sensors(times, outlier=1.0)
    assert np.mean(np.square((said - 1.0) / std)[T[1:] > 3.0]) > 10.0


def test_the_steering_torque_knows_sooner_than_the_force():
    mu = 0.5
    drive = lateral_drive(mu, active(0.034), brush_axles)
    trail = 0.015 + 0.02 * brush_curve.trail_share(drive["front"], mu * PLANAR.front.peak)
    drive["steering_torque"] = np.asarray(drive["front"] * trail / 16.0)
    said, force = estimated("aligning_torque", drive), estimated("lateral_curve", drive)
    used = np.abs(drive["front"]).max() / (mu * float(PLANAR.front.peak))
    assert 0.5 < used < 0.9
    late = T > 5.0
    assert np.asarray(said.known.friction)[late].mean() > 0.5 + np.asarray(force.known.friction)[late].mean()
    np.testing.assert_allclose(said["friction"][late & np.asarray(said.known.friction)], mu, rtol=0.12)


def wheels_drive(mu, slip, side=None, ratio=1.0):
    """All wheels at a longitudinal slip (T,), forces on the curve along of friction mu (by side where given)."""
    channels = {"v_x": np.full(T.shape, SPEED), "a_x": np.zeros(T.shape), "a_y": np.zeros(T.shape)}
    for k, at in enumerate(CORNERS):
        axle = (PLANAR.front, PLANAR.rear)[k // 2]
        own = mu if side is None else side[k % 2]
        force = 0.5 * np.asarray(axle.force(ratio * slip, own))
        speed = SPEED * (1.0 + slip)
        spin = np.gradient(speed, T) / RADIUS
        channels[f"wheel_speed_{at}"] = speed
        channels[f"torque_{at}"] = RADIUS * force + INERTIA * spin
    return channels


def swings(most):
    return most * np.sin(2.0 * np.pi * 0.25 * T)


@pytest.mark.parametrize("name", ["sides_apart", "reconstruction"])
def test_wheels_that_slip_show_the_friction(name):
    mu = 0.4
    said = estimated(name, wheels_drive(mu, swings(0.06)))
    known = np.asarray(said.known.friction) & (T > 4.0)
    assert known.mean() > 0.1
    assert abs(np.median(said["friction"][known]) / mu - 1.0) < 0.15
    calm = estimated(name, wheels_drive(mu, swings(0.001)))
    assert not np.asarray(calm.known.friction)[T > 1.0].any()


@pytest.mark.parametrize("mu", [0.2, 0.35, 0.6])
@pytest.mark.parametrize("softness", [1.0, 3.0])
def test_wheels_under_abs_have_lost_force_beyond_the_peak(softness, mu):
    """Usual tyres (C = 1.65, a slip stiffness of 18 loads) at slips of 5 to 25 %, also where the axles of the car's file are
    `softness` times as soft across, as by a compliant steering: no friction is known that is wrong by a fifth."""
    slip = np.where(T > 2.0, -0.15 + 0.1 * np.sin(2.0 * np.pi * 1.5 * T), 0.0)
    keys = ("front_cornering_stiffness", "rear_cornering_stiffness")
    car = dataclasses.replace(CAR, **{key: getattr(CAR, key) / softness for key in keys})
    drive = wheels_drive(mu, slip)
    for k, at in enumerate(CORNERS):
        load = 0.5 * float(PLANAR.static_loads()[k // 2])
        peak = 0.5 * float((PLANAR.front, PLANAR.rear)[k // 2].peak)
        force = mu * peak * np.sin(1.65 * np.arctan(18.0 * load * slip / (1.65 * mu * peak)))
        drive[f"torque_{at}"] = RADIUS * force + INERTIA * np.gradient(drive[f"wheel_speed_{at}"], T) / RADIUS
    drive |= {"steer": 0.0 * T, "yaw_rate": 0.0 * T}
    said = estimated("bank", drive, car)
    late = T > 4.0
    sure = np.asarray(said.known.friction)[late]
    off = np.abs(np.asarray(said["friction"])[late] / mu - 1.0)
    assert not (sure & (off > 0.2)).any()
    assert np.median(off) < 0.25


def test_observers_of_the_wheels_find_the_friction_of_their_own_law():
    mu = 0.4
    drive = wheels_drive(mu, swings(0.08))
    # The law that is linear in friction: all of the dry curve times mu.
    for k, at in enumerate(CORNERS):
        force = 0.5 * mu * np.asarray((PLANAR.front, PLANAR.rear)[k // 2].force(swings(0.08), 1.0))
        spin = np.gradient(drive[f"wheel_speed_{at}"], T) / RADIUS
        drive[f"torque_{at}"] = RADIUS * force + INERTIA * spin
    said = estimated("wheel_observer", drive)
    known = np.asarray(said.known.friction) & (T > 8.0)
    assert known.mean() > 0.1
    assert abs(np.median(said["friction"][known]) / mu - 1.0) < 0.15
    law = friction.METHODS["lugre"].make(CAR).inner.law
    for k, at in enumerate(CORNERS):
        load = float(PLANAR.static_loads()[k // 2]) / 2.0
        contact = Contact(slip_ratio=swings(0.08), load=load, friction=mu, speed=SPEED, slip_speed=SPEED)
        force = np.asarray(law.forces(contact, law.start(contact)).F_x)
        spin = np.gradient(drive[f"wheel_speed_{at}"], T) / RADIUS
        drive[f"torque_{at}"] = RADIUS * force + INERTIA * spin
    said = estimated("lugre", drive)
    known = np.asarray(said.known.friction) & (T > 8.0)
    assert known.mean() > 0.1
    assert abs(np.median(said["friction"][known]) / mu - 1.0) < 0.15


def own_law_drive(name, mu, slip):
    """Wheels whose forces are those of the method's own law; of others those of the curve that friction stretches."""
    if name == "slip_slope":
        return wheels_drive(1.0, slip, ratio=mu)
    drive = wheels_drive(mu, slip)
    if name not in ("wheel_observer", "lugre"):
        return drive
    law = friction.METHODS["lugre"].make(CAR).inner.law
    for k, at in enumerate(CORNERS):
        load = float(PLANAR.static_loads()[k // 2]) / 2.0
        contact = Contact(slip_ratio=slip, load=load, friction=mu, speed=SPEED, slip_speed=SPEED)
        linear = 0.5 * mu * np.asarray((PLANAR.front, PLANAR.rear)[k // 2].force(slip, 1.0))
        force = linear if name == "wheel_observer" else np.asarray(law.forces(contact, law.start(contact)).F_x)
        drive[f"torque_{at}"] = RADIUS * force + INERTIA * np.gradient(drive[f"wheel_speed_{at}"], T) / RADIUS
    return drive


ACROSS = ("bank", "lateral_curve", "hybrid", "augmented", "aligning_torque")


QUICK = ("lateral_curve", "hybrid")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.studies]) for name in friction.METHODS]
)
def test_a_file_whose_stiffness_is_wrong_by_a_fifth_makes_no_friction_known_that_is_not_there(name):
    """From the linear range to the limit, on roads of which the curve is the method's own: of what it calls known nine tenths
    are within a fifth of the truth, or the spread that it claims says how far off it is."""
    drives, truths = [], []
    for mu, used in ((0.9, 0.2), (0.9, 0.5), (0.35, 0.5), (0.35, 1.1)):
        if name in ACROSS:
            brush = name not in ("bank", "augmented")
            forces = brush_axles if brush else similar_axles
            drive = lateral_drive(mu, active(0.13 * mu * used, 0.25 if brush else 0.5), forces)
            trail = 0.015 + 0.02 * brush_curve.trail_share(drive["front"], mu * PLANAR.front.peak)
            drive["steering_torque"] = np.asarray(drive["front"] * trail / 16.0)
        else:
            drive = own_law_drive(name, mu, swings(0.15 * mu * used))
        drives.append(drive)
        truths.append(mu)
    keys = ("front_cornering_stiffness", "rear_cornering_stiffness")
    wrong = lambda by: {key: getattr(CAR, key) * factor for key, factor in zip(keys, by, strict=True)}
    factors = ((0.8, 0.8), (1.0, 1.0), (1.2, 1.2), (1.2, 0.8), (0.8, 1.2))
    files = {by: dataclasses.replace(CAR, **wrong(by)) for by in factors}
    cases = [(by, drive) for by in files for drive in drives]
    said = follow_all(lambda by: friction.METHODS[name].make(files[by]), cases, T)
    mean, std, known = (part.friction[:, T > 3.0] for part in said[:3])
    error = mean / np.tile(truths, len(files))[:, None] - 1.0
    for k, by in enumerate(files):
        rows = slice(k * len(drives), (k + 1) * len(drives))
        sure, wrong = known[rows], np.abs(error[rows]) > 0.2
        off = (mean - np.tile(truths, len(files))[:, None])[rows] / std[rows]
        honest = np.mean(off[sure] ** 2) < 2.0 if sure.any() else True
        assert (wrong & sure).sum() <= 0.1 * sure.sum() or honest, by


def test_sides_are_told_apart():
    said = estimated("sides_apart", wheels_drive(None, swings(0.06), side=(0.3, 0.8)))
    known = np.asarray(said.known.friction_left) & (T > 4.0)
    assert known.mean() > 0.1
    np.testing.assert_allclose(np.median(said["friction_left"][known]), 0.3, rtol=0.15)
    assert np.median(said["friction_right"][T > 4.0]) > 0.6
    both = 0.5 * (np.asarray(said["friction_left"]) + np.asarray(said["friction_right"]))
    np.testing.assert_allclose(said["friction"], both)


def test_the_slip_slope_is_a_stiffness_and_becomes_friction_by_its_calibration_alone():
    # Two roads with one slope: the same answer, near one.
    one, other = (estimated("slip_slope", wheels_drive(mu, swings(0.009)))["friction"][-1] for mu in (1.0, 0.5))
    np.testing.assert_allclose([one, other], 1.0, rtol=0.1)
    # Half the slope, at an exponent of one: half the friction.
    soft = estimated("slip_slope", wheels_drive(1.0, swings(0.02), ratio=0.5))
    assert bool(soft.known.friction[-1])
    np.testing.assert_allclose(soft["friction"][-1], 0.5, rtol=0.1)
    assert soft.std.friction[-1] > 0.3 * soft["friction"][-1] * 0.99


def test_a_file_without_wheels_has_lateral_methods_alone():
    bare = dataclasses.replace(CAR, wheel_radius=None)
    assert friction.METHODS["bank"].make(bare).inner.along is None
    with pytest.raises(InputError, match="no wheel_radius"):
        friction.METHODS["sides_apart"].make(bare)
    with pytest.raises(InputError, match="no steering_ratio"):
        friction.METHODS["aligning_torque"].make(dataclasses.replace(CAR, steering_ratio=None))


@pytest.mark.full
def test_a_simulated_car_with_production_sensors_is_never_wrong_and_known_but_in_the_second_after_a_jump():
    car = vehicles.named_car("suv", "seven-dof")
    told = vehicles.specification_of(vehicles.kit.CARS["suv"]())
    drive = manoeuvres.random_steering(20.0, 0.05, jax.random.key(8), lowest=0.2, highest=0.7, duration=24.0)
    suite = sensors.production_car(float(car.wheel_radius), gnss=False)
    log = simulate(car, drive, suite, jax.random.key(9), road=roads.MuJump(0.8, 0.4, 240.0), solver="explicit")
    channels = {name: log[name] for name in ("steer", "yaw_rate", "a_y", "a_x")} | {"v_x": log["true.v_x"]}
    units = {name: log.unit(name) for name in ("steer", "yaw_rate", "a_y", "a_x")} | {"v_x": "m/s"}
    said = friction.estimate(told, Recording(log.time, channels, units))
    truth, time = np.asarray(log["true.friction_fl"]), np.asarray(log.time)
    error = np.abs(np.asarray(said["friction"]) / truth - 1.0)
    known, wrong = np.asarray(said.known.friction), error > 0.2
    assert known[time > 14.0].mean() > 0.2
    # No force shows a jump before it is excited: a second is allowed, and nothing beside it.
    since = time - time[np.argmax(truth < 0.6)]
    assert not (wrong & known)[(since < 0.0) | (since > 1.0)].any()
    assert np.mean(error[known & (time > 14.0)] < 0.1) > 0.8
    used = np.hypot(log["true.F_y"], log["true.F_x"]) / (told.mass * 9.81 * truth)
    # The drive does excite it.
    assert used[since > 0.0].max() > 0.8
