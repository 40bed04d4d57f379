"""Tyres with few parameters as short TOML files that are easy to read and edit."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_flags, path_of, word_for
from jaxveh.io import kit
from jaxveh.tyres.arctangent import Arctangent
from jaxveh.tyres.base import AbstractTyre
from jaxveh.tyres.brush import Brush
from jaxveh.tyres.dugoff import Dugoff
from jaxveh.tyres.exponential import Exponential
from jaxveh.tyres.fiala import Fiala
from jaxveh.tyres.fiala_adams import FialaADAMS
from jaxveh.tyres.hsri import HSRI
from jaxveh.tyres.isotropic import IsotropicMagicFormula
from jaxveh.tyres.linear import Linear
from jaxveh.tyres.linear_with_load import LinearWithLoad
from jaxveh.tyres.magic_formula import MagicFormula
from jaxveh.tyres.parabolic import Parabolic
from jaxveh.tyres.unitire import UniTire

MODELS: dict[str, type[AbstractTyre]] = {
    law.__name__: law
    for law in (
        Arctangent, Brush, Dugoff, Exponential, Fiala, FialaADAMS, HSRI, IsotropicMagicFormula, Linear,
        LinearWithLoad, MagicFormula, Parabolic, UniTire,
    )
}  # fmt: skip
"""The laws whose parameters are single numbers or words."""


def write_parameters(tyre: AbstractTyre, path: str | Path, *, note: str = "", overwrite: bool = False) -> None:
    """Write a tyre's parameters as TOML, in SI units and radians; `note` is a comment at its top.

    Its one table `[tyre]` has `model`, the law's name, and a number for each parameter that is not None (a string for an option).

    **Raises** `InputError` for a law that is not in `MODELS`, parameters that are not finite scalars, or an existing file without
    `overwrite`.
    """
    check_flags(overwrite=overwrite)
    name = type(tyre).__name__
    if MODELS.get(name) is not type(tyre):
        raise InputError(
            f"write_parameters: tyre = {word_for(tyre)}: must be one of {', '.join(MODELS)}; for MFTyre use to_property_file."
        )
    lines = ["# SI units and radians.", "[tyre]", f"model = {kit.toml_string(name)}"]
    entries = [(field, getattr(tyre, field.name)) for field in dataclasses.fields(tyre)]
    entries = [(field, value) for field, value in entries if value is not None]
    width = max(len(field.name) for field, _ in entries)
    for field, value in entries:
        if isinstance(value, str):
            lines.append(f"{field.name:<{width}} = {kit.toml_string(value)}")
            continue
        value = np.asarray(value)
        if value.shape != () or not np.isfinite(value):
            raise InputError(f"{name}.{field.name} = {value}: must be one finite number to be written.")
        # The fewest digits that represent this value in its own precision.
        shown, unit = repr(float(str(value[()]))), field.metadata["unit"]
        lines.append(f"{field.name:<{width}} = {shown}" + ("" if unit == "-" else f"  # {unit}"))
    kit.write_toml(lines, path, overwrite, note)


def read_parameters(path: str | Path) -> AbstractTyre:
    """The tyre of a file in the format of `write_parameters`; parameters with a default may be missing.

    **Raises** `InputError` for a file that is not TOML, an unknown model, or an unknown, missing or invalid parameter.
    """
    path = path_of(path)
    content = kit.read_toml(path)
    kit.check_file(path, content, "tyre", ("tyre",))
    if "tyre" not in content:
        raise InputError(f"{path}: has no table [tyre]; it needs one with `model = ...` and the parameters.")
    kit.check_keys(str(path), content, ("tyre",))
    table, where = content["tyre"], f"{path}: [tyre]"
    if not isinstance(table, dict) or "model" not in table:
        raise InputError(f"{where}: has no `model`; it must be one of {', '.join(MODELS)}.")
    name = kit.toml_text(f"{where} model", table["model"])
    kit.check_known(where, "model", name, MODELS)
    fields = {field.name: field for field in dataclasses.fields(MODELS[name])}
    kit.check_keys(f"{where} of {name}", table, ("model", *fields))
    for field in fields.values():
        if field.default is dataclasses.MISSING and field.name not in table:
            raise InputError(f"{where}: {field.name} is missing; {name} needs it ({field.metadata['unit']}).")
    values: dict[str, Any] = {
        # Fields without a unit are options given as words.
        key: (kit.toml_number if "unit" in fields[key].metadata else kit.toml_text)(f"{where} {key}", value)
        for key, value in table.items()
        if key != "model"
    }
    try:
        return MODELS[name](**values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
