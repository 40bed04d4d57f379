"""Checks that a model is one: its numbers are scalars, where several models at once have arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.statespace.noise import AbstractNoise, CauchyGaussianMixture, Gaussian, StudentT

LEVELS = {Gaussian: ("std",), StudentT: ("dof", "scale"), CauchyGaussianMixture: ("weight", "scale", "std")}
"""The fields of laws whose numbers are scalars."""


def check_one_model(prior: Any, process_noise: Any, measurement_noise: Any) -> None:
    """Raise `InputError` for several models in one, as `jax.vmap` returns them, and for a noise level that is an array."""
    laws = {
        "prior": prior.law,
        "process_noise": getattr(process_noise, "law", None),
        "measurement_noise": measurement_noise,
    }
    wide = _wide("prior.mean", prior.mean)
    for place, law in laws.items():
        wide += wide_levels(place, law) if isinstance(law, AbstractNoise) else []
    if wide:
        raise InputError(
            f"StateSpace: {', '.join(wide)}: must be one number each. For several models at once use jax.vmap, e.g. "
            "jax.vmap(lambda model: jaxveh.run(filter, model, recording))(models)."
        )


def wide_levels(place: str, law: AbstractNoise) -> list[str]:
    """The levels of a law that are arrays, in words."""
    return [
        one
        for part in law.parts
        for name in LEVELS.get(type(part), ())
        for one in _wide(f"{place}.{name}", getattr(part, name))
    ]


def _wide(place: str, values: Any) -> list[str]:
    named = values._asdict() if hasattr(values, "_fields") else {"it": values}
    return [f"{place}: {name} has shape {np.shape(value)}" for name, value in named.items() if np.ndim(value)]
