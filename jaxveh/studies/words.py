"""The words of a sweep's axes and values on figures: of a mass its name, of an rmse of a quantity the RMSE of it."""

from __future__ import annotations

from jaxveh import plots
from jaxveh.studies.metrics import METRICS
from jaxveh.studies.summary import Shown, display_of
from jaxveh.sweeps import Swept

TABLES = {
    "car_": "{}",
    "told_": "{}, as told",
    "sensors_": "{} of the sensors",
    "process_noise_": "process noise of {}",
    "measurement_noise_": "measurement noise of {}",
    "drive_": "{} of the drive",
    "estimator_": "{} of the estimator",
    "filter_": "{} of the filter",
    "samples.": "{}",
}
"""How the name of a number says in which table of a study it is."""

SCALING = {
    "LFZO": "nominal load", "LCX": "shape of F_x", "LMUX": "friction of F_x", "LEX": "curvature of F_x", "LKX": "slip stiffness",
    "LHX": "horizontal shift of F_x", "LVX": "vertical shift of F_x", "LCY": "shape of F_y", "LMUY": "friction of F_y",
    "LEY": "curvature of F_y", "LKY": "cornering stiffness", "LHY": "horizontal shift of F_y", "LVY": "vertical shift of F_y",
    "LKYC": "camber stiffness of F_y", "LKZC": "camber stiffness of M_z", "LTR": "pneumatic trail", "LRES": "residual torque",
    "LXAL": "influence of slip angle on F_x", "LYKA": "influence of slip ratio on F_y", "LVYKA": "F_y by slip ratio",
    "LS": "moment arm of F_x", "LMX": "overturning moment", "LVMX": "shift of the overturning moment",
    "LMY": "rolling resistance", "LMP": "parking moment", "LSGKP": "longitudinal relaxation length",
    "LSGAL": "lateral relaxation length",
}  # fmt: skip
"""What the scaling factors of an MF-Tyre scale."""

ERRORS = {
    "rmse": "RMSE", "baseline": "RMSE of doing nothing,", "crps": "CRPS", "nees": "NEES", "worst": "largest error", "nis": "NIS",
    "final": "last error", "coverage_50": "share in the 50 % band,", "coverage_95": "share in the 95 % band,",
}  # fmt: skip
"""The words of metrics, where they are not the name."""


def shown_on_figure(found: Swept, name: str) -> Shown:
    """How a figure shows a value or an axis: in words, with its unit."""
    shown = display_of(found, name)
    unit = shown.label.removeprefix(name)
    return Shown(words_for(name) + unit, shown.factor)


def words_for(name: str) -> str:
    """The name of an axis or a value in words; the last part of an unknown name stays as it is."""
    kind, _, quantity = name.partition(".")
    if kind in METRICS:
        word = ERRORS.get(kind, kind.replace("_", " "))
        return f"{word} of {_plain(quantity)}".replace(", of", ",") if quantity else word
    for table, form in TABLES.items():
        if name.startswith(table):
            return form.format(
                words_for(name.removeprefix(table)) if table == "samples." else _plain(name.removeprefix(table))
            )
    return _plain(name)


def _plain(name: str) -> str:
    """A number of a car, a tyre or a drive in words."""
    axle = next((one for one in ("front", "rear") if name.startswith((f"{one}_", f"{one}."))), "")
    code = name.replace(".", "_").rpartition("_")[2]
    if code in SCALING:
        return f"factor {code} of the {f'{axle} ' if axle else ''}tyres' {SCALING[code]}"
    if code.isupper() and axle:
        return f"{code} of the {axle} tyres"
    return plots.kit.quantity(name.removesuffix("_deg")).label.partition(" [")[0]
