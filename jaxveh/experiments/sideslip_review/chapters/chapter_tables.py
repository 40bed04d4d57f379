"""One table per chapter with the errors of every method in every scenario, and one with the methods' properties."""

from __future__ import annotations

import numpy as np

from jaxveh.experiments.report import spread
from jaxveh.experiments.sideslip_review.chapters.fleet import told_cars
from jaxveh.experiments.sideslip_review.chapters.racing import CHAPTERS, ChaptersRaced, quantities
from jaxveh.experiments.sideslip_review.chapters.scenarios import SCENARIOS
from jaxveh.sweeps import Table

SCALES = {"rad": (180.0 / np.pi, "deg"), "rad/s": (180.0 / np.pi, "deg/s"), "N/rad": (1e-3, "kN/rad")}
"""Units in which the quantities are shown."""

NOTHING = "nothing done"

NAMES = tuple(SCENARIOS)


def chapter_tables(raced: ChaptersRaced) -> list[Table]:
    """Two tables per chapter."""
    found = []
    for chapter, names in CHAPTERS.items():
        found += [_errors(raced, chapter, names), _properties(raced, chapter, names)]
    return found


def names_and_units(raced: ChaptersRaced, names: tuple[str, ...]):
    """(quantity, shown name, scale, unit) of a chapter, for quantities whose truth is in the drives."""
    for quantity in names:
        for shown, unit in quantities()[quantity].SHOWN.items():
            if any(key[0] == quantity and key[2] == shown for key in raced.found):
                scale, word = SCALES.get(unit, (1.0, unit))
                yield quantity, shown, scale, word


def _errors(raced: ChaptersRaced, chapter: str, names: tuple[str, ...]) -> Table:
    rows = []
    for quantity, shown, scale, unit in names_and_units(raced, names):
        label = f"{shown} [{unit}]"
        idle = raced.nothing.get((quantity, shown))
        if idle is not None:
            rows.append((label, NOTHING, *[spread(scale * idle["rmse"][i]) for i in range(len(NAMES))]))
        for key, values in raced.found.items():
            if key[0] == quantity and key[2] == shown:
                cells = [spread(scale * values["rmse"][i]) for i in range(len(NAMES))]
                rows.append((label, method_label(quantity, key[1]), *cells))
    return Table(f"{chapter}: RMSE, median over seeds [quartiles]; * is recommended", ("what", "method", *NAMES), rows)


def method_label(quantity: str, method: str) -> str:
    """The method's name, with a star if it is recommended."""
    return f"{method} *" if method == quantities()[quantity].RECOMMENDED else method


def _properties(raced: ChaptersRaced, chapter: str, names: tuple[str, ...]) -> Table:
    """Properties on ordinary drives and over all: share of known rows, the largest error, the delay, a long run; needed
    channels."""
    rows = []
    for quantity, shown, scale, unit in names_and_units(raced, names):
        module, normal = quantities()[quantity], NAMES.index("normal")
        for key, values in raced.found.items():
            if key[0] != quantity or key[2] != shown:
                continue
            at = lambda metric, values=values, normal=normal: _median(values[metric][normal])
            method = module.METHODS[key[1]]
            needs = method.make(told_cars()[0]).needs
            rows.append((
                f"{shown} [{unit}]", method_label(quantity, key[1]), f"{100.0 * at('known'):.0f} %", scale * at("rmse_known"),
                scale * np.nanmax(values["worst"]), at("nees"), at("delay"),
                at("late") / max(at("early"), 1e-12), values["failed"].sum(),
                ", ".join(_short([need.channel for need in needs if not need.optional])), method.source,
            ))  # fmt: skip
    rows += [
        ("", f"{q}: {m}", "not raced", "", "", "", "", "", "", why, "")
        for (q, m), why in raced.left_out.items()
        if q in names
    ]
    columns = (
        "what", "method", "known, normal", "rmse of it known", "worst of all drives", "NEES of it known", "delay [s]",
        "late over early", "failed", "needs", "from",
    )  # fmt: skip
    return Table(f"{chapter}: properties of the methods", columns, rows)


def _median(values: np.ndarray) -> float:
    """The median over the seeds that have a value."""
    there = values[np.isfinite(values)]
    return float(np.median(there)) if there.size else float("nan")


def _short(channels: list[str]) -> list[str]:
    """The channels, with the four wheels of a channel as one."""
    found: list[str] = []
    for channel in channels:
        stem, _, corner = channel.rpartition("_")
        name = f"{stem}_*" if corner in ("fl", "fr", "rl", "rr") else channel
        if name not in found:
            found.append(name)
    return found
