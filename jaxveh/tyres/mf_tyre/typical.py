"""Coefficients of a typical car tyre, the defaults for those missing from a property file."""

from __future__ import annotations

TYPICAL_COEFFICIENTS = {
    "BREFF": 8.4, "DREFF": 0.27, "FREFF": 0.07, "Q_RA1": 0.5, "Q_RA2": 1.0, "Q_RB1": 1.0, "Q_RB2": -1.0,
    "PCX1": 1.65, "PDX1": 1.3, "PDX2": -0.15, "PKX1": 20.0, "RBX1": 20.0, "RBX2": 15.0, "RCX1": 1.0,
    "PCY1": 1.3, "PDY1": 1.1, "PDY2": -0.15, "PKY1": -20.0, "PKY2": 1.0, "PKY4": 2.0, "PKY6": -1.0,
    "RBY1": 10.0, "RBY2": 10.0, "RCY1": 1.0, "RVY4": 20.0, "RVY5": 2.0, "RVY6": 10.0,
    "QSX4": 5.0, "QSX5": 1.0, "QSX6": 10.0, "QSX9": 0.4, "QSX11": 5.0,
    "QSY1": 0.01, "QSY3": 4e-4, "QSY4": 4e-5, "QSY7": 0.85, "QSY8": -0.4,
    "QBZ1": 10.0, "QBZ9": 10.0, "QCZ1": 1.1, "QDZ1": 0.12, "QDZ8": -0.05,
}  # fmt: skip
"""The default coefficients by name, with the signs of ISO-W, as in the reference evaluator (MFeval 4.3.1, readTIR). All others
are 0, and scaling factors are 1. With them a file without coefficients of combined slip stays within its friction."""
