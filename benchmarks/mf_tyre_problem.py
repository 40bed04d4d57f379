"""A tyre in which every coefficient of MF-Tyre 6.1 has an effect, and contacts over all of its ranges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

__all__ = ["COEFFICIENTS", "Contacts", "contacts"]

# An invented passenger-car tyre with round numbers: no term is zero, so that none can be omitted unnoticed.
_TYRE = {
    "UNLOADED_RADIUS": 0.32, "FNOMIN": 4500.0, "LONGVL": 16.7, "NOMPRES": 220e3,
    "KPUMIN": -0.8, "KPUMAX": 0.8, "ALPMIN": -0.7, "ALPMAX": 0.7, "CAMMIN": -0.15, "CAMMAX": 0.15,
    "FZMIN": 300.0, "FZMAX": 11000.0, "PRESMIN": 160e3, "PRESMAX": 300e3, "VXLOW": 1.0,
}  # fmt: skip
_LONGITUDINAL = {
    "PCX1": 1.6, "PDX1": 1.15, "PDX2": -0.06, "PDX3": 0.9, "PEX1": 0.2, "PEX2": 0.12, "PEX3": -0.05, "PEX4": 0.08,
    "PKX1": 24.0, "PKX2": 0.6, "PKX3": -0.15, "PHX1": 0.0012, "PHX2": -0.0006, "PVX1": 0.003, "PVX2": -0.002,
    "PPX1": -0.35, "PPX2": 0.4, "PPX3": -0.09, "PPX4": 0.07,
    "RBX1": 13.0, "RBX2": 10.0, "RBX3": 4.0, "RCX1": 1.02, "REX1": -0.4, "REX2": -0.1, "RHX1": 0.004,
}  # fmt: skip
_LATERAL = {
    "PCY1": 1.35, "PDY1": 1.05, "PDY2": -0.1, "PDY3": 1.2, "PEY1": -0.7, "PEY2": -0.4, "PEY3": 0.12, "PEY4": -3.0,
    "PEY5": 5.0, "PKY1": -18.0, "PKY2": 1.7, "PKY3": 0.4, "PKY4": 1.9, "PKY5": 0.8, "PKY6": -0.9, "PKY7": -0.2,
    "PHY1": 0.002, "PHY2": -0.001, "PVY1": 0.02, "PVY2": -0.015, "PVY3": -0.15, "PVY4": -0.2,
    "PPY1": -0.4, "PPY2": -0.1, "PPY3": -0.1, "PPY4": 0.06, "PPY5": -0.3,
    "RBY1": 11.0, "RBY2": 9.0, "RBY3": 0.01, "RBY4": 3.0, "RCY1": 1.04, "REY1": 0.2, "REY2": -0.3,
    "RHY1": 0.008, "RHY2": 0.004, "RVY1": 0.04, "RVY2": 0.01, "RVY3": -0.3, "RVY4": 15.0, "RVY5": 1.9, "RVY6": -18.0,
}  # fmt: skip
_MOMENTS = {
    "QBZ1": 10.5, "QBZ2": -1.2, "QBZ3": -0.5, "QBZ4": 0.3, "QBZ5": -0.4, "QBZ9": 15.0, "QBZ10": 0.2, "QCZ1": 1.15,
    "QDZ1": 0.12, "QDZ2": -0.004, "QDZ3": -0.5, "QDZ4": 0.8, "QDZ6": 0.001, "QDZ7": -0.0008, "QDZ8": -0.1,
    "QDZ9": -0.05, "QDZ10": 0.2, "QDZ11": 0.1, "QEZ1": -1.5, "QEZ2": 0.6, "QEZ3": -0.4, "QEZ4": 0.2, "QEZ5": -2.5,
    "QHZ1": 0.004, "QHZ2": -0.002, "QHZ3": 0.14, "QHZ4": 0.06, "PPZ1": -0.4, "PPZ2": -0.3,
    "SSZ1": 0.02, "SSZ2": 0.03, "SSZ3": 0.4, "SSZ4": -0.2,
    "QSX1": -0.008, "QSX2": 0.6, "QSX3": 0.05, "QSX4": 0.04, "QSX5": 0.5, "QSX6": 0.9, "QSX7": 0.7, "QSX8": 0.4,
    "QSX9": 0.3, "QSX10": 0.2, "QSX11": 0.6, "QSX12": 0.5, "QSX13": 0.02, "QSX14": 0.1, "PPMX1": 0.1,
    "QSY1": 0.008, "QSY2": 0.005, "QSY3": 0.0012, "QSY4": 0.00006, "QSY5": 0.1, "QSY6": -0.2, "QSY7": 0.9, "QSY8": -0.4,
}  # fmt: skip
_SCALES = {
    "LFZO": 1.02, "LCX": 0.98, "LMUX": 0.95, "LEX": 1.03, "LKX": 1.04, "LHX": 0.9, "LVX": 1.1, "LCY": 1.01,
    "LMUY": 0.96, "LEY": 0.97, "LKY": 1.05, "LHY": 1.1, "LVY": 0.9, "LKYC": 1.06, "LKZC": 0.94, "LTR": 1.02,
    "LRES": 0.93, "LXAL": 1.04, "LYKA": 0.98, "LVYKA": 1.07, "LS": 0.92, "LMX": 1.03, "LVMX": 0.95, "LMY": 1.08,
}  # fmt: skip

COEFFICIENTS: dict[str, float] = {**_TYRE, **_LONGITUDINAL, **_LATERAL, **_MOMENTS, **_SCALES}
"""All coefficients of MF-Tyre 6.1 that forces and moments depend on, by their names in property files, in SI units."""


class Contacts(NamedTuple):
    """Contacts (n,): slip angle (rad; positive gives positive force), slip ratio (-), load (N), camber (rad), the road's
    friction (-), speed (m/s), pressure (Pa)."""

    slip_angle: np.ndarray
    slip_ratio: np.ndarray
    load: np.ndarray
    camber: np.ndarray
    friction: np.ndarray
    speed: np.ndarray
    pressure: np.ndarray


def contacts(count: int, seed: int = 0, dtype: type = np.float64) -> Contacts:
    """Draw contacts uniformly over slightly more than the tyre's ranges, so that every limit and VXLOW apply to a few."""
    rng = np.random.default_rng(seed)
    edges = [(-0.8, 0.8), (-0.9, 0.9), (100.0, 12e3), (-0.17, 0.17), (0.3, 1.1), (0.2, 60.0), (150e3, 310e3)]
    return Contacts(*[rng.uniform(low, high, count).astype(dtype) for low, high in edges])
