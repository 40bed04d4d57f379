"""The drives: a car with a motor in each wheel on a slalom on a slippery road."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import manoeuvres, numerics, roads, tyres, vehicles
from jaxveh._core.names import record
from jaxveh._core.parameter import parameter
from jaxveh.experiments.federated_ckf.settings import Study
from jaxveh.manoeuvres import AbstractManoeuvre, AbstractSpeed, DriverInputs
from jaxveh.manoeuvres import kit as manoeuvres_kit
from jaxveh.simulation import simulate
from jaxveh.statespace import Gaussian, RolledRK4
from jaxveh.tyres import Dugoff, Similarity
from jaxveh.vehicles import SevenDOF, sets
from jaxveh.vehicles import kit as vehicles_kit

WHEELS = vehicles_kit.wheel_names("omega")
PULLS = vehicles_kit.wheel_names("pull")
FRICTIONS = vehicles_kit.wheel_names("friction")
STEERS = vehicles_kit.wheel_names("steer")


class Drive(NamedTuple):
    """The channels that filters may use, (T,) each, and the truth.

    Measured: `a_x`, `a_y` (m/s^2), `yaw_rate` (rad/s), `omega` of the wheels (rad/s; (T, 4): front left, front right, rear left,
    rear right). Known: `steer` of the wheels (rad, (T, 4)), `torque` of the motors (N m, (T, 4)). Truth: `true_v_x`, `true_v_y`
    (m/s), `true_yaw_rate` (rad/s), `true_sideslip` (rad), `true_friction` under each wheel (-, (T, 4)).
    """

    a_x: Any
    a_y: Any
    yaw_rate: Any
    omega: Any
    steer: Any
    torque: Any
    true_v_x: Any
    true_v_y: Any
    true_yaw_rate: Any
    true_sideslip: Any
    true_friction: Any


class Slalom(AbstractManoeuvre):
    """A sine of `steer` (rad) and `frequency` (Hz) at a varying speed; it fades in over the first second. The rear wheels
    turn by `rear` (-) times as much: the manoeuvre gives all four angles."""

    speed: AbstractSpeed
    duration: float = eqx.field(static=True)
    frequency: float = eqx.field(static=True)
    steer: jax.Array = parameter("rad", scale=0.1)
    rear: float = eqx.field(static=True, default=0.0)

    def inputs(self, t: Any) -> Any:
        t = manoeuvres_kit.as_time(t, self.steer)
        v_x, v_x_rate = self.speed.at(t)
        wave = numerics.sin(2.0 * np.pi * self.frequency * t) * numerics.smooth_step(t)
        return with_four_angles(DriverInputs(steer=self.steer * wave, v_x=v_x, v_x_rate=v_x_rate), self.rear)


def with_four_angles(u: DriverInputs, rear: Any) -> Any:
    """A driver's inputs with the angle of each wheel; the rear angles are `rear` (-) times the front angles."""
    angles = (u.steer, u.steer, rear * u.steer, rear * u.steer)
    return record("DriverInputs", u._asdict() | dict(zip(STEERS, angles, strict=True)))


def times(study: Study) -> jax.Array:
    """The times of the rows, s."""
    return jnp.asarray(np.arange(round(study.duration / study.dt) + 1) * study.dt)


def dugoff(study: Study) -> Dugoff:
    """The paper's tyre, with the friction of the road."""
    numbers = sets.ev().front
    assert numbers is not None and numbers.slip_stiffness is not None
    return Dugoff(numbers.slip_stiffness, numbers.cornering_stiffness, friction=1.0, fading=study.fading)


def peaked_tyre() -> Similarity:
    """A Magic Formula of ordinary shape, as stiff as the paper's tyre at a wheel's mean load; less friction scales its curve
    down."""
    numbers = sets.ev()
    assert numbers.front is not None and numbers.front.slip_stiffness is not None
    load, stiffness = 0.5 * sum(numbers.wheel_loads()), numbers.front.cornering_stiffness
    curve = tyres.kit.GENERIC_TYRE.magic_formula(stiffness, load)
    return Similarity(curve, load, slip_stiffness_ratio=numbers.front.slip_stiffness / stiffness)


def truth_of(study: Study, magic_formula: bool = False) -> SevenDOF:
    """The true car: on Dugoff's tyres, or on tyres of the same stiffness and peak friction whose curve has a peak."""
    tyre = peaked_tyre() if magic_formula else dugoff(study)
    return vehicles.build(sets.ev(), SevenDOF, front=tyre, rear=tyre, steering=vehicles.IndependentSteering())


def drive_once(study: Study, steer, speed_std, key, *, magic_formula: bool = False) -> Drive:
    """One drive with a steer amplitude (rad) and a standard deviation of the speed (m/s); a pure function, for `vmap`."""
    slalom = lambda speed: Slalom(speed=speed, duration=study.duration, frequency=study.steer_frequency, steer=steer)
    return drive_on(study, roads.Level(study.friction), slalom, speed_std, key, magic_formula=magic_formula)


def drive_on(
    study: Study, road: roads.AbstractRoad, driver: Callable[[AbstractSpeed], Any], speed_std, key,
    *, magic_formula: bool = False,
) -> Drive:  # fmt: skip
    """One drive on a road: `driver` makes the driver from the speed, which varies about the study's by `speed_std` (m/s)."""
    speed_key, sensor_key = jax.random.split(key)
    speed = manoeuvres.wavering_speed(
        study.speed, speed_std, speed_key, time=study.speed_time, fastest=study.speed_fastest, count=20
    )
    found = simulate(
        truth_of(study, magic_formula), driver(speed), road=road, dt=study.dt,
        max_step=study.max_step, start={"v_x": speed.at(0.0)[0]}, solver=RolledRK4(), throw=False,
    )  # fmt: skip
    levels = {"a_x": study.a_x, "a_y": study.a_y, "yaw_rate": study.yaw_rate} | dict.fromkeys(WHEELS, study.wheel_speed)
    noise = Gaussian(levels).sample(sensor_key, times(study).shape)
    said = {name: found[f"true.{name}"] + noise[name] for name in levels}
    return Drive(
        a_x=said["a_x"],
        a_y=said["a_y"],
        yaw_rate=said["yaw_rate"],
        omega=jnp.stack([said[name] for name in WHEELS], axis=-1),
        steer=jnp.stack([found[name] for name in STEERS], axis=-1),
        torque=jnp.stack([found[name] for name in vehicles_kit.wheel_names("torque")], axis=-1),
        true_v_x=found["true.v_x"],
        true_v_y=found["true.v_y"],
        true_yaw_rate=found["true.yaw_rate"],
        true_sideslip=found["true.sideslip"],
        true_friction=jnp.stack([found[f"true.{name}"] for name in FRICTIONS], axis=-1),
    )


def wheel_rates(study: Study, drive: Drive) -> jax.Array:
    """Accelerations of the wheels from their past speeds, rad/s^2, (T, 4): differences over `rate_time`, or over as many
    rows as there are.

    Over one row their noise would correspond to 4.6 N at the tread. The wheel speeds of the filter's measurements contain
    the same noise; friction would then be estimated one per cent too large.
    """
    n, rows = round(study.rate_time / study.dt), np.arange(drive.omega.shape[0])
    back = np.maximum(rows - n, 0)
    over = np.maximum(rows - back, 1) * study.dt
    return (drive.omega - drive.omega[back]) / over[:, None]


def felt_accelerations(study: Study, drive: Drive) -> tuple[jax.Array, jax.Array]:
    """The accelerations that the loads follow (m/s^2, (T,) each): the measured ones behind the lag of roll and pitch."""
    kept = np.exp(-study.dt / study.load_time)

    def step(before, measured):
        now = kept * before + (1.0 - kept) * measured
        return now, now

    both = jnp.stack([drive.a_x, drive.a_y], axis=-1)
    return tuple(jax.lax.scan(step, jnp.zeros_like(both[0]), both)[1].T)
