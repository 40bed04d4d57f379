"""Cars with steered rear wheels: the recommended method of every quantity includes their angle, the others refuse such a car."""

import dataclasses
from typing import ClassVar

import banked_drives
import equinox as eqx
import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
from test_every_method import QUANTITIES, every_quantity

from jaxveh import InputError, Recording, diagnostics, estimators, io, vehicles
from jaxveh.estimators import kit
from jaxveh.estimators.friction.motion import start_told
from jaxveh.estimators.linear_baseline import open_loop, open_loop_of
from jaxveh.estimators.method_of_car import TURNING, method_of
from jaxveh.estimators.rear_steer import rear_steer_of, with_rear_angle
from jaxveh.estimators.sliding import Sliding

PLAIN = method_logs.CAR
RATIO = -0.3
STEERED = {
    "rear": dataclasses.replace(PLAIN, steering="rear"), "independent": dataclasses.replace(PLAIN, steering="independent"),
    "four-wheel": dataclasses.replace(PLAIN, steering="four-wheel", rear_steer_ratio=RATIO),
}  # fmt: skip
REAR = STEERED["rear"]
REFUSAL = (
    r'steering = "rear", but the equations used here hold only for a car with front steering.*estimators.state_space'
)
TURNED = 0.08
"""rad: by how much the rear wheels turn to and fro in the logs of this file."""


def test_every_kind_of_a_file_is_known_here():
    front = {"front", "ackermann"}
    assert {*STEERED, *front} == {*vehicles.kit.STEERINGS}
    assert all(dataclasses.replace(PLAIN, steering=kind).steers_front_alone for kind in front)


@every_quantity
def test_a_method_includes_their_angle_or_refuses_the_car_and_names_those_that_do(quantity):
    methods = QUANTITIES[quantity].METHODS
    assert methods[QUANTITIES[quantity].RECOMMENDED].any_steering
    for name, entry in methods.items():
        if entry.any_steering:
            continue
        needs = entry.make(PLAIN).needs
        if any(need.channel in TURNING for need in needs):
            for car in STEERED.values():
                wanted = REFUSAL.replace('"rear"', f'"{car.steering}"')
                with pytest.raises(InputError, match=f"{quantity}: {name}: the car's file has {wanted}") as found:
                    method_of(quantity, methods, car, name)
                assert f'"{QUANTITIES[quantity].RECOMMENDED}"' in str(found.value)
        else:
            assert method_of(quantity, methods, REAR, name).needs == needs


QUICK = (("bank", "filter", "rear"), ("grade", "filter", "four-wheel"))
"""Those of which CI runs a fifth."""

KNOWING = [
    pytest.param(
        quantity, name, kind, marks=pytest.mark.thorough if (quantity, name, kind) in QUICK else pytest.mark.full
    )
    for quantity, module in QUANTITIES.items()
    for name, entry in module.METHODS.items()
    if entry.any_steering
    for kind in STEERED
]
TRUTHS = {
    "v_y": 0.05, "sideslip": 0.003, "bank": 0.002, "roll": 0.002, "grade": 0.002, "v_x": 0.02, "mass": 0.01 * PLAIN.mass,
    "rear_cornering_stiffness": 0.0, "front_cornering_stiffness": 0.0, "steering_ratio": 0.2, "front_axle_to_cg": 0.02,
    "yaw": 0.003, "yaw_inertia": 50.0, "steer_offset": 0.0005,
}  # fmt: skip
"""What the drive is made of, and an error that is allowed beside that for a car with straight rear wheels, RMS in the last third
of 30 s. Without the angle of the rear wheels, which is 0.06 rad RMS, sideslips and lateral speeds are off by as much; the bank,
whose gate then leaves the slip angle out, is not."""


def truth_of(name, made):
    """A quantity of the log, by the name that the methods show it under."""
    return made[name] if name in made else np.full(len(made["time"]), getattr(PLAIN, name) or 0.0)


def drive(needs, rear=TURNED, rows=1500):
    return method_logs.log(needs, rows=rows, rear=rear)


@pytest.mark.parametrize(("quantity", "name", "kind"), KNOWING)
def test_it_is_as_right_as_for_a_car_with_straight_rear_wheels(quantity, name, kind):
    module = QUANTITIES[quantity]
    needs = module.METHODS[name].make(STEERED[kind]).needs
    made = method_logs.channels(rows=1500, rear=TURNED)
    log = drive(needs)
    said = module.estimate(STEERED[kind], log, method=name)
    plain = module.estimate(PLAIN, drive(needs, 0.0), method=name)
    straight = method_logs.channels(rows=1500)
    last = slice(1000, None)
    for field in {*module.SHOWN, *({"v_y"} & {*said.mean._fields})} & {*TRUTHS}:
        off = lambda said, made, field=field: np.sqrt(np.mean(np.square((said[field] - truth_of(field, made))[last])))
        assert off(said, made) <= max(TRUTHS[field], 1.45 * off(plain, straight)), field
        known = lambda said, field=field: np.mean(np.asarray(getattr(said.known, field))[last])
        assert known(said) >= known(plain) - 0.2, field


def test_the_axles_of_stiffness_and_friction_carry_what_the_drive_feels():
    """At the true motion, since on so short a drive neither quantity is known."""
    made = method_logs.channels(rear=TURNED)
    walking = QUANTITIES["stiffness"].METHODS["walking"].make(REAR).inner
    bank = QUANTITIES["friction"].METHODS["bank"].make(REAR).inner.inner
    flat = np.gradient(made["v_y"], made["time"]) + made["v_x"] * made["motion_yaw_rate"]
    t, felt = jnp.asarray(0.0), {"walking": [], "walking, next": [], "bank": []}
    rows = range(20, 300, 20)
    for k in rows:
        row = {name: jnp.asarray(made[name][k]) for name in ("v_x", "steer", "steer_rear", "a_y", "a_x", "yaw_rate")}
        v_y, yaw_rate = made["v_y"][k], made["motion_yaw_rate"][k]
        x = jnp.zeros(11).at[:2].set(jnp.stack([v_y, yaw_rate])).at[10].set(1.0)
        first = walking.followed.start(t, row)
        for name, signals in (("walking", first), ("walking, next", walking.followed.next(first, t + 0.01, row))):
            felt[name].append(float(walking._forces(x, signals)[2]))
        told = start_told(t, row, bank.car.late)._replace(a_x=jnp.asarray(0.0))
        forces = bank._forces(jnp.zeros(8).at[:2].set(jnp.stack([v_y, yaw_rate])), 3.0, told)
        felt["bank"].append(float(sum(forces)) / PLAIN.mass)
    for name, values in felt.items():
        np.testing.assert_allclose(values, flat[list(rows)], atol=0.15, err_msg=name)


@pytest.mark.thorough
def test_a_calibrated_car_is_as_right_and_says_the_same_live_and_from_its_file(tmp_path):
    sideslip = estimators.sideslip
    names = (*[need.channel for need in sideslip.needs], "steer", "steer_rear")
    made = method_logs.channels(rows=1500, rear=TURNED)
    log = Recording(made["time"], {name: made[name] for name in names})
    found = sideslip.calibrate(REAR, log)
    estimate = sideslip.estimate(found, log)
    error = lambda said: np.degrees(np.std((np.asarray(said.mean.sideslip) - made["sideslip"])[250:]))
    assert error(estimate) < 0.3 and error(sideslip.estimate(PLAIN, log)) > 0.6
    found.save(tmp_path / "rear.toml")
    again = sideslip.estimate(estimators.read_calibration(tmp_path / "rear.toml", estimator=sideslip), log)
    np.testing.assert_array_equal(again.mean.sideslip, estimate.mean.sideslip)
    fitted = sideslip.fitted_car(found, REAR, recording=log)
    assert fitted.steering == "rear"
    np.testing.assert_allclose(fitted.front_cornering_stiffness, PLAIN.front_cornering_stiffness, rtol=0.05)
    causal, live, belief = sideslip.estimate(found, log, smoothed=False), sideslip.live(found), None
    for k in range(40):
        row = float(log.time[k]), {name: float(log[name][k]) for name in log.names}
        belief, said = live.init(*row) if belief is None else live.step(belief, *row)
    np.testing.assert_allclose(said.mean.sideslip, causal.mean.sideslip[39], rtol=1e-9)
    with pytest.raises(InputError, match=r"sideslip: steer_rear \(rad\) is missing from the log"):
        sideslip.estimate(REAR, log.without("steer_rear"))


RATIOS = {"straight": None, "alike": 0.5, "against": -0.4}
"""Rear over front angle."""


def heard_with(ratio, name="sedan", count=3):
    """Channels of simulated drives with fourteen degrees of freedom and production sensors, their truths, and the time."""
    steering = None if ratio is None else vehicles.FourWheelSteering(ratio)
    found = banked_drives.drives(name, 500 + np.arange(count), 60.0, steering)
    cases, truths = [], []
    for k in range(count):
        truth = {field: values[k] for field, values in found.items()}
        said, _, time = banked_drives.heard(name, truth, k)
        said |= {"steer": said["steering_wheel"] / banked_drives.RATIO, "v_x": 1.003 * truth["v_x"]}
        cases.append((name, said | ({} if ratio is None else {"steer_rear": truth["steer_rl"]})))
        truths.append(truth)
    return cases, truths, time


TAKEN_UP = pytest.mark.xfail(
    strict=True, reason="the axle that is estimated takes it up: 1.10 against the front wheels"
)


@pytest.mark.full
@pytest.mark.parametrize(
    ("quantity", "least"),
    [("sideslip", 1.2), ("navigation", 1.05), pytest.param("navigation", 1.15, marks=TAKEN_UP), ("bank", 1.15)],
)
def test_simulated_cars_are_estimated_as_well_as_with_straight_rear_wheels(quantity, least):
    """`least`: how much larger the error is at least if nobody tells of the rear wheels; navigation takes wheels that are turned
    against the front for a softer or stiffer axle, which it estimates."""
    field = "bank" if quantity == "bank" else "sideslip"
    entry, errors = QUANTITIES[quantity].METHODS[QUANTITIES[quantity].RECOMMENDED], {}
    for kind, ratio in RATIOS.items():
        cases, truths, time = heard_with(ratio)
        for told in (True, False) if ratio else (True,):
            steered = {"steering": "four-wheel", "rear_steer_ratio": ratio} if ratio and told else {}
            made = lambda car, steered=steered: entry.make(dataclasses.replace(banked_drives.file_of(car), **steered))
            said = banked_drives.follow_all(made, cases, time)
            right = [one["bank"] if field == "bank" else np.arctan2(one["v_y"], one["v_x"]) for one in truths]
            error = np.sqrt(np.mean(np.square(getattr(said.mean, field) - right)[:, 500:], axis=1))
            errors[kind, told] = float(np.median(error))
    for kind in ("alike", "against"):
        assert errors[kind, True] < 1.1 * errors["straight", True]
        assert errors[kind, False] > least * errors["straight", True]


def prepared_rows(car, log):
    """What a method hears of a log: the angle of the rear wheels, and the yaw rate."""
    return with_rear_angle("here", rear_steer_of(car), log)


LAW = dataclasses.replace(
    STEERED["four-wheel"], rear_steer_ratio_fast=0.2, rear_steer_speed=15.0, steer_offset=0.01, steering_ratio=16.0
)
WHEELS = ("steer_rl", "steer_rr")
TELLING = [
    *[
        (car, (*more, *names))
        for car in (REAR, STEERED["independent"], LAW)
        for names in (("steer_rear",), WHEELS)
        for more in ((), ("steer",))
    ],
    (LAW, ("steer", "v_x")),
    (LAW, ("steering_wheel", "v_x")),
]
"""A car's file, and channels that tell the angle of its rear wheels: the measured angle, that of the wheels, or the ratio."""


@pytest.mark.parametrize(("car", "names"), TELLING)
def test_the_angle_is_the_measured_one_or_that_of_the_wheels_or_of_the_ratio(car, names):
    made = method_logs.channels(rear=TURNED)
    by_ratio = vehicles.kit.steering_of(LAW).ratio(made["v_x"]) * (made["steer"] - 0.01)
    wanted = by_ratio if "v_x" in names else made["steer_rear"]
    log = Recording(made["time"], {name: made[name] for name in (*names, "yaw_rate")})
    heard = prepared_rows(car, log)
    shifted = np.interp(made["time"] - float(rear_steer_of(car).late), made["time"], wanted)
    np.testing.assert_allclose(heard["steer_rear"][10:], shifted[10:], atol=6e-4)
    np.testing.assert_array_equal(heard["yaw_rate"], made["yaw_rate"])
    # That of the log is the same without the delay.
    of_log = io.with_road_steer(car, log)
    np.testing.assert_allclose(of_log["steer_rear"], wanted, rtol=1e-12, atol=1e-15)
    # A column without values says nothing.
    empty = log if "steer_rear" in names else log.replace(steer_rear=np.full(len(log), np.nan))
    np.testing.assert_array_equal(prepared_rows(car, empty)["steer_rear"], heard["steer_rear"])
    np.testing.assert_array_equal(io.with_road_steer(car, empty)["steer_rear"], of_log["steer_rear"])


def test_spikes_of_the_angle_are_not_heard_and_steps_are():
    made = method_logs.channels(rear=TURNED)
    log = Recording(made["time"], {name: made[name] for name in ("steer_rear", "yaw_rate")})
    raw, heard = np.array(made["steer_rear"]), prepared_rows(REAR, log)["steer_rear"]
    raw[100] += 0.5
    np.testing.assert_allclose(prepared_rows(REAR, log.replace(steer_rear=raw))["steer_rear"], heard, atol=0.005)
    raw[101:] += 0.5
    stepped = prepared_rows(REAR, log.replace(steer_rear=raw))["steer_rear"]
    np.testing.assert_allclose(stepped[115:], heard[115:] + 0.5, atol=1e-4)


def test_a_car_that_steers_the_front_alone_hears_no_angle():
    log = drive(estimators.sideslip.needs).replace(steer_rear=np.full(1500, np.nan))
    assert rear_steer_of(PLAIN) is None and "steer_rear" not in prepared_rows(PLAIN, log)
    bare = log.without("steer_rear")
    assert prepared_rows(PLAIN, bare) is bare


@pytest.mark.parametrize("kind", STEERED)
def test_a_log_that_does_not_tell_the_angle_is_refused_before_anything_runs(kind):
    car, log = STEERED[kind], drive(estimators.sideslip.needs)
    silent = log.replace(steer_rear=np.full(len(log), np.nan))
    acts = (
        lambda one: estimators.sideslip.estimate(car, one),
        lambda one: estimators.sideslip.calibrate(car, one),
        lambda one: estimators.sideslip.estimate(car, one, method="rear_axle"),
        lambda one: estimators.grade.estimate(car, one),
    )
    for one in (log, silent):
        for act in acts:
            with pytest.raises(
                InputError, match=r"(sideslip|grade): steer_rear \(rad\) is missing from the log, but the car"
            ):
                act(one)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", STEERED)
@pytest.mark.parametrize("gap", [False, True])
def test_what_is_behind_a_low_pass_is_estimated_and_calibrated_from_any_telling_log(kind, gap):
    car = dataclasses.replace(STEERED[kind], low_pass=5.0)
    names = {"rear": ("steer_rear",), "independent": WHEELS, "four-wheel": ("steer",)}[kind]
    made = method_logs.channels(rows=400, rear=TURNED)
    if kind == "four-wheel":
        made |= {"steer_rear": RATIO * made["steer"]}
    log = Recording(made["time"], {n: made[n] for n in (*[need.channel for need in estimators.sideslip.needs], *names)})
    log = log.rows(np.flatnonzero((made["time"] < 3.0) | (made["time"] > 3.7))) if gap else log
    said = estimators.sideslip.estimate(car, log)
    assert np.isfinite(np.asarray(said.mean.sideslip)).all()
    if not gap:
        found = estimators.sideslip.calibrate(car, log)
        truth = log.replace(v_y=made["v_y"], steer=made["steer"])
        scored = estimators.sideslip.score(car, estimators.sideslip.estimate(found, log), truth)
        assert np.isfinite(scored["open_loop_sideslip_rmse_deg"])


def test_it_is_held_in_gaps_and_after_long_ones_no_turn_is_heard():
    made = method_logs.channels(rear=TURNED)
    angle = np.where((made["time"] > 2.0) & (made["time"] < 2.2), np.nan, made["steer_rear"])
    angle = np.where((made["time"] > 3.0) & (made["time"] < 4.0), np.nan, angle)
    log = Recording(made["time"], {"steer_rear": angle, "yaw_rate": made["yaw_rate"]})
    heard = prepared_rows(REAR, log)
    assert np.isfinite(heard["steer_rear"]).all()
    silent = np.isnan(heard["yaw_rate"])
    assert silent[(made["time"] > 3.35) & (made["time"] < 4.0)].all() and not silent[made["time"] < 3.2].any()
    assert not silent[made["time"] > 4.05].any()


@pytest.mark.whole
@pytest.mark.parametrize("car", [REAR, STEERED["independent"], LAW])
def test_slopes_batches_and_float32_with_gaps(car):
    made = method_logs.channels(rows=60, rear=TURNED)
    names = ("steer", "steer_rear", *WHEELS, "steering_wheel", "v_x", "yaw_rate", "wheel_speed_fl", "wheel_speed_rl")
    values = {name: np.where(np.arange(60) % 3 == 1, np.nan, made[name]) for name in names}
    if car is LAW:
        del values["steer_rear"], values["steer_rl"], values["steer_rr"]
    rear = rear_steer_of(car)
    numbers, rest = eqx.partition(rear, eqx.is_array)

    def angles(numbers, values, time):
        one = eqx.combine(numbers, rest)
        row = lambda k: {name: value[k] for name, value in values.items()}
        memory, _ = one.first(time[0], row(0))

        def step(memory, k):
            memory, heard = one.next(memory, time[k], row(k))
            return memory, heard["steer_rear"]

        return jax.lax.scan(step, memory, jnp.arange(1, 60))[1]

    time, values = jnp.asarray(made["time"]), {name: jnp.asarray(value) for name, value in values.items()}
    total = lambda numbers, values: jnp.sum(jnp.square(angles(numbers, values, time)))
    slopes = jax.grad(total, argnums=(0, 1))(numbers, values)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes))
    later = eqx.tree_at(lambda r: r.late, numbers, numbers.late + 1e-6)
    np.testing.assert_allclose(slopes[0].late, (total(later, values) - total(numbers, values)) / 1e-6, rtol=1e-3)
    alone = angles(numbers, values, time)
    twice = jax.vmap(lambda by: angles(numbers, values | {"v_x": by * values["v_x"]}, time))(jnp.asarray([1.0, 1.0]))
    np.testing.assert_allclose(twice, jnp.stack([alone, alone]), rtol=1e-12, atol=1e-15)
    single = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), (numbers, values, time))
    found = angles(*single)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, alone, atol=1e-5)


def test_the_parts_of_a_prepared_method():
    method = QUANTITIES["bank"].METHODS["filter"].make(dataclasses.replace(REAR, sensor_position=(1.0, 0.0, 0.0)))
    assert isinstance(method, kit.AbstractSmoothable) and type(method.inner.inner).__name__ == "Leaning"
    assert [need.channel for need in method.needs].count("yaw_rate") == 1


def rolling_wheels(front, rear, v_x):
    """The speeds (m/s) of wheels that roll on their circles, turned by these angles (rad), and the yaw rate."""
    yaw_rate = v_x * (np.tan(front) - np.tan(rear)) / PLAIN.wheelbase
    speeds = [np.hypot(v_x - s * 0.75 * yaw_rate, v_x * np.tan(angle)) for angle in (front, rear) for s in (1, -1)]
    return dict(zip(vehicles.kit.wheel_names("wheel_speed"), speeds, strict=True)), yaw_rate


@pytest.mark.parametrize(
    ("front", "rear", "v_x"), [(0.35, 0.0, 5.0), (0.0, 0.35, 5.0), (0.25, -0.25, 4.0), (0.1, 0.1, 12.0)]
)
def test_wheels_of_a_tight_bend_do_not_slide_wherever_they_point(front, rear, v_x):
    wheels, yaw_rate = rolling_wheels(front, rear, v_x)
    heard = {"dt": 0.01, "a_y": v_x * yaw_rate, "yaw_rate": yaw_rate, **wheels} | ({"steer_rear": rear} if rear else {})
    heard = {name: jnp.asarray(value) for name, value in heard.items()}
    sliding, time = Sliding(), jnp.asarray(0.0)
    doubt = sliding.next(sliding.start(time), heard, jnp.asarray(v_x), jnp.asarray(0.0), PLAIN.wheelbase).doubt
    assert float(doubt.along) < 0.03


def test_the_angle_of_a_standing_car_s_wheels_is_no_slip_angle():
    made = method_logs.channels(speed=0.0)
    log = Recording(made["time"], {need.channel: made[need.channel] for need in estimators.sideslip.needs})
    steered, straight = (
        estimators.sideslip.estimate(car, log.replace(steer_rear=np.full(len(log), 0.4))) for car in (REAR, PLAIN)
    )
    np.testing.assert_allclose(steered.mean.slip_angle_rear, straight.mean.slip_angle_rear, atol=1e-12)


def test_a_log_is_checked_against_such_a_car():
    made = method_logs.channels(rows=3000, rear=TURNED)
    names = ("v_x", "yaw_rate", "a_y", "a_x", "steer", "steer_rear")
    log = Recording(made["time"], {name: made[name] for name in names})
    judged = lambda car, log: {(one.channel, one.severity) for one in diagnostics.check_log(log, car=car)}
    found = judged(REAR, log)
    assert not {severity for _, severity in found} & {"error"} and ("steer", "warning") not in found
    assert ("steer_rear", "warning") in judged(PLAIN, log)
    assert ("steer_rear", "warning") not in judged(PLAIN, log.replace(steer_rear=0.0 * made["steer_rear"]))
    wrong = judged(REAR, log.replace(steer_rear=-made["steer_rear"]))
    assert {("steer", "note"), ("yaw_rate", "note")} <= wrong and not {("steer", "note"), ("yaw_rate", "note")} & found
    missing = [one for one in diagnostics.check_log(log.without("steer_rear"), car=REAR) if one.channel == "steer_rear"]
    assert [one.severity for one in missing] == ["error"] and "is missing, but the car's file has" in missing[0].message
    wheels = log.without("steer_rear").replace(steer_rl=made["steer_rl"], steer_rr=made["steer_rr"])
    assert ("steer_rl", "warning") in judged(PLAIN, wheels)
    assert not {severity for _, severity in judged(REAR, wheels)} & {"error"}
    spike = np.zeros(3000)
    spike[100] = 0.3
    assert ("steer_rear", "warning") not in judged(PLAIN, log.replace(steer_rear=spike))


class Levered(vehicles.AbstractSteering):
    inputs: ClassVar[tuple] = ("lever",)
    front_alone: ClassVar[bool] = True

    def angles(self, car, u, v_x):
        return u.lever, u.lever, 0.0, 0.0

    def axle_gains(self, v_x):
        return 1.0, 0.0


def test_the_baseline_drives_with_all_four_wheels():
    car = vehicles.passenger_car()
    time = 0.05 * np.arange(100.0)
    steer, v_x = 0.02 * np.sin(time), np.full(100, 15.0)
    log = Recording(time, {"steer": steer, "v_x": v_x, "steer_rear": 0.25 * steer})
    log = log.replace(steer_fl=1.1 * steer, steer_fr=0.9 * steer, steer_rl=0.2 * steer, steer_rr=0.3 * steer)
    of = lambda steering: open_loop(dataclasses.replace(car, steering=steering), log)
    by_ratio = of(vehicles.FourWheelSteering(0.25))
    for steering in (vehicles.RearSteering(), vehicles.IndependentSteering()):
        for name, values in of(steering).items():
            np.testing.assert_allclose(values, by_ratio[name], rtol=1e-9, atol=1e-12)
    straight = of(vehicles.FrontSteering())["yaw_rate"]
    np.testing.assert_allclose(by_ratio["yaw_rate"][20:], 0.75 * straight[20:], atol=0.05 * np.abs(straight).max())
    # In the steady turn of a constant steer, rear wheels that turn by a quarter of it take a quarter of the yaw rate.
    held = log.replace(steer=np.full(100, 0.02))
    turns = lambda steering: open_loop(dataclasses.replace(car, steering=steering), held)["yaw_rate"][-1]
    ratio = turns(vehicles.FourWheelSteering(0.25)) / turns(vehicles.FrontSteering())
    np.testing.assert_allclose(ratio, 0.75, rtol=1e-3)
    # A car inside another is driven by its own steering; one that is steered by something else is refused.
    inside = vehicles.Travelling(dataclasses.replace(car, steering=vehicles.RearSteering()))
    np.testing.assert_allclose(open_loop(inside, log)["yaw_rate"], by_ratio["yaw_rate"], rtol=1e-9, atol=1e-12)
    with pytest.raises(
        InputError, match=r"open_loop: car.steering = Levered: needs lever; must be a steering whose inputs"
    ):
        open_loop(dataclasses.replace(car, steering=Levered()), log)
    with pytest.raises(
        InputError, match=r"open_loop_of: car.steering = RearSteering: needs steer_rear \(rad\) as well"
    ):
        open_loop_of(dataclasses.replace(car, steering=vehicles.RearSteering()), time, steer, v_x)
    with pytest.raises(InputError, match=r"open_loop: steer_rear \(rad\) is missing"):
        open_loop(dataclasses.replace(car, steering=vehicles.RearSteering()), log.without("steer_rear"))
    # Of a file, from what the log has.
    told = estimators.sideslip.do_nothing(REAR, log)
    assert np.abs(told["sideslip"] - estimators.sideslip.do_nothing(PLAIN, log)["sideslip"]).max() > 1e-3
    assert not estimators.sideslip.do_nothing(REAR, log.select(["steer", "v_x"]))["sideslip"].any()
    slower = log.replace(steer_rear=np.where(np.arange(100) % 5 == 0, 0.25 * steer, np.nan))
    for one in (REAR, STEERED["independent"]):
        found = estimators.sideslip.do_nothing(one, slower)
        np.testing.assert_allclose(found["sideslip"], told["sideslip"], atol=1e-3)
