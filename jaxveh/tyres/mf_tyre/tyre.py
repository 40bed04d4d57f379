"""MF-Tyre as a tyre of this package: forces, moments and internal quantities at a contact."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_one_of
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load
from jaxveh.tyres.mf_tyre.aligning import AligningCoefficients
from jaxveh.tyres.mf_tyre.lateral import LateralCoefficients
from jaxveh.tyres.mf_tyre.longitudinal import LongitudinalCoefficients
from jaxveh.tyres.mf_tyre.operating import Operating
from jaxveh.tyres.mf_tyre.overturning import OverturningCoefficients
from jaxveh.tyres.mf_tyre.ranges import Ranges
from jaxveh.tyres.mf_tyre.rolling import RollingCoefficients
from jaxveh.tyres.mf_tyre.scaling import Scaling
from jaxveh.tyres.mf_tyre.structure import Structure
from jaxveh.tyres.mf_tyre.turn_slip import NO_SPIN, Spin, TurnSlip

VERSIONS = (52, 61, 62)


class MFOutputs(NamedTuple):
    """All outputs of MF-Tyre at a contact, in the wheel's axes (x forward, y left, z up) and SI units.

    Forces and moments; `trail` and residual torque `M_zr`; friction `mu_x`, `mu_y`; slip stiffness `K_xk` (N) and cornering
    stiffness `K_ya` (N/rad, positive here); wheel speed `omega`, effective radius `R_e`, loaded radius `R_l`, deflection `rho`,
    half length `a` and half width `b` of the patch (m); stiffnesses `C_x`, `C_y`, `C_z` (N/m); relaxation lengths `sigma_x`,
    `sigma_y` (m).
    """

    F_x: Any
    F_y: Any
    M_x: Any
    M_y: Any
    M_z: Any
    trail: Any
    M_zr: Any
    mu_x: Any
    mu_y: Any
    K_xk: Any
    K_ya: Any
    omega: Any
    R_e: Any
    R_l: Any
    rho: Any
    a: Any
    b: Any
    C_x: Any
    C_y: Any
    C_z: Any
    sigma_x: Any
    sigma_y: Any


class MFTyre(AbstractTyre):
    """MF-Tyre 5.2, 6.1 or 6.2: the Magic Formula in full, pure and combined slip, camber, load and inflation pressure.

    `version` 52, 61 or 62 chooses the equations (62 differs from 61 only in the loaded radius). `limits`: limit slip, camber,
    load and pressure to `ranges` and curvatures to 1, and let slip and shifts fade below `ranges.VXLOW`, as the reference
    evaluator does. (The slips of a contact with a `slip_speed` are regularised already and do not fade; otherwise a vehicle at
    standstill would have no forces.) `angles`: use tan(slip angle) and sin(camber) as the book does (False: the angles).
    `spins`: include the contact's turn slip, and the spin due to camber, with the coefficients `turn_slip`. Every coefficient is
    a leaf, such as `lambda tyre: tyre.lateral.PKY1`.

    The contact must have a load. Without a speed LONGVL is used, without a pressure INFLPRES. The contact's friction multiplies
    LMUX and LMUY.

    **Raises** `InputError` for an unknown version, turn slip in version 5.2 (it has none), or a contact without a load.
    """

    structure: Structure
    longitudinal: LongitudinalCoefficients
    lateral: LateralCoefficients
    aligning: AligningCoefficients
    overturning: OverturningCoefficients
    rolling: RollingCoefficients
    scaling: Scaling
    ranges: Ranges
    turn_slip: TurnSlip | None = None
    version: int = eqx.field(static=True, default=61)
    limits: bool = eqx.field(static=True, default=True)
    angles: bool = eqx.field(static=True, default=True)
    spins: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        check_one_of("MFTyre.version", self.version, VERSIONS)
        if self.spins and self.version == 52:
            raise InputError("MFTyre.spins = True: version 5.2 has no turn slip; it needs version 61 or 62.")
        if self.spins and self.turn_slip is None:
            raise InputError("MFTyre.spins = True: needs the coefficients `turn_slip`, a TurnSlip.")

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """Forces (N) and moments (N m) at a contact."""
        found = self.outputs(contact)
        return Forces(found.F_x, found.F_y, found.M_x, found.M_y, found.M_z)

    def outputs(self, contact: Contact) -> MFOutputs:
        """The forces, moments and internal quantities at a contact."""
        if contact.load is None:
            raise InputError("contact.load = None: MFTyre scales with load; give the wheel's load in N.")
        at, s, load = self._operating_point(contact), self.scaling, need_load(contact, "MFTyre")
        nominal = s.LFZO * self.structure.FNOMIN
        along = self.longitudinal.pure(at, s)
        across = self.lateral.pure(at, s, nominal, self.version)
        weight_y = self.lateral.weight(at, s)
        added = self.lateral.ply_steer(at, s, across.mu)
        # All three moments use F_x and F_y. With the fences a contact takes 554 instead of 647 ns before jax 0.12 (float64),
        # which needs them exactly here.
        F_x = numerics.fence_blocks(self.longitudinal.weight(at, s) * along.force)
        F_y = numerics.fence_blocks(weight_y * across.force + added)
        if self.version == 52:
            on_trail = F_y - added
        else:
            upright = at._replace(camber=jnp.zeros_like(at.camber), sine=jnp.zeros_like(at.sine), spin=NO_SPIN)
            on_trail = weight_y * self.lateral.pure(upright, s, nominal, self.version).force
        turning = self.aligning.parts(at, s, self.structure, across, along.stiffness, weight_y, (F_x, F_y, on_trail))
        M_x = self.overturning.moment(at, s, self.structure, self.ranges.FZMIN, F_y)
        M_y = self.rolling.moment(at, s, self.structure, self.ranges, self.version, F_x, load, contact.slip_ratio)
        mu_x, mu_y = self._frictions(at, along, across)
        body = self._body(contact, at, along, across, F_x, F_y)
        return MFOutputs(
            F_x, F_y, M_x, M_y, turning.moment, turning.trail, turning.residual,
            mu_x, mu_y, along.stiffness, -across.stiffness, *body,
        )  # fmt: skip

    def _frictions(self, at: Operating, along, across) -> tuple[Any, Any]:
        """mu_x and mu_y as in the reference evaluator: zero off the ground, and with limits mu_y is positive."""
        mu_y = jnp.abs(across.mu) if self.limits else across.mu
        return jnp.where(at.load > 0, along.mu, 0.0), jnp.where(at.load > 0, mu_y, 0.0)

    @numerics.fence_results
    def _operating_point(self, contact: Contact) -> Operating:
        """The contact within the ranges, with the signs of ISO-W."""
        structure, r = self.structure, self.ranges
        load = need_load(contact, "MFTyre")
        speed = structure.LONGVL if contact.speed is None else jnp.abs(contact.speed)
        pressure = structure.INFLPRES if contact.pressure is None else contact.pressure
        kappa, alpha, camber, smooth = contact.slip_ratio, -contact.slip_angle, contact.camber, jnp.ones_like(speed)
        if self.limits:
            fading = r.fading_factors(alpha, speed)
            if contact.slip_speed is None:
                along, across, smooth = fading
                kappa, alpha = kappa * along, alpha * across
            else:
                smooth = fading[2]
            kappa, alpha = jnp.clip(kappa, r.KPUMIN, r.KPUMAX), jnp.clip(alpha, r.ALPMIN, r.ALPMAX)
            camber = jnp.clip(camber, r.CAMMIN, r.CAMMAX)
            load, pressure = jnp.minimum(load, r.FZMAX), jnp.clip(pressure, r.PRESMIN, r.PRESMAX)
        moment_load = jnp.where(load > 0, jnp.maximum(load, r.FZMIN), 0.0) if self.limits else load
        nominal = self.scaling.LFZO * structure.FNOMIN
        at = Operating(
            load=load,
            moment_load=moment_load,
            slip_ratio=kappa,
            slip_angle=alpha,
            camber=camber,
            speed=speed,
            pressure=pressure,
            df_z=load / nominal - 1,
            dp_i=pressure / structure.NOMPRES - 1,
            tangent=numerics.tan(alpha) if self.angles else alpha,
            sine=numerics.sin(camber) if self.angles else camber,
            mu_x=self.scaling.LMUX * contact.friction,
            mu_y=self.scaling.LMUY * contact.friction,
            smooth=smooth,
            direction=contact.direction,
            bounded=self.limits,
        )
        return at._replace(spin=self._spin(contact, at)) if self.spins else at

    def _spin(self, contact: Contact, at: Operating) -> Spin:
        """The factors of turn slip, which with limits fades like the slip ratio and is multiplied by cos(slip angle)."""
        phi_t = contact.turn_slip
        if self.limits:
            phi_t = phi_t * numerics.cos(contact.slip_angle) * self.ranges.fading_factors(at.slip_angle, at.speed)[0]
        wheel = self.structure.wheel(need_load(contact, "MFTyre"), contact.slip_ratio, at.speed, at.dp_i)
        assert self.turn_slip is not None
        return self.turn_slip.spin(at, phi_t, wheel.speed, self.structure.UNLOADED_RADIUS, self.ranges.VXLOW)

    def _body(self, contact: Contact, at: Operating, along, across, F_x, F_y) -> tuple:
        """The fields of `MFOutputs` from omega to sigma_y."""
        s, structure = self.scaling, self.structure
        load = need_load(contact, "MFTyre")
        wheel = structure.wheel(load, contact.slip_ratio, at.speed, at.dp_i)
        if self.version == 62:
            R_l, rho = structure.loaded_radius(load, at.camber, wheel, at.dp_i, F_x, F_y)
            carries = at.load
        else:
            rho = structure.deflection(at.moment_load, wheel.speed, at.dp_i, F_x, F_y)
            R_l = jnp.maximum(wheel.free_radius - rho, 0.0)
            carries = at.moment_load
        a, b = structure.contact_patch(load, at.dp_i, self.version)
        C_x, C_y = structure.carcass(at.df_z, at.dp_i)
        C_z = carries / numerics.or_one(rho, rho > 0)
        if self.version != 52:
            sigma = jnp.abs(along.stiffness / C_x), jnp.abs(across.stiffness / C_y)
        else:
            sigma = self._manual_relaxation(at, s)
        return wheel.speed, wheel.effective_radius, R_l, rho, a, b, C_x, C_y, C_z, *sigma

    def _manual_relaxation(self, at: Operating, s) -> tuple:
        """The relaxation lengths of version 5.2, m. The book's sin(2 arctan(F_z / (PTY2 F_z0))) is computed without angles; it is
        zero for zero load and for a PTY2 of zero, which in files of truck tyres means that there is no such length."""
        x, y, R_0 = self.longitudinal, self.lateral, self.structure.UNLOADED_RADIUS
        nominal = s.LFZO * self.structure.FNOMIN
        sigma_x = (x.PTX1 + x.PTX2 * at.df_z) * jnp.exp(-x.PTX3 * at.df_z) * s.LSGKP
        sigma_x = sigma_x * R_0 * at.load / self.structure.FNOMIN
        greatest = y.PTY2 * nominal
        squares = at.load**2 + greatest**2
        sine = 2 * at.load * greatest / numerics.or_one(squares, squares > 0)
        sigma_y = y.PTY1 * sine * (1 - y.PKY3 * jnp.abs(at.camber)) * R_0 * s.LFZO * s.LSGAL
        return sigma_x, sigma_y
