"""Evaluation of an MF-Tyre for the rows of a table, with the column names of the reference evaluator."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_kind, check_one_of
from jaxveh.tyres.base import Contact
from jaxveh.tyres.mf_tyre import MFTyre

EVALUATION_INPUTS = {
    "Fz": ("in_Fz", "Fz", "load"),
    "kappa": ("in_kappa", "kappa", "slip_ratio"),
    "alpha": ("in_alpha", "alpha", "slip_angle"),
    "gamma": ("in_gamma", "gamma", "camber"),
    "phit": ("in_phit", "phit", "turn_slip"),
    "Vx": ("in_Vx", "Vx", "speed"),
    "P": ("in_P", "P", "pressure"),
}
"""The column names that a table may use for each input: load (N), slip ratio, slip angle, camber (rad), turn slip (1/m),
speed (m/s), pressure (Pa). The load is required. An input without a column is LONGVL for the speed, INFLPRES for the pressure
and zero for the others."""

OUTPUTS = {
    "Re": "R_e", "rho": "rho", "t": "trail", "mux": "mu_x", "muy": "mu_y", "omega": "omega", "Rl": "R_l", "Mzr": "M_zr",
    "Cx": "C_x", "Cy": "C_y", "Cz": "C_z", "sigmax": "sigma_x", "sigmay": "sigma_y", "Kxk": "K_xk",
}  # fmt: skip
"""The outputs with the same sign in both axis systems: the reference's name for each field of `MFOutputs`."""

AXES = ("iso-w", "ours")


def evaluate(tyre: MFTyre, columns: Mapping[str, np.ndarray], *, axes: str = "iso-w") -> dict[str, np.ndarray]:
    """Forces, moments and internal quantities of each row, by the names of the reference evaluator.

    `columns`: arrays of equal length by the names of `EVALUATION_INPUTS`. A column `useMode` chooses the options of each row:
    hundreds digit 1 with limits, 2 without; tens digit 1 angles, 2 their tangent and sine; units digit 1 without turn slip, 2
    with it. `axes`: `iso-w`, where a positive slip angle gives a negative force, or `ours`, where it gives a positive force
    (K_ya is then positive too).

    **Raises** `InputError` for a table without a load, an unknown mode or negative speeds.
    """
    check_kind("evaluate: tyre", tyre, MFTyre, "Of another law call its `forces` with a Contact of arrays.")
    check_one_of("axes", axes, AXES)
    given = {name: _column(columns, names) for name, names in EVALUATION_INPUTS.items()}
    if given["Fz"] is None:
        raise InputError(
            f"no load among the columns {', '.join(columns)}: one of {', '.join(EVALUATION_INPUTS['Fz'])} is needed."
        )
    rows = len(given["Fz"])
    for name, value in given.items():
        if value is not None and len(value) != rows:
            raise InputError(
                f"{EVALUATION_INPUTS[name][0]}: {len(value)} rows, {EVALUATION_INPUTS['Fz'][0]} has {rows}; must be equal."
            )
    _refuse(given["Vx"], lambda x: x < 0, "speed", "must be at least 0: turn the wheel's axes instead")
    filled = {name: np.zeros(rows) if value is None else value for name, value in given.items()}
    if given["Vx"] is None:
        filled["Vx"] = np.full(rows, float(tyre.structure.LONGVL))
    # As in the reference, a pressure of zero means the file's pressure.
    own = float(tyre.structure.INFLPRES)
    filled["P"] = np.where(filled["P"] == 0, own, filled["P"])
    modes = _column(columns, ("useMode",))
    modes = np.full(rows, _mode(tyre)) if modes is None else modes.astype(int)
    found: dict[str, np.ndarray] = {}
    for mode in np.unique(modes):
        chosen = np.flatnonzero(modes == mode)
        part = _evaluate(_in_mode(tyre, int(mode)), {name: value[chosen] for name, value in filled.items()}, axes)
        for name, values in part.items():
            found.setdefault(name, np.empty(rows))[chosen] = values
    return found


def _evaluate(tyre: MFTyre, given: dict[str, np.ndarray], axes: str) -> dict[str, np.ndarray]:
    sign = -1.0 if axes == "iso-w" else 1.0
    value = {name: jnp.asarray(array) for name, array in given.items()}
    contact = Contact(
        slip_angle=sign * value["alpha"], slip_ratio=value["kappa"], load=value["Fz"], camber=value["gamma"],
        speed=value["Vx"], pressure=value["P"], turn_slip=value["phit"],
    )  # fmt: skip
    out = _outputs(tyre, contact)
    forces = {name: getattr(out, f"{name[0]}_{name[1]}") for name in ("Fx", "Fy", "Mx", "My", "Mz")}
    others = {name: getattr(out, field) for name, field in OUTPUTS.items()}
    mixed = {"two_a": 2 * out.a, "two_b": 2 * out.b, "Kya": sign * out.K_ya}
    load = {"Fz": jnp.maximum(value["Fz"], 0.0)}
    seen = {name: value[name] for name in ("kappa", "alpha", "gamma", "phit", "Vx", "P")}
    return {name: np.asarray(array) for name, array in {**forces, **load, **seen, **others, **mixed}.items()}


@eqx.filter_jit
def _outputs(tyre: MFTyre, contact: Contact):
    return tyre.outputs(contact)


def _column(columns: Mapping[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray | None:
    """The column of the first of the names that the table has, as floats; None if it has none of them."""
    for name in names:
        if name in columns:
            values = np.asarray(columns[name], dtype=float)
            if values.ndim != 1:
                raise InputError(f"{name} has shape {values.shape}: must be (n,), a number for each row.")
            if not np.isfinite(values).all():
                row = int(np.flatnonzero(~np.isfinite(values))[0])
                raise InputError(f"{name} = {values[row]} in row {row}: must be finite.")
            return values
    return None


def _refuse(values: np.ndarray | None, bad, name: str, allowed: str) -> None:
    if values is not None and bad(values).any():
        row = int(np.flatnonzero(bad(values))[0])
        raise InputError(f"{name} = {values[row]:g} in row {row}: {allowed}.")


def _mode(tyre: MFTyre) -> int:
    return (100 if tyre.limits else 200) + (20 if tyre.angles else 10) + (2 if tyre.spins else 1)


def _in_mode(tyre: MFTyre, mode: int) -> MFTyre:
    """The tyre with the settings of a `useMode`."""
    hundreds, tens, units = mode // 100, mode // 10 % 10, mode % 10
    if hundreds not in (1, 2) or tens not in (1, 2) or units not in (1, 2):
        raise InputError(f"useMode = {mode}: its digits must be 1 or 2, such as 111 or 121.")
    return dataclasses.replace(tyre, limits=hundreds == 1, angles=tens == 2, spins=units == 2)
