"""Car parameters of the speed methods: those of the car's file, and typical ones for values that the file lacks."""

from __future__ import annotations

from typing import Any

import jax

from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.two_axles import AbstractLinearAxles, linear_axles_of
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

TYPICAL = {
    "cg_height": 0.2, "track_front": 0.56, "track_rear": 0.56, "wheel_radius": 0.12, "drag": 3e-4, "rolling_resistance": 0.012,
    "front_drive": 0.5, "front_brake": 0.65,
}  # fmt: skip
"""Defaults for values that a car's file lacks: height, tracks and radius over the wheelbase, the drag over the mass (1/m)."""


class SpeedCar(AbstractLinearAxles):
    """Lengths (m), drag (N s^2/m^2), shares (-) and the steering of a car's file, beside its mass and axles."""

    cg_height: jax.Array = parameter("m", scale=0.5)
    track_front: jax.Array = positive("m")
    track_rear: jax.Array = positive("m")
    wheel_radius: jax.Array = positive("m")
    drag: jax.Array = parameter("N s^2/m^2", scale=0.4)
    rolling_resistance: jax.Array = parameter("-", scale=0.01)
    front_drive: jax.Array = parameter("-", scale=0.1)
    front_brake: jax.Array = parameter("-", scale=0.1)
    steering_ratio: jax.Array = positive("-")
    steer_offset: jax.Array = parameter("rad", scale=0.01)

    @property
    def cornering_stiffnesses(self) -> tuple[Any, Any]:
        """Cornering stiffnesses of the front and the rear axle, N/rad."""
        return self.front_cornering_stiffness, self.rear_cornering_stiffness

    @property
    def loads(self) -> tuple[Any, Any]:
        """Load of a front and of a rear wheel at rest, N."""
        half = 0.5 * self.mass * GRAVITY / self.wheelbase
        return half * self.rear_axle_to_cg, half * self.front_axle_to_cg


def speed_car(car: CarSpecification) -> SpeedCar:
    """The parameters of a car's file; missing ones are those of a typical car (`TYPICAL`), with a steering ratio of 16."""
    scale = dict.fromkeys(("cg_height", "track_front", "track_rear", "wheel_radius"), car.wheelbase) | {
        "drag": car.mass
    }
    told = {name: getattr(car, name) for name in TYPICAL}
    numbers = {n: share * scale.get(n, 1.0) if told[n] is None else told[n] for n, share in TYPICAL.items()}
    return SpeedCar(
        **linear_axles_of(car),
        steering_ratio=16.0 if car.steering_ratio is None else car.steering_ratio,
        steer_offset=0.0 if car.steer_offset is None else car.steer_offset,
        **numbers,
    )


FORCE_KEYS = {
    "mass": "kg",
    "wheel_radius": "m",
    "wheel_inertia": "kg m^2",
    "drag": "N s^2/m^2",
    "rolling_resistance": "-",
}
"""Keys of the values that convert torques at the wheels to a rate of the speed, and their units."""


def forces_of_axles(car: SpeedCar, push: Any) -> tuple[Any, Any]:
    """Longitudinal force of a front and of a rear wheel (N) for a total force `push` (N), negative in braking.

    A driving force is distributed like the drive, a braking force like the brakes; the transition is as wide as a hundredth of
    the car's weight.
    """
    edge = 0.01 * car.mass * GRAVITY
    drives = jax.nn.sigmoid(4.0 * push / edge)
    share = drives * car.front_drive + (1.0 - drives) * car.front_brake
    return 0.5 * share * push, 0.5 * (1.0 - share) * push
