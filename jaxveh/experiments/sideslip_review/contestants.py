"""The methods of the review, each a function from a car's measurements to its sideslip."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters, numerics, observers
from jaxveh._core.result import Result, code
from jaxveh.experiments.sideslip_review.drives import Drive
from jaxveh.experiments.sideslip_review.models import Cars, Models, rows
from jaxveh.experiments.sideslip_review.settings import Study
from jaxveh.statespace import StateSpace


class Found(NamedTuple):
    """An estimate: `v_y` (m/s) and its standard deviation `std` (m/s, NaN if a method has none), (T,) each; `result`: the
    first code that is not a success."""

    v_y: Any
    std: Any
    result: Any


WHAT = {
    "open loop": "linear single track with the steer alone, no sensor: the baseline",
    "steady state": "eq 2: yaw rate and a_y, as if the turn were steady",
    "integration": "a_y - v_x r, integrated from straight running",
    "kinematic Kalman": "v_x and v_y driven by accelerometers and gyroscope, v_x measured",
    "linear Kalman": "linear single track",
    "Luenberger": "nonlinear single track, poles placed on straight running",
    "sliding mode": "the same gain, most of it in a smooth switch",
    "EKF": "nonlinear single track",
    "UKF": "nonlinear single track",
    "PF": "nonlinear single track",
    "UPF": "nonlinear single track, particles drawn given the measurement",
    "switch": "integration while |a_y| is large, otherwise EKF",
    "pseudo-integration": "slow part of the EKF, fast part of the integration",
    "weighted": "kinematic Kalman and EKF, by their covariances",
    "handling": "the library's handling model, UKF: errors of tyres and a_y are states",
}
"""The methods, beginning with the one without sensors, and their descriptions."""

Method = Callable[[Drive, Any], Found]


class Group(NamedTuple):
    """Methods with shared work in one program: `run(drive, key)` gives a `Found` for each of `names`."""

    names: tuple[str, ...]
    run: Callable[[Drive, Any], dict[str, Found]]


def groups(study: Study, cars: Cars, models: Models) -> list[Group]:
    """All methods. Gains and models are made here, before any tracing."""
    gain, reach = gain_of(study, models.nonlinear), np.asarray(study.boundary)
    sliding = observers.SlidingMode(study.share * gain, (1.0 - study.share) * gain * reach, reach)
    nonlinear = lambda method: run_method(method, models.nonlinear)
    deaf = observers.Luenberger(np.zeros((len(models.linear.states), len(models.linear.channels))))
    single = {
        "open loop": run_method(deaf, models.linear),
        "steady state": steady_state(cars),
        "integration": integrate_v_y,
        "linear Kalman": run_method(filters.Kalman(), models.linear),
        "Luenberger": nonlinear(observers.Luenberger(gain)),
        "sliding mode": nonlinear(sliding),
        "UKF": nonlinear(filters.Unscented()),
        # One drive after the other: side by side, resampling takes more than twice as long.
        "PF": jax.custom_batching.sequential_vmap(nonlinear(filters.ParticleFilter(study.particles))),
        "UPF": jax.custom_batching.sequential_vmap(nonlinear(filters.Guided(study.particles, rule="unscented"))),
        "handling": run_method(filters.Unscented(), models.handling),
    }
    fused = _fusion(study, run_method(filters.Kalman(), models.kinematic), nonlinear(filters.Extended()))
    return [*(_alone(name, method) for name, method in single.items()), fused]


def _alone(name: str, method: Method) -> Group:
    return Group((name,), lambda drive, key: {name: method(drive, key)})


def _fusion(study: Study, kinematic: Method, extended: Method) -> Group:
    """The kinematic and the dynamic filter, and the methods that combine them."""

    def run(drive: Drive, key) -> dict[str, Found]:
        fast, slow = kinematic(drive, key), extended(drive, key)
        return {
            "kinematic Kalman": fast,
            "EKF": slow,
            "switch": switch(study.switch_at, slow, drive),
            "pseudo-integration": pseudo_integrated(study.pseudo_time, slow, drive),
            "weighted": weighted_mean(fast, slow),
        }

    return Group(("kinematic Kalman", "EKF", "switch", "pseudo-integration", "weighted"), run)


def gain_of(study: Study, model: StateSpace) -> np.ndarray:
    """The gain that places the poles of a straight run at the study's speed as the study wants them, (n, m)."""
    return observers.place_poles(model, study.poles, dt=study.dt, u={"v_x": study.speed}, leave=("yaw",))


def run_method(method, model: StateSpace) -> Method:
    """A filter or an observer over the drive."""

    def run(drive: Drive, key) -> Found:
        estimate = filters.scan(method, model, rows(model, drive), key)
        if "v_y" in estimate.mean._fields:
            return Found(estimate.mean.v_y, estimate.std.v_y, estimate.result)
        v_x = drive.v_x
        return Found(v_x * numerics.tan(estimate.mean.sideslip), v_x * estimate.std.sideslip, estimate.result)

    return run


def integrate_v_y(drive: Drive, key) -> Found:
    """Lateral velocity by the trapezoidal rule from zero: only sensors, without forgetting."""
    del key
    steps = _middle(drive.a_y - drive.v_x * drive.yaw_rate) * jnp.diff(drive.time)
    v_y = jnp.pad(jnp.cumsum(steps), (1, 0))
    return Found(v_y, jnp.full_like(v_y, jnp.nan), _worst(v_y))


def steady_state(cars: Cars) -> Method:
    """Eq 2: `beta = b r / v - m a / (l C_r) a_y`; the printed k_r belongs to one tyre, C_r = 2 k_r."""
    car = cars.linear
    front, rear = car.front_axle_to_cg, car.rear_axle_to_cg

    def run(drive: Drive, key) -> Found:
        del key
        slope = car.mass * front / ((front + rear) * car.rear_stiffness)
        v_y = rear * drive.yaw_rate - slope * drive.a_y * drive.v_x
        return Found(v_y, jnp.full_like(v_y, jnp.nan), _worst(v_y))

    return run


def pseudo_integrated(time: float, slow: Found, drive: Drive) -> Found:
    """Piyabongkarn et al. (2009): `dv/dt = a_y - v_x r + (v_slow - v) / time`, a first-order filter and its complement."""
    kept = jnp.exp(-jnp.diff(drive.time) / time)
    wanted = _middle(drive.a_y - drive.v_x * drive.yaw_rate) * time + _middle(slow.v_y)

    def step(v, given):
        share, towards = given
        v = share * v + (1.0 - share) * towards
        return v, v

    return _from(slow, jax.lax.scan(step, slow.v_y[0], (kept, wanted))[1])


def switch(hard: float, slow: Found, drive: Drive) -> Found:
    """Nishio et al. (2001) in its simplest form: while |a_y| exceeds `hard` (m/s^2), integration continues from the model's
    estimate."""
    steps = _middle(drive.a_y - drive.v_x * drive.yaw_rate) * jnp.diff(drive.time)

    def step(v, given):
        gained, model, a_y = given
        v = jnp.where(jnp.abs(a_y) > hard, v + gained, model)
        return v, v

    return _from(slow, jax.lax.scan(step, slow.v_y[0], (steps, slow.v_y[1:], drive.a_y[1:]))[1])


def weighted_mean(fast: Found, slow: Found) -> Found:
    """Lee (2006): both estimates weighted by the inverses of the variances of their filters."""
    weights = fast.std**-2, slow.std**-2
    total = weights[0] + weights[1]
    v_y = (weights[0] * fast.v_y + weights[1] * slow.v_y) / total
    return Found(v_y, total**-0.5, jnp.maximum(fast.result, slow.result))


def _middle(values):
    """Values halfway between rows, (T - 1,)."""
    return 0.5 * (values[1:] + values[:-1])


def _from(slow: Found, rest) -> Found:
    """An estimate that begins with the first value of another one."""
    v_y = jnp.append(slow.v_y[:1], rest)
    return Found(v_y, jnp.full_like(v_y, jnp.nan), jnp.maximum(slow.result, _worst(v_y)))


def _worst(v_y):
    """0 if all values are finite, otherwise the code of a state that is not."""
    return jnp.where(jnp.all(jnp.isfinite(v_y)), jnp.int32(0), code(Result.non_finite_state))
