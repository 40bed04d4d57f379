"""The one place that decides, at trace time, between forms for the CPU and forms for an accelerator.

On the CPU XLA recomputes an expression in each consumer that it fuses it into, and its trigonometric functions are
slow; on an accelerator both are handled well. Everything in this package that differs by platform asks here.
"""

import jax


def on_cpu() -> bool:
    """Whether code traced now is meant for the CPU: the platform of `jax_default_device`, else the default backend."""
    device = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    if device is None:
        return jax.default_backend() == "cpu"
    return (device if isinstance(device, str) else device.platform) == "cpu"


def barriers_hold() -> bool:
    """Whether XLA keeps to a `fence` that is not firm: on the CPU before jax 0.12 it dissolves them, and fuses across.

    Only speed depends on this: forms that rely on a fence (a concatenation of long expressions) have another without.
    """
    return not on_cpu() or jax.__version_info__ >= (0, 12)


def pays_alone() -> bool:
    """Whether a single run, that is no batch, gains by being written out: before jax 0.12 it would take twice as long."""
    return barriers_hold()
