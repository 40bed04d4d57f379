"""Parameters over time, as in the paper's figures 6 to 13, and the degeneracy of the particles towards the end."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxveh import vehicles
from jaxveh._core.parameter import pick, prior_spread, resolve
from jaxveh.experiments.report import interval, spread
from jaxveh.experiments.tyre_apf.settings import Study, tyres
from jaxveh.sweeps import Table, compare

EVERY = 10
"""Rows between those that are kept."""

MIDDLE, END = (0.4, 0.6), (0.8, 1.0)
"""Parts of the drive: its middle fifth and its last."""


class Tracks(NamedTuple):
    """By filter, with the prior's mean among them: `mean` and `std` of the parameters (seeds, 8, T), and the effective
    `share` of the particles (seeds, T), which only particle filters have. `time` s (T,)."""

    time: Any
    mean: dict
    std: dict
    share: dict


def tracks_of(time, estimates: dict, guess: Any, guess_std: Any, particles: int) -> Tracks:
    """The tracks of the filters' `estimates` by name; `guess`, `guess_std` (seeds, 8): the prior's."""
    time = np.asarray(time)[0, ::EVERY]
    still = lambda values: np.broadcast_to(np.asarray(values)[:, :, None], (*np.shape(values), time.size))
    mean, std, share = {"prior": still(guess)}, {"prior": still(guess_std)}, {}
    for name, one in estimates.items():
        rows = lambda fields: np.stack([np.asarray(field)[:, ::EVERY] for field in fields.values()], axis=1)
        mean[name], std[name] = rows(one.parameters), rows(one.parameters_std)
        if hasattr(one.info, "ess"):
            share[name] = np.asarray(one.info.ess)[:, ::EVERY] / particles
    return Tracks(time, mean, std, share)


class Course(NamedTuple):
    """One filter's track over seeds, in prior standard deviations of each parameter, as root mean squares over all eight:
    the error in the drive's `middle` and at its `end`, and over the whole drive (`rmse`); `restless`: the deviation of the
    estimates from their mean over the second half, and `restless_E`, that of both E alone; `claimed`: the filter's own
    standard deviation at the end."""

    middle: np.ndarray
    end: np.ndarray
    rmse: np.ndarray
    restless: np.ndarray
    restless_E: np.ndarray
    claimed: np.ndarray


def course_of(tracks: Tracks, name: str, study: Study) -> Course:
    """The course of a filter, (seeds,) each."""
    car = vehicles.passenger_car()
    chosen = resolve(car, tyres)
    values = pick(car, chosen)
    scales = [
        p.domain.slope(v) * s for p, v, s in zip(chosen, values, prior_spread(chosen, values, study.prior), strict=True)
    ]
    truth, scale = (np.asarray(jnp.stack(x))[:, None] for x in (values, scales))
    part = tracks.time / tracks.time[-1]
    within = lambda low, high: (part >= low) & (part <= high)
    error = (tracks.mean[name] - truth) / scale
    late = tracks.mean[name][..., within(0.5, 1.0)] / scale
    about = late - late.mean(axis=-1, keepdims=True)
    rms = lambda x: np.sqrt(np.mean(np.square(x), axis=(-2, -1)))
    last = within(*END)
    return Course(
        rms(error[..., within(*MIDDLE)]), rms(error[..., last]), rms(error), rms(about), rms(about[:, [3, 7]]),
        rms((tracks.std[name] / scale)[..., last]),
    )  # fmt: skip


def tracks_table(tracks: Tracks, study: Study) -> Table:
    """Figures 6 to 13 in numbers."""
    rows = []
    for name in tracks.mean:
        course = course_of(tracks, name, study)
        last = tracks.time >= END[0] * tracks.time[-1]
        share = spread(np.median(tracks.share[name][:, last], axis=-1), 2) if name in tracks.share else ""
        rows.append(
            (name, spread(course.rmse), spread(course.middle), spread(course.end),
             interval(compare(course.end, course.middle).ratio), spread(course.restless), spread(course.restless_E),
             interval(compare(course.end, course.claimed).ratio), share)
        )  # fmt: skip
    return Table(
        "Figures 6 to 13: the eight parameters over time, in prior standard deviations, median [quartiles] or ratio [95 %]",
        ("filter", "RMSE", "in the middle fifth", "in the last fifth", "last over middle", "variation in the second half",
         "both E", "last fifth: error over own standard deviation", "effective particles there"),
        rows,
    )  # fmt: skip
