"""MF-Tyre against the reference evaluator MFeval 4.3.1, and what the book says of every Magic Formula tyre."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import mfeval_rows
import numpy as np
import pytest
from shared_data import shared, shared_names

from jaxveh import InputError, tyres
from jaxveh.tyres import Contact
from jaxveh.tyres.evaluation import evaluate

pytestmark = pytest.mark.product

FILES = {
    "mfeval_mf61.csv": "mfeval__MagicFormula61_Parameters.tir",
    "mfeval_pacejkabook.csv": "mfeval__PacejkaBook_Defaults.tir",
}
FORCES = {"Fx": "F_x", "Fy": "F_y", "Mx": "M_x", "My": "M_y", "Mz": "M_z"}
INTERNALS = {
    "t": "trail", "Mzr": "M_zr", "mux": "mu_x", "muy": "mu_y", "Kxk": "K_xk", "omega": "omega", "Re": "R_e", "Rl": "R_l",
    "rho": "rho", "two_a": "a", "two_b": "b", "Cx": "C_x", "Cy": "C_y", "Cz": "C_z", "sigmax": "sigma_x", "sigmay": "sigma_y",
    "Kya": "K_ya",
}  # fmt: skip
FACTOR = {"two_a": 2.0, "two_b": 2.0, "Kya": -1.0}


ADDED_62 = {
    "Q_FCY2": -0.4, "Q_CAM1": 80.0, "Q_CAM2": 250.0, "Q_CAM3": 0.5, "Q_FYS1": -20000.0, "Q_FYS2": -50000.0, "Q_FYS3": 80000.0,
    "ASPECT_RATIO": 0.55,
}  # fmt: skip
ADDED_SPIN = {
    "PDXP2": 0.1, "PDXP3": 2.0, "PDYP2": 0.2, "PDYP3": 1.5, "PDYP4": 0.3, "PHYP3": 0.02, "PECP2": 0.1, "PKYP1": 1.2,
}  # fmt: skip


def tyre_of(name, **settings):
    return tyres.from_property_file(shared("tyres") / name, **settings)


evaluated = jax.jit(lambda tyre, contact: tyre.outputs(contact))


@pytest.fixture(scope="module", params=[(table, mode) for table in FILES for mode in (111, 121)], ids=str)
def compared(request):
    """The reference's rows of one mode, and ours."""
    import pandas as pd

    table, mode = request.param
    rows = pd.read_csv(shared(table)).astype(float)
    rows = rows[rows.useMode == mode]
    assert len(rows) == 1086
    column = lambda name: rows[name].to_numpy()
    contact = Contact(
        slip_angle=-column("in_alpha"),
        slip_ratio=column("in_kappa"),
        load=column("in_Fz"),
        camber=column("in_gamma"),
        speed=column("in_Vx"),
        pressure=column("in_P"),
    )
    tyre = tyre_of(FILES[table], angles=mode == 121)
    return table, rows, evaluated(tyre, contact)


@pytest.mark.parametrize("name", FORCES)
def test_forces_and_moments_are_the_reference_s(compared, name):
    _, rows, found = compared
    expected = rows[name].to_numpy()
    # Beside 1e-9 of the value, what sums of terms of the load's size lose: it shows where a force passes through zero.
    allowed = 1e-9 * np.abs(expected) + 1e-15 * rows.in_Fz.to_numpy()
    np.testing.assert_array_less(np.abs(np.asarray(getattr(found, FORCES[name])) - expected), allowed)


@pytest.mark.parametrize("name", INTERNALS)
def test_internals_are_the_reference_s(compared, name):
    table, rows, found = compared
    expected = rows[name].to_numpy()
    ours = FACTOR.get(name, 1.0) * np.asarray(getattr(found, INTERNALS[name]))
    if table == "mfeval_pacejkabook.csv":
        if name in ("rho", "Rl", "Cz"):
            # The file has Q_FZ2 = 0, for which the reference divides by zero and says that the tyre does not sink at all.
            assert (rows.rho == 0).all()
            # Ours sinks by what its force then is: load = stiffness * rho, softened by speed and forces (A2).
            rho, load = np.asarray(found.rho), rows.in_Fz.to_numpy()
            stiffness = float(tyre_of(FILES[table]).structure.VERTICAL_STIFFNESS)
            assert (rho > 0).all()
            np.testing.assert_allclose(rho * stiffness, load, rtol=0.35)
            np.testing.assert_allclose(np.asarray(found.C_z) * rho, load, rtol=1e-12)
            np.testing.assert_allclose(np.asarray(found.R_l) + rho, rows.Rl, rtol=1e-12)
            return
        if name == "t":
            # At exactly zero slip angle and shift the reference takes sign(0) = 0 and forgets the slip ratio: one point, beside
            # which its own trail is another.
            same = ~((rows.in_alpha == 0) & (rows.in_kappa != 0)).to_numpy()
            assert (~same).sum() == 124 * 2
            expected, ours = expected[same], ours[same]
    np.testing.assert_allclose(ours, expected, rtol=1e-8)


@jax.jit
def with_finite_gradients(tyre, contact):
    """The forces, and whether all gradients of their sum are finite.

    Compiled once a version; looked at inside, as a program without hundreds of results compiles in half the time.
    """

    def total(tyre, contact):
        forces = tyre.forces(contact)
        return sum(forces), forces

    (value, forces), found = jax.value_and_grad(total, argnums=(0, 1), has_aux=True)(tyre, contact)
    return forces, jnp.all(jnp.stack([jnp.isfinite(leaf).all() for leaf in jax.tree.leaves((value, found))]))


@pytest.mark.parametrize("name", shared_names("tyres", "*.tir"))
def test_every_file_evaluates_with_finite_gradients(name):
    tyre = tyre_of(name)
    load = np.asarray(tyre.structure.FNOMIN)

    def found(*slips, share):
        angle, ratio, camber, friction = (np.asarray(value) for value in (*slips, 1.0))
        point = Contact(
            slip_angle=angle, slip_ratio=ratio, camber=camber, load=np.asarray(share * load), friction=friction
        )
        return with_finite_gradients(tyre, point)

    assert found(0.0, 0.0, 0.0, share=1.0)[1]
    assert found(0.1, -0.05, 0.02, share=0.7)[1]
    assert found(0.0, 0.1, 0.0, share=1.0)[1]
    assert found(0.1, 0.0, 0.0, share=0.0)[1]
    # Signs of this package: a positive slip angle pushes left, a positive slip ratio forward.
    forces, _ = found(0.05, 0.05, 0.0, share=1.0)
    assert forces.F_y > 0 and forces.F_x >= 0


def test_stiffnesses_are_slopes_and_forces_vanish_with_load():
    tyre = tyre_of(FILES["mfeval_pacejkabook.csv"])

    @jax.jit
    def found(load):
        # The last one: a wheel off the ground.
        off = Contact(slip_angle=jnp.asarray(0.1), slip_ratio=jnp.asarray(0.1), load=jnp.asarray(-100.0))
        contact = Contact(load=load)
        return tyres.cornering_stiffness(tyre, contact), tyre.outputs(contact).K_ya, tyre.forces(off)

    slope, stiffness, off = found(tyre.structure.FNOMIN)
    np.testing.assert_allclose(slope, stiffness, rtol=1e-6)
    assert all(float(value) == 0.0 for value in off)


def test_gradients_equal_differences():
    tyre = tyre_of(FILES["mfeval_mf61.csv"])
    rng = np.random.default_rng(0)

    def forces(slips):
        a, k, g, load = slips
        found = tyre.forces(Contact(slip_angle=a, slip_ratio=k, camber=g, load=load, speed=jnp.asarray(20.0)))
        return jnp.stack(found), jnp.stack(found)

    both = jax.jit(jax.jacfwd(forces, has_aux=True))
    for _ in range(20):
        point = np.array(
            [rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(-0.05, 0.05), rng.uniform(2e3, 9e3)]
        )
        steps = np.diag([1e-6, 1e-6, 1e-6, 1e-2])
        ends = [(both(point + h)[1], both(point - h)[1]) for h in steps]
        numeric = np.stack([np.subtract(*end) / (2 * np.sum(h)) for end, h in zip(ends, steps, strict=True)], axis=1)
        scale = np.array([[1e5, 1e5, 1e5, 1.0]])
        np.testing.assert_allclose(np.asarray(both(point)[0]) / scale, numeric / scale, atol=2e-6)


def test_friction_scales_and_what_is_unknown_is_nominal():
    tyre = tyre_of(FILES["mfeval_mf61.csv"])
    nominal = tyre.structure

    @jax.jit
    def found(angle):
        contact = Contact(slip_angle=angle, load=nominal.FNOMIN)
        told = contact._replace(speed=nominal.LONGVL, pressure=nominal.INFLPRES)
        return [tyre.forces(at) for at in (contact, contact._replace(friction=0.4), told)]

    plain, slippery, told = found(0.3)
    assert 0.35 < slippery.F_y / plain.F_y < 0.45
    np.testing.assert_array_equal(told.M_z, plain.M_z)


def test_bad_requests_name_the_value():
    with pytest.raises(tyres.base.InputError, match="contact.load = None"):
        tyre_of(FILES["mfeval_mf61.csv"]).forces(Contact(slip_angle=0.1))


def version_62():
    """The shared 6.1 file as version 6.2."""
    tyre = tyre_of(FILES["mfeval_mf61.csv"])
    structure = dataclasses.replace(tyre.structure, **ADDED_62)
    spin = dataclasses.replace(tyre.turn_slip, **ADDED_SPIN)
    return dataclasses.replace(tyre, structure=structure, turn_slip=spin, version=62)


def known(rows, mode):
    """The inputs of known answers as columns, and the answers."""
    columns = {name: np.array(values) for name, values in rows.items()}
    given = {name: columns.pop(name) for name in list(columns) if name.startswith("in_")}
    return {**given, "useMode": np.full(len(given["in_Fz"]), mode)}, columns


@pytest.mark.thorough
def test_version_62_is_the_reference_s():
    inputs, answers = known(mfeval_rows.VERSION_62, 121)
    found = evaluate(version_62(), inputs)
    for name, expected in answers.items():
        np.testing.assert_allclose(found[name], expected, rtol=1e-9 if name in FORCES else 1e-8, err_msg=name)


def test_a_number_that_is_none_is_named_with_its_row():
    inputs, _ = known(mfeval_rows.VERSION_62, 121)
    inputs["in_Fz"] = np.where(np.arange(len(inputs["in_Fz"])) == 2, np.nan, inputs["in_Fz"])
    with pytest.raises(InputError, match="in_Fz = nan in row 2: must be finite"):
        evaluate(version_62(), inputs)


def test_version_52_is_the_reference_s():
    tyre = tyre_of("tumftm__pa_sim_tireparameters.tir")
    assert tyre.version == 52
    tyre = eqx.tree_at(lambda t: t.structure.Q_FZ2, tyre, jnp.asarray(1e-4))
    inputs, answers = known(mfeval_rows.VERSION_52, 121)
    found = evaluate(tyre, inputs)
    for name, expected in answers.items():
        rows = slice(1, None) if name == "Mzr" else slice(None)  # at slip angle 0 the reference takes sign(0) = 0
        rtol = 1e-9 if name in FORCES else 1e-8
        # The reference loses digits in rho: it subtracts roots that are nearly equal.
        rtol = 1e-7 if name in ("rho", "Cz") else rtol
        np.testing.assert_allclose(found[name][rows], expected[rows], rtol=rtol, err_msg=name)


@pytest.mark.thorough
def test_turn_slip_is_the_reference_s():
    """Of M_z three slips of the evaluator were mended before its answers were written down: the slope (4.99) is
    `QDZ8 + QDZ9 df_z`, not their product; F_y' (4.74) is that without spin; arccos ends at 1 instead of going complex."""
    tyre = version_62()
    inputs, answers = known(mfeval_rows.TURN_SLIP, 122)
    found = evaluate(tyre, inputs)
    for name, expected in answers.items():
        np.testing.assert_allclose(found[name], expected, rtol=1e-8, err_msg=name)
    _, moments = known(mfeval_rows.TURN_SLIP_MOMENT, 122)
    for name, expected in moments.items():
        np.testing.assert_allclose(found[name], expected, rtol=3e-7, err_msg=name)
    straight = evaluate(tyre, {**inputs, "useMode": np.full(6, 121)})
    assert np.all(np.abs(found["Fy"] / straight["Fy"] - 1) > 1e-4)


def test_turn_slip_is_smooth_at_zero_and_refused_in_52():
    tyre = dataclasses.replace(version_62(), spins=True)
    contact = Contact(*map(np.asarray, (0.0, 0.0, 4000.0, 0.0, 1.0, 20.0)))

    def found(phi, tyre=tyre, **more):
        at = {name: np.asarray(value) for name, value in ({"turn_slip": phi} | more).items()}
        return with_finite_gradients(tyre, contact._replace(**at))

    for phi, camber in ((0.0, 0.0), (0.0, 0.02), (1e-3, 0.0), (30.0, 0.0)):
        assert found(phi, camber=camber)[1], (phi, camber)
    # A section of zeros is a tyre that spin does not shift.
    zeros = dataclasses.replace(tyre, turn_slip=jax.tree.map(jnp.zeros_like, tyre.turn_slip))
    assert found(0.1, zeros, camber=0.02)[1]
    # Turning on the spot needs a moment against the turn, and leaves less force sideways.
    turning, straight = (found(phi, slip_angle=0.1)[0] for phi in (2.0, 0.0))
    assert abs(turning.F_y) < abs(straight.F_y)
    with pytest.raises(tyres.base.InputError, match="version 5.2 has no turn slip"):
        dataclasses.replace(tyre, version=52)


@pytest.mark.thorough
def test_the_loaded_radius_of_62_carries_the_load_and_has_its_derivatives():
    tyre = version_62()

    @jax.jit
    @jax.value_and_grad
    def radius(x):
        load, angle, camber = x
        contact = Contact(slip_angle=angle, load=load, camber=camber, speed=jnp.asarray(20.0))
        return tyre.outputs(contact).R_l

    point, steps = np.array([5000.0, 0.05, 0.02]), np.diag([100.0, 1e-3, 1e-3])
    numeric = [(float(radius(point + h)[0]) - float(radius(point - h)[0])) / (2 * np.sum(h)) for h in steps]
    _, slopes = radius(point)
    np.testing.assert_allclose(slopes, numeric, rtol=2e-3)
    assert float(slopes[0]) < 0


def test_the_contact_patch_is_its_equation_and_ends_where_the_rim_would_touch_the_road():
    """A9, A10 of MF-Tyre 6.1 (I. Besselink, A. Schmeitz & H. Pacejka 2010): a grows with share and its root, b with its cube
    root."""
    structure = version_62().structure
    r, stiffness = float(structure.UNLOADED_RADIUS), float(structure.vertical_stiffness(0.1))
    lowest = r - float(structure.RIM_RADIUS) - float(structure.BOTTOM_OFFST)
    for load in (0.0, 1500.0, 4000.0, 2.0 * lowest * stiffness):
        share = min(load, lowest * stiffness) / (stiffness * r)
        a = r * (float(structure.Q_RA2) * share + float(structure.Q_RA1) * share**0.5)
        b = float(structure.WIDTH) * (float(structure.Q_RB2) * share + float(structure.Q_RB1) * share ** (1 / 3))
        np.testing.assert_allclose(structure.contact_patch(load, 0.1, 61), (a, b), rtol=1e-12, atol=1e-15)


def test_below_vxlow_shifts_fade_smoothly_and_slips_alone_where_the_car_gives_no_slip_speed():
    """A car that gives the slip speed has its own way of a wheel that hardly turns."""
    tyre = tyre_of("tumftm__pa_sim_tireparameters.tir")
    tyre = eqx.tree_at(lambda t: (t.ranges.VXLOW, t.lateral.PVY1), tyre, (jnp.asarray(2.0), jnp.asarray(0.05)))
    at = lambda angle, **given: float(tyre.forces(Contact(slip_angle=angle, load=3000.0, **given)).F_y)
    shift = lambda **given: 0.5 * (at(1e-9, **given) + at(-1e-9, **given))
    # A third of VXLOW: 0.5 (1 - cos(pi / 3)) = 1 / 4.
    for given in ({"slip_speed": 1.0}, {}):
        np.testing.assert_allclose(shift(speed=2.0 / 3.0, **given) / shift(speed=20.0, **given), 0.25, rtol=0.02)
    slope = lambda **given: at(1e-4, **given) - at(-1e-4, **given)
    np.testing.assert_allclose(slope(speed=2.0 / 3.0, slip_speed=1.0) / slope(speed=20.0), 1.0, rtol=0.05)
    np.testing.assert_allclose(slope(speed=2.0 / 3.0) / slope(speed=20.0), 1.0 / 3.0, rtol=0.05)
