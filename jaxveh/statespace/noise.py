"""Noise laws by field name: fields without a name in the law carry no noise."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.bijectors import Interval, Positive
from jaxveh._core.contracts import check_unchanged
from jaxveh._core.errors import InputError, check, check_positive, float_array, is_concrete
from jaxveh._core.names import as_mapping, record
from jaxveh._core.parameter import parameter, positive

LOG_2PI = 1.8378770664093453
"""Logarithm of 2 pi."""


class AbstractNoise(eqx.Module):
    """A zero-mean additive noise law over named scalar fields.

    A batch is a mapping from each name to an array of any common shape.

    Further properties are declared where they hold; the default is *no*: `is_gaussian`, `adds_up`.

    **Raises** `TypeError` for a class that replaces a method of a law of this package, which filters read by its numbers.
    """

    def __init_subclass__(cls, **given):
        super().__init_subclass__(**given)
        check_unchanged(cls, AbstractNoise, "filters read a law of this package by its numbers alone.")

    @property
    def is_gaussian(self) -> bool:
        """Whether it is normal, jointly in all its fields."""
        return False

    @property
    def adds_up(self) -> bool:
        """Whether the sum of n independent draws follows the law `times` sqrt(n), as for white noise in continuous time."""
        return False

    @property
    def parts(self) -> tuple[AbstractNoise, ...]:
        """The independent laws of which it consists."""
        return (self,)

    # Not an `eqx.AbstractVar`: under postponed annotations that would be a field of the dataclass.
    @property
    @abc.abstractmethod
    def has_covariance(self) -> bool:
        """Whether the law has a covariance."""

    @property
    @abc.abstractmethod
    def names(self) -> tuple[str, ...]:
        """The fields that carry noise, in the order of `covariance`."""

    @abc.abstractmethod
    def sample(self, key, shape: tuple[int, ...] = ()) -> dict[str, jax.Array]:
        """Independent draws: each name with an array of `shape`."""

    @abc.abstractmethod
    def log_prob(self, residual: Mapping[str, jax.Array], present: Mapping[str, jax.Array]) -> jax.Array:
        """Log-density of residuals, the marginal over the fields present (booleans); absent residuals are not read."""

    @abc.abstractmethod
    def covariance(self) -> jax.Array:
        """(k, k) covariance in the order of `names`; raises `InputError` where the law has none."""

    def factor(self) -> jax.Array:
        """(k, k) lower factor L of the covariance L L^T; a field without any noise, as in a step of zero length, has zeros."""
        return _factor(self.covariance())

    @abc.abstractmethod
    def times(self, factor) -> AbstractNoise:
        """The law of `factor` times the noise."""


def _factor(covariance):
    # A field of zero variance gets unit variance first: the Cholesky factor of a zero, and its derivative, are not finite.
    still = jnp.diagonal(covariance) == 0
    unit = jnp.where(still[:, None] & np.eye(len(still), dtype=bool), jnp.ones_like(covariance), covariance)
    return jnp.where(still[:, None], jnp.zeros_like(covariance), numerics.cholesky(unit))


def _levels():
    """Declares noise levels by field name: positive, in the unit of the field."""
    return eqx.field(metadata={"unit": "of the channel", "domain": Positive(), "scale": None})


def _scales(values, what: str):
    values = {name: float_array(value) for name, value in as_mapping(values, what).items()}
    if not values:
        raise InputError(f"{what} is empty: name at least one field, or give no law at all.")
    for name, value in values.items():
        check_positive(f"{what} of {name}", value, advice="A field without noise is left out.")
    return record("Scales", values)


def mask_absent(residual, present, name):
    """The residual, zero where absent: replaced before the arithmetic, so that gradients stay finite."""
    here = present[name]
    return jnp.where(here, residual[name], jnp.zeros_like(residual[name])), here


class Gaussian(AbstractNoise):
    """Independent Gaussian noise, `Gaussian({"yaw_rate": 0.005, "a_y": 0.1})`: standard deviations in the fields' units."""

    has_covariance: ClassVar[bool] = True
    is_gaussian: ClassVar[bool] = True
    adds_up: ClassVar[bool] = True
    std: tuple = _levels()

    def __init__(self, std):
        self.std = _scales(std, "standard deviation")

    @property
    def names(self):
        return self.std._fields

    def sample(self, key, shape=()):
        draws = numerics.normals(key, len(self.names), shape, self.std[0].dtype)
        return {name: std * draw for (name, std), draw in zip(self.std._asdict().items(), draws, strict=True)}

    def log_prob(self, residual, present):
        terms = []
        for name, std in self.std._asdict().items():
            value, here = mask_absent(residual, present, name)
            term = -0.5 * (value / std) ** 2 - jnp.log(std) - 0.5 * LOG_2PI
            terms.append(jnp.where(here, term, jnp.zeros_like(term)))
        return sum(terms[1:], terms[0])

    def covariance(self):
        return jnp.diag(jnp.stack([std**2 for std in self.std]))

    def times(self, factor):
        return Gaussian(jax.tree.map(lambda std: std * factor, self.std))


class MultivariateGaussian(AbstractNoise):
    """Correlated Gaussian noise: `fields` in the order of the (k, k) `matrix`, symmetric positive definite."""

    has_covariance: ClassVar[bool] = True
    is_gaussian: ClassVar[bool] = True
    adds_up: ClassVar[bool] = True
    fields: tuple[str, ...] = eqx.field(static=True)
    matrix: jax.Array = eqx.field(converter=lambda m: float_array(m if eqx.is_array(m) else np.asarray(m)))

    def __check_init__(self):
        k = len(self.fields)
        if self.matrix.shape != (k, k):
            raise InputError(
                f"covariance has shape {self.matrix.shape}: must be ({k}, {k}) for {', '.join(self.fields)}."
            )
        check(
            "covariance", self.matrix,
            lambda m: abs(m - m.T).max() <= 1e-6 * abs(m).max() and bool((_eigenvalues(m) > 0).all()),
            "symmetric and positive definite",
        )  # fmt: skip

    @property
    def names(self):
        return self.fields

    def sample(self, key, shape=()):
        draws = numerics.normal(key, (len(self.fields), *shape), self.matrix.dtype)
        correlated = jnp.tensordot(self.factor(), draws, axes=1)
        return {name: correlated[i] for i, name in enumerate(self.fields)}

    def log_prob(self, residual, present):
        if any(jnp.ndim(present[name]) > 0 for name in self.fields):
            return self._log_prob_by_element(residual, present)
        factor, white, here = self._white(residual, present)
        count = jnp.sum(here).astype(self.matrix.dtype)
        log_prob = -0.5 * jnp.sum(white**2, axis=0) - 0.5 * numerics.log_det(factor) - 0.5 * LOG_2PI * count
        return log_prob.reshape(jnp.broadcast_shapes(*[jnp.shape(residual[name]) for name in self.fields]))

    def _white(self, residual, present):
        """Factor of the marginal covariance (k, k), whitened residuals (k, batch) and presence (k,), which is not batched."""
        values, here = zip(*[mask_absent(residual, present, name) for name in self.fields], strict=True)
        here, values = jnp.stack(here), jnp.stack(jnp.broadcast_arrays(*values))
        # The marginal of the present fields: absent ones become independent with unit variance and zero residual.
        eye = jnp.eye(len(self.fields), dtype=self.matrix.dtype)
        factor = numerics.cholesky(jnp.where(here[:, None] & here[None, :], self.matrix, eye))
        return factor, numerics.solve_lower(factor, values.reshape(len(self.fields), -1)), here

    def _log_prob_by_element(self, residual, present):
        """The same where presence differs within the batch: each element has its own covariance."""
        flat, shape = flatten_batch(self.fields, residual, present)
        return jax.vmap(self.log_prob)(*flat).reshape(shape)

    def covariance(self):
        return self.matrix

    def times(self, factor):
        return MultivariateGaussian(self.fields, self.matrix * factor**2)


def flatten_batch(names, *mappings):
    """The mappings with every array broadcast to the batch and flattened, and the batch's shape."""
    shape = jnp.broadcast_shapes(*[jnp.shape(values[name]) for values in mappings for name in names])
    wide = lambda value: jnp.broadcast_to(value, shape).reshape(-1)
    return [{name: wide(values[name]) for name in names} for values in mappings], shape


def _eigenvalues(matrix):
    return np.linalg.eigvalsh(np.asarray(matrix, dtype=np.float64))


class StudentT(AbstractNoise):
    """Independent Student-t noise with `dof` degrees of freedom (above zero) and scales by field name.

    Its covariance, `scale^2 dof / (dof - 2)`, exists for dof > 2 only.
    """

    dof: jax.Array = positive("-")
    scale: tuple = _levels()

    def __init__(self, dof, scale):
        self.dof = float_array(dof)
        self.scale = _scales(scale, "scale")
        check_positive("degrees of freedom", self.dof)

    @property
    def has_covariance(self):
        """False where the degrees of freedom are known to be 2 or fewer; under jit they are unknown."""
        return not is_concrete(self.dof) or bool(self.dof > 2)

    @property
    def names(self):
        return self.scale._fields

    def sample(self, key, shape=()):
        draws = numerics.student_t(key, self.dof, (len(self.names), *shape), self.scale[0].dtype)
        return {name: scale * draws[i] for i, (name, scale) in enumerate(self.scale._asdict().items())}

    def log_prob(self, residual, present):
        dof, half = self.dof, 0.5 * (self.dof + 1)
        constant = jax.lax.lgamma(half) - jax.lax.lgamma(0.5 * dof) - 0.5 * jnp.log(jnp.pi * dof)
        terms = []
        for name, scale in self.scale._asdict().items():
            value, here = mask_absent(residual, present, name)
            term = constant - jnp.log(scale) - half * jnp.log1p((value / scale) ** 2 / dof)
            terms.append(jnp.where(here, term, jnp.zeros_like(term)))
        return sum(terms[1:], terms[0])

    def covariance(self):
        check("degrees of freedom", self.dof, lambda dof: dof > 2, "above 2 for a covariance to exist",
              "Use a particle filter, or more degrees of freedom.")  # fmt: skip
        # Under jit the check is skipped: NaN then shows an error that a negative variance would hide.
        factor = jnp.where(self.dof > 2, self.dof / numerics.or_one(self.dof - 2, self.dof > 2), jnp.nan)
        return jnp.diag(jnp.stack([scale**2 * factor for scale in self.scale]))

    def times(self, factor):
        return StudentT(self.dof, jax.tree.map(lambda scale: scale * factor, self.scale))


class CauchyGaussianMixture(AbstractNoise):
    """With probability `weight` a Cauchy law of `scale`, otherwise a Gaussian of `std`, by field name.

    Approximates an alpha-stable law (Qin et al. 2014, eqs 12 to 14, with the weight `(4 - alpha^2) / (3 alpha^2)` on the
    Cauchy part, 1 <= alpha <= 2; erratum: the Gaussian density needs `exp(-x^2 / (2 R)) / sqrt(2 pi R)`). It has no
    covariance, and as it is the law of one step, it cannot be noise in continuous time.
    """

    has_covariance: ClassVar[bool] = False
    weight: jax.Array = parameter("-", Interval(0.0, 1.0))
    scale: tuple = _levels()
    std: tuple = _levels()

    def __init__(self, weight, scale, std):
        self.weight = float_array(weight)
        self.scale, self.std = _scales(scale, "Cauchy scale"), _scales(std, "standard deviation")
        check("weight", self.weight, lambda w: (w >= 0) & (w <= 1), "from 0 to 1")
        if self.scale._fields != self.std._fields:
            raise InputError(f"scale names {self.scale._fields}, std names {self.std._fields}: must agree.")

    @property
    def names(self):
        return self.std._fields

    def sample(self, key, shape=()):
        choice, heavy, light = jax.random.split(key, 3)
        shape, dtype = (len(self.names), *shape), self.std[0].dtype
        cauchy = numerics.uniform(choice, shape, dtype) < self.weight
        wide, narrow = numerics.cauchy(heavy, shape, dtype), numerics.normal(light, shape, dtype)
        scales = zip(self.names, self.scale, self.std, strict=True)
        return {name: jnp.where(cauchy[i], s * wide[i], d * narrow[i]) for i, (name, s, d) in enumerate(scales)}

    def log_prob(self, residual, present):
        terms = []
        for name, scale, std in zip(self.names, self.scale, self.std, strict=True):
            value, here = mask_absent(residual, present, name)
            heavy = jnp.log(self.weight) - jnp.log(jnp.pi * scale) - jnp.log1p((value / scale) ** 2)
            light = jnp.log1p(-self.weight) - 0.5 * (value / std) ** 2 - jnp.log(std) - 0.5 * LOG_2PI
            term = jnp.logaddexp(heavy, light)
            terms.append(jnp.where(here, term, jnp.zeros_like(term)))
        return sum(terms[1:], terms[0])

    def covariance(self):
        raise InputError(
            "CauchyGaussianMixture has no covariance: use a particle filter, or a Gaussian or Student-t law."
        )

    def times(self, factor):
        times = lambda values: jax.tree.map(lambda value: value * factor, values)
        return CauchyGaussianMixture(self.weight, times(self.scale), times(self.std))
