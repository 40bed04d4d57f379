"""The estimators by name: their models of the motion and of the sensors."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import filters
from jaxveh._core.names import record_type
from jaxveh.experiments.model_adaptive_pf.aar import AutoRegressive
from jaxveh.experiments.model_adaptive_pf.drives import Drive, fiala, model_car
from jaxveh.experiments.model_adaptive_pf.models import (
    RIMS,
    SIX,
    autoregression,
    dynamics,
    gaussian,
    lagging_car,
    mixture,
    rows_of,
)
from jaxveh.experiments.model_adaptive_pf.settings import Study
from jaxveh.statespace import Estimate, Row
from jaxveh.tyres import AbstractTyre
from jaxveh.vehicles import TwoTrack3DOF

Run = Callable[[Study, TwoTrack3DOF, Drive, Any], Estimate]

PLAIN = "PF"
ADAPTIVE = "PF, wavelet and mixture"
REDESIGNED = "PF, redesigned"
CUBATURE = "CKF"
STUDENT = "Student-t CKF, wavelet"
ROBUST = "robust CKF, wavelet"
TOLD = "CKF, told the noise"
"""A reference and no competitor: the gain if a filter is told what the others have to learn."""


class Contestant(NamedTuple):
    """`run(study, car, drive, key) -> Estimate`, with the car of the filter's model; and a description, `what`."""

    run: Run
    what: str


def contestants(study: Study, lags: bool = True) -> dict[str, Contestant]:
    """All estimators by name, beginning with the one that does nothing. With `lags` all but one have the tyres' relaxation
    length, otherwise none has: their tyre forces then follow without delay."""
    particles = filters.ParticleFilter(study.particles)
    wavelet = {"window": study.window, "forgetting": study.forgetting}
    haar = filters.HaarParticles(particles, **wavelet)
    cubature = filters.Cubature()
    student = filters.RobustStudentT(cubature, study.dof)
    printed = AutoRegressive(haar, study.update, as_printed=True)
    on = lambda filter_, law=gaussian: dynamics_filter(filter_, law, lags)
    return {
        "open loop": Contestant(_open_loop(lags), "the dynamics alone, from the first row on"),
        PLAIN: Contestant(on(particles), "the dynamics, the data sheet's Gaussian noise"),
        "PF, no relaxation": Contestant(
            dynamics_filter(particles, lags=False), "the same on tyres whose force follows without delay"
        ),
        "AAR as printed": Contestant(regression_filter(printed), "autoregression, wavelet variance, mixture"),
        "AAR": Contestant(regression_filter(AutoRegressive(haar, study.update)), "the same with true least squares"),
        "PF, wavelet": Contestant(on(haar), "the dynamics, variances from the Haar wavelet"),
        "PF, mixture": Contestant(on(particles, mixture), "the dynamics, Cauchy-Gaussian likelihood"),
        ADAPTIVE: Contestant(on(haar, mixture), "both; the variance is that of the Gaussian part"),
        REDESIGNED: Contestant(
            redesigned_particles(study, lags), "both parts follow the variance of a short window, large at the start"
        ),
        "strong tracking": Contestant(on(filters.StrongTracking(cubature)), "a cubature filter with a fading factor"),
        CUBATURE: Contestant(on(cubature), "the data sheet's Gaussian noise"),
        "Student-t CKF": Contestant(on(student), "Student's t law with the data sheet's scales"),
        STUDENT: Contestant(on(filters.HaarNoise(student, **wavelet)), "the same, scales from the Haar wavelet"),
        "robust CKF": Contestant(
            on(contaminated_cubature(study)), "noise with a share of wild values, with the data sheet's scales"
        ),
        ROBUST: Contestant(
            on(filters.HaarNoise(contaminated_cubature(study), **wary(study))),
            "the same, scales from the wavelet, as in the redesigned PF",
        ),
        TOLD: Contestant(
            informed_filter(cubature, lags), "is told the truth: each row's noise level, and which rows are wild"
        ),
    }


JUDGED = (PLAIN, ADAPTIVE, REDESIGNED, CUBATURE, STUDENT, ROBUST)
"""The estimators of the criteria: the plain filter, those asked about, and those made later."""

WILD = 4.0
"""Errors beyond this many standard deviations of their row are wild."""


def dynamics_filter(filter_, law=gaussian, lags: bool = True) -> Run:
    """A filter of the dynamics; `lags`: with the tyres' relaxation length."""

    def run(study, car, drive, key):
        car = lagging_car(study, car) if lags else car
        model = dynamics(study, car, drive.v_x[0], law(study))
        return filters.scan(filter_, model, rows_of(study, drive), key)

    return run


def wary(study: Study) -> dict[str, Any]:
    """The wavelet of the redesigned filters: a short window, used from its first rows on, and until then noise far above the
    data sheet's."""
    return {
        "window": study.short_window,
        "forgetting": study.forgetting,
        "fewest": study.fewest,
        "initial": study.initial,
    }


def contaminated_cubature(study: Study) -> filters.Contaminated:
    """The cubature filter whose noise model has a share of wild measurements."""
    return filters.Contaminated(filters.Cubature(), study.wild_share, study.wild_factor)


def redesigned_particles(study: Study, lags: bool = True) -> Run:
    """The particle filter whose noise law follows the wavelet as a whole, with its own window and tails."""
    law = lambda study: mixture(dataclasses.replace(study, alpha=study.heavy_alpha))
    haar = filters.HaarParticles(filters.ParticleFilter(study.particles), **wary(study), follows="both")
    return dynamics_filter(haar, law, lags)


def informed_filter(filter_, lags: bool = True) -> Run:
    """A filter of the dynamics that is told the noise's true level in each row, and leaves out wild values."""

    def run(study, car, drive, key):
        names = {name: f"{name}_std" for name in study.stds}
        car = lagging_car(study, car) if lags else car
        model = dynamics(study, car, drive.v_x[0], more=tuple(names.values()))
        rows = rows_of(study, drive)
        stds = {name: std * drive.level for name, std in study.stds.items()}
        error = {name: jnp.abs(getattr(drive, name) - getattr(drive, f"true_{name}")) for name in stds}
        u = record_type("ToldInputs", model.inputs)(*rows.u, *stds.values())
        y = {name: jnp.where(error[name] > WILD * stds[name], jnp.nan, getattr(rows.y, name)) for name in stds}
        rows = rows._replace(u=u, y=type(rows.y)(**y))
        return filters.scan(filters.VaryingNoise(filter_, names), model, rows, key)

    return run


def regression_filter(filter_, law=mixture) -> Run:
    """A filter of the autoregression."""

    def run(study, car, drive, key):
        model = autoregression(study, car, drive.v_x[0], law(study))
        return filters.scan(filter_, model, rows_of(study, drive), key)

    return run


def _open_loop(lags: bool) -> Run:
    def run(study, car, drive, key):
        rows = rows_of(study, drive)
        first = jnp.arange(rows.t.shape[0]) == 0
        y = jax.tree.map(lambda values: jnp.where(first, values, jnp.nan), rows.y)
        model = dynamics(study, lagging_car(study, car) if lags else car, drive.v_x[0])
        return filters.scan(filters.Cubature(), model, Row(rows.t, rows.u, y), key)

    return run


EVERY = 5
"""Rows between those of the six states that are kept."""


def _slip_error(found: Estimate, drive: Drive) -> jax.Array:
    """RMSE of `S = (r_e w - v_x) / v_x` (eq 7, with the car's own v_x) over all wheels; for a filter without spins S is
    zero."""
    slip = lambda rims, v_x: rims / v_x[:, None] - 1.0
    true = slip(drive.true_rims, drive.true_v_x)
    said = jnp.zeros_like(true)
    if hasattr(found.mean, RIMS[0]):
        said = slip(jnp.stack([getattr(found.mean, name) for name in RIMS], axis=-1), found.mean.v_x)
    return jnp.sqrt(jnp.mean((said - true) ** 2))


def metrics(found: Estimate, drive: Drive) -> dict[str, Any]:
    """Root mean square errors over the drive of `sideslip` (degrees), `v_y` (m/s), `yaw_rate` (degrees/s), `v_x` (m/s),
    `a_x` and `a_y` (m/s^2), and of the wheels' slips (%; filters without spins count with slips of zero); the sideslip over
    time (rad), all six states every `EVERY` rows, and the result's code."""
    rms = lambda name: jnp.sqrt(jnp.mean((getattr(found.mean, name) - getattr(drive, f"true_{name}")) ** 2))
    return {
        "sideslip": jnp.rad2deg(rms("sideslip")),
        "v_y": rms("v_y"),
        "yaw_rate": jnp.rad2deg(rms("yaw_rate")),
        "v_x": rms("v_x"),
        "a_x": rms("a_x"),
        "a_y": rms("a_y"),
        "slip": 100.0 * _slip_error(found, drive),
        "six": jnp.stack([getattr(found.mean, name)[::EVERY] for name in SIX]),
        "course": found.mean.sideslip,
        "log_likelihood": found.log_likelihood,
        "result": found.result,
    }


def of_a_point(
    study: Study, contestant: Contestant, tyre: Callable[..., AbstractTyre] = fiala
) -> Callable[[Any, Any, Any], dict[str, Any]]:
    """The contestant's run at a design's point: `run(point, key, (case, drive))`, as `sweeps.sweep` calls it; `tyre(study,
    share)` makes the filter's tyre, `share` times as stiff and as strong."""

    def run(point, key, data):
        del point
        case, drive = data
        noises = {name: case.process * getattr(study, name) for name in ("v_x_noise", "v_y_noise", "yaw_noise")}
        own = dataclasses.replace(
            study, relaxation=case.relaxation * study.relaxation, friction=case.told * study.friction, **noises
        )
        return metrics(contestant.run(own, model_car(own, tyre(own, case.tyre)), drive, key), drive)

    return run
