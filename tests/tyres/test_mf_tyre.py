"""MF-Tyre against the reference evaluator MFeval 4.3.1, and what the book says of every Magic Formula tyre."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shared_data import shared, shared_names

from jaxveh import tyres
from jaxveh.tyres import Contact

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


def tyre_of(name, **settings):
    return tyres.from_property_file(shared("tyres") / name, **settings)


@pytest.fixture(scope="module", params=[(table, mode) for table in FILES for mode in (111, 121)], ids=str)
def compared(request):
    """The reference's rows of one mode, and ours."""
    import pandas as pd

    table, mode = request.param
    rows = pd.read_csv(shared(table)).astype(float)
    rows = rows[rows.useMode == mode]
    assert len(rows) == 1086
    column = lambda name: jnp.asarray(rows[name].to_numpy())
    contact = Contact(
        slip_angle=-column("in_alpha"),
        slip_ratio=column("in_kappa"),
        load=column("in_Fz"),
        camber=column("in_gamma"),
        speed=column("in_Vx"),
        pressure=column("in_P"),
    )
    tyre = tyre_of(FILES[table], angles=mode == 121)
    return table, rows, jax.jit(lambda tyre, contact: tyre.outputs(contact))(tyre, contact)


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


@pytest.mark.parametrize("name", shared_names("tyres", "*.tir"))
def test_every_file_evaluates_with_finite_gradients(name):
    tyre = tyre_of(name)
    load = tyre.structure.FNOMIN

    def total(tyre, slips):
        return sum(tyre.forces(Contact(slip_angle=slips[0], slip_ratio=slips[1], camber=slips[2], load=slips[3])))

    for slips in ([0.0, 0.0, 0.0, 1.0], [0.1, -0.05, 0.02, 0.7], [0.0, 0.1, 0.0, 1.0], [0.1, 0.0, 0.0, 0.0]):
        point = jnp.asarray(slips) * jnp.asarray([1.0, 1.0, 1.0, load])
        gradients = jax.grad(total, argnums=(0, 1))(tyre, point)
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves((total(tyre, point), gradients)))
    # Signs of this package: a positive slip angle pushes left, a positive slip ratio forward.
    found = tyre.forces(Contact(slip_angle=jnp.asarray(0.05), slip_ratio=jnp.asarray(0.05), load=load))
    assert found.F_y > 0 and found.F_x >= 0


def test_stiffnesses_are_slopes_and_forces_vanish_with_load():
    tyre = tyre_of(FILES["mfeval_pacejkabook.csv"])
    load = tyre.structure.FNOMIN
    slope = tyres.cornering_stiffness(tyre, Contact(load=load))
    np.testing.assert_allclose(slope, tyre.outputs(Contact(load=load)).K_ya, rtol=1e-6)
    # A wheel off the ground.
    off = tyre.forces(Contact(slip_angle=jnp.asarray(0.1), slip_ratio=jnp.asarray(0.1), load=jnp.asarray(-100.0)))
    assert all(float(value) == 0.0 for value in off)


def test_gradients_equal_differences():
    tyre = tyre_of(FILES["mfeval_mf61.csv"])
    rng = np.random.default_rng(0)

    @jax.jit
    def forces(slips):
        a, k, g, load = slips
        return jnp.stack(tyre.forces(Contact(slip_angle=a, slip_ratio=k, camber=g, load=load, speed=jnp.asarray(20.0))))

    for _ in range(20):
        point = jnp.asarray(
            [rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(-0.05, 0.05), rng.uniform(2e3, 9e3)]
        )
        steps = jnp.diag(jnp.asarray([1e-6, 1e-6, 1e-6, 1e-2]))
        numeric = jnp.stack([(forces(point + h) - forces(point - h)) / (2 * jnp.sum(h)) for h in steps], axis=1)
        scale = jnp.asarray([[1e5, 1e5, 1e5, 1.0]])
        np.testing.assert_allclose(jax.jacfwd(forces)(point) / scale, numeric / scale, atol=2e-6)


def test_friction_scales_and_what_is_unknown_is_nominal():
    tyre = tyre_of(FILES["mfeval_mf61.csv"])
    contact = Contact(slip_angle=jnp.asarray(0.3), load=tyre.structure.FNOMIN)
    slippery = tyre.forces(contact._replace(friction=0.4))
    assert 0.35 < slippery.F_y / tyre.forces(contact).F_y < 0.45
    told = contact._replace(speed=tyre.structure.LONGVL, pressure=tyre.structure.INFLPRES)
    np.testing.assert_array_equal(tyre.forces(told).M_z, tyre.forces(contact).M_z)


def test_bad_requests_name_the_value():
    with pytest.raises(tyres.base.InputError, match="contact.load = None"):
        tyre_of(FILES["mfeval_mf61.csv"]).forces(Contact(slip_angle=0.1))
