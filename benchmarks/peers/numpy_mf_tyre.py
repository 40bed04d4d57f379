"""MF-Tyre 6.1 in NumPy: the equations as an engineer would copy them from the book, over arrays of contacts."""

from __future__ import annotations

import types
from collections.abc import Mapping

import numpy as np
from numpy import abs, arctan, cos, sin, sqrt, tan

from ..mf_tyre_problem import Contacts

__all__ = ["forces", "of_type", "operating", "slip_forces"]

EPSILON = 1e-6


def _sign(x):
    return np.where(x >= 0, 1.0, -1.0).astype(x.dtype)


def _not_zero(x):
    return x + EPSILON * _sign(x)


def _curve_angle(x, B, C, E):
    return C * arctan(B * x - E * (B * x - arctan(B * x)))


def _weight(x, shift, B, C, E):
    return cos(_curve_angle(x + shift, B, C, E)) / cos(_curve_angle(shift, B, C, E))


def forces(coefficients: Mapping[str, float], contacts: Contacts) -> tuple[np.ndarray, ...]:
    """Return F_x, F_y (N), M_x, M_y, M_z (N m), in the contacts' type and with the library's signs; limits are applied."""
    c = of_type(contacts.load.dtype, coefficients)
    at = operating(c, contacts)
    F_x, K_xk = _longitudinal(c, at)
    F_y, G_yk, (K_ya, _, B_y, S_Hy, S_Vy) = _lateral(c, at)
    upright = G_yk * _pure_lateral(c, at, np.zeros_like(at.sine))[0]
    M_z = _aligning(c, at, K_xk, (K_ya, B_y, S_Hy, S_Vy), F_x, F_y, upright)
    return F_x, F_y, _overturning(c, at, F_y), _rolling(c, at, F_x, contacts), M_z


def slip_forces(c: types.SimpleNamespace, at: types.SimpleNamespace) -> tuple[np.ndarray, np.ndarray]:
    """Return only F_x and F_y (N), for coefficients from `of_type` at points from `operating`."""
    return _longitudinal(c, at)[0], _lateral(c, at)[0]


def of_type(dtype: np.dtype, coefficients: Mapping[str, float]) -> types.SimpleNamespace:
    """Return the coefficients as numbers of a type."""
    return types.SimpleNamespace(**{name: dtype.type(value) for name, value in coefficients.items()})


def _longitudinal(c, at):
    F_x0, K_xk = _pure_longitudinal(c, at)
    B = (c.RBX1 + c.RBX3 * at.sine**2) * cos(arctan(c.RBX2 * at.kappa)) * c.LXAL
    return F_x0 * _weight(at.tangent, c.RHX1, B, c.RCX1, np.minimum(c.REX1 + c.REX2 * at.df_z, 1)), K_xk


def _lateral(c, at):
    F_y0, *parts = _pure_lateral(c, at, at.sine)
    B = (c.RBY1 + c.RBY4 * at.sine**2) * cos(arctan(c.RBY2 * (at.tangent - c.RBY3))) * c.LYKA
    E = np.minimum(c.REY1 + c.REY2 * at.df_z, 1)
    G_yk = _weight(at.kappa, c.RHY1 + c.RHY2 * at.df_z, B, c.RCY1, E)
    D = parts[1] * at.load * (c.RVY1 + c.RVY2 * at.df_z + c.RVY3 * at.sine) * cos(arctan(c.RVY4 * at.tangent))
    return G_yk * F_y0 + D * sin(c.RVY5 * arctan(c.RVY6 * at.kappa)) * c.LVYKA * at.smooth, G_yk, parts


def operating(c: types.SimpleNamespace, contacts: Contacts) -> types.SimpleNamespace:
    """Return contacts within the tyre's ranges, and quantities that all equations use; these include no slip coefficient."""
    speed, alpha = abs(contacts.speed), -contacts.slip_angle
    share = np.minimum(speed / c.VXLOW, 1)
    alpha = np.clip(alpha * np.minimum(speed * (1 + abs(tan(alpha))) / c.VXLOW, 1), c.ALPMIN, c.ALPMAX)
    load = np.clip(contacts.load, 0, c.FZMAX)
    pressure = np.clip(contacts.pressure, c.PRESMIN, c.PRESMAX)
    camber = np.clip(contacts.camber, c.CAMMIN, c.CAMMAX)
    return types.SimpleNamespace(
        speed=speed,
        smooth=(1 - cos(np.pi * share)) / 2,
        tangent=tan(alpha),
        kappa=np.clip(contacts.slip_ratio * share, c.KPUMIN, c.KPUMAX),
        camber=camber,
        sine=sin(camber),
        load=load,
        moment_load=np.where(load > 0, np.maximum(load, c.FZMIN), 0).astype(load.dtype),
        df_z=load / (c.LFZO * c.FNOMIN) - 1,
        pressure=pressure,
        dp_i=pressure / c.NOMPRES - 1,
        mu_x=c.LMUX * contacts.friction,
        mu_y=c.LMUY * contacts.friction,
    )


def _pure_longitudinal(c, at):
    df_z, dp_i = at.df_z, at.dp_i
    kappa = at.kappa + (c.PHX1 + c.PHX2 * df_z) * c.LHX * at.smooth
    C = c.PCX1 * c.LCX
    mu = (c.PDX1 + c.PDX2 * df_z) * (1 + c.PPX3 * dp_i + c.PPX4 * dp_i**2) * (1 - c.PDX3 * at.camber**2) * at.mu_x
    D = mu * at.load
    E = (c.PEX1 + c.PEX2 * df_z + c.PEX3 * df_z**2) * (1 - c.PEX4 * _sign(kappa)) * c.LEX
    K = at.load * (c.PKX1 + c.PKX2 * df_z) * np.exp(c.PKX3 * df_z) * (1 + c.PPX1 * dp_i + c.PPX2 * dp_i**2) * c.LKX
    S_V = at.load * (c.PVX1 + c.PVX2 * df_z) * c.LVX * at.mu_x * at.smooth
    return D * sin(_curve_angle(kappa, K / _not_zero(C * D), C, np.minimum(E, 1))) + S_V, K


def _pure_lateral(c, at, sine):
    df_z, dp_i, nominal = at.df_z, at.dp_i, c.LFZO * c.FNOMIN
    K = c.PKY1 * nominal * (1 + c.PPY1 * dp_i) * (1 - c.PKY3 * abs(sine)) * c.LKY
    K = K * sin(c.PKY4 * arctan(at.load / nominal / ((c.PKY2 + c.PKY5 * sine**2) * (1 + c.PPY2 * dp_i))))
    S_Vg = at.load * (c.PVY3 + c.PVY4 * df_z) * sine * c.LKYC * at.mu_y
    K_g = at.load * (c.PKY6 + c.PKY7 * df_z) * (1 + c.PPY5 * dp_i) * c.LKYC
    S_H = ((c.PHY1 + c.PHY2 * df_z) * c.LHY + (K_g * sine - S_Vg) / _not_zero(K)) * at.smooth
    S_V = (at.load * (c.PVY1 + c.PVY2 * df_z) * c.LVY * at.mu_y + S_Vg) * at.smooth
    alpha = at.tangent + S_H
    C = c.PCY1 * c.LCY
    mu = (c.PDY1 + c.PDY2 * df_z) * (1 + c.PPY3 * dp_i + c.PPY4 * dp_i**2) * (1 - c.PDY3 * sine**2) * at.mu_y
    D = mu * at.load
    side = 1 + c.PEY5 * sine**2 - (c.PEY3 + c.PEY4 * sine) * _sign(alpha)
    E = np.minimum((c.PEY1 + c.PEY2 * df_z) * side * c.LEY, 1)
    B = K / _not_zero(C * D)
    return D * sin(_curve_angle(alpha, B, C, E)) + S_V, K, mu, B, S_H, S_V


def _aligning(c, at, K_xk, lateral, F_x, F_y, upright):
    df_z, dp_i, camber = at.df_z, at.dp_i, at.camber
    K_ya, B_y, S_Hy, S_Vy = lateral
    R = c.UNLOADED_RADIUS
    slip = (K_xk / _not_zero(K_ya)) ** 2 * at.kappa**2
    alpha = at.tangent + c.QHZ1 + c.QHZ2 * df_z + (c.QHZ3 + c.QHZ4 * df_z) * at.sine
    B = (c.QBZ1 + c.QBZ2 * df_z + c.QBZ3 * df_z**2) * (1 + c.QBZ4 * camber + c.QBZ5 * abs(camber)) * c.LKY / at.mu_y
    D = (c.QDZ1 + c.QDZ2 * df_z) * (1 - c.PPZ1 * dp_i) * (1 + c.QDZ3 * camber + c.QDZ4 * camber**2)
    D = D * at.moment_load * R / (c.FNOMIN * c.LFZO) * c.LTR
    side = 1 + (c.QEZ4 + c.QEZ5 * at.sine) * _kind_of(alpha, 2 / np.pi) * arctan(B * c.QCZ1 * alpha)
    E = np.minimum((c.QEZ1 + c.QEZ2 * df_z + c.QEZ3 * df_z**2) * side, 1)
    equivalent = arctan(sqrt(tan(alpha) ** 2 + slip)) * _sign(alpha)
    course = at.speed / (at.speed * sqrt(1 + at.tangent**2) + EPSILON)
    trail = D * cos(_curve_angle(equivalent, B, c.QCZ1, E)) * course * at.smooth * c.LFZO
    turned = at.tangent + S_Hy + S_Vy / _not_zero(K_ya)
    B_r = c.QBZ9 * c.LKY / at.mu_y + c.QBZ10 * B_y * c.PCY1 * c.LCY
    cambered = (c.QDZ8 + c.QDZ9 * df_z) * (1 + c.PPZ2 * dp_i) + (c.QDZ10 + c.QDZ11 * df_z) * abs(at.sine)
    D_r = (c.QDZ6 + c.QDZ7 * df_z) * c.LRES + cambered * at.sine * c.LKZC
    D_r = at.moment_load * R * D_r * at.mu_y * cos(at.tangent)
    turned = arctan(sqrt(tan(turned) ** 2 + slip)) * _sign(turned)
    residual = D_r * cos(arctan(B_r * turned)) * at.smooth
    arm = R * (c.SSZ1 + c.SSZ2 * F_y / c.FNOMIN + (c.SSZ3 + c.SSZ4 * df_z) * camber) * c.LS
    return residual - trail * upright + arm * F_x


def _overturning(c, at, F_y):
    load = np.where(at.load < c.FZMIN, at.load**3 / c.FZMIN**2, at.load)
    share, side, camber = load / c.FNOMIN, F_y / c.FNOMIN, at.camber
    mixed = cos(c.QSX5 * arctan((c.QSX6 * share) ** 2)) * sin(c.QSX7 * camber + c.QSX8 * arctan(c.QSX9 * side))
    part = c.QSX1 * c.LVMX - c.QSX2 * camber * (1 + c.PPMX1 * at.dp_i) + c.QSX3 * side + c.QSX4 * mixed
    part = part + c.QSX10 * arctan(c.QSX11 * share) * camber
    rest = F_y * (c.QSX13 + c.QSX14 * abs(camber)) - load * c.QSX12 * camber * abs(camber)
    return c.UNLOADED_RADIUS * c.LMX * (load * part + rest)


def _rolling(c, at, F_x, contacts):
    # Load and slip ratio as given, not limited to the ranges.
    load, slip_ratio = np.maximum(contacts.load, 0), contacts.slip_ratio
    load = np.where(load < c.FZMIN, load**2 / c.FZMIN, load)
    share, speed = load / c.FNOMIN, at.speed / c.LONGVL
    part = (
        c.QSY1 + c.QSY2 * F_x / c.FNOMIN + c.QSY3 * speed + c.QSY4 * speed**4 + (c.QSY5 + c.QSY6 * share) * at.camber**2
    )
    moment = -c.UNLOADED_RADIUS * c.FNOMIN * c.LMY * part * share**c.QSY7 * (at.pressure / c.NOMPRES) ** c.QSY8
    high = c.VXLOW / at.speed - 1
    low = -1 - c.VXLOW - high
    between = sin(_kind_of(high, np.pi / 2) * (slip_ratio + 1) / (high + 1))
    return moment * np.where(slip_ratio > high, 1, np.where(slip_ratio < low, -1, between)).astype(moment.dtype)


def _kind_of(like, value):
    """Return a number in the type of an array, so that float32 stays float32."""
    return like.dtype.type(value)
