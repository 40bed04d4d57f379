"""The one place that decides, at trace time, between forms for the CPU and forms for an accelerator.

On the CPU, XLA computes an expression again in each operation into which it fuses it, and its trigonometric functions
are slow; on an accelerator neither is a problem. Every choice by platform in this package is made by these functions.
"""

import jax


def on_cpu() -> bool:
    """Whether code traced now is meant for the CPU: the platform of `jax_default_device`, otherwise the default backend."""
    device = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    if device is None:
        return jax.default_backend() == "cpu"
    return (device if isinstance(device, str) else device.platform) == "cpu"


def barriers_hold() -> bool:
    """Whether XLA respects a `fence` that is not firm: on the CPU before jax 0.12 it removes such fences and fuses across them.

    Only speed depends on this: forms that rely on a fence (a concatenation of long expressions) have an alternative without it.
    """
    return not on_cpu() or jax.__version_info__ >= (0, 12)


def pays_alone() -> bool:
    """Whether a single run, not a batch, is faster when written out: before jax 0.12 it would take twice as long."""
    return barriers_hold()
