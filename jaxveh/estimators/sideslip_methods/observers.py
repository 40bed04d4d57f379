"""Observers of v_y and yaw rate that recompute their gains in each row, for constant poles at any speed and tyre slope."""

# No postponed annotations in this file: they would turn class variables into fields.

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check
from jaxveh._core.names import record_type
from jaxveh._core.parameter import UNNAMED, check_parameters, positive, table
from jaxveh.estimators.method import Filtered
from jaxveh.estimators.sideslip_methods.common import (
    A_Y,
    SLOWEST,
    STEER,
    V_X,
    YAW_RATE,
    Guarded,
    guard,
    size_of,
    slowest_of,
)
from jaxveh.estimators.sideslip_methods.single_track import (
    YAW_RATE_NOISE,
    LateralReport,
    LateralState,
    full_state,
    in_filter,
    lateral_model,
    report,
    single_track,
)
from jaxveh.estimators.sideslip_methods.stiff_step import StiffStep
from jaxveh.io import CarSpecification
from jaxveh.observers import AbstractObserver, PointBelief
from jaxveh.statespace import Gaussian, Prior, StateSpace
from jaxveh.vehicles import SingleTrack, linear

POLES = (-10.0, -12.0)
"""1/s, for a car of the usual wheelbase: about the poles of a car at 15 m/s, so that the error decays within 0.3 s where the
car's own poles are slower, and noise is not amplified."""

LEAST_SLOPE = 0.2
"""Lower limit of `d a_y / d v_y`, by which a gain is divided, over its value at straight running. The force of a sliding tyre
does not depend on v_y."""

LEAST_LEVER = 0.1
"""Smallest change of the yaw acceleration with sideslip, over the sum of the axles' moments `(a C_f + b C_r) / J`. Below it the
yaw rate alone does not determine v_y, and the gain fades out."""

LINEAR_SHARE, BOUNDARY = 0.3, (0.02, 1.0)
"""Linear share of the sliding observer's gain; width of its switch, rad/s and m/s^2: about ten times the sensors' noise."""

LOST = 0.3
"""rad/s, for a car of the usual wheelbase: an observer whose yaw rate is further from the measured one has spun, and its gain
does not bring it back. It is reset to the measured yaw rate and zero lateral velocity."""

TINY = 1e-12


class StepMemory(NamedTuple):
    """Slopes of the last step, (2, 2), and whether the car was fast enough for them to be valid."""

    slopes: Any
    moves: Any


class AbstractPlaced(AbstractObserver):
    """An observer whose error, after each correction, obeys `(I - K H) F` with the poles `exp(poles dt)`; `poles` (2,), 1/s.

    F are the slopes of the step and H those of the observation, recomputed in each row. Where a measurement is missing, there is
    no correction. Yaw rate is the first channel; if its error exceeds `LOST`, the observer is reset.
    """

    poles: jax.Array = table("1/s")

    def __check_init__(self):
        check_parameters(self)
        check(f"{type(self).__name__}.poles", self.poles, lambda p: p < 0, "negative")

    @abc.abstractmethod
    def gain(self, model: StateSpace, F: Any, H: Any, z: Any, row: Any) -> Any:
        """The gain (2, m) for slopes F (2, 2) and H (m, 2) and the poles z (2,) of this step."""

    def at(self, model: StateSpace, vector: Any) -> Any:
        """The state (2,) at which slopes are taken."""
        del model
        return vector

    def check(self, model):
        del model

    def start(self, model):
        eye = jnp.eye(2, dtype=model.dtype)
        return StepMemory(eye, jnp.zeros((), bool))

    def predict(self, model, belief, row):
        u = model.step_inputs(belief.t, row.t, belief.u, row.u)
        move = lambda vector: jnp.stack(model.transition(belief.t, row.t, belief.state_type(*vector), u))
        F = jax.jacfwd(move)(self.at(model, belief.vector))
        moves = belief.u.v_x >= model.system.slowest
        eye = jnp.eye(2, dtype=F.dtype)
        return move(belief.vector), StepMemory(jnp.where(moves, F, eye), moves)

    def correct(self, model, belief: PointBelief, row, error, here):
        F, moves = belief.memory
        see = lambda vector: jnp.stack([getattr(channels_of(model, row, vector), name) for name in model.channels])
        H = jax.jacfwd(see)(self.at(model, belief.vector))
        z = jnp.exp(self.poles.astype(error.dtype) * (row.t - belief.t))
        K = self.gain(model, F, H, z, row)
        corrects = jnp.all(here) & moves
        change = jnp.where(corrects, self.change(K, error), 0.0)
        lost = here[0] & (jnp.abs(error[0]) > LOST * SLOWEST / model.system.slowest)
        return jnp.where(lost, jnp.stack([-belief.vector[0], error[0]]), change), belief.memory

    def change(self, K: Any, error: Any) -> Any:
        """The correction (2,) from a gain and the channels' errors."""
        return K @ error


def channels_of(model: StateSpace, row, vector):
    """The predicted measurements for a state (2,)."""
    return model.observation(row.t, type(model.prior.mean)(*vector), row.u)


class ErrorLinearising(AbstractPlaced):
    """The nonlinear observer of U. Kiencke & A. Daiss (the review's [59], section 1.4.2): with gains computed at the estimate the
    error obeys one linear equation everywhere.

        L(x, u):  df/dx - L dh/dx = diag(poles)    in a step:  K = (I - diag(z) F^-1) H^-1

    Yaw rate and a_y are measured, so that H is square. Where the axles slide, its slope `d a_y / d v_y` is limited to
    `LEAST_SLOPE` of that at straight running.
    """

    def gain(self, model, F, H, z, row):
        car: Any = model.system.car
        plain = stiffnesses(car)
        least = LEAST_SLOPE * (plain[0] + plain[1]) / car.mass / jnp.maximum(row.u.v_x, model.system.slowest)
        # The channels are yaw rate, which is the second state, and a_y.
        slope, turning = -jnp.maximum(-H[1, 0], least), H[1, 1]
        inverse = jnp.stack([jnp.stack([-turning / slope, 1.0 / slope]), jnp.asarray([1.0, 0.0], slope.dtype)])
        determinant = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
        back = jnp.stack([jnp.stack([F[1, 1], -F[0, 1]]), jnp.stack([-F[1, 0], F[0, 0]])]) / determinant
        return (jnp.eye(2, dtype=F.dtype) - z[:, None] * back) @ inverse


class ConstantPoles(ErrorLinearising):
    """The Luenberger observer (section 1.4.2) with the gain of straight running at the row's speed."""

    def at(self, model, vector):
        del model
        return jnp.zeros_like(vector)


class ArctangentSliding(ConstantPoles):
    """The sliding-mode observer of section 1.4.3 (its [60-62]), with eq 9 for the sign:

        x = x- + share K e + M (2 / pi) arctan(lambda e),    M = (pi / 2) (1 - share) K / lambda

    K places the poles. For small errors the observer is linear with gain K; for large ones the switching term corrects at most M
    per row. `share` (-) is the linear part of the gain, `boundary` = 1 / lambda (rad/s, m/s^2) the width of each channel's
    switch.
    """

    share: jax.Array = positive("-", default=LINEAR_SHARE)
    boundary: jax.Array = table("rad/s, m/s^2", default=BOUNDARY)

    def change(self, K, error):
        edge = self.boundary.astype(error.dtype)
        switching = 0.5 * jnp.pi * (1.0 - self.share) * edge
        return K @ (self.share * error + switching * saturated_sign(error, 1.0 / edge))


def saturated_sign(error: Any, steepness: Any) -> Any:
    """Eq 9 of the review: `(2 / pi) arctan(lambda e)` in place of sgn(e); its slope at 0 is 2 lambda / pi."""
    return 2.0 / jnp.pi * jnp.arctan(steepness * error)


class StateDependentGain(AbstractPlaced):
    """M. Zeitz's extended Luenberger observer (the review's [58], section 1.4.2): Ackermann's formula at the estimate, with the
    yaw rate alone.

    With the slopes f of a step, their determinant D, and the poles z:

        k_r = 1 - z1 z2 / D,    k_v = (f_11 + f_22 z1 z2 / D - z1 - z2) / f_21

    f_21 is proportional to `(b C_r - a C_f) / (J v)`: the yaw rate of a neutral car does not determine v_y. Where f_21 is less
    than `least` (1/s^2) over the speed, times the step, the correction of v_y fades out, and the yaw rate has its own pole.
    """

    least: jax.Array = positive("1/s^2", default=1.0)

    def gain(self, model, F, H, z, row):
        del H
        # The step's length from its poles: a step of zero length corrects nothing.
        step = jnp.log(z[0]) / self.poles[0].astype(z.dtype)
        edge = self.least.astype(z.dtype) * step / jnp.maximum(row.u.v_x, model.system.slowest)
        lever = F[1, 0]
        telling = jnp.square(lever) + jnp.square(edge) + TINY
        share, product = jnp.square(lever) / telling, z[0] * z[1] / (F[0, 0] * F[1, 1] - F[0, 1] * lever)
        aside = (F[0, 0] + F[1, 1] * product - z[0] - z[1]) * lever / telling
        turning = share * (1.0 - product) + (1.0 - share) * (1.0 - numerics.smallest(z) / F[1, 1])
        return jnp.stack([aside, turning])[:, None]


class RearForce(eqx.Module):
    """The system of an observer that does not use the front axle: the `car`, of which only the rear axle counts; `slowest` as in
    `Lateral`."""

    car: SingleTrack = eqx.field(metadata=UNNAMED)
    slowest: jax.Array = positive("m/s")


def rear_derivatives(system: RearForce, t, x: LateralState, u) -> LateralState:
    """`dv_y/dt = a_y - v_x r`, `J dr/dt = a m a_y - (a + b) F_r`: the front axle's force is `m a_y - F_r`."""
    car: Any = system.car
    straight = record_type("Inputs", ("steer", "v_x"))(jnp.zeros_like(u.v_x), u.v_x)
    F_r = car.outputs(t, full_state(car, x), straight).F_yr
    moment = car.front_axle_to_cg * car.mass * u.a_y - car.wheelbase * F_r
    return LateralState(u.a_y - u.v_x * x.yaw_rate, moment / car.yaw_inertia)


REAR_STEP = StiffStep(rear_derivatives)


def rear_transition(system: RearForce, t0, t1, x: LateralState, u) -> LateralState:
    """The state after a step; below `slowest` the rear wheels roll without slip."""
    moved = REAR_STEP(system, t0, t1, x, u)
    rolling = LateralState(system.car.rear_axle_to_cg * x.yaw_rate, x.yaw_rate)
    return jax.tree.map(lambda a, b: jnp.where(u.v_x >= system.slowest, a, b), moved, rolling)


def yaw_rate_alone(system, t, x, u):
    """The yaw rate of the gyroscope."""
    return record_type("Measurements", ("yaw_rate",))(x.yaw_rate)


def rear_force_model(car: SingleTrack, slowest: float) -> StateSpace:
    """The model of an observer of lateral velocity that no disturbance of the front axle's force affects (the review's [21, 65],
    section 1.4.4).

    A force d at the front adds d / m to dv_y/dt and to the measured a_y, and a d / J to dr/dt. A gain `(1, m a / J)` from a_y
    therefore removes any d from the error equation: a wrong front stiffness, a wrong steer, a slippery road under the front
    wheels. This gain also removes the model's front force, so that a_y is an input, and the yaw rate is left to place the poles.
    The rear axle's stiffness still matters.
    """
    return StateSpace(
        system=RearForce(car, slowest),
        transition=rear_transition,
        observation=yaw_rate_alone,
        report=report,
        process_noise=None,
        measurement_noise=Gaussian({"yaw_rate": YAW_RATE_NOISE}),
        prior=Prior(LateralState(0.0, 0.0), Gaussian({"v_y": 0.5, "yaw_rate": 0.1})),
        inputs=("v_x", "a_y"),
    )


def blind_to_front(car: CarSpecification) -> Guarded:
    """Makes the observer that does not use the front axle from a car's file."""
    model = rear_force_model(single_track(car), slowest_of(car))
    filter = StateDependentGain(_poles(car), _least(model.system.car))
    inner = Filtered(model, filter, (V_X, YAW_RATE, A_Y), shown=LateralReport._fields)
    return guard(car, inner, (YAW_RATE, A_Y), (A_Y,))


def luenberger(car: CarSpecification) -> Guarded:
    """Makes the observer with the gain of straight running from a car's file."""
    return _observer(car, ConstantPoles(_poles(car)))


def error_linearising(car: CarSpecification) -> Guarded:
    """Makes the error-linearising observer from a car's file."""
    return _observer(car, ErrorLinearising(_poles(car)))


def sliding_mode(car: CarSpecification) -> Guarded:
    """Makes the sliding-mode observer from a car's file."""
    return _observer(car, ArctangentSliding(_poles(car)))


def state_dependent(car: CarSpecification) -> Guarded:
    """Makes the extended Luenberger observer from a car's file."""
    plain = lateral_model(single_track(car), slowest_of(car))
    model = eqx.tree_at(lambda m: m.measurement_noise, plain, Gaussian({"yaw_rate": YAW_RATE_NOISE}))
    filter = StateDependentGain(_poles(car), _least(model.system.car))
    inner = Filtered(model, filter, (V_X, STEER, YAW_RATE), shown=LateralReport._fields)
    return guard(car, inner, (YAW_RATE,))


def _observer(car: CarSpecification, observer: AbstractPlaced) -> Guarded:
    return in_filter(car, lateral_model(single_track(car), slowest_of(car)), observer)


def _poles(car: CarSpecification) -> list[float]:
    return [pole / size_of(car) ** 0.5 for pole in POLES]


def _least(car: SingleTrack) -> float:
    front, rear = (float(one) for one in stiffnesses(car))
    a, b = float(car.front_axle_to_cg), float(car.rear_axle_to_cg)
    return LEAST_LEVER * (a * front + b * rear) / float(car.yaw_inertia)


def stiffnesses(car: Any) -> tuple[Any, Any]:
    """Cornering stiffnesses of the axles, N/rad, at rest."""
    plain = linear(car)
    return plain.front.cornering_stiffness, plain.rear.cornering_stiffness
