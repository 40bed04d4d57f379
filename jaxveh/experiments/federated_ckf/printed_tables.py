"""The results of the paper's printed settings, and the cost of its errata."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters, sweeps
from jaxveh._core.names import record_type
from jaxveh._core.progress import Progress, part, silent
from jaxveh.experiments.federated_ckf.contestants import Contestant, contestants, with_shares
from jaxveh.experiments.federated_ckf.drives import Drive
from jaxveh.experiments.federated_ckf.model import noise_levels, planar, rows_of, states_model
from jaxveh.experiments.federated_ckf.printed import as_printed as printed_filters
from jaxveh.experiments.federated_ckf.settings import PARAMETERS, PRINTED_START, Start, Study
from jaxveh.experiments.federated_ckf.study import ALIKE, Setting, along_drives, drives_of, run_of, truth
from jaxveh.experiments.report import spread
from jaxveh.statespace import Gaussian, kit
from jaxveh.sweeps import IN_MEMORY, Stores, Table

SHOWN = ("first guess", "three federated, shared sensors", "joint")
"""The estimators beside the printed settings."""


def as_printed(
    study: Study | None = None,
    *,
    seeds: int = 20,
    seed: int = 0,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> list[Table]:
    """The paper's test (constant speed, printed start) with its printed numbers and with ours, and the effect on the
    covariance when sensors are counted twice."""
    study, stores = study or Study(), stores.under("as-printed")
    key = jax.random.fold_in(jax.random.key(seed), 3)
    told = part(progress, 0.0, 0.1, "drives")
    drives = drives_of(study, (study.steer,), (0.0,), seeds, key, progress=told, stores=stores)
    drives = jax.tree.map(lambda leaf: leaf[0, 0], drives)
    found = _race(study, drives, part(progress, 0.1, 0.8, "estimators"), stores)
    twice = _twice(study, drives, part(progress, 0.8, 1.0, "shared sensors"), stores)
    progress(1.0, 1.0, "done")
    return [_table(found, seeds), _traces(twice, seeds)]


def _runs(study: Study) -> dict[str, Contestant]:
    every = contestants(study)
    own = {name: every[name] for name in SHOWN}
    first = {"first guess": own.pop("first guess")}
    what = "printed P, Q, R and start; shares 1/2 at first (printed: 0), zeros in R as 1e-8, R of parameters for three channels"
    return {
        **first,
        "as printed": Contestant(printed_filters, what),
        **own,
        "federated, disjoint sensors": with_shares(),
    }


def _race(study: Study, drives: Drive, progress: Progress, stores: Stores) -> sweeps.Swept:
    design = sweeps.Design(estimator={name: run_of(study, one) for name, one in _runs(study).items()})
    data = along_drives((Setting.of(study, PRINTED_START), drives))
    run = lambda point, data: point.estimator(data)
    return stores.sweep("race", run, design, data=data, alike=ALIKE, progress=progress)


def _table(found: sweeps.Swept, seeds: int) -> Table:
    rows = []
    whats = _runs(Study())
    for name in found.design.axis("estimator").labels:
        at = lambda value, scale=1.0, name=name: spread(found.at(value, estimator=name), scale=scale)
        final = np.median(found.at("parameters", estimator=name)[:, -1], axis=0)
        errors = [at(f"{parameter}_error", 100.0) for parameter in PARAMETERS]
        rows.append((name, *errors, float(final[1]), at("sideslip_rmse"), at("v_x_rmse"), whats[name].what))
    return Table(
        f"As printed: constant 20 km/h, steer 8 degrees, mu 0.2, from mu 1, 700 kg, 1400 kg m^2, 1.0 m; {seeds} seeds",
        (
            "estimator",
            "mu, %",
            "m, %",
            "I_z, %",
            "a, %",
            "final m, kg",
            "sideslip RMSE, degrees",
            "v_x RMSE, m/s",
            "what it is",
        ),
        rows,
    )


Z_1, Z_2 = ("a_x", "a_y", "yaw_rate"), ("a_y", "yaw_rate")
"""The measurements of the paper's two local filters."""


def _twice(study: Study, drives: Drive, progress: Progress, stores: Stores) -> sweeps.Swept:
    """Final traces of the states' covariance, divided by the prior's variances, with the paper's sensors only and all
    parameters known."""
    cubature, right = filters.Cubature(), truth(study)
    chosen = {
        "centralised": cubature,
        "shared sensors": filters.Federated(cubature, (Z_1, Z_2), overlapping=True),
        "disjoint sensors": filters.Federated(cubature, (("a_x", "a_y"), ("yaw_rate",))),
    }
    levels = noise_levels(study)

    def of(filter_):
        def run(drive):
            model = states_model(study, planar(study, Start(*right)), drive)
            law = Gaussian({name: levels[name] for name in Z_1})
            model = eqx.tree_at(lambda m: m.measurement_noise, model, law)
            rows = rows_of(study, drive)
            rows = rows._replace(y=record_type("Measurements", Z_1)(*[getattr(rows.y, name) for name in Z_1]))
            _, P = kit.scan_and_keep(filter_, model, rows, None, lambda belief: belief.covariance)
            return {"trace": jnp.sum(jnp.diagonal(P[-1]) / jnp.diagonal(model.prior.covariance()))}

        return run

    design = sweeps.Design(filter={name: of(filter_) for name, filter_ in chosen.items()})
    run = lambda point, drive: point.filter(drive)
    return stores.sweep("shared-sensors", run, design, data=drives, progress=progress)


def _traces(found: sweeps.Swept, seeds: int) -> Table:
    centralised = found.at("trace", filter="centralised")
    names = found.design.axis("filter").labels
    rows = [(name, spread(found.at("trace", filter=name) / centralised)) for name in names]
    return Table(
        f"Three states, parameters known: trace of the filter's P over that of the centralised filter; {seeds} seeds",
        ("filter", "ratio"),
        rows,
    )
