"""Every tyre's forces at contacts in general position, and at the odd ones, as recorded."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import test_every_dynamic_tyre
import test_every_tyre
import test_wrappers
from recorded_numbers import check_declared, check_recorded, classes_of, lively, without_effect
from shared_data import shared

from jaxveh import tyres
from jaxveh.tyres import Contact

pytestmark = pytest.mark.whole


def file(name):
    return lambda: tyres.from_property_file(shared("tyres") / name)


def every_coefficient(**more):
    """An MF-Tyre none of whose coefficients is zero, none of whose factors is one, with ranges that contacts leave: files leave
    many out."""
    tyre = dataclasses.replace(tyres.typical_mf_tyre(4000.0), turn_slip=tyres.mf_tyre.TurnSlip(PDXP3=4.0))
    ranges = tyres.mf_tyre.Ranges(-0.21, 0.22, -0.23, 0.24, -0.07, 0.08, 1500.0, 7000.0, 2.0e5, 3.0e5, 5.0)
    body = dataclasses.replace(lively(tyre.structure), Q_FYS1=9000.0, Q_FYS2=7000.0, Q_FYS3=5000.0)
    return dataclasses.replace(lively(tyre, 0.6), ranges=ranges, structure=body, **more)


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
    "MF-Tyre with every coefficient": lambda: every_coefficient(spins=True),
    "MF-Tyre of small angles, without limits": lambda: every_coefficient(limits=False, angles=False),
    "MF-Tyre 5.2 with every coefficient": lambda: every_coefficient(version=52),
    "FialaPolynomial, as printed": lambda: tyres.FialaPolynomial(
        90000.0, 60000.0, 0.9, 0.03, contact_length=0.11, as_printed=True
    ),
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


@jax.jit
def outputs(tyre):
    """Loaded radii, patch and lags, beside the forces, while the wheel turns on the spot, too."""
    at = contacts()
    return jax.vmap(tyre.outputs)(at._replace(turn_slip=20.0 * at.turn_slip))._asdict()


VERSIONS = {52: {}, 61: {"spins": True}, 62: {}}


@pytest.mark.parametrize("version", VERSIONS)
def test_outputs_of_mf_tyres_are_those_recorded(version):
    check_recorded(__file__, f"outputs: {version}", outputs(every_coefficient(version=version, **VERSIONS[version])))


def test_every_coefficient_has_an_effect_on_what_is_on_record():
    made = [every_coefficient(version=version, **more) for version, more in VERSIONS.items()]
    before = [outputs(tyre) for tyre in made]
    paths, leaves = zip(*jax.tree_util.tree_leaves_with_path(made[0]), strict=True)
    idle = set()
    for place, (path, leaf) in enumerate(zip(paths, leaves, strict=True)):
        changed = [*leaves[:place], 1.1 * leaf, *leaves[place + 1 :]]
        after = [outputs(jax.tree.unflatten(jax.tree.structure(tyre), changed)) for tyre in made]
        differ = lambda one, other: np.abs(one - other).max() > 1e-6 * np.abs(one).max()
        if not any(map(differ, *(jax.tree.leaves(jax.device_get(found)) for found in (before, after)))):
            idle.add(path[-1].name)
    assert idle == {"INFLPRES", "RIM_RADIUS", "BOTTOM_OFFST"}  # what the equations do not read: checks of a file do


def test_every_number_and_option_of_a_law_stands_out_in_a_tyre_on_record():
    assert without_effect([make() for make in TYRES.values()], "jaxveh.tyres") == set()


DECLARED = classes_of(tyres, tyres.mf_tyre)


@pytest.mark.parametrize("name", DECLARED)
def test_parameters_are_declared_as_recorded(name):
    check_declared(__file__, name, DECLARED[name])
