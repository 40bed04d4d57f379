"""Predicted measurements of satellites, wheels, the rear axle and a camera, and their noise."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record, record_type
from jaxveh.estimators.navigation.system import BALANCE, ROLLS, SLOWEST, STANDS, Navigator, channels_of, misfit_of
from jaxveh.estimators.navigation.window import rotate
from jaxveh.estimators.rear_steer import CHANNEL
from jaxveh.vehicles import GRAVITY

WHEELS_APART = 5.0
"""Factor from the difference of two wheels to the error of their mean. It is large because the error lasts over many rows."""

SATURATED = 0.93
"""Share of the grip beyond which the force no longer determines the slip angle."""

BEND = 0.05
"""Width of the smooth transition to `SATURATED`, as a share of the grip."""

STEEPEST = 0.6
"""rad: limit of an axle's slip angle, beyond which the tangent becomes too large."""


ANGLES = ("course", "heading", "lane_heading")
"""Channels that are angles, known up to whole turns."""


def observation(system: Navigator, t, x, u) -> Any:
    """The predicted measurements by channel."""
    del t
    parts = system.parts
    ahead, aside = antenna_velocity(system, x, u)
    seen = {
        "speed": numerics.hypot(ahead, aside),
        "course": x.yaw + numerics.arctan2(aside, ahead),
        "heading": x.yaw - turned_since(system, x, u, "sky"),
    }
    if parts.wheels:
        # Wheel speeds have no sign; driven wheels turn faster.
        slips = x.wheel_scale + x.wheel_slip * u.a_x
        rolls = numerics.sqrt(jnp.square(x.v_x) + 1e-4)
        seen["wheel_speed"] = (1.0 + slips) * (rolls / numerics.cos(rear_steer(u)) if parts.rear_steer else rolls)
    if parts.axle == "none":
        seen[ROLLS] = (
            x.v_y - system.rear_axle_to_cg * (u.yaw_rate - x.bias_yaw_rate) - x.v_x * numerics.tan(rear_steer(u))
        )
    else:
        seen[BALANCE] = balance(system, x, u)
    if parts.camera:
        seen |= lane(system, x, u)
    if parts.three_more:
        f_x, f_y = system.forces(x, u)
        roll, pitch = system.tilts(x, u)
        seen["a_z"] = GRAVITY * numerics.cos(roll) * numerics.cos(pitch) + x.bias_a_z
        seen[f"{STANDS}_roll"] = x.lean - x.lean_gradient * f_y
        seen[f"{STANDS}_pitch"] = x.dip + system.dip_gradient * f_x
    channels = channels_of(parts)
    return record("NavigationOutputs", {name: numerics.as_wide_as(seen[name], x.v_x) for name in channels})


def velocity_then(system: Navigator, x, u, past: str) -> tuple[Any, Any]:
    """The velocity of the centre of gravity (m/s) at the beginning of `past`, in the car's present axes.

    It is the present velocity less its change since, which is `gained` corrected for biases and slopes.
    """
    lag, gains = system.lags[past], (1.0, 1.0) if system.parts.three_more else system.gains(x)
    leant = (0.0, 0.0)
    if system.parts.three_more:
        # The mean attitude over this time.
        half = 0.5 * lag
        dip = x.dip - half * (u.pitch_rate - x.bias_pitch_rate)
        leant = -dip, x.lean - half * (u.roll_rate - x.bias_roll_rate)
    tilts = x.grade + leant[0], x.bank + leant[1]
    gained = getattr(u, f"{past}_gained_x"), getattr(u, f"{past}_gained_y")
    biases = x.bias_a_x, x.bias_a_y
    ahead, aside = (
        v - ((felt - lag * bias) / gain - lag * GRAVITY * tilt)
        for v, felt, bias, gain, tilt in zip((x.v_x, x.v_y), gained, biases, gains, tilts, strict=True)
    )
    return ahead, aside


def turned_since(system: Navigator, x, u, past: str) -> Any:
    """The angle (rad) by which the car has turned since the beginning of `past`."""
    return getattr(u, f"{past}_turned") - system.lags[past] * x.bias_yaw_rate


def antenna_velocity(system: Navigator, x, u) -> tuple[Any, Any]:
    """The antenna's velocity (m/s) at the time of the satellites' measurement, in the car's present axes.

    It is the velocity of the centre of gravity plus `omega x r` of the lever arm in its past direction; the antenna's height
    counts if the unit measures the roll rate.
    """
    ahead, aside = velocity_then(system, x, u, "sky")
    spun, turned = u.sky_spun - x.bias_yaw_rate, turned_since(system, x, u, "sky")
    arm_x, arm_y, arm_z = system.antenna_x, system.antenna_y, system.antenna_z
    swing_x, swing_y = rotate(-spun * arm_y, spun * arm_x - u.sky_rolled * arm_z, turned)
    return ahead + swing_x, aside + swing_y


def balance(system: Navigator, x, u) -> Any:
    """The rear axle's lateral velocity (to the left) beyond the one that its force implies, m/s.

    Force and motion are averages over `axle_time`, that of the motion by Simpson's rule: a single acceleration is noisy, and an
    adapted law would mistake its noise for slip without force.
    """
    moves = [(x.v_x, x.v_y, u.yaw_rate)]
    for past in ("half", "whole"):
        ahead, aside = rotate(*velocity_then(system, x, u, past), -turned_since(system, x, u, past))
        moves.append((ahead, aside, getattr(u, f"{past}_spun")))
    v_x, v_y, spun = ((now + 4.0 * half + whole) / 6.0 for now, half, whole in zip(*moves, strict=True))
    law, _, share = axle_slip(system, x, u)
    angle = law + x.slip_error * error_growth(system, share) - rear_steer(u)
    return v_y - system.rear_axle_to_cg * (spun - x.bias_yaw_rate) + v_x * numerics.tan(angle)


def rear_steer(u) -> Any:
    """The angle of steered rear wheels, rad."""
    return getattr(u, CHANNEL, 0.0)


def error_growth(system: Navigator, share) -> Any:
    """The law's error at a force of this share of the load, over that without a force."""
    return 1.0 + system.slip_growth * numerics.hypot(share, 0.01)


def axle_slip(system: Navigator, x, u) -> tuple[Any, Any, Any]:
    """The slip angle (rad) that the rear axle's force implies, its derivative by the force over load, and the force over load.

    Linear: force over load = stiffness angle. Saturating: `F = c a / (1 + |c a / grip|^shape)^(1 / shape)`, whose inverse has a
    closed form.
    """
    time, a, length = system.axle_time, system.front_axle_to_cg, system.wheelbase
    a_x, a_y = rotate(u.whole_gained_x / time, u.whole_gained_y / time, -0.5 * u.whole_turned)
    felt = u._replace(a_y=a_y)
    if system.parts.three_more:
        # With the body's attitude in the middle of this time.
        felt = felt._replace(a_y=a_y + GRAVITY * 0.5 * time * (u.roll_rate - x.bias_roll_rate))
    f_y = system.forces(x, felt)[1]
    swing = (u.yaw_rate - u.whole_spun) / time
    force = (a * system.mass * f_y - system.yaw_inertia * swing) / length
    # The measured acceleration without bias states, so that errors of the law are not attributed to them.
    load = system.mass * (GRAVITY * a + system.cg_height * a_x) / length
    share = force / jnp.maximum(load, 0.2 * GRAVITY * system.mass * a / length)
    stiffness = system.stiffness * (jnp.exp(x.stiffening) if system.parts.adapts else 1.0)
    if system.parts.axle == "linear":
        angle, slope = share / stiffness, numerics.as_wide_as(1.0 / stiffness, share)
    else:
        grip = system.grip * (jnp.exp(x.gripping) if system.parts.adapts else 1.0)
        used = numerics.smooth_clip(share / grip, -SATURATED, SATURATED, BEND)
        # Slightly above zero, because a power of zero has no derivative.
        rest = 1.0 - numerics.sqrt(jnp.square(used) + 1e-12) ** system.shape
        angle = used * grip / stiffness * rest ** (-1.0 / system.shape)
        slope = rest ** (-1.0 - 1.0 / system.shape) / stiffness
    return jnp.clip(angle, -STEEPEST, STEEPEST), slope, share


def lane(system: Navigator, x, u) -> dict[str, Any]:
    """Offset from the lane's middle (m, to the left) and heading against it (rad) at the time of the camera's measurement."""
    lag, turned = system.camera_lag, turned_since(system, x, u, "camera")
    along = lag * x.v_x * x.bend
    middle = x.lane_heading - 0.5 * (turned - along)
    then = x.lane_heading - (turned - along)
    before = velocity_then(system, x, u, "camera")
    # The mean velocity, in the axes at the middle of the lag.
    ahead, aside = rotate(0.5 * (x.v_x + before[0]), 0.5 * (x.v_y + before[1]), -0.5 * turned)
    gone = lag * (ahead * numerics.sin(middle) + aside * numerics.cos(middle))
    return {
        "lane_offset": x.lane_offset - gone + system.camera_x * numerics.sin(then),
        "lane_heading": then,
    }


def noise(system: Navigator, t, x, u) -> dict[str, Any]:
    """Standard deviations by channel. That of the course is the lateral error of the velocity over the speed."""
    del t
    parts, moving = system.parts, numerics.sqrt(jnp.square(x.v_x) + jnp.square(x.v_y) + SLOWEST**2)
    # A lasting error counts once per `slip_time`, not in every row.
    lasting = numerics.sqrt(system.slip_time / u.step)
    std = {
        "speed": system.along,
        "course": system.across / moving,
        "heading": system.heading_error,
        "lane_offset": system.lane_error,
        "lane_heading": system.lane_angle_error,
        "a_z": 0.3 * lasting,
        f"{STANDS}_roll": system.lean_error * lasting,
        f"{STANDS}_pitch": system.lean_error * lasting,
    }
    if parts.wheels:
        # A wheel that is in the air or locked is detected by the other one.
        std["wheel_speed"] = (
            system.wheel_error
            + system.wheel_slip_error * jnp.abs(u.a_x) * moving
            + WHEELS_APART * numerics.hypot(u.wheels_apart, 1e-3)
        )
    if parts.axle == "none":
        slip = system.rolling_slip + system.slip_gradient * jnp.abs(system.forces(x, u)[1])
        std[ROLLS] = (0.02 + moving * slip) * lasting
    else:
        angle, slope, _ = axle_slip(system, x, u)
        # Averages of successive rows overlap.
        shared = numerics.sqrt(system.axle_time / u.step)
        force = numerics.hypot(system.force_noise * shared, u.rough / GRAVITY)
        # Near saturation the law gives less and less information on the slip angle.
        uncertain = numerics.hypot(system.slip_noise / numerics.sqrt(u.step), force * slope)
        std[BALANCE] = 0.02 * shared + jnp.abs(x.v_x) * (1.0 + jnp.square(numerics.tan(angle))) * uncertain
    misfits = {name: numerics.sqrt(getattr(u, misfit_of(name))) for name in channels_of(parts)}
    return {name: numerics.as_wide_as(std[name] * misfit, x.v_x) for name, misfit in misfits.items()}


def report(system: Navigator, t, x, u) -> Any:
    """The outputs at the present time: the inertial unit's own lag is compensated with its accelerations."""
    del t
    a_x, a_y = system.accelerations(x, u)
    roll, pitch = system.tilts(x, u)
    lag, yaw_rate = system.sensor_lag, u.yaw_rate - x.bias_yaw_rate
    v_x = x.v_x + lag * (a_x + yaw_rate * x.v_y)
    v_y = x.v_y + lag * (a_y - yaw_rate * x.v_x)
    shown = {
        "v_x": v_x,
        "v_y": v_y,
        "yaw": x.yaw + lag * yaw_rate,
        "sideslip": numerics.arctan2(v_y, numerics.sqrt(jnp.square(v_x) + 1e-4)),
        "roll": roll,
        "pitch": pitch,
        "bank": x.bank,
        "grade": x.grade,
        "lean_gradient": x.lean_gradient,
    }
    shown |= {name: value for name, value in x._asdict().items() if name.startswith("bias_")}
    if system.parts.wheels:
        shown |= {"wheel_scale": x.wheel_scale, "wheel_slip": x.wheel_slip}
    if system.parts.axle != "none":
        weight = system.mass * GRAVITY * system.front_axle_to_cg / system.wheelbase
        adapted = jnp.exp(x.stiffening) if system.parts.adapts else 1.0
        shown |= {
            "slip_error": x.slip_error * error_growth(system, axle_slip(system, x, u)[2]),
            "stiffness_rear": system.stiffness * weight * adapted,
        }
    if system.parts.camera:
        shown |= {"lane_offset": x.lane_offset, "lane_heading": x.lane_heading}
    return record_type("NavigationReport", shown)(*[numerics.as_wide_as(value, x.v_x) for value in shown.values()])
