"""Cars with steered rear wheels: the recommended method of every quantity includes their angle, the others refuse such a car."""

import dataclasses

import banked_drives
import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
from test_every_method import QUANTITIES, every_quantity

from jaxveh import InputError, Recording, diagnostics, estimators, io, vehicles
from jaxveh.estimators import kit
from jaxveh.estimators.linear_baseline import open_loop, open_loop_of
from jaxveh.estimators.method_of_car import TURNING, method_of
from jaxveh.estimators.rear_steer import RearSteer, rear_steer_of, with_rear_angle

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
"""Those of the default run."""

KNOWING = [
    pytest.param(quantity, name, kind, marks=[] if (quantity, name, kind) in QUICK else [pytest.mark.full])
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
of 30 s. Methods that are not told the angle of the rear wheels, which is 0.06 rad RMS, are off by far more."""


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
        assert off(said, made) <= max(TRUTHS[field], 1.5 * off(plain, straight)), field
        known = lambda said, field=field: np.mean(np.asarray(getattr(said.known, field))[last])
        assert known(said) >= known(plain) - 0.2, field


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
    np.testing.assert_allclose(fitted.front_cornering_stiffness, PLAIN.front_cornering_stiffness, rtol=0.25)
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


@pytest.mark.full
@pytest.mark.parametrize(("quantity", "least"), [("sideslip", 1.2), ("navigation", 1.15), ("bank", 1.15)])
def test_simulated_cars_are_estimated_as_well_as_with_straight_rear_wheels(quantity, least):
    """`least`: how much larger the error is at least if nobody tells of the rear wheels."""
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


def test_the_angle_is_the_measured_one_or_that_of_the_wheels_or_of_the_ratio():
    made = method_logs.channels(rear=TURNED)
    slow = dataclasses.replace(
        STEERED["four-wheel"], rear_steer_ratio_fast=0.2, rear_steer_speed=15.0, steer_offset=0.01
    )
    law = vehicles.kit.steering_of(slow)
    by_ratio = law.ratio(made["v_x"]) * (made["steer"] - 0.01)
    late = rear_steer_of(REAR).late
    for car, names, wanted in (
        (REAR, ("steer_rear",), made["steer_rear"]),
        (STEERED["independent"], ("steer_rl", "steer_rr"), made["steer_rear"]),
        (slow, ("steer", "v_x"), by_ratio),
        (slow, ("steer", "steer_rear", "v_x"), made["steer_rear"]),
    ):
        log = Recording(made["time"], {name: made[name] for name in (*names, "yaw_rate")})
        heard = prepared_rows(car, log)
        shifted = np.interp(made["time"] - float(late), made["time"], wanted)
        np.testing.assert_allclose(heard["steer_rear"][10:], shifted[10:], atol=2e-4)
        np.testing.assert_array_equal(heard["yaw_rate"], made["yaw_rate"])
        # The same as that of the log, which has no delay.
        if names != ("steer", "steer_rear", "v_x"):
            of_log = io.with_road_steer(car, log if "steer" in names else log.replace(steer=made["steer"]))
            np.testing.assert_allclose(of_log["steer_rear"], wanted, rtol=1e-12)
    assert rear_steer_of(PLAIN) is None and prepared_rows(PLAIN, log) is log


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
    never = prepared_rows(REAR, log.replace(steer_rear=np.full(len(log), np.nan)))
    assert np.isnan(never["yaw_rate"]).all()


def test_gradients_float32_and_batches():
    rear = RearSteer(vehicles.FourWheelSteering(0.2, fast_ratio=-0.1), 0.01, 0.03)
    time = jnp.arange(50.0) * 0.02

    def last(rear, steer):
        memory, heard = rear.first(time[0], {"steer": steer[0], "v_x": time[0] + 10.0, "yaw_rate": time[0]})
        for k in range(1, 8):
            memory, heard = rear.next(memory, time[k], {"steer": steer[k], "v_x": time[k] + 10.0, "yaw_rate": time[k]})
        return heard["steer_rear"]

    steer = 0.05 * jnp.sin(3.0 * time)
    slope = jax.grad(lambda r: last(rear.__class__(vehicles.FourWheelSteering(r), 0.01, 0.03), steer))(0.2)
    step = 1e-5
    of = lambda r: last(rear.__class__(vehicles.FourWheelSteering(r), 0.01, 0.03), steer)
    np.testing.assert_allclose(slope, (of(0.2 + step) - of(0.2 - step)) / (2.0 * step), rtol=1e-6)
    both = jax.vmap(lambda s: last(rear, s))(jnp.stack([steer, 2.0 * steer]))
    np.testing.assert_allclose(both, [last(rear, steer), last(rear, 2.0 * steer)], rtol=1e-12)


def test_the_parts_of_a_prepared_method():
    method = QUANTITIES["bank"].METHODS["filter"].make(dataclasses.replace(REAR, sensor_position=(1.0, 0.0, 0.0)))
    assert isinstance(method, kit.AbstractSmoothable) and type(method.inner.inner).__name__ == "Leaning"
    assert [need.channel for need in method.needs].count("yaw_rate") == 1


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
    with pytest.raises(
        InputError, match=r"check_log: steer_rear \(rad\) is missing from the log, but the car's file has"
    ):
        diagnostics.check_log(log.without("steer_rear"), car=REAR)


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
