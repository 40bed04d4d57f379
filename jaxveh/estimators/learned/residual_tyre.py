"""A physical tyre law with a small network that corrects its errors."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check_has, check_kind
from jaxveh._core.parameter import parameter, positive
from jaxveh.statespace import kit
from jaxveh.tyres import AbstractDynamicTyre, AbstractTyre, Contact, Forces, cornering_stiffness
from jaxveh.tyres import kit as tyres

REACH = 3.0
"""Range of the network's inputs, which are scaled slip angles: beyond it the tyre slides."""


class ResidualTyre(AbstractTyre):
    """`tyre` and a network of one hidden layer that corrects its lateral force:

        F_y = F_y of tyre + F_z sum over j of v_j (1 + c_j (F_z / load - 1)) (tanh(a_j s + b_j) + tanh(a_j s - b_j)) / 2

    with the slip angle relative to that at which the force of a linear tyre of `stiffness` (N/rad) equals the load,
    `s = stiffness alpha / F_z`. The correction is odd in the slip angle, as the force is. With `outer` v = 0 there is no
    correction. It depends on slip angle and load only; friction, combined slip and aligning moment are those of the physical law.

    `inner` a, `bias` b, `outer` v, `load_share` c: (H,) each. `load` (N): reference load of the correction.

    **Raises** `InputError` for a tyre with states of its own.
    """

    tyre: AbstractTyre
    inner: jax.Array = parameter("-", scale=1.0)
    bias: jax.Array = parameter("-", scale=1.0)
    outer: jax.Array = parameter("-", scale=0.1)
    load_share: jax.Array = parameter("-", scale=0.1)
    stiffness: jax.Array = positive("N/rad")
    load: jax.Array = positive("N")

    def __check_init__(self):
        tyres.need_static("ResidualTyre.tyre", self.tyre)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        found = self.tyre.forces(contact, state)
        load = tyres.need_load(contact, "ResidualTyre")
        # A loop over the hidden units: a contact may be a batch of any shape, which then needs no further axis.
        scaled = self.stiffness * contact.slip_angle / jnp.maximum(load, 1e-3 * self.load)
        ratio = load / self.load - 1.0
        correction = jnp.zeros_like(scaled)
        for j in range(self.inner.shape[0]):
            a, b, v, c = self.inner[j], self.bias[j], self.outer[j], self.load_share[j]
            odd = 0.5 * (jnp.tanh(a * scaled + b) + jnp.tanh(a * scaled - b))
            correction = correction + v * (1.0 + c * ratio) * odd
        return found._replace(F_y=found.F_y + load * correction)


def with_residual_tyres(car: Any, key: jax.Array, *, units: int = 6) -> Any:
    """The car with a `ResidualTyre` of `units` hidden units around its `front` and its `rear` tyre, with zero correction.

    **Raises** `InputError` for tyres with states of their own.
    """
    check_has("with_residual_tyres: car", car, ("static_loads", "front", "rear"), "vehicles.SingleTrack has them.")
    front_key, rear_key = jax.random.split(key)
    loads = car.static_loads()
    return eqx.tree_at(
        lambda c: (c.front, c.rear),
        car,
        (_around(car.front, loads[0], front_key, units), _around(car.rear, loads[1], rear_key, units)),
    )


def network_weights(model: Any) -> tuple[jax.Array, ...]:
    """The weights of both tyres' networks, for a model whose vehicle has such tyres: a `where` for `train`."""
    kit.check_model("network_weights", model)
    check_has(
        "network_weights: model.system", model.system, ("vehicle",), "estimators.state_space returns such a model."
    )
    car = model.system.vehicle
    for axle in ("front", "rear"):
        check_kind(
            f"network_weights: {axle}",
            getattr(car, axle, None),
            ResidualTyre,
            "with_residual_tyres puts them on a car.",
        )
    return tuple(w for tyre in (car.front, car.rear) for w in (tyre.inner, tyre.bias, tyre.outer, tyre.load_share))


def _around(tyre: AbstractTyre, load: Any, key: jax.Array, units: int) -> ResidualTyre:
    load = jnp.asarray(load)
    if isinstance(tyre, AbstractDynamicTyre):
        tyres.need_static("with_residual_tyres", tyre)
    at_rest, speed = jnp.asarray(0.0, load.dtype), jnp.asarray(20.0, load.dtype)
    stiffness = cornering_stiffness(tyre, Contact(at_rest, load=load, speed=speed))
    # The bends of the hidden units are spread over the range of slips.
    bias = jnp.linspace(0.0, REACH, units, dtype=load.dtype)
    inner = 1.0 + 0.3 * jax.random.normal(key, (units,), load.dtype)
    none = jnp.zeros(units, load.dtype)
    return ResidualTyre(tyre, inner, bias, none, none, stiffness, load)
