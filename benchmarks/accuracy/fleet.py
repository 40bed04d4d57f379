"""A fleet of simulated cars: full cars on winding roads, with the sensors of production cars and car files with errors.

The truth is the car of fourteen degrees of freedom on MF-Tyres. It shares only the laws of mechanics with the estimator, which is
a single track with its own tyre law, without roll, pitch and road.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import Recording, io, manoeuvres, numerics, roads, sensors, simulate, vehicles

from .logs import Log

DT = 0.01
"""Step between rows of the logs, s."""

MAX_STEP = 0.002
"""Largest step of the simulation, s; shorter than wheel hop and spins at these speeds need."""

LATEST = 5
"""Largest delay, or lead, of the steering channel relative to the inertial unit, rows."""


class Drive(NamedTuple):
    """A way of driving: the mean `speed` (m/s) on dry road, and the share of the tyres' `grip` that the sharpest corners need."""

    speed: float
    grip: float


DRIVES = {
    "motorway": Drive(30.0, 0.25),
    "country road": Drive(22.0, 0.45),
    "brisk": Drive(20.0, 0.65),
    "at the limit": Drive(18.0, 0.9),
}

SPREADS = {"mass": 0.15, "yaw_inertia": 0.2, "cg": 0.1}
"""Relative standard deviations of the values in a car file about the truth; `cg`: of the distance to the front axle."""

STIFFNESS = (0.6, 1.6)
"""Range of an axle's cornering stiffness in the car file over the truth, uniform on the logarithm."""

ROUGHNESS = (8e-6, 256e-6)
"""Range of the roads' unevenness, m^3, uniform on the logarithm: half of ISO 8608's class A, to class C."""

SHORTEST_WAVE, WAVES = 1.0, 40
"""Shortest wavelength of the unevenness, m, and number of waves; shorter ones shake the wheels, but have no effect on an
accelerometer below 15 Hz."""

BIASES = {"a_y": 0.3, "a_x": 0.3, "yaw_rate": np.radians(0.3), "steer": np.radians(0.5), "v_x": 0.005}
"""Standard deviations of constant sensor errors: m/s^2, rad/s, rad at the road wheels; of the speed's gain."""


LOST = np.radians(30.0)
"""Sideslip above which the car is lost, rad; its log ends a second before, and is dropped if shorter than `LEAST`."""

LEAST = 30.0
"""Shortest log, s."""


class WindingRoad(manoeuvres.AbstractGraph):
    """A road whose curvature is random along x: harmonics of equal energy between two wavelengths.

    `curvature` (1/m): its standard deviation. `wavenumbers` (1/m) and `phases` (rad): (n,) each.
    """

    curvature: jax.Array
    wavenumbers: jax.Array
    phases: jax.Array

    def y(self, x):
        k = 2 * jnp.pi * self.wavenumbers
        turns = k * jnp.asarray(x)[..., None] + self.phases
        # y'' of each harmonic has the standard deviation `curvature` / sqrt(n); the road starts at the origin along x.
        size = self.curvature * jnp.sqrt(2.0 / self.wavenumbers.size) / k**2
        wave = (
            numerics.sin(turns) - numerics.sin(self.phases) - k * jnp.asarray(x)[..., None] * numerics.cos(self.phases)
        )
        return jnp.sum(size * wave, axis=-1)


class Run(NamedTuple):
    """The numbers of one run, or of many in a batch: the car, its road, its driver, its sensors' constant errors, a key."""

    car: Any
    road: Any
    driver: Any
    biases: Any
    key: Any


class FleetLog(NamedTuple):
    """A `Log` of the fleet, and hidden values: the car's name, its drive, the road's friction, bank and roughness (m^3)."""

    log: Log
    car: str
    drive: str
    friction: float
    banked: bool
    roughness: float


def cars() -> dict[str, vehicles.CarNumbers]:
    """Return the parameter sets that have a suspension, on tyres of one law."""
    made = {name: make() for name, make in vehicles.sets.CARS.items()}
    plain = lambda tyre: dataclasses.replace(tyre, coefficients=None)
    return {
        name: dataclasses.replace(numbers, front=plain(numbers.front), rear=plain(numbers.rear), four_motors=False)
        for name, numbers in made.items()
        if numbers.suspension is not None
    }


def fleet(runs: int, seed: int = 0, duration: float = 90.0) -> list[FleetLog]:
    """Return logs of up to `runs` drives of `duration` s, with every car and every drive in turn, simulated by one program.

    A drive ends when its car is `LOST` or stands, and is left out if that is sooner than `LEAST`.
    """
    rng, numbers = np.random.default_rng(seed), cars()
    names, drives = list(numbers), list(DRIVES)
    plans = [(names[i % len(names)], drives[(i // len(names)) % len(drives)]) for i in range(runs)]
    drawn = [_draw(numbers[car], DRIVES[drive], rng, duration) for car, drive in plans]
    stacked = jax.tree.map(
        lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *[run for run, _ in drawn]
    )
    said, truth = simulate_runs(stacked)
    said, truth = (jax.tree.map(np.asarray, one) for one in (said, truth))
    found = []
    for i, ((car, drive), (run, told)) in enumerate(zip(plans, drawn, strict=True)):
        channels = shift_steer({name: values[i] for name, values in said.items()}, rng)
        v_y = truth["v_y"][i] + told.cg_error * truth["yaw_rate"][i]
        recording = Recording(DT * np.arange(len(v_y)), {**channels, "v_y": v_y}, source=f"fleet {i}")
        kept = _until_lost(recording)
        if kept is None:
            continue
        # The reference is the truth at the centre of gravity of the car file.
        name = f"fleet {i}: {car}, {drive}"
        shape = run.road.grade
        banked = bool(shape.bank.std > 1e-6)
        found.append(FleetLog(Log(name, told.file, kept), car, drive, float(shape.friction), banked, told.roughness))
    return found


def _until_lost(recording: Recording) -> Recording | None:
    v_x, v_y = np.asarray(recording["v_x"]), np.asarray(recording["v_y"])
    lost = np.flatnonzero((np.abs(np.arctan2(v_y, v_x)) > LOST) | (v_x < 2.0))
    rows = len(recording) if lost.size == 0 else int(lost[0] - 1.0 / DT)
    return recording.rows(slice(0, rows)) if rows * DT >= LEAST else None


class Told(NamedTuple):
    """A car file, the distance (m) of its centre of gravity ahead of the true one, and the roughness of its road (m^3)."""

    file: io.CarSpecification
    cg_error: float
    roughness: float


def _draw(numbers: vehicles.CarNumbers, drive: Drive, rng: np.random.Generator, duration: float) -> tuple[Run, Told]:
    friction = rng.uniform(0.4, 1.0)
    key = jax.random.key(int(rng.integers(2**31)))
    bank, speed, way, own, uneven = jax.random.split(key, 5)
    car = vehicles.build(numbers, vehicles.FourteenDOF)
    bank_std = 0.04 if rng.random() < 0.5 else 1e-9
    shape = roads.RandomRoad(bank=roads.gauss_markov(bank_std, 60.0, bank), friction=friction)
    roughness = float(np.exp(rng.uniform(*np.log(ROUGHNESS))))
    road = roads.Combined(shape, shape, height=roads.rough(roughness, uneven, shortest=SHORTEST_WAVE, count=WAVES))
    grip = friction * min(numbers.front.friction, numbers.rear.friction)
    mean = drive.speed * np.sqrt(min(grip, 1.0)) * rng.uniform(0.85, 1.15)
    wanted = manoeuvres.wavering_speed(mean, 0.1 * mean, speed, time=15.0)
    # The largest curvature of a sum of many harmonics is about two and a half times its standard deviation.
    curvature = drive.grip * grip * vehicles.GRAVITY / mean**2 / 2.5
    path = WindingRoad(curvature, *numerics.band_harmonics(way, 1.0 / 400.0, 1.0 / 60.0, 40))
    driver = manoeuvres.SpeedControl(
        manoeuvres.PathDriver(duration, path, wanted, wheelbase=numbers.wheelbase),
        car.mass,
        wheel_radius=numbers.wheel_radius,
    )
    return Run(car, road, driver, draw_biases(rng), own), draw_file(numbers, rng, roughness)


def draw_biases(rng: np.random.Generator) -> dict[str, float]:
    """Draw the constant errors of the sensors."""
    return {name: std * rng.normal() for name, std in BIASES.items()}


def draw_file(numbers: vehicles.CarNumbers, rng: np.random.Generator, roughness: float) -> Told:
    """Draw the errors of a car file."""
    factor = lambda name: float(np.exp(SPREADS[name] * rng.normal()))
    stiffness = lambda tyre: 2.0 * tyre.cornering_stiffness * float(np.exp(rng.uniform(*np.log(STIFFNESS))))
    front_axle_to_cg = min(numbers.front_axle_to_cg * factor("cg"), 0.75 * numbers.wheelbase)
    file = io.CarSpecification(
        mass=numbers.mass * factor("mass"), yaw_inertia=numbers.yaw_inertia * factor("yaw_inertia"),
        front_axle_to_cg=front_axle_to_cg, rear_axle_to_cg=numbers.wheelbase - front_axle_to_cg,
        front_cornering_stiffness=stiffness(numbers.front), rear_cornering_stiffness=stiffness(numbers.rear),
    )  # fmt: skip
    return Told(file, numbers.front_axle_to_cg - front_axle_to_cg, roughness)


SEEN = ("v_x", "v_y", "yaw_rate", "a_x", "a_y", "a_z", "yaw_acceleration", "steer", "grade", "bank")
POSES = ("roll", "pitch", "roll_rate", "pitch_rate", "roll_acceleration", "pitch_acceleration")


@eqx.filter_jit
@eqx.filter_vmap
def simulate_runs(run: Run) -> tuple[dict, dict]:
    """Return the measurements and the truth of a batch of runs."""
    drive = simulate(run.car, run.driver, road=run.road, dt=DT, max_step=MAX_STEP, solver="explicit", throw=False)
    truth = {name: drive[f"true.{name}"] for name in (*SEEN, *POSES)}
    said = {}
    for device in _devices(run.biases):
        said |= device.read(DT * jnp.arange(float(len(drive))), truth, run.key)
    said["v_x"] = truth["v_x"] * (1 + run.biases["v_x"])
    return said, {name: truth[name] for name in ("v_y", "yaw_rate")}


def _devices(biases: dict) -> tuple:
    degree = np.pi / 180
    accelerometer = lambda name: sensors.Signal(noise=0.05, bias=biases[name], quantisation=1.25e-3)
    imu = sensors.IMU(
        {
            "a_x": accelerometer("a_x"),
            "a_y": accelerometer("a_y"),
            "yaw_rate": sensors.Signal(noise=0.1 * degree, bias=biases["yaw_rate"], quantisation=0.005 * degree),
        },
        low_pass=sensors.LowPass(15.0),
        rate=1 / DT,
    )
    steer = sensors.Signal(bias=biases["steer"], quantisation=0.1 * degree / 16)
    return imu, sensors.SteeringAngle(steer, backlash=degree / 16, rate=1 / DT)


def shift_steer(channels: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Delay the steer by up to `LATEST` rows relative to all other channels, or make it early by as much."""
    rows = int(rng.integers(-LATEST, LATEST + 1))
    at = np.clip(np.arange(len(channels["steer"])) - rows, 0, len(channels["steer"]) - 1)
    return channels | {"steer": channels["steer"][at]}
