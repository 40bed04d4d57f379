"""Steering systems: from the driver's steering to the angles of the wheels."""

from __future__ import annotations

import abc
from dataclasses import KW_ONLY
from typing import Any, ClassVar

import equinox as eqx
import jax

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, check_one_of, word_for
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh._core.plain import plain_float
from jaxveh.io import kit as io
from jaxveh.vehicles.base import AbstractVehicle
from jaxveh.vehicles.wheels import Wheels, front_rear, is_straight, wheel_names, wheels_of

STEER_UNITS = dict.fromkeys(("steer", "steer_rear", *wheel_names("steer")), "rad")
"""The units of the wheel angles among the inputs and outputs of cars."""


class AbstractSteering(eqx.Module):
    """A steering system: from the inputs to the angles of the road wheels (rad, positive to the left).

    The angle of a wheel that is never steered is the Python number 0.0, so that nothing is computed for it.
    """

    inputs: eqx.AbstractVar[tuple[str, ...]]
    front_alone: eqx.AbstractClassVar[bool]
    """Whether the rear wheels are never steered."""

    @abc.abstractmethod
    def angles(self, car: Any, u: Any, v_x: Any) -> Wheels:
        """The angle of each wheel of the `car` at the inputs `u` and the forward speed `v_x` (m/s), rad."""

    @abc.abstractmethod
    def axle_gains(self, v_x: Any) -> tuple[Any, Any]:
        """The angles of front and rear axle over a small input `steer` (-) at the speed `v_x` (m/s), with other inputs zero.

        **Raises** `InputError` for a steering without that input.
        """


class FrontSteering(AbstractSteering):
    """Both front wheels are turned by the input `steer` (rad): the ordinary car."""

    inputs: ClassVar[tuple[str, ...]] = ("steer",)
    front_alone: ClassVar[bool] = True

    def angles(self, car, u, v_x):
        del car, v_x
        return front_rear(u.steer, 0.0)

    def axle_gains(self, v_x):
        del v_x
        return 1.0, 0.0


class Ackermann(AbstractSteering):
    """Front wheels whose axes meet in one point on the line of the rear axle, so that the inner wheel is turned further.

    With L the wheelbase and w half the front track, `tan(delta) = L tan(steer) / (L -+ w tan(steer))` (R. Rajamani, Vehicle
    Dynamics and Control, 2nd ed., sec. 2.2.1). `share` (-): 0 for parallel wheels, 1 for this geometry, linear between. For a
    car on one track the angle of the front axle is the steer. `FourteenDOF` has the parameter `ackermann` for this.

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
    """The front wheels are turned by the input `steer` (rad), the rear wheels by `steer_rear` (rad), as by a rear actuator."""

    inputs: ClassVar[tuple[str, ...]] = ("steer", "steer_rear")
    front_alone: ClassVar[bool] = False

    def angles(self, car, u, v_x):
        del car, v_x
        return front_rear(u.steer, u.steer_rear)

    def axle_gains(self, v_x):
        del v_x
        return 1.0, 0.0


class FourWheelSteering(AbstractSteering):
    """The rear wheels are turned in a ratio to the front wheels, which may depend on speed, as in production cars.

    The rear angle is k `steer`, with k = `rear_ratio` (-) at all speeds. With `fast_ratio` (-, at high speed) k changes from
    `rear_ratio` at standstill to `fast_ratio`; half of the change is reached at `middle_speed` v_m (m/s):

        k = (rear_ratio + fast_ratio (v / v_m)^2) / (1 + (v / v_m)^2)

    With a negative ratio the rear wheels turn against the front wheels (more agile, narrower circles), with a positive one in
    the same direction (more stable). The form is that of the law for zero sideslip (Y. Furukawa, N. Yuhara, S. Sano et al.,
    Vehicle System Dynamics 18 (1989) 151; M. Abe, Vehicle Handling Dynamics, ch. 8), see `steering_without_sideslip`.

    **Raises** `InputError` for ratios outside -5 to 5, or a speed that is not positive.
    """

    rear_ratio: jax.Array = parameter("-", scale=0.1)
    _: KW_ONLY
    fast_ratio: jax.Array | None = parameter("-", scale=0.1, default=None)
    middle_speed: jax.Array = positive("m/s", default=io.USUAL_MIDDLE_SPEED)
    inputs: ClassVar[tuple[str, ...]] = ("steer",)
    front_alone: ClassVar[bool] = False

    def __check_init__(self):
        check_parameters(self)
        for name in ("rear_ratio", "fast_ratio"):
            value, what = getattr(self, name), f"FourWheelSteering.{name}"
            if value is not None:
                check(what, value, lambda v: (v >= -5) & (v <= 5), "between -5 and 5 (rear over front)")

    def ratio(self, v_x: Any) -> Any:
        """The rear angle over the front angle (-) at the forward speed `v_x` (m/s)."""
        return io.rear_ratio(self.rear_ratio, self.fast_ratio, self.middle_speed, v_x)

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
            "IndependentSteering has no input steer, so that gains are not defined: its inputs are "
            f"{', '.join(self.inputs)}. Use FourWheelSteering or RearSteering for gains."
        )


STEERINGS: dict[str, Any] = {
    "front": FrontSteering,
    "ackermann": Ackermann,
    "rear": RearSteering,
    "four-wheel": FourWheelSteering,
    "independent": IndependentSteering,
}
"""The kinds of steering by their names in a car's file."""


def steering_of(specification: Any) -> AbstractSteering:
    """The steering of a car's file (`jaxveh.io.CarSpecification`), from its `steering` and the ratios of rear to front angle."""
    s, kind = specification, getattr(specification, "steering", None) or "front"
    check_one_of("steering", kind, STEERINGS)
    make = STEERINGS[kind]
    if make is not FourWheelSteering:
        return make()
    speed = {} if s.rear_steer_speed is None else {"middle_speed": s.rear_steer_speed}
    return FourWheelSteering(s.rear_steer_ratio, fast_ratio=s.rear_steer_ratio_fast, **speed)


def specification_of_steering(steering: AbstractSteering | None) -> dict[str, Any]:
    """The entries of a car's file for a steering, by key: the inverse of `steering_of`. `FrontSteering` needs none.

    **Raises** `InputError` for a steering that no file can describe: another kind, or an `Ackermann` with a share other than 1.
    """
    if steering is None or type(steering) is FrontSteering:
        return {}
    names = {kind: name for name, kind in STEERINGS.items()}
    if type(steering) not in names or (isinstance(steering, Ackermann) and float(steering.share) != 1.0):
        raise InputError(f"{steering}: a car's file cannot describe this steering; it can have {', '.join(STEERINGS)}.")
    found: dict[str, Any] = {"steering": names[type(steering)]}
    if isinstance(steering, FourWheelSteering):
        found["rear_steer_ratio"] = plain_float(steering.rear_ratio)
        if steering.fast_ratio is not None:
            found |= {
                "rear_steer_ratio_fast": plain_float(steering.fast_ratio),
                "rear_steer_speed": plain_float(steering.middle_speed),
            }
    return found


def about_one_point(left: Any, right: Any, share: Any, length: Any, half: Any) -> tuple[Any, Any]:
    """The angles (rad) of both front wheels: `left` and `right` for a `share` (-) of 0, those of a turn about one point on a line
    `length` (m) behind the wheels for 1, linear between; `half` (m) is half the track."""
    at_left = numerics.sin(left), numerics.cos(left)
    at_right = at_left if right is left else (numerics.sin(right), numerics.cos(right))

    def one(side, angle, s, c):
        return (1.0 - share) * angle + share * numerics.arctan2(length * s, length * c - side * half * s)

    return one(1.0, left, *at_left), one(-1.0, right, *at_right)


def axle_angles(angles: Wheels) -> tuple[Any, Any]:
    """The angles of front and rear axle, rad: the means over their wheels."""
    return _mean(angles.fl, angles.fr), _mean(angles.rl, angles.rr)


def _mean(left: Any, right: Any) -> Any:
    return left if left is right or (is_straight(left) and is_straight(right)) else 0.5 * (left + right)


def steer_outputs(steering: AbstractSteering, angles: Wheels) -> dict[str, Any]:
    """The wheel angles among the outputs of a car on four wheels: `steer`, the mean over the front wheels, and, except for
    `FrontSteering`, `steer_fl` ... of each wheel."""
    steer = {"steer": axle_angles(angles)[0]}
    plain = isinstance(steering, FrontSteering)
    return steer if plain else steer | dict(zip(wheel_names("steer"), angles, strict=True))


class AbstractSteeredByRoadWheels(AbstractVehicle):
    """A car with steered road wheels.

    **Parameters** of the steering: `steering` (which wheels are steered and how: a `FrontSteering`, `Ackermann`, `RearSteering`,
    `FourWheelSteering` or `IndependentSteering`); on one track the angle of an axle is the mean over its wheels.

    **Raises** `InputError` for a steering that is not a steering of `jaxveh.vehicles`.
    """

    _: KW_ONLY
    steering: AbstractSteering = eqx.field(default_factory=FrontSteering)

    def __check_init__(self):
        if not isinstance(self.steering, AbstractSteering):
            raise InputError(
                f"{type(self).__name__}.steering = {word_for(self.steering)}: must be a steering of jaxveh.vehicles: "
                f"{', '.join(kind.__name__ for kind in STEERINGS.values())}."
            )


def steering_without_sideslip(car: Any) -> FourWheelSteering:
    """The steering with which a linear single track (`LinearSingleTrack`) has no sideslip in any steady turn.

    The slip angles follow from the axles' shares of the lateral force. With these and zero sideslip,

        k(v) = (m a v^2 / (L C_r) - b) / (m b v^2 / (L C_f) + a)

    (Y. Furukawa, N. Yuhara, S. Sano et al., Vehicle System Dynamics 18 (1989) 151): k is -b / a at standstill, a C_f / (b C_r) at
    high speed, and halfway at v_m^2 = a C_f L / (m b).

    **Raises** `InputError` for a car without axle stiffnesses (`linear_single_track` makes such a car from any other).
    """
    if not all(hasattr(car, name) for name in ("front_stiffness", "rear_stiffness")):
        raise InputError(
            f"steering_without_sideslip: {type(car).__name__} has no axle stiffnesses: give linear_single_track(car) instead."
        )
    a, b, C_f, C_r = car.front_axle_to_cg, car.rear_axle_to_cg, car.front_stiffness, car.rear_stiffness
    return FourWheelSteering(
        -b / a, fast_ratio=a * C_f / (b * C_r), middle_speed=numerics.sqrt(a * C_f * (a + b) / (car.mass * b))
    )
