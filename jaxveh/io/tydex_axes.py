"""Conversion of the channels of a TYDEX file to slips, forces and moments at the contact patch, in SI units with ISO-W's signs.

TYDEX has three axis systems, all with z up (Unrau & Zamow 1997, section 2.6): W at the contact point, H at the wheel's centre
with the same directions, C at the centre and inclined with the wheel. With the loaded radius R and the inclination angle gamma,
the vector from the contact point to the centre is `R (0, -sin gamma, cos gamma)`.
"""

from __future__ import annotations

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.tydex import TydexFile

UNITS = {
    "angle": {"rad": 1.0, "deg": np.pi / 180, "degree": np.pi / 180, "degrees": np.pi / 180, "°": np.pi / 180},
    "ratio": {"-": 1.0, "": 1.0, "1": 1.0, "%": 0.01},
    "force": {"n": 1.0, "dan": 10.0, "kn": 1e3},
    "moment": {"nm": 1.0, "n*m": 1.0, "n.m": 1.0, "n m": 1.0, "knm": 1e3},
    "speed": {"m/s": 1.0, "km/h": 1 / 3.6, "kph": 1 / 3.6, "mm/s": 1e-3},
    "pressure": {"pa": 1.0, "hpa": 1e2, "kpa": 1e3, "mpa": 1e6, "bar": 1e5, "mbar": 1e2},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
}
"""Units by quantity, in any case, and their size in SI."""


def contact_patch(file: TydexFile, measured: tuple[str, ...], axes: str = "iso-w") -> dict[str, np.ndarray | None]:
    """Return the inputs of a `RigTable`, and those of its `measured` quantities that the file has, with the signs of the file.

    Names without a letter for the axes count as W. Forces at the wheel's centre equal those at the contact point, rotated by
    INCLANGL for C; moments there also need the forces, INCLANGL, and LOADRAD (loaded radius) or DSTGRWHC (height of the centre).
    The format prescribes ISO-W; for files in other `axes` only quantities at the contact point are used.

    **Raises** `InputError` for an unknown unit, a file without a load or any slip, and quantities that cannot be converted
    with the channels in the file; the message names the missing ones.
    """
    rig = _Rig(file, centre=axes in ("iso-w", "ours"))
    if rig.quantity("SLIPANGL", "angle") is None and rig.quantity("LONGSLIP", "ratio") is None:
        raise InputError(f"{file.source}: neither SLIPANGL nor LONGSLIP is among the channels: no slip was measured.")
    load = rig.force("Z")
    if load is None:
        raise InputError(f"{file.source}: no load among the channels: one of FZW, FZ, FZH or FZC is needed.")
    slip_angle, slip_ratio = rig.quantity("SLIPANGL", "angle"), rig.quantity("LONGSLIP", "ratio")
    found: dict[str, np.ndarray | None] = {
        "slip_angle": np.zeros(rig.rows) if slip_angle is None else slip_angle,
        "slip_ratio": np.zeros(rig.rows) if slip_ratio is None else slip_ratio,
        "load": load,
        "camber": rig.quantity("INCLANGL", "angle"),
        "speed": rig.speed(),
        "pressure": rig.quantity("INFLPRES", "pressure"),
    }
    for name in measured:
        kind, axis = name.split("_")
        found[name] = rig.force(axis.upper()) if kind == "F" else rig.moment(axis.upper())
    return found


class _Rig:
    """The quantities of one file, by TYDEX name, in SI units and W axes.

    `centre`: whether quantities at the wheel's centre are converted; this is possible only if z points up.
    """

    def __init__(self, file: TydexFile, centre: bool = True):
        self.file, self.centre = file, centre
        self.rows = len(np.asarray(next(iter(file.channels.values())).values))

    def quantity(self, name: str, kind: str) -> np.ndarray | None:
        """Return a channel, or a constant in each row, in SI units; None if the file has neither."""
        channel = self.file.find(name)
        if channel is None:
            return None
        known = UNITS[kind]
        where = f"{self.file.source}, line {channel.line}: {name}"
        if channel.unit.casefold() not in known:
            units = ", ".join(unit or "nothing" for unit in known)
            raise InputError(f"{where}: unit {channel.unit!r}: must be one of {units}, in any case.")
        if isinstance(channel.values, str):
            raise InputError(f"{where} = {channel.values!r}: must be a number.")
        return np.broadcast_to(np.asarray(channel.values) * known[channel.unit.casefold()], self.rows).copy()

    def require(self, name: str, kind: str, for_what: str) -> np.ndarray:
        found = self.quantity(name, kind)
        if found is None:
            raise InputError(
                f"{self.file.source}: {for_what} is not in the axes of the contact patch (W), and {name} is needed to convert "
                "it: add that channel or constant, or leave the quantity out of `measured`."
            )
        return found

    def speed(self) -> np.ndarray | None:
        """Return the forward speed of the contact point, m/s."""
        forward, trajectory = self.quantity("LONGVEL", "speed"), self.quantity("TRAJVELW", "speed")
        if forward is not None:
            return np.abs(forward)
        slip_angle = self.quantity("SLIPANGL", "angle")
        if trajectory is None or slip_angle is None:
            return trajectory
        return np.abs(trajectory * np.cos(slip_angle))

    def force(self, axis: str) -> np.ndarray | None:
        found = self._at_contact("F", axis, "force")
        if found is not None or not self.centre:
            return found
        found = self.quantity(f"F{axis}H", "force")
        return self._rotate("F", axis, "force") if found is None else found

    def moment(self, axis: str) -> np.ndarray | None:
        found = self._at_contact("M", axis, "moment")
        if found is not None or not self.centre:
            return found
        name, found = f"M{axis}H", self.quantity(f"M{axis}H", "moment")
        if found is None:
            name, found = f"M{axis}C", self._rotate("M", axis, "moment")
        return None if found is None else found + self._arm(axis, name)

    def _at_contact(self, kind: str, axis: str, unit: str) -> np.ndarray | None:
        """Return a component in axes of the contact patch (W) unchanged from the file; None if the file has none."""
        for name in (f"{kind}{axis}W", f"{kind}{axis}"):
            if (found := self.quantity(name, unit)) is not None:
                return found
        if not self.centre:
            self._refuse_centre(f"{kind}{axis}")
        return None

    def _refuse_centre(self, name: str) -> None:
        """Raise `InputError` if the file has this quantity at the wheel's centre, whose axes are not converted."""
        for centre in (f"{name}H", f"{name}C"):
            if self.file.find(centre) is not None:
                raise InputError(
                    f"{self.file.source}: {centre} is in axes of the wheel's centre, which are converted only if z points up: "
                    "leave `axes` out (TYDEX is ISO-W), or leave the quantity out of `measured`."
                )

    def _rotate(self, kind: str, axis: str, unit: str) -> np.ndarray | None:
        """Return a component from C axes, rotated by the inclination angle about x."""
        name = f"{kind}{axis}C"
        found = self.quantity(name, unit)
        if found is None or axis == "X":
            return found
        camber = self.require("INCLANGL", "angle", name)
        other = self.require(f"{kind}{'Z' if axis == 'Y' else 'Y'}C", unit, name)
        return found * np.cos(camber) + (-other if axis == "Y" else other) * np.sin(camber)

    def _arm(self, axis: str, name: str) -> np.ndarray | float:
        """Return the moment about the contact point of the forces at the wheel's centre: radius vector times force."""
        camber = self.require("INCLANGL", "angle", name)
        if axis == "Z" and not camber.any():
            return 0.0
        height, side = self._centre(camber, name)
        if axis == "X":
            return side * self._needed_force("Z", name) - height * self._needed_force("Y", name)
        F_x = self._needed_force("X", name)
        return height * F_x if axis == "Y" else -side * F_x

    def _centre(self, camber: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the height of the wheel's centre and its distance to the left of the contact point, m."""
        height = self.quantity("DSTGRWHC", "length")
        if height is None:
            height = self.require("LOADRAD", "length", name) * np.cos(camber)
        return height, -height * np.tan(camber)

    def _needed_force(self, axis: str, name: str) -> np.ndarray:
        found = self.force(axis)
        return self.require(f"F{axis}W", "force", name) if found is None else found
