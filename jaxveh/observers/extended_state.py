"""The extended-state observer: estimates disturbances in addition to the states, with all poles at one bandwidth."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.host import on_host
from jaxveh._core.names import as_names
from jaxveh.observers.luenberger import Luenberger
from jaxveh.observers.poles import place_poles
from jaxveh.statespace import StateSpace, kit


@on_host
def extended_state(
    model: StateSpace, bandwidth: float, *, dt: float, x: Any = None, u: Any = None, leave: tuple[str, ...] = ()
) -> Luenberger:
    """The linear extended-state observer of a model `with_disturbances`: every pole at `-bandwidth` (1/s).

    (J. Han, From PID to active disturbance rejection control, IEEE Trans. Ind. Electron. 56, 2009; one bandwidth for all gains:
    Z. Gao, Scaling and bandwidth-parameterization based controller tuning, ACC 2003; the poles of a step of `dt` s are
    exp(-bandwidth dt).) The other arguments are those of `place_poles`. On a linear model a constant disturbance is estimated
    exactly, with an error that falls as t^k exp(-bandwidth t). A changing one is followed with a delay of about k / bandwidth
    seconds, where k is the number of poles between it and a channel. A larger bandwidth follows faster and passes more noise.

        banked = statespace.with_disturbances(model, {"v_y": 1.0})
        estimate = run(observers.extended_state(banked, 10.0, dt=0.01, u={"v_x": 25.0}, leave=("yaw",)), banked, drive)
        estimate.mean.disturbance_v_y                                   # m/s^2: -g sin(bank)

    **Raises** `InputError` for a model without disturbances, for a bandwidth that is not positive, and as `place_poles` does:
    each disturbance must reach a channel, and the channels must be able to distinguish them.
    """
    kit.check_model("extended_state", model)
    if not any(name.startswith(kit.DISTURBANCE_PREFIX) for name in model.states):
        raise InputError("extended_state: the model has no disturbances; statespace.with_disturbances adds them.")
    check_positive("bandwidth", bandwidth, "1/s")
    leave = as_names(leave, "leave") or ()
    poles = np.full(len(model.states) - len(set(leave)), -float(bandwidth))
    return Luenberger(place_poles(model, poles, dt=dt, x=x, u=u, leave=leave))
