"""Every tyre's forces at contacts in general position, and at the odd ones, as recorded."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import test_every_dynamic_tyre
import test_every_tyre
import test_wrappers
from recorded_numbers import check_declared, check_recorded, classes_of
from shared_data import shared

from jaxveh import tyres
from jaxveh.tyres import Contact

pytestmark = pytest.mark.whole


def file(name):
    return lambda: tyres.from_property_file(shared("tyres") / name)


def every_coefficient():
    """An MF-Tyre none of whose coefficients is zero: files leave many out."""
    random, tyre = np.random.default_rng(7), tyres.typical_mf_tyre(4000.0)
    groups = ("longitudinal", "lateral", "aligning", "overturning", "rolling")
    parts = {name: getattr(tyre, name) for name in groups} | {"turn_slip": tyres.mf_tyre.TurnSlip()}
    drawn = lambda number: number if number != 0 else jnp.asarray(random.choice([-1, 1]) * random.uniform(0.02, 0.1))
    return dataclasses.replace(tyre, spins=True, **{name: jax.tree.map(drawn, part) for name, part in parts.items()})


def curves(**more):
    """TMeasy by its other curve."""
    tyre = test_every_tyre.tmeasy()
    return tyres.TMeasy(**{name: getattr(tyre, name) for name in tyre.__dataclass_fields__} | more)


MORE = {
    "Brush, along the velocity": lambda: tyres.Brush(80000.0, 60000.0, 0.9, 0.04, slides="against velocity"),
    "Brush, trail": lambda: tyres.Brush(80000.0, 60000.0, 0.9, 0.04),
    "TMeasy, parabolas": lambda: curves(after_peak="parabolas"),
    "typical MF-Tyre": lambda: tyres.typical_mf_tyre(4000.0),
    "MF-Tyre 6.1": file("mfeval__MagicFormula61_Parameters.tir"),
    "MF-Tyre 5.2": file("chrono__hmmwv__tire__HMMWV_pacejka.tir"),
    "MF-Tyre of a race car": file("tumftm__pa_sim_tireparameters.tir"),
    "MF-Tyre with every coefficient": every_coefficient,
    "generic": lambda: tyres.kit.GENERIC_TYRE.magic_formula(60000.0, 4000.0),
    "relaxed MF-Tyre": test_every_dynamic_tyre.own_lengths,
}
TYRES = (
    {name: law.make for name, law in test_every_tyre.LAWS.items()}
    | test_wrappers.TYRES
    | test_every_dynamic_tyre.TYRES
    | MORE
)
POINTS = 16


def contacts():
    """Points all over the ranges; then without load, standing still, gliding sideways, with a locked wheel, backwards."""
    random = np.random.default_rng(11)
    between = lambda low, high: random.uniform(low, high, POINTS)
    columns = {
        "slip_angle": between(-0.3, 0.3), "slip_ratio": between(-0.3, 0.3), "load": between(500.0, 8000.0),
        "camber": between(-0.1, 0.1), "friction": between(0.3, 1.2), "speed": between(2.0, 40.0),
        "pressure": between(1.8e5, 3.2e5), "turn_slip": between(-0.02, 0.02), "direction": np.ones(POINTS),
    }  # fmt: skip
    odd = (
        ("load", 0.0),
        ("speed", 0.0),
        ("slip_angle", 1.4),
        ("slip_ratio", -1.0),
        ("direction", -1.0),
        ("load", 300.0),
    )
    for place, (name, value) in enumerate(odd):
        columns[name][place] = value
    columns["slip_angle"][6:8], columns["slip_ratio"][7:9] = 0.01, 0.005
    return Contact(**{name: jnp.asarray(values) for name, values in columns.items()})


@jax.jit
def said(tyre, at):
    """Forces, and of a tyre with states these' derivatives, a little beside where it has settled."""

    def one(at):
        if not isinstance(tyre, tyres.AbstractDynamicTyre):
            return tyre.forces(at)._asdict()
        state = jax.tree.map(lambda value: value + 0.001, tyre.start(at))
        return {"forces": tyre.forces(at, state)._asdict(), "rates": tyre.derivatives(at, state)._asdict()}

    return jax.vmap(one)(at)


@pytest.mark.parametrize("name", TYRES)
def test_forces_are_those_recorded(name):
    tyre = TYRES[name]()
    check_recorded(__file__, name, said(tyre, contacts()))
    numbers = [leaf for leaf in jax.tree.leaves(tyre) if leaf.size == 1]
    check_recorded(__file__, f"{name}: coefficients", np.stack(numbers), given=True)


DECLARED = classes_of(tyres, tyres.mf_tyre)


@pytest.mark.parametrize("name", DECLARED)
def test_parameters_are_declared_as_recorded(name):
    check_declared(__file__, name, DECLARED[name])
