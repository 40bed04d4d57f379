"""Kalman filters and smoothers side by side with every library that has the same filter: one run, and 64 at once.

About the linear filters for 64 runs: if a library does not support missing values (dynamax, smcx), the covariances of a linear
filter do not depend on the measurements, and `vmap` over the measurements alone leaves the covariances out of the batch: all 64
runs share one recursion of matrices, and only means are computed for each. In jaxveh and cuthbert a different channel may be
missing in each run, and the whole work is done. If anything but the measurements differs between runs, all libraries do it (see
the extended filters).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import equinox as eqx

from jaxveh import filters, statespace

from .compared import LOOPS, OURS, PROBLEMS, Compared, contestants, same
from .measure import Bound, Case, Contestant, Skipped

__all__ = ["COMPARED", "cases"]

MEMBERS = 300
ALL = ("dynamax", "smcx", "cuthbert", "filterpy")
LAG = 10
# Two modes that differ only in the process noise's standard deviations, and the probability of staying in one for a step.
RESTLESS, STAY = 4.0, 0.95
BOUND, SCALES = 0.5, {"v_y": 0.1, "yaw_rate": 0.05}


def _calm(model: statespace.StateSpace) -> statespace.StateSpace:
    return model


def _restless(model: statespace.StateSpace) -> statespace.StateSpace:
    return eqx.tree_at(lambda m: m.process_noise.law, model, replace_fn=lambda law: law.times(RESTLESS))


COMPARED = {
    "kalman": Compared("Kalman filter", filters.Kalman(), "linear", same("kalman", *ALL, "particles")),
    "kalman-square-root": Compared(
        "Square-root Kalman filter",
        filters.Kalman(form=filters.SquareRoot()),
        "linear",
        {"cuthbert": "kalman", "filterpy": "square_root"},
    ),
    "kalman-smoother": Compared(
        "Rauch-Tung-Striebel smoother",
        filters.Kalman(),
        "linear",
        same("kalman_smoother", *ALL),
        filters.smooth,
    ),
    "kalman-parallel": Compared(
        "Kalman filter and smoother in parallel over time",
        filters.Kalman(),
        "linear",
        same("parallel_smoother", "dynamax", "cuthbert"),
        filters.smooth_parallel,
    ),
    "extended-3": Compared("Extended Kalman filter", filters.Extended(), "speed", same("extended", *ALL)),
    "extended-11": Compared("Extended Kalman filter", filters.Extended(), "track", same("extended", *ALL)),
    "extended-square-root-11": Compared(
        "Extended square-root Kalman filter",
        filters.Extended(form=filters.SquareRoot()),
        "track",
        same("extended", "cuthbert"),
    ),
    "extended-smoother-11": Compared(
        "Extended Rauch-Tung-Striebel smoother",
        filters.Extended(),
        "track",
        same("extended_smoother", "dynamax", "smcx", "cuthbert"),
        filters.smooth,
    ),
    "iterated-11": Compared(
        "Extended Kalman filter with five linearisations",
        filters.Iterated(filters.Extended(), 4),
        "track",
        same("iterated", "dynamax"),
        equal=False,
    ),
    "unscented-11": Compared(
        "Unscented Kalman filter",
        filters.Unscented(),
        "track",
        same("unscented_filter", "dynamax", "smcx", "filterpy"),
    ),
    "unscented-smoother-3": Compared(
        "Unscented Rauch-Tung-Striebel smoother",
        filters.Unscented(),
        "speed",
        same("unscented_smoother", "dynamax"),
        filters.smooth,
    ),
    "unscented-smoother-11": Compared(
        "Unscented Rauch-Tung-Striebel smoother",
        filters.Unscented(),
        "track",
        same("unscented_smoother", "dynamax"),
        filters.smooth,
    ),
    "cubature-3": Compared(
        "Cubature Kalman filter", filters.Cubature(), "speed", same("cubature", "dynamax", "filterpy")
    ),
    "cubature-11": Compared(
        "Cubature Kalman filter", filters.Cubature(), "track", same("cubature", "dynamax", "filterpy")
    ),
    "gauss-hermite-3": Compared(
        "Gauss-Hermite Kalman filter of 27 points", filters.GaussHermite(3), "speed", same("gauss_hermite", "dynamax")
    ),
    "ensemble-11": Compared(
        f"Ensemble Kalman filter of {MEMBERS} members",
        filters.Ensemble(MEMBERS, perturbed=True),
        "track",
        same("ensemble", "cuthbert", "filterpy"),
        settings={"members": MEMBERS},
        random=True,
    ),
    "interacting": Compared(
        "Interacting multiple models, two Kalman filters",
        filters.InteractingModels(filters.Kalman(), (_calm, _restless), [[STAY, 1 - STAY], [1 - STAY, STAY]]),
        "linear",
        same("interacting", "filterpy"),
        settings={"levels": (1.0, RESTLESS), "stay": STAY},
    ),
    "h-infinity": Compared(
        "H-infinity filter",
        filters.HInfinity(filters.Kalman(), BOUND, SCALES),
        "linear",
        same("h_infinity", "filterpy"),
        settings={"bound": BOUND, "weights": [s**-2 for s in SCALES.values()] + [0.0, 0.0]},
    ),
    "fixed-lag": Compared(
        f"Fixed-lag smoother of {LAG} rows",
        filters.Kalman(),
        "linear",
        same("fixed_lag", "filterpy"),
        functools.partial(filters.smooth, lag=LAG),
        settings={"lag": LAG},
        equal=False,
    ),
}

# The cases of the smoke run, and their peers: each peer once.
SMOKE = {"kalman": ("particles", "cuthbert"), "extended-3": ("dynamax", "filterpy"), "unscented-11": ("smcx",)}


def cases(smoke: bool) -> list[Case]:
    """Return every filter for one run and for 64."""
    made = []
    for name, compared in COMPARED.items():
        if smoke and name not in SMOKE:
            continue
        for runs in (1,) if smoke else (1, 64):
            problem = PROBLEMS[compared.problem].title
            peers = SMOKE[name] if smoke else tuple(p for p in compared.peers if runs == 1 or p not in LOOPS)
            if not peers:
                continue
            bounds = (Bound(OURS, peers, 1.0),) if compared.equal else ()
            made.append(
                Case(
                    name=f"gaussian_filters/{name}-{runs}",
                    title=f"{compared.title}, {problem}, {runs} run{'s' if runs > 1 else ''}, float64{_shared(compared, runs)}",
                    unit="us a run-step",
                    build=functools.partial(_build, compared, peers, runs, smoke),
                    base=OURS,
                    bounds=bounds,
                )
            )
    return made


def _shared(compared: Compared, runs: int) -> str:
    """Return the note in the title for many runs of a linear filter (see the module's text)."""
    return "; dynamax and smcx share covariances" if runs > 1 and compared.problem == "linear" else ""


def _build(compared: Compared, peers: Sequence[str], runs: int, smoke: bool) -> Sequence[Contestant | Skipped]:
    problem = PROBLEMS[compared.problem]
    rows = 12 if smoke else 3000 if runs == 1 else 300
    return contestants(compared, peers, problem.plain(rows, runs), problem.plain(min(rows, 60), 1))
