"""A study's file: TOML, checked key by key, with the cars' files that it names."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxveh import vehicles
from jaxveh._core.errors import InputError, check_seed, check_whole, path_of
from jaxveh.io import kit, read_car
from jaxveh.studies.axes import MOST, Varied, axes_of, sampled_paths
from jaxveh.studies.settings import DEFAULTS, WHOLE, with_defaults
from jaxveh.studies.study import Study

SEEDS = 20
"""Runs at every point, if the file gives no number."""

STUDY_SCHEMA = """\
# A study: how well an estimator does over many simulated drives. Angles are rad and units SI unless the key says otherwise.
seeds = 20                      # runs at every point of what varies; each point has the same seeds
seed = 0

[drive]                         # what is simulated: the truth
vehicle = "passenger_car"       # a car of the package (jaxveh simulate --list), or a car's file (jaxveh schema car)
fidelity = "two-track-3dof"
manoeuvre = "double-lane-change"
speed = 20.0                    # m/s
steer_deg = 3.0                 # amplitude at the road wheels, degrees
road = "level"
rate = 50.0                     # rows a second, Hz
# duration = 8.0                # s; and the manoeuvre's own options

[car]                           # numbers of the true car that differ from its file; the estimator is not told them
mass = 1550.0                   # kg

[sensors]
devices = "esc"                 # or "production", "proving-ground"; for esc standard deviations by channel:
yaw_rate = 0.005                # rad/s
a_y = 0.1                       # m/s^2
v_x = 0.1                       # m/s: an input of the estimator's single track, which this car gives only as a measurement

# [channels]                    # the estimator's name of a channel that is recorded under another name; the inputs of its
# v_x = "speed"                 # model are held in rows without a measurement

[estimator]                     # the model that the filter sees
name = "state-space"            # or "sideslip", "mass-and-grade"
fidelity = "single-track"
# estimate = ["front.D"]        # parameters among the states

[told]                          # numbers of the estimator's own car that differ from its file
yaw_inertia = 2300.0            # kg m^2

[process_noise]                 # of state-space, by state, in its unit per root second
v_y = 0.3
yaw_rate = 0.02

[filter]
name = "extended"               # every filter of jaxveh.filters; options are keys beside the name

[metrics]
names = ["rmse.sideslip", "coverage_95.sideslip", "nis"]
after = 0.5                     # s: rows before it do not count

[vary]                          # every combination of these
# Speed, steer_deg, and the numbers of car, told, sensors and noises vary within one compiled program; for everything else
# (names, options of the manoeuvre or the filter) each value is a program of its own.
"sensors.yaw_rate" = [0.002, 0.02]
"drive.speed" = {from = 15.0, to = 25.0, count = 3}   # scale = "log" for equal ratios

[vary.filter]                   # by labels of your own
EKF = "extended"
UKF = "unscented"

[vary.samples]                  # points that fill a box, as a further axis
method = "sobol"                # a power of two; or "latin-hypercube"
count = 8
ranges = {"car.mass" = [1400.0, 1700.0], "car.rear.scaling.LKY" = [0.6, 1.0]}   # LKY: of its tyres' cornering stiffness
"""
"""The file's schema as a commented example that can be read, for programs to print."""


def read_study(path: str | os.PathLike) -> Study:
    """Read a study from TOML (`STUDY_SCHEMA`).

    **Raises** `InputError` naming the file and the unknown key or the value out of range, with the valid ones, before any
    run.
    """
    path = path_of(path)
    try:
        told = kit.read_toml(path)
        kit.check_file(path, told, "study", (*WHOLE, *DEFAULTS))
        study = study_of(told, path.parent)
        study.check()
    except InputError as error:
        raise error if str(error).startswith(str(path)) else InputError(f"{path}: {error}") from None
    return study


def study_of(told: Mapping[str, Any], folder: Path = Path()) -> Study:
    """A study from a file's content; cars' files are searched for from `folder`. It is not yet checked (`Study.check`)."""
    for key in told:
        kit.check_known("study", "table", key, (*WHOLE, *DEFAULTS))
    seeds, seed = told.get("seeds", SEEDS), told.get("seed", 0)
    check_whole("seeds", seeds, most=MOST)
    check_seed("seed", seed)
    settings, vary = with_defaults(told), told.get("vary", {})
    kit.check_keys("vary", vary, vary)
    for key, found in FILES.items():
        settings["drive"][key] = found(settings["drive"][key], folder)
    kit.check_keys("metrics", settings["metrics"], DEFAULTS["metrics"])
    axes = axes_of(vary)
    return Study(settings, tuple(_with_files(axis, folder) for axis in axes), sampled_paths(vary), seeds, seed)


def _with_files(axis: Varied, folder: Path) -> Varied:
    """The axis with the files that its values name read in."""
    found = FILES.get((axis.path or "").removeprefix("drive."))
    return (
        axis
        if found is None
        else axis._replace(values={label: found(value, folder) for label, value in axis.values.items()})
    )


def _car(name: Any, folder: Path) -> Any:
    """A car's name unchanged, or its file read."""
    if not isinstance(name, str):
        raise InputError(f"drive.vehicle = {name!r}: must be the name of a car, or the path of its file.")
    if not Path(name).suffix:
        kit.check_known("drive.vehicle", "car", name, vehicles.kit.CARS, "Or give the path of a car's file (.toml).")
        return name
    return read_car(folder / name)


def _road(name: Any, folder: Path) -> Any:
    """A road's name unchanged, or the full path of its file, which every worker must see."""
    if isinstance(name, str) and Path(name).suffix:
        return str((folder / name).resolve())
    return name


FILES = {"vehicle": _car, "road": _road}
"""Keys of `drive` that may name a file, relative to the study's folder."""
