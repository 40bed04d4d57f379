"""Several noise laws combined into one."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_kind
from jaxveh.statespace.noise import AbstractNoise, Gaussian, MultivariateGaussian, flatten_batch, mask_absent


class Independent(AbstractNoise):
    """Several independent laws over disjoint fields, as one law."""

    laws: tuple[AbstractNoise, ...]

    def __check_init__(self):
        check_kind("Independent: laws", self.laws, tuple, "A tuple of laws, such as (Gaussian({...}), StudentT(...)).")
        for law in self.laws:
            check_kind("Independent: a law", law, AbstractNoise)
        names = self.names
        if len(set(names)) < len(names):
            raise InputError(f"noise laws share fields: {', '.join(names)}; each field has one law.")

    @property
    def has_covariance(self):
        return all(law.has_covariance for law in self.laws)

    @property
    def is_gaussian(self):
        return all(law.is_gaussian for law in self.laws)

    @property
    def adds_up(self):
        return all(law.adds_up for law in self.laws)

    @property
    def parts(self):
        return self.laws

    @property
    def names(self):
        return tuple(name for law in self.laws for name in law.names)

    def sample(self, key, shape=()):
        keys = jax.random.split(key, len(self.laws))
        draws = [law.sample(k, shape) for law, k in zip(self.laws, keys, strict=True)]
        return {name: value for draw in draws for name, value in draw.items()}

    def log_prob(self, residual, present):
        terms = [law.log_prob(residual, present) for law in self.laws]
        return sum(terms[1:], terms[0])

    def covariance(self):
        return jax.scipy.linalg.block_diag(*[law.covariance() for law in self.laws])

    def times(self, factor):
        return Independent(tuple(law.times(factor) for law in self.laws))


def whiten(law: AbstractNoise, residual: Mapping, present: Mapping) -> dict[str, jax.Array]:
    """Residuals as independent numbers of unit variance, by the law's covariance; zero where absent (batches broadcast).

    **Raises** `InputError` for a noise that is not one law, such as `StateDependent`.
    """
    if not isinstance(law, AbstractNoise):
        raise InputError(
            f"residuals are weighted by one law, and {type(law).__name__} has another for each state. "
            "Take a filter's likelihood (fitting.maximum_likelihood), or one law."
        )
    if isinstance(law, Independent):
        return {name: value for part in law.laws for name, value in whiten(part, residual, present).items()}
    flat, shape = flatten_batch(law.names, residual, present)
    if isinstance(law, MultivariateGaussian):
        white = jax.vmap(lambda r, p: law._white(r, p)[1][:, 0], out_axes=1)(*flat)
    else:
        std = numerics.sqrt(jnp.diagonal(law.covariance()))
        values, here = flat
        white = jnp.stack([mask_absent(values, here, name)[0] / std[i] for i, name in enumerate(law.names)])
    return {name: white[i].reshape(shape) for i, name in enumerate(law.names)}


def combine(*laws: AbstractNoise | None) -> AbstractNoise | None:
    """Several laws over disjoint fields as one law; independent Gaussians merge into one, so that one draw serves all."""
    given = [law for law in laws if law is not None]
    if not given:
        return None
    gaussian = [law for law in given if isinstance(law, Gaussian)]
    merged = {name: std for law in gaussian for name, std in law.std._asdict().items()}
    others = [law for law in given if not isinstance(law, Gaussian)]
    if gaussian and len(merged) < sum(len(law.names) for law in gaussian):
        raise InputError("noise laws share fields: each field has one law.")
    parts = ([Gaussian(merged)] if gaussian else []) + others
    return parts[0] if len(parts) == 1 else Independent(tuple(parts))
