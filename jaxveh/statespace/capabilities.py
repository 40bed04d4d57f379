"""What a filter and all filters inside it declare that they can, and the refusals of what one of them cannot."""

from __future__ import annotations

from typing import Any

from jaxveh._core.errors import InputError
from jaxveh.statespace.contract import Gradient, Smoothing, layers


def smoothing_of(filter: Any) -> Smoothing:
    """How a filter can be smoothed: as declared by its own class and those of all filters inside, if they agree."""
    kinds = {_declared_smoothing(layer) for layer in layers(filter)}
    return kinds.pop() if len(kinds) == 1 else Smoothing.none


def check_smooths(who: str, filter: Any) -> Smoothing:
    """How the filter can be smoothed; raises `InputError` naming the filter that cannot."""
    kind = smoothing_of(filter)
    if kind is not Smoothing.none:
        return kind
    name = type(
        next((layer for layer in layers(filter) if _declared_smoothing(layer) is Smoothing.none), filter)
    ).__name__
    raise InputError(
        f"{who}: {name} has no smoother: its class does not declare one (`smooths`, which is not inherited). Take a Gaussian "
        "filter or a particle filter that does; a filter of your own declares smooths = Smoothing.gaussian if it predicts like "
        "the filter inside."
    )


def who_lacks(filter: Any, capability: str) -> str | None:
    """The name of the outermost filter, among a filter and all inside it, that does not declare a capability (`whitens`,
    `has_covariance`, `noise_by_row`, `rows_between`), or None."""
    return next((type(layer).__name__ for layer in layers(filter) if not getattr(layer, capability)), None)


def gradients_of(filter: Any) -> Gradient:
    """The kind of derivatives of a filter's log-likelihood: the least that it and the filters inside declare."""
    return min((layer.gradients for layer in layers(filter)), key=lambda kind: kind.value)


def check_gradients(who: str, filter: Any, least: Gradient) -> None:
    """Raise `InputError` where the derivatives of the filter's log-likelihood are less than `least`."""
    kind = gradients_of(filter)
    if kind.value < least.value:
        name = next(type(layer).__name__ for layer in layers(filter) if layer.gradients is kind)
        wanted = "a Gaussian filter in the form Covariance() or SquareRoot()"
        if least is Gradient.on_average:
            wanted += ", or a particle filter with gradient='score'"
        raise InputError(
            f"{who}: needs derivatives, and those of this {name} are `Gradient.{kind.name}`: must be at least "
            f"`Gradient.{least.name}`. Take {wanted}."
        )


def check_covariance(who: str, filter: Any) -> None:
    """Raise `InputError` where the filter's belief has no covariance of the state."""
    says = (
        "has no covariance of the state (`has_covariance`). Take a Gaussian filter, an ensemble or a particle filter."
    )
    _check_declared("has_covariance", who, filter, says)


def check_noise_by_row(who: str, filter: Any) -> None:
    """Raise `InputError` where a filter inside replaces the given measurement noise by its own."""
    says = (
        "inside it does not take its measurement noise row by row (`noise_by_row`), and would replace that of {who}. "
    )
    _check_declared("noise_by_row", who, filter, says + "Put {who} inside: {kind}({who}(...)).")


def check_rows_between(who: str, filter: Any) -> None:
    """Raise `InputError` if inserting a row would change the filter's result."""
    says = "inside it takes no late rows (`rows_between`): it would repeat its work of each step. "
    _check_declared("rows_between", who, filter, says + "Take a filter that does, or give the rows in their order.")


def _check_declared(capability: str, who: str, filter: Any, says: str) -> None:
    """Raise `InputError` if a filter, or one inside it, the `kind`, does not declare the capability that `who` needs."""
    kind = who_lacks(filter, capability)
    if kind is not None:
        raise InputError(f"{who}: {kind} {says.format(who=who, kind=kind)}")


def _declared_smoothing(filter: Any) -> Smoothing:
    return vars(type(filter)).get("smooths", Smoothing.none)
