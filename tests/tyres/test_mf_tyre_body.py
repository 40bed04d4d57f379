"""The body of MF-Tyre beside its equations in NumPy: radii, deflection, patch, carcass; and what a table's columns mean."""

import dataclasses
import itertools
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, tyres
from jaxveh.tyres import Contact, evaluation
from jaxveh.tyres.evaluation import evaluate
from jaxveh.tyres.mf_tyre import Structure
from jaxveh.tyres.mf_tyre.structure import Wheel
from jaxveh.tyres.mf_tyre.turn_slip import Spin

NUMBERS = {
    "UNLOADED_RADIUS": 0.32, "FNOMIN": 4200.0, "LONGVL": 15.0, "NOMPRES": 210000.0, "INFLPRES": 230000.0, "WIDTH": 0.215,
    "ASPECT_RATIO": 0.55, "RIM_RADIUS": 0.19, "BOTTOM_OFFST": 0.012, "VERTICAL_STIFFNESS": 205000.0, "BREFF": 8.4,
    "DREFF": 0.27, "FREFF": 0.07, "Q_RE0": 0.998, "Q_V1": 7e-4, "Q_V2": 0.046, "Q_FZ2": 14.0, "Q_FCX": 0.14, "Q_FCY": 0.11,
    "Q_FCY2": 0.3, "Q_CAM1": 80.0, "Q_CAM2": 250.0, "Q_CAM3": 0.5, "Q_FYS1": -20000.0, "Q_FYS2": -50000.0, "Q_FYS3": 80000.0,
    "PFZ1": 0.7, "Q_RA1": 0.67, "Q_RA2": 0.73, "Q_RB1": 1.06, "Q_RB2": -1.04, "Q_A1": 0.15, "Q_A2": 1.2,
    "LONGITUDINAL_STIFFNESS": 350000.0, "LATERAL_STIFFNESS": 100000.0, "PCFX1": 0.28, "PCFX2": 0.21, "PCFX3": 0.5,
    "PCFY1": 0.17, "PCFY2": 0.13, "PCFY3": -0.25,
}  # fmt: skip
N = type("Numbers", (), NUMBERS)
BODY = Structure(**NUMBERS)
POINTS = [
    (4200.0, 0.0, 0.1, 20.0, 0.0, 0.0),
    (2500.0, 0.03, -0.05, 8.0, 900.0, -1500.0),
    (6500.0, -0.05, 0.2, 35.0, -2000.0, 3000.0),
]
"""Load, camber, relative pressure, speed, F_x, F_y."""


def rolling(load, slip_ratio, speed, dp_i):
    """The effective radius by Newton's way of trying: R_e = R_w(omega) - sinking, omega = (1 + kappa) v / R_e."""
    share, r = load / N.FNOMIN, N.UNLOADED_RADIUS
    sinking = N.FNOMIN / (N.VERTICAL_STIFFNESS * (1 + N.PFZ1 * dp_i))
    sinking *= N.DREFF * np.arctan(N.BREFF * share) + N.FREFF * share
    radius = r
    for _ in range(200):
        omega = (1 + slip_ratio) * speed / radius
        free = r * (N.Q_RE0 + N.Q_V1 * (omega * r / N.LONGVL) ** 2)
        radius = free - sinking
    return radius, free, omega


@pytest.mark.parametrize("slip_ratio", [0.0, -0.3, 0.1])
@pytest.mark.parametrize("point", POINTS)
def test_the_rolling_radius_is_the_fixed_point_of_a1_and_a7(point, slip_ratio):
    load, _, dp_i, speed, *_ = point
    found = BODY.wheel(*map(jnp.asarray, (load, slip_ratio, speed, dp_i)))
    np.testing.assert_allclose(found, rolling(load, slip_ratio, speed, dp_i), rtol=1e-12)
    np.testing.assert_allclose(BODY.vertical_stiffness(dp_i), 205000.0 * (1 + 0.7 * dp_i), rtol=1e-12)


@pytest.mark.parametrize("point", POINTS)
def test_a_deflection_carries_the_load_of_a2_to_a4(point):
    load, _, dp_i, _, F_x, F_y = point
    omega, r = 55.0, N.UNLOADED_RADIUS
    x = float(BODY.deflection(load, omega, dp_i, F_x, F_y)) / r
    q_1 = np.sqrt((N.VERTICAL_STIFFNESS * r / N.FNOMIN) ** 2 - 4 * N.Q_FZ2)
    factor = 1 + N.Q_V2 * r / N.LONGVL * omega - (N.Q_FCX * F_x / N.FNOMIN) ** 2 - (N.Q_FCY * F_y / N.FNOMIN) ** 2
    carried = factor * (1 + N.PFZ1 * dp_i) * (q_1 * x + N.Q_FZ2 * x**2) * N.FNOMIN
    np.testing.assert_allclose(carried, load, rtol=1e-10)
    assert x > 0 == float(BODY.deflection(0.0, omega, dp_i, 0.0, 0.0))


def carried(radius, camber, wheel, dp_i, F_x, F_y):
    """Load and deflection of version 6.2 at a loaded radius."""
    r, free, omega = N.UNLOADED_RADIUS, wheel.free_radius, wheel.speed
    asymmetric = (N.Q_FYS1 + N.Q_FYS2 * radius / free + N.Q_FYS3 * (radius / free) ** 2) * camber
    rho = max(free - radius, 0.0)
    if camber:
        ratio = (N.Q_CAM1 * radius + N.Q_CAM2 * radius**2) / (N.Q_CAM1 * free + N.Q_CAM2 * free**2)
        tread = (1.075 - 0.5 * N.ASPECT_RATIO) * N.WIDTH
        rho += ratio**2 * tread * abs(np.tan(camber)) / 8 - N.Q_CAM3 * rho * abs(camber)
    x = rho / r
    q_1 = np.sqrt((N.VERTICAL_STIFFNESS * r / N.FNOMIN) ** 2 - 4 * N.Q_FZ2)
    factor = 1 + N.Q_V2 * r / N.LONGVL * abs(omega) - (N.Q_FCX * F_x / N.FNOMIN) ** 2
    factor -= (x**N.Q_FCY2 * N.Q_FCY * (F_y - asymmetric) / N.FNOMIN) ** 2
    return factor * (1 + N.PFZ1 * dp_i) * (q_1 * x + N.Q_FZ2 * x**2) * N.FNOMIN, rho


@pytest.mark.parametrize("point", POINTS)
def test_the_loaded_radius_of_62_is_where_the_load_is_carried(point):
    load, camber, dp_i, speed, F_x, F_y = point
    wheel = Wheel(*rolling(load, 0.0, speed, dp_i))
    rest = camber, wheel, dp_i, F_x, F_y
    for radius in (0.29, 0.31):
        np.testing.assert_allclose(BODY.carried_load(radius, *rest), carried(radius, *rest), rtol=1e-10)
    upright = 0.0, *rest[1:]
    np.testing.assert_allclose(BODY.carried_load(0.33, *upright), 0.0, atol=1e-6)
    radius, rho = BODY.loaded_radius(jnp.asarray(load), *map(jnp.asarray, rest[:1]), wheel, dp_i, F_x, F_y)
    # Within the tolerance of the reference evaluator: a millionth of the nominal load.
    told = carried(float(radius), *rest)
    np.testing.assert_allclose(told[0], load, atol=1e-6 * N.FNOMIN)
    np.testing.assert_allclose(rho, told[1], rtol=1e-12)
    assert 0 < rho < 0.06


@pytest.mark.parametrize("told", [True, False])
def test_the_patch_of_52_has_the_manual_s_guess_where_the_file_tells_none(told):
    body = BODY if told else dataclasses.replace(BODY, Q_A1=0.0, Q_A2=0.0)
    load, dp_i = 3000.0, 0.1
    y = np.log10(N.UNLOADED_RADIUS * N.VERTICAL_STIFFNESS / N.FNOMIN)
    root = N.Q_A1 if told else -0.0388 * y**3 + 0.2509 * y**2 - 0.6283 * y + 0.6279
    linear = N.Q_A2 if told else 1.693 * root**2
    share = load / N.FNOMIN
    a, b = body.contact_patch(load, dp_i, 52)
    np.testing.assert_allclose((a, b), (0.32 * (linear * share + root * share**0.5), 0.215 / 2), rtol=1e-12)


def test_the_carcass_is_a17_and_a18():
    for df_z, dp_i in ((0.0, 0.0), (0.4, 0.0), (-0.3, 0.2)):
        along = 350000.0 * (1 + 0.28 * df_z + 0.21 * df_z**2) * (1 + 0.5 * dp_i)
        across = 100000.0 * (1 + 0.17 * df_z + 0.13 * df_z**2) * (1 - 0.25 * dp_i)
        np.testing.assert_allclose(BODY.carcass(df_z, dp_i), (along, across), rtol=1e-12)


@pytest.mark.parametrize("version", [52, 61, 62])
def test_relaxation_lengths_and_stiffness_are_those_of_their_version(version):
    """Slip stiffness over that of the carcass; in 5.2 lengths of their own (the manual's PTX and PTY)."""
    tyre = tyres.typical_mf_tyre(4000.0, version=version)
    x = dataclasses.replace(tyre.longitudinal, PTX1=2.0, PTX2=1.5, PTX3=0.2)
    y = dataclasses.replace(tyre.lateral, PTY1=2.1, PTY2=1.9, PKY3=0.4)
    structure = dataclasses.replace(tyre.structure, PCFX1=0.3, PCFY2=0.2)
    tyre = dataclasses.replace(tyre, longitudinal=x, lateral=y, structure=structure)
    load, camber = 5000.0, 0.05
    out = tyre.outputs(Contact(slip_angle=jnp.asarray(0.02), load=jnp.asarray(load), camber=jnp.asarray(camber)))
    df_z, r = load / 4000.0 - 1, 0.32
    np.testing.assert_allclose(out.C_z, load / out.rho, rtol=1e-9)
    if version == 52:
        sigma_x = (2.0 + 1.5 * df_z) * np.exp(-0.2 * df_z) * r * load / 4000.0
        sigma_y = 2.1 * np.sin(2 * np.arctan(load / (1.9 * 4000.0))) * (1 - 0.4 * camber) * r
    else:
        sigma_x, sigma_y = out.K_xk / (300000.0 * (1 + 0.3 * df_z)), out.K_ya / (100000.0 * (1 + 0.2 * df_z**2))
    np.testing.assert_allclose((out.sigma_x, out.sigma_y), (sigma_x, sigma_y), rtol=1e-9)


def test_a_table_s_empty_columns_are_the_nominal_speed_and_pressure():
    """And its names those of either program; signs of forces and slopes those of the axes that are asked for."""
    tyre = tyres.typical_mf_tyre(4000.0)
    tyre = dataclasses.replace(tyre, structure=dataclasses.replace(tyre.structure, INFLPRES=jnp.asarray(240000.0)))
    given = {"load": [4000.0, 3000.0], "slip_angle": [0.03, -0.02], "camber": [0.0, 0.02]}
    plain = evaluate(tyre, given, axes="ours")
    told = {**given, "speed": [16.7, 16.7], "pressure": [0.0, 240000.0], "useMode": [121, 121]}
    for name, values in evaluate(tyre, told, axes="ours").items():
        np.testing.assert_array_equal(plain[name], values, err_msg=name)
    assert np.all(plain["Vx"] == 16.7) and np.all(plain["P"] == 240000.0)
    assert plain["Fy"][0] > 0 > plain["Fy"][1] and np.all(plain["Kya"] > 0)
    turned = evaluate(tyre, {"Fz": given["load"], "in_alpha": [-0.03, 0.02], "gamma": given["camber"]})
    np.testing.assert_array_equal(turned["Fy"], plain["Fy"])
    np.testing.assert_array_equal(turned["Kya"], -plain["Kya"])
    # Half the patch twice, and no load below none.
    out = tyre.outputs(Contact(slip_angle=jnp.asarray(0.03), load=jnp.asarray(4000.0)))
    np.testing.assert_allclose((plain["two_a"][0], plain["two_b"][0]), (2 * out.a, 2 * out.b), rtol=1e-12)


def test_every_mode_s_digits_are_the_tyre_s_settings():
    """And a table without modes is evaluated with the tyre's own."""
    for limits, angles, spins in itertools.product((True, False), repeat=3):
        tyre = dataclasses.replace(tyres.typical_mf_tyre(4000.0), limits=limits, angles=angles, spins=spins)
        mode = (1 if limits else 2) * 100 + (2 if angles else 1) * 10 + (2 if spins else 1)
        assert evaluation._mode(tyre) == mode
        found = evaluation._in_mode(tyres.typical_mf_tyre(4000.0), mode)
        assert (found.limits, found.angles, found.spins) == (limits, angles, spins)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"kappa": [0.1]}, "no load among the columns kappa"),
        ({"Fz": [1.0, 2.0], "kappa": [0.1]}, "in_kappa: 1 rows, in_Fz has 2; must be equal"),
        ({"Fz": [1.0, 2.0], "Vx": [3.0, -4.0]}, "speed = -4 in row 1: must be at least 0"),
        ({"Fz": [1.0], "useMode": [321]}, "useMode = 321: its digits must be 1 or 2"),
        ({"Fz": [1.0], "useMode": [131]}, "useMode = 131"),
        ({"Fz": [1.0], "useMode": [123]}, "useMode = 123"),
    ],
)
def test_bad_columns_are_named(columns, message):
    with pytest.raises(InputError, match=message):
        evaluate(tyres.typical_mf_tyre(4000.0), columns)


@pytest.mark.parametrize(
    ("limits", "angles", "spins"), [(True, True, False), (False, False, True), (True, False, True)]
)
def test_a_mode_s_digits_are_the_tyre_s_options(limits, angles, spins):
    from jaxveh.tyres.evaluation import _in_mode, _mode

    mode = (100 if limits else 200) + (20 if angles else 10) + (2 if spins else 1)
    tyre = _in_mode(tyres.typical_mf_tyre(4000.0), mode)
    assert (tyre.limits, tyre.angles, tyre.spins) == (limits, angles, spins)
    assert _mode(tyre) == mode


def test_the_torque_of_parking_whatever_the_coefficients_are():
    """Some of the draws are beyond both ends of the arccos; the last two have no torque of their own."""
    rng = np.random.default_rng(3)
    draw = lambda low, high: rng.uniform(low, high, 60)
    load, mu, path, weight, most = (
        draw(2000.0, 9000.0),
        draw(0.2, 1.2),
        draw(-1.0, 1.0),
        draw(-1.0, 1.0),
        draw(0.1, 0.4),
    )
    at_90, shape, reduction, df_z, camber = (
        draw(0.1, 4.0),
        draw(0.5, 1.5),
        draw(0.0, 0.8),
        draw(-0.5, 0.5),
        draw(-0.1, 0.1),
    )
    slopes = dict(
        zip(("QDZ8", "QDZ9", "QDZ10", "QDZ11"), (draw(0.01, 0.3), *(draw(-0.1, 0.1) for _ in "123")), strict=True)
    )
    load[-1], path[-2] = 0.0, 0.0
    spin = Spin(path=path, reduction=reduction, coefficients=SimpleNamespace(QCRP1=most, QCRP2=at_90, QDRP1=shape))
    given = (
        SimpleNamespace(moment_load=load, df_z=df_z, camber=camber),
        SimpleNamespace(LFZO=1.1, LMP=0.9, LKZC=1.2), SimpleNamespace(**slopes), BODY, -mu, weight,
    )  # fmt: skip
    torque, zeta_7 = spin.parking(*given)
    peak = most * mu * N.UNLOADED_RADIUS * load * np.sqrt(load / (1.1 * N.FNOMIN)) * 0.9
    D = peak / np.sin(0.5 * np.pi * shape)
    c = SimpleNamespace(**slopes)
    slope = load * N.UNLOADED_RADIUS * 1.2 * (c.QDZ8 + c.QDZ9 * df_z + (c.QDZ10 + c.QDZ11 * df_z) * np.abs(camber))
    with np.errstate(all="ignore"):
        turned = np.where(load > 0.0, slope / (shape * D * (1.0 - reduction)) * path, 0.0)
        expected = D * np.sin(shape * np.arctan(turned))
        share = peak * 2.0 / np.pi * np.arctan(at_90 * np.abs(path)) * weight / np.abs(expected)
    assert (share > 1.0).sum() > 3 and (share < -1.0).sum() > 3 and (np.abs(share) < 1.0).sum() > 20
    # The law adds a millionth to what it divides by.
    np.testing.assert_allclose(torque, expected, rtol=1e-6, atol=1e-9)
    limited = 2.0 / np.pi * np.arccos(np.clip(share, -1.0, 1.0))
    np.testing.assert_allclose(zeta_7[:-2], limited[:-2], rtol=1e-4, atol=1e-9)
    np.testing.assert_array_equal(zeta_7[-2:], 1.0)
