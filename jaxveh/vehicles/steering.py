"""Who steers the wheels: from the driver's steering to each wheel's angle."""

from __future__ import annotations

import abc
from dataclasses import KW_ONLY
from typing import Any, ClassVar

import equinox as eqx
import jax

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, check_one_of
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.vehicles.base import AbstractVehicle
from jaxveh.vehicles.wheels import Wheels, front_rear, is_straight, wheel_names, wheels_of

STEER_UNITS = dict.fromkeys(("steer", "steer_rear", *wheel_names("steer")), "rad")
"""Units of what cars are told of their wheels' angles, and what they say of them."""


class AbstractSteering(eqx.Module):
    """From inputs to the angles of the road wheels (rad, positive to the left).

    A wheel that is never steered has the Python number 0.0, for which nothing is computed.
    """

    inputs: eqx.AbstractVar[tuple[str, ...]]
    front_alone: eqx.AbstractClassVar[bool]
    """Whether the rear wheels are never steered."""

    @abc.abstractmethod
    def angles(self, car: Any, u: Any, v_x: Any) -> Wheels:
        """The angle of each wheel of the `car` at the inputs `u` and the forward speed `v_x` (m/s), rad."""

    @abc.abstractmethod
    def axle_gains(self, v_x: Any) -> tuple[Any, Any]:
        """Angles of front and rear axle over a small input `steer` (-) at a speed (m/s), other inputs zero.

        **Raises** `InputError` for a steering without that input.
        """


class FrontSteering(AbstractSteering):
    """Both front wheels turn by `steer`: the ordinary car."""

    inputs: ClassVar[tuple[str, ...]] = ("steer",)
    front_alone: ClassVar[bool] = True

    def angles(self, car, u, v_x):
        del car, v_x
        return front_rear(u.steer, 0.0)

    def axle_gains(self, v_x):
        del v_x
        return 1.0, 0.0


class Ackermann(AbstractSteering):
    """Front wheels that turn about one point on the rear axle's line, so that the inner one turns further.

    With L the wheelbase and w half the front track, `tan(delta) = L tan(steer) / (L -+ w tan(steer))` (R. Rajamani, Vehicle
    Dynamics and Control, 2nd ed., sec. 2.2.1). `share` (-): how much of the way to there from parallel wheels, 1 the whole.
    A car on one track turns its front axle by the steer. `FourteenDOF` has a parameter `ackermann` for this.

    **Raises** `InputError` for a share outside -1 to 2.
    """

    share: jax.Array = parameter("-", scale=1.0, default=1.0)
    inputs: ClassVar[tuple[str, ...]] = ("steer",)
    front_alone: ClassVar[bool] = True

    def __check_init__(self):
        check("Ackermann.share", self.share, lambda v: (v >= -1) & (v <= 2), "between -1 and 2")

    def angles(self, car, u, v_x):
        del v_x
        (ahead, half), _, (behind, _), _ = car.wheel_positions
        if isinstance(half, float) and half == 0.0:
            return front_rear(u.steer, 0.0)
        return Wheels(*about_one_point(u.steer, u.steer, self.share, ahead - behind, half), 0.0, 0.0)

    def axle_gains(self, v_x):
        del v_x
        return 1.0, 0.0


class RearSteering(AbstractSteering):
    """The front wheels turn by `steer`, the rear wheels by `steer_rear` (rad): a rear axle with an actuator."""

    inputs: ClassVar[tuple[str, ...]] = ("steer", "steer_rear")
    front_alone: ClassVar[bool] = False

    def angles(self, car, u, v_x):
        del car, v_x
        return front_rear(u.steer, u.steer_rear)

    def axle_gains(self, v_x):
        del v_x
        return 1.0, 0.0


class FourWheelSteering(AbstractSteering):
    """The rear wheels turn with the front ones by a ratio, which may go with the speed, as in cars that are sold.

    The rear angle is k `steer`, with k = `rear_ratio` (-) at all speeds; with a `fast_ratio` k goes from `rear_ratio` at
    standstill to `fast_ratio` at high speed, half of the way at `middle_speed` v_m (m/s):

        k = (rear_ratio + fast_ratio (v / v_m)^2) / (1 + (v / v_m)^2)

    Negative is against the front wheels (more agile, narrower circles), positive with them (calmer). The form is that of the law
    of no sideslip (Y. Furukawa, N. Yuhara, S. Sano et al., Vehicle System Dynamics 18 (1989) 151; M. Abe, Vehicle Handling
    Dynamics, ch. 8), which `steering_without_sideslip` makes.

    **Raises** `InputError` for ratios outside -5 to 5, or a speed that is not positive.
    """

    rear_ratio: jax.Array = parameter("-", scale=0.1)
    _: KW_ONLY
    fast_ratio: jax.Array | None = parameter("-", scale=0.1, default=None)
    middle_speed: jax.Array = positive("m/s", default=20.0)
    inputs: ClassVar[tuple[str, ...]] = ("steer",)
    front_alone: ClassVar[bool] = False

    def __check_init__(self):
        check_parameters(self)
        for name in ("rear_ratio", "fast_ratio"):
            value = getattr(self, name)
            check(
                f"FourWheelSteering.{name}", value, lambda v: (v >= -5) & (v <= 5), "between -5 and 5 (rear over front)"
            )

    def ratio(self, v_x: Any) -> Any:
        """Rear angle over front angle (-) at a forward speed, m/s."""
        if self.fast_ratio is None:
            return self.rear_ratio
        square = v_x * v_x * (1.0 / (self.middle_speed * self.middle_speed))
        return (self.rear_ratio + self.fast_ratio * square) / (1.0 + square)

    def angles(self, car, u, v_x):
        del car
        return front_rear(u.steer, self.ratio(v_x) * u.steer)

    def axle_gains(self, v_x):
        return 1.0, self.ratio(v_x)


class IndependentSteering(AbstractSteering):
    """Each wheel has an angle of its own: `steer_fl`, `steer_fr`, `steer_rl`, `steer_rr` (rad)."""

    inputs: ClassVar[tuple[str, ...]] = wheel_names("steer")
    front_alone: ClassVar[bool] = False

    def angles(self, car, u, v_x):
        del car, v_x
        return wheels_of(u, "steer")

    def axle_gains(self, v_x):
        raise InputError(
            "IndependentSteering has no input steer over which a gain could be told: its inputs are "
            f"{', '.join(self.inputs)}. Take FourWheelSteering or RearSteering for gains."
        )


STEERINGS: dict[str, Any] = {
    "front": FrontSteering,
    "ackermann": Ackermann,
    "rear": RearSteering,
    "four-wheel": FourWheelSteering,
    "independent": IndependentSteering,
}
"""Kinds of steering by the names that a car's file has for them."""


def steering_of(specification: Any) -> AbstractSteering:
    """The steering that a car's file asks for (`jaxveh.io.CarSpecification`): `steering` and the ratios of rear to front."""
    s, kind = specification, getattr(specification, "steering", None) or "front"
    check_one_of("steering", kind, STEERINGS)
    make = STEERINGS[kind]
    if make is not FourWheelSteering:
        return make()
    speed = {} if s.rear_steer_speed is None else {"middle_speed": s.rear_steer_speed}
    return FourWheelSteering(s.rear_steer_ratio, fast_ratio=s.rear_steer_ratio_fast, **speed)


def specification_of_steering(steering: AbstractSteering | None) -> dict[str, Any]:
    """What a car's file says of a steering, by key: the inverse of `steering_of`; nothing of front wheels that turn alike.

    **Raises** `InputError` for one that no file can say: another kind, or an `Ackermann` of another share than 1.
    """
    if steering is None or type(steering) is FrontSteering:
        return {}
    names = {kind: name for name, kind in STEERINGS.items()}
    if type(steering) not in names or (isinstance(steering, Ackermann) and float(steering.share) != 1.0):
        raise InputError(f"{steering}: a car's file cannot say this steering; it knows {', '.join(STEERINGS)}.")
    found: dict[str, Any] = {"steering": names[type(steering)]}
    if isinstance(steering, FourWheelSteering):
        found["rear_steer_ratio"] = float(steering.rear_ratio)
        if steering.fast_ratio is not None:
            found |= {
                "rear_steer_ratio_fast": float(steering.fast_ratio),
                "rear_steer_speed": float(steering.middle_speed),
            }
    return found


def about_one_point(left: Any, right: Any, share: Any, length: Any, half: Any) -> tuple[Any, Any]:
    """Angles (rad) of both front wheels on the `share` (-) of the way from `left` and `right` to those with which the car turns
    about one point, `length` (m) behind them; `half` (m) is half their track."""
    at_left = numerics.sin(left), numerics.cos(left)
    at_right = at_left if right is left else (numerics.sin(right), numerics.cos(right))

    def one(side, angle, s, c):
        return (1.0 - share) * angle + share * numerics.arctan2(length * s, length * c - side * half * s)

    return one(1.0, left, *at_left), one(-1.0, right, *at_right)


def axle_angles(angles: Wheels) -> tuple[Any, Any]:
    """Angles of front and rear axle, rad: the mean of their wheels'."""
    return _mean(angles.fl, angles.fr), _mean(angles.rl, angles.rr)


def _mean(left: Any, right: Any) -> Any:
    return left if left is right or (is_straight(left) and is_straight(right)) else 0.5 * (left + right)


def steer_outputs(steering: AbstractSteering, angles: Wheels) -> dict[str, Any]:
    """What a car on four wheels says of their angles: `steer`, the mean of the front wheels', and `steer_fl` ... of each unless
    they are those of `FrontSteering`."""
    steer = {"steer": axle_angles(angles)[0]}
    plain = isinstance(steering, FrontSteering)
    return steer if plain else steer | dict(zip(wheel_names("steer"), angles, strict=True))


class AbstractSteeredByRoadWheels(AbstractVehicle):
    """A car whose road wheels turn.

    **Parameters** of the steering: `steering`, what turns which wheels (`FrontSteering`, `Ackermann`, `RearSteering`,
    `FourWheelSteering`, `IndependentSteering`); on one track an axle has the mean of its wheels' angles.

    **Raises** `InputError` for a steering that is none.
    """

    _: KW_ONLY
    steering: AbstractSteering = eqx.field(default_factory=FrontSteering)

    def __check_init__(self):
        if not isinstance(self.steering, AbstractSteering):
            raise InputError(
                f"{type(self).__name__}.steering = {type(self.steering).__name__}: must be a steering of jaxveh.vehicles: "
                f"{', '.join(kind.__name__ for kind in STEERINGS.values())}."
            )


def steering_without_sideslip(car: Any) -> FourWheelSteering:
    """The steering with which a linear single track (`LinearSingleTrack`) has no sideslip in any steady turn.

    With both slip angles from the axles' shares of the lateral force and no sideslip,

        k(v) = (m a v^2 / (L C_r) - b) / (m b v^2 / (L C_f) + a)

    (Y. Furukawa, N. Yuhara, S. Sano et al., Vehicle System Dynamics 18 (1989) 151): k is -b / a at standstill, a C_f / (b C_r) at
    high speed, and halfway at v_m^2 = a C_f L / (m b).

    **Raises** `InputError` for a car without axles' stiffnesses (`linear_single_track` makes one of any car).
    """
    if not all(hasattr(car, name) for name in ("front_stiffness", "rear_stiffness")):
        raise InputError(
            f"steering_without_sideslip: {type(car).__name__} has no axle stiffnesses: give linear_single_track(car), which has."
        )
    a, b, C_f, C_r = car.front_axle_to_cg, car.rear_axle_to_cg, car.front_stiffness, car.rear_stiffness
    return FourWheelSteering(
        -b / a, fast_ratio=a * C_f / (b * C_r), middle_speed=numerics.sqrt(a * C_f * (a + b) / (car.mass * b))
    )
