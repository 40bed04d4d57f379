"""Noise whose standard deviation is a channel of the recording, such as a receiver's accuracy or the roughness of a road."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_one_of, word_for
from jaxveh._core.names import check_names
from jaxveh.statespace import AbstractFilter, AbstractWrapper, Continuous, Discrete, Gaussian, Gradient, StateSpace, kit


class VaryingNoise(AbstractWrapper):
    """Any filter `inner`, with standard deviations that are inputs of the model, row by row.

    `measurement`: by channel, the input that is its standard deviation (in its unit) in the same row
    (`{"gnss_speed": "gnss_speed_accuracy"}`). `process`: by state, the input that is its process noise (unit per root
    second, or per step, as in the model). Its value is that of the step's first row, or with `process_of="after"` that
    of its last row, the one being filtered, if the input describes the time before its row (such as a brake used since
    the row before). The model's noises must be Gaussian, with one standard deviation per field; fields that are not
    named keep theirs. Values that are not positive lead to a result code.
    """

    whitens: ClassVar[bool] = True
    has_covariance: ClassVar[bool] = True
    noise_by_row: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True
    inner: AbstractFilter
    measurement: tuple[tuple[str, str], ...] = eqx.field(static=True)
    process: tuple[tuple[str, str], ...] = eqx.field(static=True)
    process_of: str = eqx.field(static=True)

    @property
    def gradients(self):
        return Gradient.exact

    def __init__(
        self,
        inner: AbstractFilter,
        measurement: Mapping[str, str] | None = None,
        process: Mapping[str, str] | None = None,
        process_of: str = "before",
    ):
        self.inner, self.process_of = inner, process_of
        self.measurement, self.process = (
            tuple(sorted((measurement or {}).items())),
            tuple(sorted((process or {}).items())),
        )

    def __check_init__(self):
        check_one_of("VaryingNoise.process_of", self.process_of, ("before", "after"))
        if not self.measurement and not self.process:
            raise InputError("VaryingNoise: name a channel in `measurement` or a state in `process`.")

    def check(self, model):
        check_names("VaryingNoise.measurement", [name for name, _ in self.measurement], model.channels)
        noisy = () if model.process_noise is None else model.process_noise.law.names
        check_names("VaryingNoise.process (of states with process noise)", [name for name, _ in self.process], noisy)
        check_names("VaryingNoise: inputs", [name for _, name in (*self.measurement, *self.process)], model.inputs)
        laws = [("measurement noise", model.measurement_noise)] if self.measurement else []
        if self.process:
            kind = word_for(model.process_noise)
            if not isinstance(model.process_noise, Continuous | Discrete):
                raise InputError(f"VaryingNoise: the process noise is {kind}: must be Continuous or Discrete.")
            laws.append(("process noise", model.process_noise.law))
        if self.measurement:
            kit.check_fixed(
                "VaryingNoise.measurement", model.measurement_noise, "Let its function use the input directly."
            )
        for what, law in laws:
            if not isinstance(law, Gaussian):
                kind = word_for(law)
                raise InputError(
                    f"VaryingNoise: the {what} is {kind}: must be Gaussian, one standard deviation per field."
                )
        if self.measurement:
            kit.check_noise_by_row("VaryingNoise", self.inner)
        self.inner.check(model)

    def _init(self, model, row, key):
        return self.inner._init(self._with_noise_of(model, row.u, row.u), row, key)

    def _step(self, model, belief, row):
        moved = row.u if self.process_of == "after" else belief.u
        return self.inner._step(self._with_noise_of(model, row.u, moved), belief, row)

    def _with_noise_of(self, model: StateSpace, now: Any, moved: Any) -> StateSpace:
        """The model with measurement noise from the inputs `now` and process noise from the inputs `moved`."""
        if self.measurement:
            law = _with(model.measurement_noise, self.measurement, now)
            model = eqx.tree_at(lambda m: m.measurement_noise, model, law)
        if self.process:
            noise = model.process_noise
            assert noise is not None  # `check` ensures it
            model = eqx.tree_at(lambda m: m.process_noise.law, model, _with(noise.law, self.process, moved))
        return model


def _with(law: Gaussian, told: tuple[tuple[str, str], ...], u: Any) -> Gaussian:
    stds = dict(told)
    # A value that is no standard deviation must not be used: NaN leads to a result code.
    positive = lambda value: jnp.where(value > 0, value, jnp.nan)
    new = {name: positive(getattr(u, stds[name])) if name in stds else std for name, std in law.std._asdict().items()}
    return eqx.tree_at(lambda l: l.std, law, type(law.std)(**new))
