"""The filters' model of the car: the paper's three degrees of freedom, with F_x from the motor torques and F_y by Dugoff."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import positive
from jaxveh.experiments.federated_ckf.drives import (
    PULLS,
    STEERS,
    WHEELS,
    Drive,
    dugoff,
    felt_accelerations,
    times,
    wheel_rates,
)
from jaxveh.experiments.federated_ckf.settings import PARAMETERS, Study
from jaxveh.statespace import Continuous, Gaussian, Prior, Propagate, RolledRK4, Row, StateSpace, with_parameters
from jaxveh.tyres import Dugoff, Forces
from jaxveh.vehicles import GRAVITY, kit, sets

INPUTS = (*STEERS, "a_x_felt", "a_y_felt", *PULLS)
CHANNELS = ("a_x", "a_y", "yaw_rate", *WHEELS)

TURNS = 3
"""How often the slip under a longitudinal force is computed again; that force is small against the friction limit, so each
iteration gains one digit."""

LEAST_SHARE = 0.02
"""The least share of its unbounded force that the model gives a sliding wheel: slips stay finite for any guess."""

LEAST_SPEED = 1.0
"""m/s: slips are taken relative to this speed at least, even for slower sigma points."""


class State(NamedTuple):
    """Speeds of the centre of gravity (m/s) and the yaw rate (rad/s)."""

    v_x: Any
    v_y: Any
    yaw_rate: Any


class Pushed(NamedTuple):
    """Accelerations (m/s^2) and yaw moment (N m) of the wheels' forces, and the speeds of the wheels' spins (rad/s)."""

    a_x: Any
    a_y: Any
    moment: Any
    omega: kit.Wheels


class Planar(eqx.Module):
    """The paper's car: mass, inertia, position of the centre of gravity and friction are unknown, the rest is
    `vehicles.sets.ev`.

    A wheel's longitudinal force is known from its motor, `F_x = (T - J_w domega/dt) / r` (eq 10), less rolling resistance.
    Its lateral force is Dugoff's at the slip ratio that gives this F_x, or with `measured_slip` at the slip ratio of the
    measured wheel speeds (eq 14; inputs `omega_fl` ...), which is noisy. Loads follow the measured accelerations (eq 9).
    `friction` may be one number or one per wheel (`Wheels`), or may be given by the inputs `friction_fl` ....
    """

    friction: Any = positive("-")
    mass: jax.Array = positive("kg")
    yaw_inertia: jax.Array = positive("kg m^2")
    front_axle_to_cg: jax.Array = positive("m")
    wheelbase: jax.Array = positive("m")
    cg_height: jax.Array = positive("m")
    track_front: jax.Array = positive("m")
    track_rear: jax.Array = positive("m")
    wheel_radius: jax.Array = positive("m")
    wheel_inertia: jax.Array = positive("kg m^2")
    drag: jax.Array = positive("N s^2/m^2")
    rolling_resistance: jax.Array = positive("-")
    tyre: Dugoff  # pyright: ignore[reportGeneralTypeIssues]
    front_roll_share: None = None
    measured_slip: bool = eqx.field(static=True, default=False)

    @property
    def rear_axle_to_cg(self):
        """m."""
        return self.wheelbase - self.front_axle_to_cg

    @property
    def places(self) -> kit.Wheels:
        """(x, y), m, of the wheels from the centre of gravity."""
        return kit.corners(self.front_axle_to_cg, self.rear_axle_to_cg, self.track_front, self.track_rear)

    def push(self, x: State, u: Any) -> Pushed:
        """The accelerations and the moment that the wheels cause in the state x with the inputs u (`steer_fl` ..., `pull_fl`
        ...; eqs 1-9)."""
        moves = kit.rolling_wheels(self.places, x.v_x, x.v_y, x.yaw_rate, kit.wheels_of(u, "steer"))
        pulls = kit.wheels_of(u, "pull")
        loads = kit.planar_loads(self, u.a_x_felt, u.a_y_felt, -GRAVITY)
        pulls = kit.each_wheel(lambda pull, load: pull - self.rolling_resistance * load, pulls, loads)
        found = self._wheels(
            moves, loads, pulls, self._frictions(u), self._slips(moves, u) if self.measured_slip else None
        )
        push = kit.body_forces(self.places, moves, kit.each_wheel(lambda wheel: wheel[0], found))
        omega = kit.each_wheel(lambda move, wheel: move.along * (1.0 + wheel[1]) / self.wheel_radius, moves, found)
        drag = kit.air_drag(self.drag, x.v_x)
        return Pushed((push.F_x - drag) / self.mass, push.F_y / self.mass, push.M_z, omega)

    def _frictions(self, u: Any) -> kit.Wheels:
        """The friction under each wheel: the input, if it is one, otherwise the car's."""
        if hasattr(u, "friction_fl"):
            return kit.wheels_of(u, "friction")
        return self.friction if isinstance(self.friction, kit.Wheels) else kit.Wheels(*[self.friction] * 4)

    def _slips(self, moves: kit.Wheels, u: Any) -> kit.Wheels:
        """Slip ratios of the measured wheel speeds (eq 14)."""
        slip = lambda move, omega: (omega * self.wheel_radius - move.along) / jnp.maximum(move.along, LEAST_SPEED)
        return kit.each_wheel(slip, moves, kit.wheels_of(u, "omega"))

    def _wheels(
        self, moves: kit.Wheels, loads: kit.Wheels, pulls: kit.Wheels, friction: kit.Wheels, slips: kit.Wheels | None
    ) -> kit.Wheels:
        """Forces and slip ratios of all four wheels in one call, which makes the program a quarter as long."""
        along = kit.each_wheel(lambda m: m.along, moves)
        across = kit.each_wheel(lambda m: m.across, moves)
        told = pulls if slips is None else slips
        flat = jnp.broadcast_arrays(*along, *across, *loads, *told, *friction)
        stacked = [jnp.stack(flat[i : i + 4]) for i in range(0, 20, 4)]
        F_y, slip_ratio = self._lateral_and_slip(*stacked) if slips is None else self._lateral_at_slip(*stacked)
        return kit.Wheels(*[(Forces(F_x=pull, F_y=F_y[i]), slip_ratio[i]) for i, pull in enumerate(pulls)])

    def _lateral_and_slip(self, along, across, load, pull, friction) -> tuple[Any, Any]:
        """Lateral force (N) and slip ratio of wheels with the longitudinal force `pull` (N): Dugoff's law solved for the slip.

        With W = |C sigma| the force is W l (2 - l), l = min(1, mu F_z / (2 W)), so that sigma_x = pull / (C_x l (2 - l)).
        """
        tangent = -across / jnp.maximum(jnp.abs(along), LEAST_SPEED)
        rolls = lambda sigma_x: 1.0 / (1.0 - jnp.clip(sigma_x, -0.5, 0.5))
        share = lambda sigma_x: self._share(along, tangent, load, rolls(sigma_x), friction)
        turn = lambda _, sigma_x: pull / (self.tyre.slip_stiffness * share(sigma_x))
        sigma_x = jax.lax.fori_loop(0, TURNS, turn, jnp.zeros_like(tangent))
        return share(sigma_x) * self.tyre.cornering_stiffness * tangent / rolls(sigma_x), rolls(sigma_x) - 1.0

    def _lateral_at_slip(self, along, across, load, slip_ratio, friction) -> tuple[Any, Any]:
        """Lateral force (N) and slip ratio of wheels whose slip ratio is known."""
        tangent = -across / jnp.maximum(jnp.abs(along), LEAST_SPEED)
        rolls = 1.0 + jnp.clip(slip_ratio, -0.5, 0.5)
        share = self._share(along, tangent, load, rolls, friction)
        return share * self.tyre.cornering_stiffness * tangent / rolls, slip_ratio

    def _share(self, along, tangent, load, rolls, friction) -> Any:
        """The share of the unbounded force that is left when the wheel slides, l (2 - l); `rolls` is 1 + kappa, sigma =
        kappa / (1 + kappa)."""
        fading = 0.0 if self.tyre.fading is None else self.tyre.fading
        slides = numerics.hypot(rolls - 1.0, tangent)
        faded = 1.0 - fading * jnp.maximum(jnp.abs(along), LEAST_SPEED) * slides
        limit = friction * jnp.maximum(load, 0.0) * jnp.maximum(faded, 0.0)
        wish_x, wish_y = self.tyre.slip_stiffness * (rolls - 1.0), self.tyre.cornering_stiffness * tangent
        wish = numerics.hypot(wish_x, wish_y) / rolls
        part = jnp.where(2.0 * wish > limit, limit / jnp.maximum(2.0 * wish, 1e-6), 1.0)
        return jnp.maximum(part * (2.0 - part), LEAST_SHARE)


def planar(study: Study, start: Any, measured_slip: bool = False) -> Planar:
    """The car with the first guesses `start` of its parameters."""
    numbers = sets.ev()
    names = (
        "cg_height", "track_front", "track_rear", "wheel_radius", "wheel_inertia", "drag", "rolling_resistance",
    )  # fmt: skip
    known = {name: getattr(numbers, name) for name in names}
    guessed = {name: getattr(start, name) for name in PARAMETERS}
    return Planar(**guessed, **known, wheelbase=numbers.wheelbase, tyre=dugoff(study), measured_slip=measured_slip)


def rates(system: Planar, t, x: State, u) -> State:
    """The equations of motion."""
    del t
    push = system.push(x, u)
    return State(push.a_x + x.v_y * x.yaw_rate, push.a_y - x.v_x * x.yaw_rate, push.moment / system.yaw_inertia)


def sensor_outputs(system: Planar, t, x: State, u) -> Any:
    """The sensors' measurements without noise."""
    del t
    push = system.push(x, u)
    return record_type("Measurements", CHANNELS)(push.a_x, push.a_y, x.yaw_rate, *push.omega)


def reported_state(system: Planar, t, x: State, u) -> Any:
    """The states and the sideslip (rad)."""
    del system, t, u
    names = (*State._fields, "sideslip")
    return record_type("Report", names)(*x, numerics.arctan2(x.v_y, x.v_x))


MOVE = Propagate(rates, RolledRK4())


def noise_levels(study: Study) -> dict[str, float]:
    """The sensors' standard deviations by channel."""
    own = {"a_x": study.a_x, "a_y": study.a_y, "yaw_rate": study.yaw_rate}
    return own | dict.fromkeys(WHEELS, study.wheel_speed)


def states_model(study: Study, car: Planar, drive: Drive, inputs: tuple[str, ...] = INPUTS) -> StateSpace:
    """Three states; the car's parameters are known."""
    v_x = jnp.mean(drive.omega[0, 2:]) * car.wheel_radius
    return StateSpace(
        system=car,
        transition=MOVE,
        observation=sensor_outputs,
        report=reported_state,
        process_noise=Continuous(
            Gaussian({"v_x": study.speed_noise, "v_y": study.speed_noise, "yaw_rate": study.yaw_noise})
        ),
        measurement_noise=Gaussian(noise_levels(study)),
        prior=Prior(State(v_x, jnp.zeros_like(v_x), jnp.zeros_like(v_x)), {"v_x": 0.1, "v_y": 0.1, "yaw_rate": 0.05}),
        inputs=inputs,
        input_path="linear",
    )


def joint_model(study: Study, start: Any, drive: Drive) -> StateSpace:
    """Seven states: three of the car, and the logarithms of four parameters."""
    spreads = (study.friction_spread, study.mass_spread, study.inertia_spread, study.cg_spread)
    where = lambda model: tuple(getattr(model.system, name) for name in PARAMETERS)
    return with_parameters(
        states_model(study, planar(study, start), drive), where, dict(zip(PARAMETERS, spreads, strict=True)), study.walk
    )


def rows_of(study: Study, drive: Drive) -> Row:
    """The drive's rows: longitudinal forces from torques and measured wheel speeds (eq 10), measurements by channel."""
    car = sets.ev()
    assert car.wheel_inertia is not None and car.wheel_radius is not None
    pulls = (drive.torque - car.wheel_inertia * wheel_rates(study, drive)) / car.wheel_radius
    u = record_type("Inputs", INPUTS)(*drive.steer.T, *felt_accelerations(study, drive), *pulls.T)
    y = record_type("Measurements", CHANNELS)(drive.a_x, drive.a_y, drive.yaw_rate, *drive.omega.T)
    return Row(times(study), u, y)
