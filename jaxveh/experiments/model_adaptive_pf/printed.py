"""The paper's equations to the letter, errata included, and their results."""

from __future__ import annotations

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters
from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.model_adaptive_pf.aar import AutoRegressive
from jaxveh.experiments.model_adaptive_pf.contestants import (
    ADAPTIVE,
    PLAIN,
    Contestant,
    contestants,
    dynamics_filter,
    regression_filter,
)
from jaxveh.experiments.model_adaptive_pf.drives import fiala, numbers_of
from jaxveh.experiments.model_adaptive_pf.models import mixture
from jaxveh.experiments.model_adaptive_pf.report import against
from jaxveh.experiments.model_adaptive_pf.settings import (
    CASES,
    LIMIT,
    PRINTED_CONTACT_LENGTH,
    PRINTED_DIVISOR,
    PRINTED_SLIP_STIFFNESS,
    Study,
)
from jaxveh.experiments.model_adaptive_pf.study import Raced, drives_of, race
from jaxveh.experiments.report import interval, spread
from jaxveh.filters import kit
from jaxveh.statespace import AbstractWrapper
from jaxveh.sweeps import IN_MEMORY, Stores, Table
from jaxveh.tyres import Contact

SHOWN = {"constant": CASES["constant"], "both": CASES["both"], "both, 5 degrees of steer": LIMIT["right tyre"]}


class PrintedNoise(AbstractWrapper):
    """The filter of `inner`, for a mixture whose Gaussian part follows eqs 15 and 16 as printed.

    `delta = median |d| / 0.627`, then `R = 0.9 R + 0.1 delta`: a standard deviation is mixed into a variance, so R ends at
    delta, which is 200 times a variance of 0.005^2. `density="eq 14"` takes eq 14 to the letter, `exp(-x^2 / (4 R^2))`,
    whose standard deviation is `sqrt(2) R`: far too small if R is a variance, and 1.5 times too large if R has become a
    standard deviation. `density="variance"` treats R as the variance that it is called.
    """

    inner: filters.HaarParticles
    density: str = eqx.field(static=True, default="eq 14")

    def check(self, model):
        self.inner.check(model)

    def _init(self, model, row, key):
        own = jnp.square(jnp.stack(model.measurement_noise.std))
        memory = self._window_after(model, kit.first_window(self.inner, own), row)
        inside, info = self.inner.inner._init(self._with_memory(model, memory), row, key)
        return kit.Remembering(inside, memory), info

    def _step(self, model, belief, row):
        memory = self._window_after(model, belief.memory, row)
        inside, info = self.inner.inner._step(self._with_memory(model, memory), belief.inside, row)
        return kit.Remembering(inside, memory), info

    def _window_after(self, model, memory: kit.Window, row) -> kit.Window:
        """The window after a row; its `variances` hold the paper's R."""
        forgetting, R = self.inner.forgetting, memory.variances
        now = kit.window_after(
            self.inner, jnp.square(jnp.stack(model.measurement_noise.std)), memory, kit.row_values(model, row)
        )
        variance = (now.variances - forgetting * R) / (1.0 - forgetting)
        delta = jnp.sqrt(jnp.maximum(variance, 0.0)) * (kit.NORMAL_MEDIAN / PRINTED_DIVISOR)
        full = now.count >= self.inner.window
        return now._replace(variances=jnp.where(full, forgetting * R + (1.0 - forgetting) * delta, R))

    def _with_memory(self, model, memory: kit.Window) -> Any:
        R = memory.variances
        stds = math.sqrt(2.0) * R if self.density == "eq 14" else jnp.sqrt(R)
        kind = type(model.measurement_noise.std)
        return eqx.tree_at(lambda m: m.measurement_noise.std, model, kind(*stds))


def as_printed(
    *, seeds: int = 20, seed: int = 0, progress: Progress = silent, stores: Stores = IN_MEMORY
) -> list[Table]:
    """The printed settings: noise and transition of eqs 12 to 25, and the tyre of eqs 9 to 11, to the letter."""
    study, stores = Study(), stores.under("as-printed")
    drive_key, filter_key = jax.random.split(jax.random.fold_in(jax.random.key(seed), 1))
    drives = drives_of(study, SHOWN, seeds, drive_key, progress=part(progress, 0.0, 0.2, "drives"), stores=stores)
    raced = race(
        study, SHOWN, drives, filter_key, entrants=entrants(study),
        progress=part(progress, 0.2, 0.7, "filters"), stores=stores,
    )  # fmt: skip
    few = {name: one for name, one in entrants(study).items() if name in (PLAIN, ADAPTIVE)}
    own = race(
        study, SHOWN, drives, filter_key, entrants=few, tyre=printed_tyre,
        progress=part(progress, 0.7, 1.0, "printed tyre"), stores=stores.under("printed-tyre"),
    )  # fmt: skip
    progress(1.0, 1.0, "done")
    return [_noise_table(raced), _tyre_race(raced, own), tyre_table(study)]


def entrants(study: Study) -> dict[str, Contestant]:
    """The plain and the corrected filter, and the paper's equations; none has the tyres' relaxation, as in the paper."""
    particles = filters.ParticleFilter(study.particles)
    haar = filters.HaarParticles(particles, study.window, study.forgetting)
    literal, variance = PrintedNoise(haar), PrintedNoise(haar, "variance")
    whole = AutoRegressive(literal, study.update, as_printed=True)
    return {
        "open loop": contestants(study)["open loop"],
        PLAIN: Contestant(dynamics_filter(particles, lags=False), "the dynamics, the data sheet's Gaussian noise"),
        ADAPTIVE: Contestant(
            dynamics_filter(haar, mixture, lags=False), "wavelet variance and mixture, errata corrected"
        ),
        "eqs 15 and 16": Contestant(
            dynamics_filter(variance, mixture, lags=False), "the same, R of eq 16 as a variance"
        ),
        "eqs 14 to 16": Contestant(dynamics_filter(literal, mixture, lags=False), "the density of eq 14 as well"),
        "eqs 14 to 25": Contestant(
            regression_filter(whole), "the paper's filter: these, and the autoregression of eqs 22 to 25"
        ),
    }


def printed_tyre(study: Study, share=1.0):
    """The Fiala tyre of eqs 9 to 11, with the printed lengths."""
    return fiala(
        study, share, slip_stiffness=PRINTED_SLIP_STIFFNESS, contact_length=PRINTED_CONTACT_LENGTH, as_printed=True
    )


def _noise_table(raced: Raced) -> Table:
    rows = []
    for name, contestant in entrants(raced.study).items():
        cells = []
        for case in raced.cases:
            cells += [spread(raced.of("sideslip", name, case)), interval(against(raced, case, name).ratio)]
        rows.append((name, *cells, contestant.what))
    heads = [head for case in raced.cases for head in (f"{case}: sideslip RMSE, degrees", f"over {PLAIN}'s")]
    title = f"Noise and transition as printed: medians [quartiles; 95 % intervals] over {raced.found.seeds} seeds"
    return Table(title, ("estimator", *heads, "what it is"), rows)


def _tyre_race(raced: Raced, own: Raced) -> Table:
    rows = [("open loop, errata corrected", *[spread(raced.of("sideslip", "open loop", case)) for case in raced.cases])]
    for name in own.found.design.axis("estimator").labels:
        for what, one in (("errata corrected", raced), ("as printed", own)):
            rows.append((f"{name}, {what}", *[spread(one.of("sideslip", name, case)) for case in raced.cases]))
    return Table("The filter's tyre as printed: sideslip RMSE, degrees", ("estimator, tyre", *raced.cases), rows)


def tyre_table(study: Study) -> Table:
    """Where the printed tyre has steps, with the load of a front wheel."""
    load = numbers_of(study).wheel_loads()[0]
    limit = study.friction * load
    rows = []
    for what, tyre in (("as printed", printed_tyre(study)), ("errata corrected", fiala(study))):
        force = lambda theta, tyre=tyre: _forces(study, tyre, load, theta)
        step = lambda name, theta, force=force: (
            100.0 * (float(getattr(force(theta + 1e-9), name)) / float(getattr(force(theta - 1e-9), name)) - 1.0)
        )
        slides = tyre.forces(_contact(0.0, 0.1, load))
        trail = -force(1e-4).M_z / force(1e-4).F_y
        rows.append((what, step("F_y", 1.54), step("M_z", 2.0), 1e3 * float(trail), 100.0 * float(slides.F_x) / limit))
    return Table(
        "The Fiala tyre of eqs 9 to 11 on a front wheel",
        (
            "tyre",
            "step of F_y at theta 1.54, %",
            "step of M_z at theta 2, %",
            "trail, mm",
            "F_x at slip 0.1, % of mu F_z",
        ),
        rows,
    )


def _forces(study: Study, tyre, load: float, theta: float):
    """The tyre's forces at a normalised slip angle."""
    return tyre.forces(_contact(math.atan(theta * study.friction * load / study.cornering_stiffness), 0.0, load))


def _contact(slip_angle: float, slip_ratio: float, load: float) -> Contact:
    value = lambda number: jnp.asarray(np.float64(number), float)
    return Contact(slip_angle=value(slip_angle), slip_ratio=value(slip_ratio), load=value(load))
