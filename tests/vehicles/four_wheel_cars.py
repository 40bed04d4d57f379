"""The cars of these tests, the mirror, and what every one of them is asked: finite, smooth, symmetric, of one precision."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import tyres, vehicles
from jaxveh._core.names import record
from jaxveh.roads import LEVEL, Ground

BODY = {
    "mass": 1450.0,
    "yaw_inertia": 2300.0,
    "front_axle_to_cg": 1.15,
    "rear_axle_to_cg": 1.55,
    "cg_height": 0.55,
}
TRACKS = {"track_front": 1.52, "track_rear": 1.48}
ROLLING = {
    "sprung_mass": 1280.0,
    "roll_inertia": 480.0,
    "roll_stiffness_front": 45e3,
    "roll_stiffness_rear": 30e3,
    "roll_damping_front": 2500.0,
    "roll_damping_rear": 1800.0,
    "roll_centre_front": 0.04,
    "roll_centre_rear": 0.12,
    "roll_yaw_product": 60.0,
}
SLOPES = Ground(0.9, 0.5, 0.8, 0.6, 0.05, -0.08)


def brush(share=1.0):
    """A wheel's tyre; `share=2` is an axle's two of them together."""
    return tyres.Brush(share * 90e3, share * 55e3, 1.0)


def car_of(kind, **changes):
    """A car of this class with ordinary numbers."""
    single = kind is vehicles.SingleTrack3DOF
    numbers = {**BODY, "front": brush(1 + single), "rear": brush(1 + single)}
    numbers |= {} if single else TRACKS
    numbers |= ROLLING if kind in (vehicles.Roll3DOF, vehicles.Roll4DOF) else {}
    return kind(**{**numbers, **changes})


def asymmetric():
    """A tyre with ply-steer and conicity."""
    tyre = tyres.typical_mf_tyre(3600.0)
    return eqx.tree_at(
        lambda t: (t.lateral.PHY1, t.lateral.PVY1, t.lateral.PEY3), tyre, [jnp.asarray(v) for v in (0.01, 0.03, 0.2)]
    )


def inputs(dtype=float, **values):
    return record("Inputs", {name: jnp.asarray(value, dtype) for name, value in values.items()})


def state(car, **values):
    """The car's state with these fields, the others zero."""
    fields = car.state_type._fields
    assert set(values) <= set(fields)
    return car.state_type(*[jnp.asarray(values.get(name, 0.0), float) for name in fields])


# The mirror of the car's x-z plane

ODD = {
    "v_y", "yaw", "course", "yaw_rate", "yaw_acceleration", "a_y", "a_y_felt", "sideslip", "steer", "steering_wheel",
    "steer_rate", "steering_torque", "roll", "roll_rate", "roll_acceleration", "F_y", "M_z", "slip_angle", "bank",
    "slip_angle_front", "slip_angle_rear", "F_yf", "F_yr", "M_zf", "M_zr",
}  # fmt: skip
OTHER = {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"}


def mirrored(values):
    """The same record seen in a mirror; states of a mirrored wheel's tyre are in the mirror already."""
    found = {}
    for name in values._fields:
        head, _, tail = name.rpartition("_")
        if tail in OTHER:
            found[name] = (-1.0 if head in ODD else 1.0) * getattr(values, f"{head}_{OTHER[tail]}")
        elif name[:2] in OTHER and name[2] == "_":
            found[name] = getattr(values, OTHER[name[:2]] + name[2:])
        else:
            found[name] = (-1.0 if name in ODD else 1.0) * getattr(values, name)
    return type(values)(**found)


def close(found, expected, rtol=1e-10, atol=1e-9):
    for name, value in expected._asdict().items():
        np.testing.assert_allclose(getattr(found, name), value, rtol=rtol, atol=atol, err_msg=name)


def evaluated(car, x, u, ground=LEVEL):
    """Rates and outputs. Not compiled: a test looks once or twice, and compiling takes a hundred times as long as looking."""
    return car.evaluate(0.0, x, u, on(ground))


def on(ground):
    """The ground as arrays, which may be differentiated."""
    return Ground(*[jnp.asarray(v, float) for v in ground])


def assert_symmetric(car, x, u, ground=SLOPES):
    """A mirrored car in a mirrored world moves as the mirror shows it."""
    there, seen = evaluated(car, x, u, ground), evaluated(car, mirrored(x), mirrored(u), mirrored(ground))
    for found, expected in zip(seen, there, strict=True):
        close(found, mirrored(expected))
    assert abs(float(there[0].yaw_rate)) > 1e-2


# Derivatives and precision


def weighed(car, x, u, ground):
    """Everything that the car says, as one number."""
    values = jax.tree.leaves(car.evaluate(0.0, x, u, ground))
    weights = np.random.default_rng(5).normal(size=len(values))
    return sum(w * jnp.tanh(1e-3 * jnp.sum(v)) for w, v in zip(weights, values, strict=True))


def slopes(everything):
    """Derivatives with respect to every array."""
    return eqx.filter_grad(lambda everything: weighed(*everything))(everything)


def assert_gradients(car, x, u, ground=SLOPES, rtol=2e-6):
    """Reverse mode over every parameter, state, input and the ground agrees with central differences in ten directions."""
    everything = car, x, u, on(ground)
    arrays, rest = eqx.partition(everything, eqx.is_inexact_array)
    gradient = jax.tree.leaves(slopes(everything))
    assert all(np.isfinite(leaf).all() for leaf in gradient)
    rng, step = np.random.default_rng(7), 1e-5
    for _ in range(10):
        way = jax.tree.map(lambda leaf: leaf * rng.normal(), arrays)
        shifted = [jax.tree.map(lambda leaf, d, s=s: leaf + s * step * d, arrays, way) for s in (1.0, -1.0)]
        above, below = (weighed(*eqx.combine(these, rest)) for these in shifted)
        found = sum(jnp.sum(g * d) for g, d in zip(gradient, jax.tree.leaves(way), strict=True))
        np.testing.assert_allclose(found, (above - below) / (2 * step), rtol=rtol, atol=1e-8)


def assert_finite(car, x, u, ground=LEVEL):
    """Values, and the gradient of a mixture of them over every parameter, state, input and the ground, are finite."""
    everything = car, x, u, on(ground)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(evaluated(car, x, u, ground)))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes(everything)))


def drive(car, inputs_at, x, duration, step):
    """States at the steps' ends by RK4; cars of one kind over as many steps share one compilation."""
    steps = round(duration / step)
    starts = step * jnp.arange(steps, dtype=float)
    times = starts[:, None] + step * jnp.asarray([0.0, 0.5, 0.5, 1.0])
    u = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, times.shape), inputs_at(times))
    return _drive(car, x, times, u, jnp.asarray(step))


@eqx.filter_jit
def _drive(car, x, times, inputs, step):
    # The stages are a loop, so that the car is compiled once.
    ahead, weights = jnp.asarray([0.0, 0.5, 0.5, 1.0]), jnp.asarray([1.0, 2.0, 2.0, 1.0]) / 6

    def advance(x, row):
        def stage(carried, now):
            rate, end = carried
            t, u, share, weight = now
            rate = car.derivatives(t, jax.tree.map(lambda a, k: a + share * step * k, x, rate), u)
            return (rate, jax.tree.map(lambda a, k: a + weight * step * k, end, rate)), None

        still = jax.tree.map(jnp.zeros_like, x)
        (_, end), _ = jax.lax.scan(stage, (still, x), (*row, ahead, weights))
        return end, end

    return jax.lax.scan(advance, x, (times, inputs))[1]
