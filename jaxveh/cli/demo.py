"""`jaxveh demo`: four estimators side by side on a double lane change, in about a minute."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import Annotated, Any

import jax
import numpy as np
import typer

from jaxveh import Result
from jaxveh._core.errors import check_at_least
from jaxveh.cli import options
from jaxveh.cli.console import number, progress, results, spread, table
from jaxveh.cli.output import check_report, make_folder, write_numbers
from jaxveh.experiments import tyre_apf

COUNT = typer.Option("--seeds", help="Number of drives, each with its own noise and prior; tables show medians.", min=1)
OUT = typer.Option("--out", metavar="DIR", help="The folder for the figures.")
PARTICLES = typer.Option("--particles", help="Number of particles of both particle filters, at least 2.")


def demo(
    seeds: Annotated[int, COUNT] = 1,
    seed: options.Seed = 0,
    particles: Annotated[int, PARTICLES] = tyre_apf.Study().particles,
    out: Annotated[Path, OUT] = Path("jaxveh-demo"),
    numbers: options.Numbers = None,
) -> None:
    """Estimate tyre parameters from a simulated double lane change, with four estimators side by side.

    A car drives at 25 m/s with 7 degrees of steer at the road wheels; a yaw-rate sensor and a lateral accelerometer are noisy.
    Each estimator starts from a prior that is about 10 % wrong in every tyre parameter: a particle filter (PF), an auxiliary
    particle filter (APF), an unscented Kalman filter (UKF) and a fit (MAP). It takes about a minute on two cores, including
    compilation.

    Example: [bold]jaxveh demo --seeds 20 --json demo.json[/]
    """
    check_report(out, numbers)
    check_at_least("--particles", particles, 2)
    study = tyre_apf.Study(particles=particles)
    start = time.perf_counter()
    with progress("demo") as report:
        found = tyre_apf.run_staged(study, seeds, jax.random.key(seed), progress=report)
        report(1, 1, "drawing")
        paths = _draw(found, study, out)
    _print(found, study, seeds)
    for path in paths:
        results().print(f"figure: {path}")
    took = time.perf_counter() - start
    results().print(f"{took:.0f} s in all, including compilation")
    configuration = {"seeds": seeds, "study": dataclasses.asdict(study)}
    write_numbers(numbers, {**_numbers(found), "total_s": took, "figures": paths}, configuration, seed)


def _draw(found: tyre_apf.Staged, study: tyre_apf.Study, out: Path) -> list[Path]:
    from jaxveh import plots

    make_folder(out)
    return [
        plots.save(tyre_apf.figures.curves_figure(found.outcome, study), out / "force_curves.png"),
        plots.save(tyre_apf.figures.parameters_figure(found.outcome, study), out / "parameters.png"),
        plots.save(tyre_apf.figures.states_figure(found), out / "states.png"),
    ]


def _print(found: tyre_apf.Staged, study: tyre_apf.Study, seeds: int) -> None:
    results().print(
        f"Double lane change, {np.degrees(study.steer):g} degrees at the road wheels, {study.speed:g} m/s, {study.rate:g} Hz; "
        f"prior {100 * study.prior:g} % (E {2 * study.prior:g}), {study.particles} particles, "
        + ("one seed" if seeds == 1 else f"medians over {seeds} seeds"),
        soft_wrap=True,
    )
    results().print()
    _print_parameters(found, study, seeds)
    _print_errors(found)
    _print_seconds(found)
    results().print("[bold]Observability of the eight parameters on this drive[/]")
    results().print(found.observability.report(), markup=False)
    results().print()
    _print_failures(found)


def _print_parameters(found: tyre_apf.Staged, study: tyre_apf.Study, seeds: int) -> None:

    true, scale = tyre_apf.figures.truth(), tyre_apf.figures.true_spread(study)
    values = {n: np.asarray(found.outcome.parameters[n]) for n in tyre_apf.ESTIMATORS}
    spreads = {n: np.asarray(found.outcome.spread[n]) for n in tyre_apf.ESTIMATORS}
    rows = []
    for i, name in enumerate(tyre_apf.figures.NAMES):
        cells = [spread(np.median(values[n][:, i]), np.median(spreads[n][:, i]), "\n") for n in tyre_apf.ESTIMATORS]
        rows.append((name, f"{true[i]:g}", *cells))
    what = "estimate ± standard deviation" if seeds == 1 else "medians of estimate ± standard deviation"
    table(f"Parameters: {what}", ("parameter", "truth", *tyre_apf.ESTIMATORS), rows)
    rows = []
    for i, name in enumerate(tyre_apf.figures.NAMES):
        errors = [np.median(np.abs(values[n][:, i] - true[i])) / scale[i] for n in tyre_apf.ESTIMATORS]
        rows.append((name, *[f"{error:.2f}" for error in errors]))
    table("Error of each parameter, in standard deviations of the prior", ("parameter", *tyre_apf.ESTIMATORS), rows)


def _print_errors(found: tyre_apf.Staged) -> None:
    outcome, rows = found.outcome, []
    for name in tyre_apf.ESTIMATORS:
        curve, states = _median(outcome.curve_error[name]), _median(outcome.states[name])
        steps = [_median(found.steps[degrees][name])[1] for degrees in found.steps]
        rows.append(
            (name, f"{100 * curve[0]:.2f}", f"{100 * curve[1]:.2f}", *[number(v, 3) for v in (*states, *steps)])
        )
    heads = ("front\n%", "rear\n%", "v_y\nm/s", "yaw rate\nrad/s", *[f"step {d}°\nrad/s" for d in found.steps])
    table(
        "RMSE: axle force over the visited slip angles in % of D; states; yaw rate in a step steer",
        ("estimator", *heads),
        rows,
        "prior and MAP states: open loop, from steer and speed alone",
    )


def _print_seconds(found: tyre_apf.Staged) -> None:
    rows = [(name, f"{s.compile:.1f}", f"{s.run:.3f}") for name, s in found.seconds.items()]
    table("Time of each stage, s (compiled two at a time)", ("stage", "compile", "run"), rows)


def _print_failures(found: tyre_apf.Staged) -> None:
    for name, codes in found.outcome.result.items():
        codes = np.asarray(codes)
        for code in np.unique(codes[codes != 0]):
            count = int(np.sum(codes == code))
            results().print(f"{name}, {count} of {codes.size} seeds: {Result(int(code)).message}")


def _median(values) -> np.ndarray:
    return np.median(np.asarray(values), axis=0)


def _numbers(found: tyre_apf.Staged) -> dict[str, Any]:

    outcome, seen = found.outcome, found.observability
    fields = lambda array: dict(zip(tyre_apf.FIELDS, np.moveaxis(np.asarray(array), -1, 0), strict=True))
    pair = lambda names, array: dict(zip(names, np.moveaxis(np.asarray(array), -1, 0), strict=True))
    return {
        "truth": fields(tyre_apf.figures.truth()),
        "estimators": {
            name: {
                "parameters": fields(outcome.parameters[name]),
                "std": fields(outcome.spread[name]),
                "curve_rmse_share_of_D": pair(("front", "rear"), outcome.curve_error[name]),
                "state_rmse": pair(("v_y", "yaw_rate"), outcome.states[name]),
                "step_steer_rmse": {d: pair(tuple(tyre_apf.STEP_OUTPUTS), e[name]) for d, e in found.steps.items()},
                "log_likelihood": outcome.log_likelihood[name],
                "result": outcome.result[name],
            }
            for name in tyre_apf.ESTIMATORS
        },
        "medians": {
            "curve_rmse_percent_of_D": {
                n: pair(("front", "rear"), 100 * _median(outcome.curve_error[n])) for n in tyre_apf.ESTIMATORS
            }
        },
        "observability": {
            "condition_number": seen.condition_number,
            "bounds": dict(seen.bounds),
            "report": seen.report().splitlines(),
        },
        "seconds": found.seconds,
    }
