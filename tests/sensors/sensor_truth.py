"""A drive that every device can look at: smooth functions of time for every vehicle output there is."""

import jax.numpy as jnp
import numpy as np

NAMES = (
    *("v_x", "v_y", "yaw", "yaw_rate", "yaw_acceleration", "a_x", "a_y", "a_z", "x", "y", "roll", "pitch"),
    *("roll_rate", "pitch_rate", "roll_acceleration", "pitch_acceleration", "grade", "bank"),
    *("omega_fl", "omega_fr", "omega_rl", "omega_rr", "steer", "steering_wheel", "drive_torque", "brake_torque"),
    *("brake_torque_fl", "torque_rl"),
)
_MEANS = {"v_x": 20.0, "a_z": 9.8, "drive_torque": 300.0, "brake_torque": 500.0, "brake_torque_fl": 100.0}
_MEANS |= dict.fromkeys(("omega_fl", "omega_fr", "omega_rl", "omega_rr"), 65.0)


def truth(times, dtype=jnp.float64):
    """The outputs (n,) by name at these times; no two are alike."""
    # By NumPy: nothing is compiled for it.
    t = np.asarray(times, float)
    values = {
        name: _MEANS.get(name, 0.0) + 0.2 * np.sin((1 + 0.1 * place) * t + 0.3 * place)
        for place, name in enumerate(NAMES)
    }
    return {name: jnp.asarray(value, dtype) for name, value in values.items()}
