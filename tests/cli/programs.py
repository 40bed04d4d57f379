"""What the command-line tests share: running a program in this process, and small logs and cars."""

from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from jaxveh.cli.app import app

CAR = """\
mass = 1420.0
yaw_inertia = 2124.0
front_axle_to_cg = 0.96
rear_axle_to_cg = 1.59
front_cornering_stiffness = 88000.0
rear_cornering_stiffness = 127000.0
"""


def run(*arguments):
    """The result of a program: `exit_code`, `stdout`, `stderr`."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def error_line(result) -> str:
    """The one line on stderr of a program that refused its input; asserts that it is one, and no traceback."""
    assert result.exit_code == 2, result.output
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("error: ")
    assert "Traceback" not in result.output
    return lines[0]


def write_car(folder: Path, text: str = CAR) -> Path:
    """A car file."""
    path = folder / "car.toml"
    path.write_text(text)
    return path


def columns(rows: int = 200) -> dict[str, np.ndarray]:
    """A steady sine of steer at 20 m/s, 100 Hz."""
    time = 0.01 * np.arange(rows)
    wave = np.sin(2 * np.pi * 0.5 * time)
    zero = np.zeros(rows)
    return {
        "time": time,
        "steer": 0.02 * wave,
        "v_x": zero + 20.0,
        "a_x": zero,
        "a_y": 2.4 * wave,
        "yaw_rate": 0.12 * wave,
        "v_y": 0.05 * wave,
    }


def write_log(folder: Path, table: dict[str, np.ndarray] | None = None, head: dict[str, str] | None = None) -> Path:
    """A CSV log; `head` renames columns in its first line."""
    table = columns() if table is None else table
    path = folder / "drive.csv"
    names = [(head or {}).get(name, name) for name in table]
    rows = zip(*table.values(), strict=True)
    lines = [",".join("" if np.isnan(value) else repr(float(value)) for value in row) for row in rows]
    path.write_text("\n".join([",".join(names), *lines]) + "\n")
    return path
