"""Axes of rig data: the table of signs is what turning the axes gives, and every kind of file comes to the same table."""

import numpy as np
import pytest
from test_tydex import line

from jaxveh import io
from jaxveh._core.errors import InputError
from jaxveh.io.rig_axes import AXES, to_ours

# A wheel that moves to the right, is driven, leans to the right and is pushed to the left, in axes with z up.
VELOCITY, LEAN = np.array([20.0, -2.0, 0.0]), 0.05
FORCE, MOMENT = np.array([300.0, 2500.0, 4000.0]), np.array([-60.0, -15.0, -40.0])

TURN = np.diag([1.0, -1.0, -1.0])
"""Half a circle about x: from z up to z down and back."""


def written(axes):
    """What a rig writes of that wheel, derived from where its axes point and not from the table of signs."""
    down = axes in ("sae", "adapted-sae")
    velocity, force, moment = (TURN @ vector if down else vector for vector in (VELOCITY, FORCE, MOMENT))
    sideways = np.arctan2(velocity[1], velocity[0])
    # The wheel's top leans to the right: about x forwards the same way round in both.
    return {
        "slip_angle": -sideways if axes in ("adapted-sae", "ours") else sideways,
        "slip_ratio": 0.03, "camber": LEAN, "load": abs(force[2]) if axes == "adapted-sae" else force[2],
        "F_x": force[0], "F_y": force[1], "M_x": moment[0], "M_y": moment[1], "M_z": moment[2],
    }  # fmt: skip


@pytest.mark.parametrize("axes", AXES)
def test_signs_are_those_of_turned_axes(axes):
    found = to_ours({name: np.array([value]) for name, value in written(axes).items()}, axes)
    ours = written("ours")
    assert {name: values[0] for name, values in found.items()} == pytest.approx(ours)
    assert ours["slip_angle"] > 0 < ours["F_y"] and ours["load"] == 4000.0


def csv_file(folder, columns):
    path = folder / "rig.csv"
    names = {"slip_angle": "alpha", "slip_ratio": "kappa", "camber": "gamma", "load": "Fz"}
    path.write_text(
        ",".join(names.get(name, name) for name in columns) + "\n" + ",".join(map(repr, columns.values())) + "\n"
    )
    return path


def ttc_file(folder, columns):
    path = folder / "rig.dat"
    names = {"slip_angle": "SA", "slip_ratio": "SL", "camber": "IA", "load": "FZ"}
    heads = [names.get(name, name.replace("_", "").upper()) for name in columns]
    units = {"SA": "rad", "IA": "rad", "SL": "none", "FX": "N", "FY": "N", "FZ": "N"}
    lines = ["a test", "\t".join(heads), "\t".join(units.get(head, "N-m") for head in heads)]
    path.write_text("\n".join([*lines, "\t".join(map(repr, columns.values()))]) + "\n")
    return path


def tydex_file(folder, columns):
    path = folder / "rig.tdx"
    names = {
        "slip_angle": ("SLIPANGL", "rad"),
        "slip_ratio": ("LONGSLIP", "-"),
        "camber": ("INCLANGL", "rad"),
        "load": ("FZW", "N"),
    }
    names |= {
        name: (name.replace("_", "").upper() + "W", "N" if name[0] == "F" else "Nm")
        for name in columns
        if name[0] in "FM"
    }
    path.write_text("\n".join([
        "**MEASURCHANNELS", *[line(*names[name], 1) for name in columns],
        "**MEASURDATA", " ".join(map(repr, columns.values())), "**END",
    ]))  # fmt: skip
    return path


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("file", [csv_file, ttc_file, tydex_file])
def test_every_file_in_every_axes_is_one_table(tmp_path, file, axes):
    columns = {name: float(value) for name, value in written(axes).items()}
    table, ours = io.read_rig_table(file(tmp_path, columns), axes), written("ours")
    assert {name: getattr(table, name)[0] for name in ours} == pytest.approx(ours)


@pytest.mark.parametrize(("file", "usual"), [(csv_file, "iso-w"), (ttc_file, "sae"), (tydex_file, "iso-w")])
def test_usual_axes_of_each_kind_of_file(tmp_path, file, usual):
    path = file(tmp_path, {name: float(value) for name, value in written(usual).items()})
    assert io.read_rig_table(path).F_y[0] == pytest.approx(written("ours")["F_y"])
    assert io.read_rig_table(path).slip_angle[0] == pytest.approx(written("ours")["slip_angle"])


def test_axes_of_the_wheel_s_centre_are_tydex_s_own(tmp_path):
    path = tydex_file(tmp_path, {name: float(value) for name, value in written("sae").items()})
    path.write_text(path.read_text().replace("MXW ", "MXH "))
    with pytest.raises(InputError, match="MXH is in axes of the wheel's centre"):
        io.read_rig_table(path, "sae")
    assert io.read_rig_table(path, "sae", measured=("F_y", "M_z")).M_x is None
