"""A rig plan, and what a rig would measure of a known tyre on it."""

import jax
import jax.numpy as jnp
import numpy as np
from shared_data import shared

from jaxveh import tyres
from jaxveh.fitting.rig_problem import contact_of
from jaxveh.io import RigTable

SPEED = 16.6
LOADS, OTHER_LOADS = (2500.0, 5000.0, 7500.0, 9500.0), (3500.0, 7000.0)
PRESSURES, NOMINAL = (230e3, 260e3, 290e3), 260e3
CAMBERS = np.radians([-4.0, -2.0, 0.0, 2.0, 4.0])
COMBINED_CAMBERS, COMBINED_ANGLES = np.radians([0.0, 4.0]), np.radians([-6.0, -2.0, 2.0, 6.0])


def truth():
    """MF-Tyre 6.1 with every effect, as its reference has it."""
    return tyres.from_property_file(shared("tyres") / "mfeval__MagicFormula61_Parameters.tir")


def plan(points=25):
    """Sweeps of slip angle, of slip ratio, and of slip ratio at a slip angle, over loads, cambers and pressures."""
    angle, ratio = np.radians(np.linspace(-14, 14, points)), np.linspace(-0.25, 0.25, points)
    sweeps = []
    for pressure in PRESSURES:
        nominal = pressure == NOMINAL
        for load in LOADS if nominal else OTHER_LOADS:
            for camber in CAMBERS if nominal else (0.0,):
                at = (load, camber, SPEED, pressure)
                sweeps += [(angle, 0.0, *at), (0.0, ratio, *at)]
                if camber in COMBINED_CAMBERS:
                    sweeps += [(steady, ratio, *at) for steady in COMBINED_ANGLES]
    columns = [np.concatenate([np.broadcast_to(sweep[i], points) for sweep in sweeps]) for i in range(6)]
    return np.stack(columns), np.repeat(np.arange(len(sweeps)), points)


def table(forces, columns, run=None, noise=0.0, seed=0):
    """The rig table of forces by channel, with noise as a share of each channel's peak."""
    random = np.random.default_rng(seed)
    measured = {
        name: np.asarray(values) + noise * peak(values) * random.standard_normal(np.shape(values))
        for name, values in forces.items()
    }
    angle, ratio, load, camber, speed, pressure = columns
    inputs = dict(slip_angle=angle, slip_ratio=ratio, load=load, camber=camber, speed=speed, pressure=pressure)
    return RigTable(**inputs, **measured, run=run)


def peak(values):
    return float(np.nanpercentile(np.abs(values), 99.5))


forces = jax.jit(lambda tyre, contact: tyre.forces(contact))


def measured_of(tyre, columns, channels):
    """The channels of a tyre on the plan, without noise."""
    empty = table({"F_x": np.zeros(columns.shape[1])}, columns)
    found = forces(tyre, contact_of(empty))
    return {name: np.asarray(getattr(found, name)) for name in channels}


def small_plan(points=30):
    """Pure and combined slip at three loads: enough for a law of a few coefficients."""
    angle, ratio = np.linspace(-0.2, 0.2, points), np.linspace(-0.2, 0.2, points)
    sweeps = [
        sweep for load in (2000.0, 4000.0, 6000.0)
        for sweep in ((angle, 0.0, load), (0.0, ratio, load), (0.05, ratio, load))
    ]  # fmt: skip
    columns = [np.concatenate([np.broadcast_to(sweep[i], points) for sweep in sweeps]) for i in range(3)]
    rest = [np.full(columns[0].shape, value) for value in (0.0, SPEED, NOMINAL)]
    return np.stack([*columns, *rest]), np.repeat(np.arange(len(sweeps)), points)


def brush():
    return tyres.Brush(jnp.asarray(9e4), jnp.asarray(7e4), jnp.asarray(0.95))
