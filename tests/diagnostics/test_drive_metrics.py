"""Numbers of standards on drives that know them: answers made by hand, and a linear car in closed form."""

import functools
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording, manoeuvres, simulate, vehicles
from jaxveh.diagnostics import (
    braking_test,
    drive_numbers,
    frequency_response,
    peaks,
    sine_with_dwell,
    steady_turns,
    step_response,
    understeer,
)
from jaxveh.diagnostics.drive_channels import channel, crossing, peak

TIME = 0.01 * np.arange(1001)


def linear_car():
    return vehicles.linear(vehicles.passenger_car())


def stiffnesses(car):
    return float(car.front.cornering_stiffness), float(car.rear.cornering_stiffness)


def understeer_gradient(car):
    """m / l (b / C_f - a / C_r), rad s^2/m (M. Mitschke, H. Wallentowitz, Dynamik der Kraftfahrzeuge)."""
    front, rear = stiffnesses(car)
    a, b = float(car.front_axle_to_cg), float(car.rear_axle_to_cg)
    return float(car.mass) / (a + b) * (b / front - a / rear)


def closed_form(car, speed, frequency):
    """Yaw rate and lateral acceleration over steer of the linear single track at frequencies in Hz, complex."""
    front, rear = stiffnesses(car)
    m, J, a, b = (float(v) for v in (car.mass, car.yaw_inertia, car.front_axle_to_cg, car.rear_axle_to_cg))
    A = np.array(
        [
            [-(front + rear) / (m * speed), (b * rear - a * front) / (m * speed) - speed],
            [(b * rear - a * front) / (J * speed), -(a**2 * front + b**2 * rear) / (J * speed)],
        ]
    )
    B = np.array([front / m, a * front / J])
    s = 2j * np.pi * np.asarray(frequency)
    states = np.stack([np.linalg.solve(one * np.eye(2) - A, B) for one in s])
    return {"yaw_rate": states[:, 1], "a_y": s * states[:, 0] + speed * states[:, 1]}


def stepped(answer, start=2.0, height=0.02, **more):
    """A recording whose steer is a step at `start` and whose yaw rate is `answer` of the time since."""
    since = TIME - start
    steer = np.where(since >= 0, height, 0.0)
    return Recording(
        TIME, {"steer": steer, "yaw_rate": np.where(since >= 0, answer(np.maximum(since, 0)), 0.0), **more}
    )


def test_first_order_answer_by_hand():
    found = step_response(stepped(lambda t: 0.2 * (1 - np.exp(-t / 0.4))))
    # The step's row and the one before it: half of the steer is turned in between.
    np.testing.assert_allclose(found.reference, 1.995, atol=1e-9)
    np.testing.assert_allclose(found.response_time, 0.4 * math.log(10) + 0.005, rtol=1e-4)
    np.testing.assert_allclose([found.steady, found.gain, found.steer], [0.2, 10.0, 0.02], rtol=1e-6)
    assert found.overshoot == 0 and math.isnan(found.peak_response_time) and math.isnan(found.peak)


def test_second_order_answer_by_hand():
    damping, natural = 0.5, 6.0
    damped = natural * math.sqrt(1 - damping**2)
    lag = math.acos(damping)
    answer = lambda t: -0.3 * (1 - np.exp(-damping * natural * t) * np.sin(damped * t + lag) / math.sin(lag))
    found = step_response(stepped(answer, height=-0.02))
    overshoot = math.exp(-math.pi * damping / math.sqrt(1 - damping**2))
    np.testing.assert_allclose(found.overshoot, overshoot, rtol=1e-4)
    np.testing.assert_allclose(found.peak_response_time, math.pi / damped + 0.005, rtol=1e-3)
    np.testing.assert_allclose([found.peak, found.gain], [-0.3 * (1 + overshoot), 15.0], rtol=1e-4)


def test_what_was_there_before_the_step_does_not_count():
    answer = lambda t: 0.2 * (1 - np.exp(-t / 0.4))
    clean = stepped(answer)
    offset = clean.replace(steer=clean["steer"] + 0.01, yaw_rate=clean["yaw_rate"] - 0.03)
    np.testing.assert_allclose(step_response(offset), step_response(clean), atol=1e-12)


def test_a_peak_in_the_first_row_after_the_reference_is_seen():
    """The rows before do not count, and so there is no parabola: the row itself is the peak."""
    found = step_response(stepped(lambda t: 0.2 + 0.1 * np.exp(-t / 0.3)))
    np.testing.assert_allclose([found.peak, found.overshoot], [0.3, 0.5], rtol=1e-6)
    np.testing.assert_allclose(found.peak_response_time, 0.005, atol=1e-9)


def test_the_truth_is_looked_at_first_and_gaps_are_bridged():
    rows = np.arange(10.0)
    gaps = np.where(np.arange(10) % 2 == 0, rows, np.nan)
    log = Recording(rows, {"a_y": gaps, "yaw_rate": 0 * rows, "true.yaw_rate": rows, "v_x": np.full(10, np.nan)})
    np.testing.assert_array_equal(channel(log, "a_y")[:9], rows[:9])
    np.testing.assert_array_equal(channel(log, "yaw_rate"), rows)
    with pytest.raises(InputError, match="no channel 'steer'; there are: a_y, yaw_rate, v_x"):
        channel(log, "steer")
    with pytest.raises(InputError, match="v_x has no finite sample"):
        channel(log, "v_x")


def test_crossings_and_peaks_lie_between_rows():
    time = np.array([0.0, 1.0, 2.0, 3.0])
    assert crossing(time, np.array([0.0, 1.0, 3.0, 0.0]), 2.0) == 1.5
    assert math.isnan(crossing(time, np.zeros(4), 2.0))
    np.testing.assert_allclose(peak(time, 5.0 - (time - 1.3) ** 2), (1.3, 5.0))


def without_samples(recording, name, start, end, every=1):
    """The channel with a gap, and with one sample in `every` rows."""
    values = np.array(recording[name])
    values[np.abs(TIME - (start + end) / 2) < (end - start) / 2] = np.nan
    return recording.replace(**{name: np.where(np.arange(TIME.size) % every == 0, values, np.nan)})


@pytest.mark.parametrize(
    ("gap", "words"),
    [
        ((4.0, 4.6), "yaw_rate has no sample after 4.000 s until 4.600 s"),
        ((-1.0, 0.7), "yaw_rate has no sample from the beginning until 0.700 s"),
        ((9.205, 11.0), "yaw_rate has no sample after 9.200 s until the end"),
        ((-1.0, 11.0), "yaw_rate has no finite sample"),
    ],
)
def test_numbers_are_not_taken_from_an_outage(gap, words):
    drive = without_samples(stepped(lambda t: 0.2 * (1 - np.exp(-t / 0.4))), "yaw_rate", *gap)
    with pytest.raises(InputError) as error:
        step_response(drive)
    assert words in str(error.value)
    assert "no finite" in words or "a gap must be at most 0.5 s" in str(error.value)


def test_slow_sensors_and_short_gaps_are_bridged():
    answer = stepped(lambda t: 0.2 * (1 - np.exp(-t / 0.4)))
    ten_hertz = without_samples(answer, "yaw_rate", 5.0, 5.4, every=10)
    np.testing.assert_allclose(step_response(ten_hertz).steady, 0.2, rtol=1e-6)


def test_each_number_looks_at_its_own_span():
    shaken = Recording(TIME, {"steer": np.sin(4 * TIME), "yaw_rate": np.sin(4 * TIME)})
    with pytest.raises(InputError, match="frequency_response: steer has no sample"):
        frequency_response(without_samples(shaken, "steer", 4.0, 5.0))
    brakes = Recording(
        TIME, {"v_x": np.clip(20.0 - 8.0 * (TIME - 4.0), 0.0, 20.0), "brake_torque": 3e3 * (TIME >= 4.0)}
    )
    early = without_samples(brakes, "v_x", 1.0, 3.0)
    np.testing.assert_allclose(braking_test(early), braking_test(brakes))
    for name, gap in (("v_x", (4.5, 5.5)), ("brake_torque", (3.5, 4.5))):
        with pytest.raises(InputError, match=f"braking_test: {name} has no sample"):
            braking_test(without_samples(brakes, name, *gap))
    dwell = without_samples(dwell_drive(), "yaw_rate", 8.0, 9.0)
    np.testing.assert_allclose(sine_with_dwell(dwell)[:7], sine_with_dwell(dwell_drive())[:7])
    for name in ("yaw_rate", "steer", "y"):
        with pytest.raises(InputError, match=f"sine_with_dwell: {name} has no sample"):
            sine_with_dwell(without_samples(dwell_drive(), name, 1.2, 1.8))


def test_steady_turns_leave_gaps_out():
    gap = (TIME > 4.0) & (TIME < 6.0)
    drive = without_samples(turning().replace(steer=np.where(gap, 9.0, turning()["steer"])), "steer", 4.0, 6.0)
    found, whole = steady_turns(drive, 2.5), steady_turns(turning(), 2.5)
    assert found.a_y.size == whole.a_y.size - gap.sum()
    np.testing.assert_allclose(found.steer, 0.01 * found.a_y)
    slow = steady_turns(without_samples(turning(), "steer", 11.0, 12.0, every=100), 2.5)
    np.testing.assert_allclose(slow.a_y, turning()["a_y"][::100])
    late = without_samples(turning().replace(v_x=np.where(TIME < 5.0, 1.0, 20.0)), "steer", 4.9, 11.0)
    with pytest.raises(InputError, match=r"outside gaps of more than 0\.5 s in a_y, sideslip, steer, v_x, yaw_rate"):
        steady_turns(late, 2.5)


def test_step_response_of_a_linear_car():
    car, speed = linear_car(), 25.0
    drive = simulate(car, manoeuvres.step_steer(speed, 0.002, duration=6.0), max_step=0.01)
    gain = speed / (float(car.wheelbase) + understeer_gradient(car) * speed**2)
    np.testing.assert_allclose(step_response(drive).gain, gain, rtol=1e-4)
    np.testing.assert_allclose(step_response(drive, "a_y").gain, speed * gain, rtol=1e-4)
    numbers = drive_numbers(drive, "step-steer")
    np.testing.assert_allclose(numbers["step response of yaw_rate (ISO 7401)"].gain, gain, rtol=1e-4)
    np.testing.assert_allclose(numbers["peaks"].a_y, np.max(np.abs(drive["true.a_y"])))


@pytest.mark.parametrize("kind", ["swept", "random"])
def test_frequency_response_of_a_linear_car(kind):
    car, speed = linear_car(), 25.0
    if kind == "swept":
        manoeuvre = manoeuvres.swept_sine(speed, 0.01, 0.2, 2.5, 40.0)
    else:
        manoeuvre = manoeuvres.random_steering(speed, 0.005, jax.random.key(3), duration=60.0)
    drive = simulate(car, manoeuvre, dt=0.02, max_step=0.02)
    for output in ("yaw_rate", "a_y"):
        found = frequency_response(drive, output)
        inner = (found.frequency >= 0.3) & (found.frequency <= 1.8)
        assert inner.sum() > 10 and found.segments >= 5
        exact = closed_form(car, speed, found.frequency)[output]
        np.testing.assert_allclose(np.abs(found.response / exact)[inner], 1.0, atol=0.01)
        assert np.max(np.abs(np.angle(found.response / exact)[inner])) < np.radians(1.5)
        assert np.min(found.coherence[inner]) > 0.99 and np.max(found.coherence) <= 1 + 1e-9


def test_coherence_is_the_share_of_the_output_that_the_input_explains():
    random = np.random.default_rng(5)
    time = 0.05 * np.arange(20000)
    u, noise = random.standard_normal((2, time.size))
    log = Recording(time, {"steer": u, "yaw_rate": 2.0 * u + 1.0 * noise})
    found = frequency_response(log, segment=10.0)
    np.testing.assert_allclose(np.mean(found.coherence), 4.0 / 5.0, atol=0.01)
    np.testing.assert_allclose(np.mean(np.real(found.response)), 2.0, rtol=0.01)


def test_understeer_gradient_of_a_linear_car():
    car = linear_car()
    steady = manoeuvres.ramp_steer(25.0, 0.03, rise=40.0)
    drive = simulate(car, steady, dt=0.05, max_step=0.05)
    found = understeer(steady_turns(drive, float(car.wheelbase)))
    np.testing.assert_allclose(found.gradient, understeer_gradient(car), rtol=0.01)
    # Sideslip of a linear car in a steady turn: (b / v^2 - m a / (l C_r)) a_y.
    a, b, m, length = (float(v) for v in (car.front_axle_to_cg, car.rear_axle_to_cg, car.mass, car.wheelbase))
    np.testing.assert_allclose(found.sideslip_gradient, b / 625 - m * a / (length * stiffnesses(car)[1]), rtol=0.03)
    numbers = drive_numbers(drive, "ramp-steer", float(car.wheelbase))
    assert numbers["steady turns (ISO 4138)"] == found
    assert set(drive_numbers(drive, "ramp-steer")) == {"peaks"}


@functools.cache
def dwell_steer():
    steering = manoeuvres.sine_with_dwell(20.0, 0.1, duration=10.0)
    return np.asarray(jax.jit(lambda time: steering.inputs(time).steer)(TIME))


def dwell_drive(peak_yaw=0.4, left=(0.1, 0.05), y=3.0, side=1.0):
    """A sine with dwell from t = 1 s on, whose yaw rate has a peak of 0.4 at 2.5 s and is left at 1 and 1.75 s after its end."""
    steer = dwell_steer()
    completed = 1.0 + 1 / 0.7 + 0.5
    knots = [0.0, 1.0, 1.5, 2.5, completed + 1.0, completed + 1.75, 10.0]
    yaw_rate = np.interp(TIME, knots, [0.0, 0.0, 0.3, -peak_yaw, -left[0], -left[1], 0.0])
    top = np.abs(TIME - 2.5) < 0.3
    yaw_rate[top] = -peak_yaw * (1.0 - (TIME[top] - 2.5) ** 2)
    path = np.where(TIME >= 1.0, y * (TIME - 1.0) ** 2, 0.0)
    channels = {"steer": steer, "yaw_rate": yaw_rate, "yaw": 0 * TIME, "x": 20 * TIME, "y": path, "a_y": 0 * TIME}
    return Recording(TIME, {name: side * values if name != "x" else values for name, values in channels.items()})


@pytest.mark.parametrize("left", [0.7, 1.0])
def test_offsets_of_the_sensors_are_taken_out(left):
    """1 deg/s in the gyroscope, 2 degrees at the steering wheel and 0.3 m/s^2 say nothing of the car; also where less than a
    second of straight driving is left."""
    clean = (
        dwell_drive().without("x", "y", "yaw").replace(a_y=np.where(TIME >= 1.1, 3.0, 0.0)).between(1.0 - left, 11.0)
    )
    shifts = {"yaw_rate": math.radians(1.0), "steer": math.radians(2.0) / 16, "a_y": 0.3}
    for sign in (1.0, -1.0):
        shifted = clean.replace(**{name: np.asarray(clean[name]) + sign * by for name, by in shifts.items()})
        np.testing.assert_allclose(sine_with_dwell(shifted)[:7], sine_with_dwell(clean)[:7], atol=1e-9)


@pytest.mark.parametrize(
    ("y", "steer_at_03g", "amplitude", "responsive", "passed"),
    [
        (1.2, 0.02, 5.0, False, False),
        (1.2, 0.021, 4.76, None, True),
        (3.0, 0.021, 4.76, None, True),
        (3.0, 0.02, 5.0, True, True),
        (1.2, None, math.nan, None, None),
        (3.0, None, math.nan, True, True),
    ],
)
def test_the_displacement_has_a_limit_from_five_times_the_steer_at_03g_on(
    y, steer_at_03g, amplitude, responsive, passed
):
    found = sine_with_dwell(dwell_drive(y=y), steer_at_03g=steer_at_03g)
    np.testing.assert_allclose(found.amplitude, amplitude, rtol=1e-3)
    assert found.responsive is responsive and found.passed is passed
    assert drive_numbers(dwell_drive(y=y), "sine-with-dwell", steer_at_03g=steer_at_03g)[
        "sine with dwell (FMVSS 126)"
    ].responsive is responsive  # fmt: skip


def test_heavier_cars_have_a_shorter_displacement_to_reach():
    drive = dwell_drive(y=1.5)
    limits = {limit: sine_with_dwell(drive, steer_at_03g=0.02, displacement_limit=limit) for limit in (1.83, 1.52)}
    assert 1.52 < limits[1.52].displacement < 1.83
    assert [found.responsive for found in limits.values()] == [False, True]
    assert all(type(value) in (float, bool) for value in limits[1.52])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_sine_with_dwell_by_hand(side):
    found = sine_with_dwell(dwell_drive(side=side))
    np.testing.assert_allclose(found.completed, 1.0 + 1 / 0.7 + 0.5, atol=0.03)
    begin = math.asin(math.radians(5) / 16 / 0.1) / (2 * math.pi * 0.7)
    np.testing.assert_allclose(found.begins, 1.0 + begin, atol=0.01)
    np.testing.assert_allclose([found.peak, found.peak_at], [0.4, 2.5], atol=1e-9)
    np.testing.assert_allclose([found.ratio_1_00, found.ratio_1_75], [0.25, 0.125], atol=0.01)
    np.testing.assert_allclose(found.displacement, 3.0 * (found.begins - 1.0 + 1.07) ** 2, rtol=1e-4)
    assert found.stable and found.responsive and found.passed


@pytest.mark.parametrize(
    ("changes", "stable", "responsive"),
    [
        ({"left": (0.15, 0.05)}, False, True),
        ({"left": (0.13, 0.09)}, False, True),
        ({"y": 1.2}, True, False),
    ],
)
def test_sine_with_dwell_beyond_each_limit(changes, stable, responsive):
    found = sine_with_dwell(dwell_drive(**changes), steer_at_03g=0.02)
    assert (found.stable, found.responsive, found.passed) == (stable, responsive, False)


def test_displacement_without_a_position_is_integrated():
    drive = dwell_drive()
    bare = drive.without("x", "y", "yaw").replace(a_y=np.where(TIME >= 1.0, 2.0, 0.0))
    found = sine_with_dwell(bare)
    np.testing.assert_allclose(found.displacement, 0.5 * 2.0 * 1.07**2, rtol=0.02)


def test_braking_by_hand():
    """8 m/s^2 from 20 m/s on: the way is that of uniform deceleration."""
    v_x = np.maximum(20.0 - 8.0 * np.maximum(TIME - 1.0, 0.0), 0.0)
    slip = np.where(TIME >= 1.0, -0.1, 0.0)
    torque = np.where(TIME >= 1.0, 3000.0, 0.0)
    log = Recording(TIME, {"v_x": v_x, "brake_torque": torque, "slip_ratio_fl": slip, "slip_ratio_rr": 2 * slip})
    found = braking_test(log)
    np.testing.assert_allclose([found.begins, found.speed], [1.0, 20.0], atol=0.011)
    np.testing.assert_allclose([found.mean_deceleration, found.peak_deceleration], 8.0, rtol=1e-3)
    np.testing.assert_allclose(found.distance, (20.0**2 - 2.0**2) / 16.0, rtol=0.01)
    assert found.most_slip == 0.2
    bare = braking_test(log.without("brake_torque", "slip_ratio_fl", "slip_ratio_rr"))
    np.testing.assert_allclose(bare.mean_deceleration, 8.0, rtol=1e-3)
    assert math.isnan(bare.most_slip)


def test_a_car_that_does_not_become_slow_has_no_mean_deceleration():
    found = braking_test(Recording(TIME, {"v_x": 20.0 - 0.5 * TIME}))
    assert math.isnan(found.mean_deceleration) and math.isnan(found.distance)
    np.testing.assert_allclose(found.peak_deceleration, 0.5)


def test_peaks_are_of_either_sign_and_loads_of_the_lightest_wheel():
    log = Recording(
        TIME, {"a_y": -TIME, "yaw_rate": 0.1 * TIME, "v_x": 10 + 0 * TIME, "v_y": 0 * TIME, "load_fl": TIME + 3}
    )
    found = peaks(log)
    assert (found.a_y, found.yaw_rate, found.sideslip, found.least_load) == (10.0, 1.0, 0.0, 3.0)


BAD = {
    "no step": (lambda: step_response(Recording(TIME, {"steer": np.sin(TIME), "yaw_rate": TIME})), "not a step that is held"),
    "no steer": (lambda: step_response(Recording(TIME, {"steer": 0 * TIME, "yaw_rate": TIME})), "not a step that is held"),
    "average": (lambda: step_response(stepped(lambda t: t), average=0.0), "average = 0.0: must be positive"),
    "still steer": (lambda: frequency_response(Recording(TIME, {"steer": 0 * TIME, "yaw_rate": TIME})), "is constant"),
    "long segment": (lambda: frequency_response(stepped(lambda t: t), segment=60.0), "segment = 60.0: must be at most"),
    "short segment": (lambda: frequency_response(stepped(lambda t: t), segment=0.05), "5 rows"),
    "no wheelbase": (lambda: understeer(steady_turns(turning())), "give `steady_turns` the car's wheelbase"),
    "one turn": (lambda: understeer(steady_turns(turning(0.0), 2.5)), "over too small a range"),
    "wheelbase": (lambda: steady_turns(turning(), -2.5), "wheelbase = -2.5: must be positive"),
    "not a sine": (lambda: sine_with_dwell(stepped(lambda t: t)), "never turns faster than 75 deg/s for 0.2 s"),
    "held sine": (lambda: sine_with_dwell(dwell_drive().between(0.0, 2.7)), "return to zero"),
    "A": (lambda: sine_with_dwell(dwell_drive(), steer_at_03g=0.0), "steer_at_03g = 0.0: must be positive"),
    "displacement": (lambda: sine_with_dwell(dwell_drive(), displacement_limit=-1.0), "displacement_limit = -1.0: must be"),
    "short sine": (lambda: sine_with_dwell(dwell_drive().between(0.0, 4.5)), "drive longer"),
    "ratio": (lambda: sine_with_dwell(dwell_drive(), steering_ratio=0.0), "steering_ratio = 0.0: must be positive"),
    "no braking": (lambda: braking_test(Recording(TIME, {"v_x": 20.0 + 0 * TIME})), "does not brake"),
}  # fmt: skip


def turning(rate=0.03):
    a_y = 1.0 + rate * TIME * 10
    return Recording(
        TIME, {"v_x": 20 + 0 * TIME, "steer": 0.01 * a_y, "a_y": a_y, "yaw_rate": a_y / 20, "sideslip": 0 * TIME}
    )


@pytest.mark.parametrize("name", BAD)
def test_bad_input(name):
    make, words = BAD[name]
    with pytest.raises(InputError) as error:
        make()
    assert words in str(error.value)


def test_float32_drives_are_looked_at_in_float64():
    car = eqx.tree_at(lambda c: c.mass, linear_car(), jnp.asarray(1420.0))
    drive = simulate(car, manoeuvres.step_steer(20.0, 0.02, duration=3.0), max_step=0.01)
    single = Recording(drive.time, {name: np.asarray(drive[name], np.float32) for name in drive.names})
    np.testing.assert_allclose(step_response(single), step_response(drive), rtol=1e-3)


def test_a_log_cut_out_of_a_drive_has_its_means_taken():
    """A sine that runs at both ends, about an offset: the offset does not leak into the lowest frequencies."""
    time = 0.02 * np.arange(3000)
    wave = sum(np.sin(2 * np.pi * f * time + f) for f in (0.3, 0.7, 1.1))
    log = Recording(time, {"steer": 0.5 + 0.01 * wave, "yaw_rate": 3.0 + 0.04 * wave})
    found = frequency_response(log, segment=20.0)
    np.testing.assert_allclose(found.response, 4.0, rtol=1e-6)
    assert found.frequency[0] > 0.2
