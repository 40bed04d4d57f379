"""The report of `jaxveh tyre fit`: stages, channels, coefficients and warnings."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh import tyres
from jaxveh._core.parameter import Parameter
from jaxveh.cli.console import number, table
from jaxveh.cli.failure import say
from jaxveh.fitting import RigFit, heavy_tails, kit

UNCERTAIN = 0.2
"""A coefficient is marked if its standard error exceeds this share of its size."""

UNITS = {"F_x": "N", "F_y": "N", "M_x": "N m", "M_y": "N m", "M_z": "N m"}

UNSEEN, WEAK, SET = "not identified", "uncertain", "held"


def show(
    fit: RigFit, start: tyres.AbstractTyre, findings: list[tyres.PropertyFinding], robust: bool = False
) -> dict[str, Any]:
    """Print tables and warnings; return every number for the JSON file.

    `start`: the tyre before the fit; `robust`: the option of `fit_rig`.
    """
    share = fit.parameters_std.array() / _sizes(fit)
    marks = [_mark(name, one) for name, one in zip(fit.names, share, strict=True)]
    _stages(fit)
    _channels(fit)
    _coefficients(fit, start, share, marks)
    if findings:
        table("Findings about the fitted file", ("about", "finding"), findings, left=2)
    warnings = warnings_of(fit, robust)
    for warning in warnings:
        say("warning", "yellow", warning)
    return {
        "stages": [stage._asdict() for stage in fit.stages],
        "channels": {
            name: {
                "peak": fit.peak[name], "start_rmse": fit.start_rmse[name], "rmse": fit.rmse[name],
                "cross_validation": fit.cross_validation[name],
            }
            for name in fit.rmse
        },
        "coefficients": {
            p.name: {"value": value, "std": std, "std_over_size": one, "unit": p.unit, "mark": mark}
            for (p, value, std), one, mark in zip(_coefficient_rows(fit), share, marks, strict=True)
        },
        "identified_directions": fit.identified,
        "heavy_tails": {
            name: tails._asdict()
            for name, residual in fit.residuals.items()
            if (tails := heavy_tails(residual)) is not None
        },
        "findings": [finding._asdict() for finding in findings],
        "warnings": warnings,
    }  # fmt: skip


def _stages(fit: RigFit) -> None:
    rows = [
        (s.name, str(s.rows), str(s.coefficients), number(100 * s.before), number(100 * s.after), str(s.steps),
         "converged" if s.converged else "stopped")
        for s in fit.stages
    ]  # fmt: skip
    heads = ("stage", "rows", "coefficients", "before, % of peak", "after, % of peak", "steps", "end")
    table("Stages: RMS of residuals relative to the measured peaks", heads, rows)


def _channels(fit: RigFit) -> None:
    """Print the RMSE of each channel; that of the start is the do-nothing baseline."""
    validated = any(np.isfinite(value) for value in fit.cross_validation.values())
    heads = ["channel", "unit", "peak", "RMSE at the start", "fitted", "% of peak"]
    rows = [
        [name, UNITS[name], fit.peak[name], fit.start_rmse[name], fit.rmse[name], 100 * fit.rmse[name] / fit.peak[name]]
        + ([fit.cross_validation[name]] if validated else [])
        for name in fit.rmse
    ]
    table("Channels", heads + (["cross-validated"] if validated else []), rows, left=2)


def _coefficients(fit: RigFit, start, share: np.ndarray, marks: list[str]) -> None:
    before = [_leaf(start, name) for name in fit.names]
    rows = [
        (p.name, "" if p.unit == "-" else p.unit, was, value, std, 100 * one, mark)
        for was, (p, value, std), one, mark in zip(before, _coefficient_rows(fit), share, marks, strict=True)
    ]
    heads = ("coefficient", "unit", "start", "fitted", "standard error", "% of its size", "")
    note = (
        f"The size of a coefficient that may be zero is its usual size; above {UNCERTAIN:.0%} of it: {WEAK}. "
        f"Coefficients that are {UNSEEN}, and those that are {SET} (see --free), keep their start values."
    )
    table("Coefficients", heads, rows, note, left=2)


def warnings_of(fit: RigFit, robust: bool = False) -> list[str]:
    """Return warnings for the user of the tyre; `robust`: whether the fit gave outliers little weight."""
    found = []
    stopped = [stage.name for stage in fit.stages[:-1] if not stage.converged]
    if not fit.stages[-1].converged:
        found.append(
            f"the fit has not converged in {fit.stages[-1].steps} steps: the tyre is the best so far, standard errors are rough"
        )
    elif stopped:
        found.append(f"stages that stopped before they converged: {', '.join(stopped)}")
    still = [name for name, std in fit.parameters_std.items() if np.isnan(std)]
    unseen = [name for name in still if name not in kit.HELD_COEFFICIENTS]
    if fit.identified < len(fit.names) - (len(still) - len(unseen)):
        found.append(
            f"the data identify {fit.identified} of {len(fit.names)} directions of the coefficients"
            + (f"; held at their start: {', '.join(unseen)}" if unseen else "")
        )
    worse = [name for name in fit.rmse if fit.rmse[name] > fit.start_rmse[name]]
    if worse:
        found.append(f"residuals larger than at the start: {', '.join(worse)}")
    exact = [name for name in fit.rmse if fit.rmse[name] < kit.LEAST_NOISE * fit.peak[name]]
    if exact:
        found.append(
            f"fitted to the last digits: {', '.join(exact)}: computed data, or as few distinct values as coefficients; "
            "this does not measure how well the law predicts"
        )
    found += [_tails_in_words(name, fit.residuals[name], robust) for name in fit.residuals if name not in exact]
    found = [one for one in found if one]
    missed = [name for name in fit.rmse if fit.cross_validation[name] > 2 * fit.rmse[name]]
    if missed:
        found.append(f"errors on rows left out in a fold are more than twice the fit's RMSE: {', '.join(missed)}")
    return found


def _mark(name: str, share: float) -> str:
    """Return the mark of a coefficient whose standard error is this share of its size."""
    if np.isnan(share):
        return SET if name in kit.HELD_COEFFICIENTS else UNSEEN
    return WEAK if share > UNCERTAIN else ""


def _tails_in_words(name: str, residual: np.ndarray, robust: bool) -> str:
    """Describe heavy tails of a channel's residuals; the text is empty if there are none."""
    tails = heavy_tails(residual)
    if tails is None:
        return ""
    if robust:
        return (
            f"{name}: {100 * tails.share:.2g} % of the rows lie beyond {kit.FAR_RESIDUAL:g} standard deviations of the others "
            f"({number(tails.deviation)} {UNITS[name]}) and had little weight: outliers, or rows that the law cannot fit"
        )
    return (
        f"{name}: residuals have heavy tails: {100 * tails.share:.2g} % of the rows lie beyond {kit.FAR_RESIDUAL:g} standard "
        f"deviations ({number(tails.deviation)} {UNITS[name]} by their median size; 0.006 % for Gaussian noise), and their RMS "
        f"is {tails.ratio:.2g} standard deviations: outliers that bias the fit, or rows that the law cannot fit; try --robust"
    )


def _coefficient_rows(fit: RigFit) -> list[tuple[Parameter, Any, Any]]:
    """Return each coefficient with its value and standard error."""
    return [(p, fit.parameters[p.name], fit.parameters_std[p.name]) for p in fit.chosen]


def _sizes(fit: RigFit) -> np.ndarray:
    scales = [abs(p.scale) if p.scale else 0.0 for p in fit.chosen]
    return np.maximum(np.maximum(np.abs(fit.parameters.array()), scales), 1e-300)


def _leaf(law: Any, name: str) -> Any:
    for part in name.split("."):
        law = getattr(law, part)
    return law
