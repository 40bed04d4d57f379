"""Where wheels are every day: off the ground, at standstill, rolling freely, sliding. Every law of `tyres.__all__`, every
wrapper and every property file gives finite forces there, and finite derivatives."""

import itertools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import members, wanting
from property_files import SMALL
from shared_data import shared, shared_names

from jaxveh import statespace, tyres
from jaxveh._core.names import record
from jaxveh.io.property_file import parse_property_file
from jaxveh.tyres import AbstractDynamicTyre, AbstractTyre, Contact


def tmeasy(**more):
    curve = tyres.TMeasyCurve
    one = curve(90e3, 0.11, 3300.0, 0.40, 3200.0), curve(75e3, 0.16, 3100.0, 0.60, 3000.0)
    two = curve(160e3, 0.12, 6000.0, 0.45, 5700.0), curve(120e3, 0.18, 5500.0, 0.70, 5400.0)
    return tyres.TMeasy(*one, 3000.0, *two, trail=tyres.TMeasyTrail(0.035, 0.20, 0.45), **more)


def magic_formula():
    return tyres.MagicFormula(10.0, 1.4, 3600.0, -0.8, nominal_load=4e3)


def truck():
    """PAC2002 as truck tyres have it: without relaxation lengths, which is said by zeros."""
    return tyres.from_property_file(parse_property_file(SMALL.decode() + "PTY1 = 0\nPTY2 = 0\n"))


LAWS = {
    "Arctangent": lambda: tyres.Arctangent(20e3, 12.0, 0.9),
    "Brush": lambda: tyres.Brush(80e3, 60e3, 0.9),
    "Dugoff": lambda: tyres.Dugoff(80e3, 60e3, 0.9, 0.01),
    "Exponential": lambda: tyres.Exponential(15.0, 0.9, 20.0),
    "Fiala": lambda: tyres.Fiala(80e3, 60e3, 0.9),
    "FialaADAMS": lambda: tyres.FialaADAMS(80e3, 60e3, 0.9, 0.7),
    "FialaPolynomial": lambda: tyres.FialaPolynomial(80e3, 60e3, 0.9),
    "FrictionEllipse": lambda: tyres.FrictionEllipse(tyres.LongitudinalLaw(magic_formula()), magic_formula()),
    "HSRI": lambda: tyres.HSRI(80e3, 60e3, 0.9),
    "IsotropicMagicFormula": lambda: tyres.IsotropicMagicFormula(10.0, 1.4, 0.9, 0.2),
    "Linear": lambda: tyres.Linear(60e3, 80e3),
    "LinearWithLoad": lambda: tyres.LinearWithLoad(60e3, 5e3, 20.0),
    "LongitudinalLaw": lambda: tyres.LongitudinalLaw(tyres.Exponential(15.0, 0.9, 20.0)),
    "LuGre": lambda: tyres.LuGre(200.0, 150.0, 1.1, 0.8, 6.0, 0.15, 0.2, 0.3, 1e-3, 0.5),
    "MFTyre": lambda: tyres.typical_mf_tyre(4000.0, version=62),
    "MagicFormula": lambda: magic_formula(),
    "Mirrored": lambda: tyres.Mirrored(tyres.Brush(80e3, 60e3, 0.9)),
    "OnRoad": lambda: tyres.OnRoad(tyres.Brush(80e3, 60e3, 0.9), 0.8),
    "Parabolic": lambda: tyres.Parabolic(60e3, 0.9, 80e3),
    "Relaxed": lambda: tyres.Relaxed(tyres.Brush(80e3, 60e3, 0.9), 0.2, 0.4),
    "Similarity": lambda: tyres.Similarity(magic_formula(), 4e3),
    "TMeasy": tmeasy,
    "UniTire": lambda: tyres.UniTire(80e3, 60e3, 0.9, 0.4),
}
"""Every law of the package by its name; others of the same law below."""

MORE = {
    "Brush, against velocity": lambda: tyres.Brush(80e3, 60e3, 0.9, slides="against velocity"),
    "TMeasy, parabolas": lambda: tmeasy(after_peak="parabolas"),
    "Relaxed, force": lambda: tyres.Relaxed(tyres.Brush(80e3, 60e3, 0.9), 0.2, 0.4, of="force"),
    "Relaxed MFTyre": lambda: tyres.Relaxed(tyres.typical_mf_tyre(4000.0)),
    "Relaxed truck": lambda: tyres.Relaxed(truck()),
}

FILES = {
    name: lambda name=name: tyres.Relaxed(tyres.from_property_file(shared("tyres") / name))
    for name in shared_names("tyres", "*.tir")
}
"""With their own relaxation lengths, so that forces, moments and lengths are looked at."""

LOADS, SPEEDS, SLIP_SPEEDS, FRICTIONS = (4000.0, 0.0, -100.0), (20.0, 0.0), (None, 0.0, 1.2), (1.0, 0.0)
SLIPS = ((0.0, 0.0), (0.05, -0.02), (-1.2, 2.0), (0.3, -1.0), (1.57, 1e4))


def test_every_law_of_the_package_is_here():
    assert not wanting(members("tyres", AbstractTyre), set(LAWS), {})


def contact(columns, told):
    """Of arrays (rows,); `told`: with the speed of its slips."""
    angle, ratio, load, speed, friction, camber, slip_speed = columns
    slip_speed = slip_speed if told else None
    return Contact(
        slip_angle=angle,
        slip_ratio=ratio,
        load=load,
        speed=speed,
        friction=friction,
        camber=camber,
        slip_speed=slip_speed,
    )


def everything(tyre, columns, told):
    """Forces and moments; of a tyre with states those beside the settled state, that state and the derivative there."""
    at = contact(columns, told)
    stacked = lambda *parts: jnp.stack(
        [jnp.broadcast_to(jnp.asarray(value, at.load.dtype), at.load.shape) for part in parts for value in part]
    )
    if not isinstance(tyre, AbstractDynamicTyre):
        return stacked(tyre.forces(at))
    if isinstance(tyre, tyres.Relaxed) and tyre.own:
        # Its settled state is that of any `Relaxed`; it would double what there is to compile.
        state = record("RelaxedState", dict.fromkeys(tyre.state_names, 1e-3 * jnp.ones_like(at.load)))
        return stacked(tyre.derivatives(at, state), tyre.forces(at, state))
    settled = tyre.start(at)
    state = jax.tree.map(lambda value: value + 1e-3, settled)
    return stacked(settled, tyre.derivatives(at, state), tyre.forces(at, state))


@jax.jit
def with_derivatives(tyre, by_whether_told):
    """Values and derivatives, (8, n, rows) each, by each of the contact's numbers and along all parameters at once: one after
    another, as a batch of directions compiles longer."""

    def found(columns, told):
        def along(direction):
            moved = jax.tree.map(lambda leaf: direction[-1] * jnp.ones_like(leaf), tyre)
            columns_moved = direction[:-1, None] * jnp.ones_like(columns)
            return jax.jvp(
                lambda tyre, columns: everything(tyre, columns, told), (tyre, columns), (moved, columns_moved)
            )

        return jax.lax.map(along, jnp.eye(len(columns) + 1, dtype=columns.dtype))

    return {told: found(columns, told) for told, columns in by_whether_told.items()}


def points(dtype):
    """Columns (7, rows) of contacts that do not tell the speed of their slips, and of those that do."""
    rows = [
        (*slips, load, speed, friction, camber, slip_speed)
        for slips, load, speed, friction, camber, slip_speed in itertools.product(
            SLIPS, LOADS, SPEEDS, FRICTIONS, (0.0, 0.05), SLIP_SPEEDS
        )
    ]
    plain = [(*row[:-1], 0.0) for row in rows if row[-1] is None]
    return {False: np.array(plain, dtype).T, True: np.array([row for row in rows if row[-1] is not None], dtype).T}


def looks_at_the_slip_speed(tyre, columns):
    """Whether a contact that tells the speed of its slips is another program: only few laws read it."""
    text = lambda told: str(jax.make_jaxpr(lambda columns: everything(tyre, columns, told))(columns))
    plain, told = (re.sub("0x[0-9a-f]+", "", text(told)) for told in (False, True))
    return plain != told


def check_finite(tyre, dtype=np.float64):
    tyre, columns = statespace.cast(tyre, dtype), points(dtype)
    if not isinstance(tyre, AbstractDynamicTyre) and not looks_at_the_slip_speed(tyre, columns[True]):
        del columns[False]
    for told, found in with_derivatives(tyre, columns).items():
        for what, values in zip(("values", "derivatives"), found, strict=True):
            values, rows = np.asarray(values).reshape(-1, columns[told].shape[1]).T, columns[told].T
            assert values.dtype == dtype
            bad = ~np.isfinite(values).all(axis=1)
            assert not bad.any(), f"{what} at {rows[bad][0]}: {values[bad][0]}"


# MF-Tyre takes longest to compile: by default it is here with its relaxation lengths, and in version 6.2 with `full`.
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.full] if name == "MFTyre" else []) for name in (*LAWS, *MORE)]
)
def test_finite_forces_and_derivatives(name):
    check_finite({**LAWS, **MORE}[name]())


@pytest.mark.parametrize("name", [name for name in LAWS if name != "MFTyre"])
def test_finite_forces_and_derivatives_in_single_precision(name):
    check_finite(LAWS[name](), np.float32)


@pytest.mark.parametrize("name", FILES)
def test_finite_forces_and_derivatives_of_files(name):
    check_finite(FILES[name]())


def test_a_truck_tyre_that_lifts_keeps_a_length():
    tyre = tyres.Relaxed(truck())

    @jax.jit
    def found(angle):
        at = Contact(slip_angle=angle, load=0.0, speed=20.0)
        return tyre.tyre.outputs(at).sigma_y, tyre.derivatives(at, tyre.start(at))

    length, rates = found(0.05)
    assert float(length) == 0.0
    assert np.isfinite(rates).all()
