"""Drives of cars with fourteen degrees of freedom on roads that bank and climb, and what production sensors say of them."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import manoeuvres, roads, sensors, vehicles
from jaxveh.estimators import kit
from jaxveh.simulation import simulate

DEGREE = np.pi / 180.0
G = 9.81
RATIO = 16.0
STEP = 0.01
BOUNDS = {
    **dict.fromkeys(("a_x", "a_y", "a_z"), 0.1), **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate"), 0.2 * DEGREE),
    "steering_wheel": 0.5 * DEGREE,
}  # fmt: skip
"""Offsets of sensors are drawn evenly within these."""

KEPT = [
    "v_x",
    "v_y",
    "yaw",
    "yaw_rate",
    "yaw_acceleration",
    "a_x",
    "a_y",
    "a_z",
    "roll",
    "pitch",
    "roll_rate",
    "pitch_rate",
    "roll_acceleration",
    "pitch_acceleration",
    "x",
    "y",
    "grade",
    "bank",
    "steer",
    "omega_fl",
    "omega_fr",
    "omega_rl",
    "omega_rr",
    "omega_to_body_fl",
    "omega_to_body_fr",
    "omega_to_body_rl",
    "omega_to_body_rr",
]


def drives(car, seeds, duration, steering=None):
    """The truth of one car's drives, (seeds, rows) a channel: winding paths, a speed that wavers, random bank and grade. With a
    `steering` of its own, the angle of the rear left wheel is among the channels."""
    numbers, vehicle = vehicles.kit.CARS[car](), vehicles.named_car(car, "fourteen-dof")
    kept = KEPT
    if steering is not None:
        vehicle, kept = dataclasses.replace(vehicle, steering=steering), [*KEPT, "steer_rl"]

    def one(seed):
        keys = jax.random.split(jax.random.key(seed), 4)
        u = jax.random.uniform(keys[0], (5,))
        mean, wave, a_y = 14.0 + 12.0 * u[0], 200.0 + 300.0 * u[1], 1.0 + 2.0 * u[2]
        amplitude = jnp.minimum(a_y / (mean * 2.0 * jnp.pi / wave) ** 2, 0.06 * wave)
        bank = roads.gauss_markov(0.01 + 0.025 * u[4], 150.0, keys[2])
        road = roads.RandomRoad(grade=roads.gauss_markov(0.015 + 0.025 * u[3], 200.0, keys[1]), bank=bank)
        path = manoeuvres.Sine(amplitude=amplitude, wavelength=wave, start=30.0, periods=50.0)
        speed = manoeuvres.wavering_speed(mean, 0.12 * mean, keys[3], time=8.0, fastest=4.0)
        driver = manoeuvres.PathDriver(
            path=path, speed=speed, duration=duration, wheelbase=numbers.wheelbase, preview_time=1.0
        )
        pedals = manoeuvres.SpeedControl(driver, numbers.mass, wheel_radius=numbers.wheel_radius)
        drive = simulate(
            vehicle, pedals, road=road, dt=STEP, max_step=0.0025, solver="explicit", start={"v_x": speed.at(0.0)[0]},
            throw=False,
        )  # fmt: skip
        return {name: drive[f"true.{name}"] for name in kept} | {n: drive[n] for n in ("drive_torque", "brake_torque")}

    return jax.tree.map(np.asarray, jax.jit(jax.vmap(one))(jnp.asarray(seeds)))


def turning_road(truth, time):
    """What a road that banks and climbs turns a car by, about its x and y axes (rad/s), which the simulation leaves out."""
    along, across = np.tan(truth["grade"]), np.tan(truth["bank"])
    run = np.hypot(1.0, along)
    rise = np.hypot(run, across)
    x = np.stack([1.0 / run, 0.0 * along, along / run], -1)
    z = np.stack([-along / rise, -across / rise, 1.0 / rise], -1)
    axes = np.stack([x, np.cross(z, x), z], -1)
    c, s, zero = np.cos(truth["yaw"]), np.sin(truth["yaw"]), np.zeros_like(time)
    heading = np.stack(
        [np.stack([c, -s, zero], -1), np.stack([s, c, zero], -1), np.stack([zero, zero, zero + 1.0], -1)], -2
    )
    axes = heading @ axes
    spin = np.swapaxes(axes, 1, 2) @ np.gradient(axes, time, axis=0)
    return spin[:, 2, 1], spin[:, 0, 2]


def horizon_roll(truth):
    """The body's roll against the horizon, rad."""
    along, across = np.tan(truth["grade"]), np.tan(truth["bank"])
    run = np.hypot(1.0, along)
    rise = np.hypot(run, across)
    x, y, z = along / run, across / (run * rise), 1.0 / rise
    z = np.cos(truth["pitch"]) * z + np.sin(truth["pitch"]) * x
    c, s = np.cos(truth["roll"]), np.sin(truth["roll"])
    return np.arctan2(c * y + s * z, c * z - s * y)


def rolling_radius(car):
    """The radius that a control unit stores, m: that of a wheel that rolls under its load at rest."""
    start = vehicles.named_car(car, "fourteen-dof").at_rest(10.0)
    return float(np.mean([10.0 / float(start[f"omega_{at}"]) for at in ("fl", "fr", "rl", "rr")]))


def suite(radius, offsets, six_axes):
    """A production car's sensors with these offsets; `six_axes`: its inertial unit has all six axes."""
    unit, steering, *others = sensors.production_car(radius, steering_ratio=RATIO).devices
    names = ("a_x", "a_y", "a_z", "roll_rate", "pitch_rate", "yaw_rate") if six_axes else ("a_x", "a_y", "yaw_rate")
    put = lambda signal, name: eqx.tree_at(lambda s: s.bias, signal, jnp.asarray(offsets[name]))
    kind = lambda name: unit.signals["a_x" if name.startswith("a") else "yaw_rate"]
    unit = sensors.IMU({name: put(kind(name), name) for name in names}, low_pass=unit.low_pass, rate=100.0, delay=0.01)
    steering = eqx.tree_at(lambda s: s.signal, steering, put(steering.signal, "steering_wheel"))
    return sensors.Suite((unit, steering, *others))


def heard(car, truth, seed, six_axes=False):
    """What the sensors say of one drive, by channel, their offsets (at the end, with what they have drifted by), and the time."""
    rows = len(truth["v_x"])
    time = STEP * np.arange(rows)
    rng = np.random.default_rng(seed)
    offsets = {name: rng.uniform(-bound, bound) for name, bound in BOUNDS.items()}
    about_x, about_y = turning_road(truth, time)
    outputs = truth | {"roll_rate": truth["roll_rate"] + about_x, "pitch_rate": truth["pitch_rate"] + about_y}
    outputs = {name: jnp.asarray(value) for name, value in outputs.items()}
    radius = rolling_radius(car)
    say = lambda offsets, key: suite(radius, offsets, six_axes).record(time, outputs, float(time[-1]), key).channels
    said, exact = say(offsets, jax.random.key(seed)), say(dict.fromkeys(offsets, 0.0), None)
    end = {name: float(np.nanmean((said[name] - exact[name])[-1000:])) for name in BOUNDS if name in said}
    torques = {name: truth[name] for name in ("drive_torque", "brake_torque")}
    return {name: np.asarray(value) for name, value in said.items()} | torques, offsets | end, time


def file_of(car, mass=1.0):
    """The car's file, with a mass that is wrong by a factor, and air and rolling resistance by a tenth."""
    told = vehicles.specification_of(vehicles.kit.CARS[car]())
    wrong = {name: (getattr(told, name) or 0.0) * by for name, by in (("drag", 0.9), ("rolling_resistance", 1.15))}
    return dataclasses.replace(
        told, mass=told.mass * mass, wheel_radius=rolling_radius(car), steering_ratio=RATIO, **wrong
    )


def follow_all(method_of_car, cases, time):
    """What methods of one structure say of cases (car, channels): answers with (cases, rows) in each field."""
    methods = [method_of_car(car) for car, _ in cases]
    numbers = [eqx.partition(method, eqx.is_array) for method in methods]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *[leaves for leaves, _ in numbers])
    nothing = np.full(len(time), np.nan)
    values = {
        need.channel: jnp.stack([jnp.asarray(channels.get(need.channel, nothing)) for _, channels in cases])
        for need in methods[0].needs
    }
    return jax.tree.map(np.asarray, _followed(eqx.combine(stacked, numbers[0][1]), jnp.asarray(time), values))


@eqx.filter_jit
def _followed(methods, time, values):
    """Compiled once for methods of one structure and as many cases and rows."""
    follow = eqx.filter_vmap(kit.follow_rows, in_axes=(eqx.if_array(0), None, 0))
    return follow(methods, time, values)
