"""The commands of the README, run as they stand in a folder that has the files that they name."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxveh
from jaxveh import io, manoeuvres, sensors, tyres, vehicles
from notebooks.site.executed import ROOT

README = (ROOT / "README.md").read_text()
BLOCKS = [block.splitlines() for block in re.findall(r"^```\n(.*?)^```", README, re.S | re.M)]
COMMANDS = [line.split("  #")[0].strip() for block in BLOCKS for line in block if line.startswith("jaxveh ")]
ELSEWHERE = ("jaxveh reproduce tyre-apf",)
"""Takes many minutes: the papers have tests of their own."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Logs of a car, its file, and a tyre's rig data."""
    folder = tmp_path_factory.mktemp("readme")
    car = vehicles.named_car("sedan", "two-track-3dof")
    devices = sensors.esc(a_x=0.1, v_x=0.1)
    for seed, name in enumerate(("drive", "monday", "tuesday")):
        driver = manoeuvres.random_steering(22.0, 0.02, jax.random.key(seed), duration=20.0)
        drive = jaxveh.simulate(car, driver, devices, jax.random.key(seed))
        kept = [one for one in drive.names if not one.startswith("true.")]
        io.write_recording(drive.select(kept), folder / f"{name}.csv")
    (folder / "car.toml").write_text(
        "mass = 1150.0\nyaw_inertia = 1800.0\nfront_axle_to_cg = 1.16\nrear_axle_to_cg = 1.42\n"
        "front_cornering_stiffness = 80000.0\nrear_cornering_stiffness = 90000.0\n"
    )
    law = tyres.typical_mf_tyre(4000.0)
    slips, loads = (grid.ravel() for grid in np.meshgrid(np.linspace(-0.2, 0.2, 41), [2000.0, 4000.0, 6000.0]))
    force = law.forces(tyres.Contact(slip_angle=slips, load=loads, speed=16.7)).F_y
    # CSV files are in ISO-W, where a positive slip angle has a negative force.
    rows = [f"{-alpha},{load},{one}" for alpha, load, one in zip(slips, loads, np.asarray(force), strict=True)]
    (folder / "rig.csv").write_text("\n".join(["alpha,Fz,Fy", *rows]) + "\n")
    return folder


def test_the_commands_are_those_that_are_run():
    assert len(COMMANDS) == 7 and set(ELSEWHERE) < set(COMMANDS)


@pytest.mark.studies
@pytest.mark.parametrize("command", [command for command in COMMANDS if command not in ELSEWHERE])
def test_a_command_of_the_readme_runs(command, folder):
    program = Path(sys.executable).parent / "jaxveh"
    words = shlex.split(command)
    if "simulate" in words:
        (folder / "drive.csv").unlink()  # It is the product here, and stays otherwise.
    done = subprocess.run(
        [str(program), *words[1:]], cwd=folder, capture_output=True, text=True,
        env={**os.environ, "COLUMNS": "100", "NO_COLOR": "1"},
    )  # fmt: skip
    assert not done.returncode, done.stdout + done.stderr
    if "-o" in words:
        assert (folder / words[words.index("-o") + 1]).exists()
