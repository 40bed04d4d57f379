"""What methods of speed know of a car: numbers of its file, and a typical car's where the file is silent."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh._core.parameter import parameter, positive
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

TYPICAL = {
    "cg_height": 0.2, "track_front": 0.56, "track_rear": 0.56, "wheel_radius": 0.12, "drag": 3e-4, "rolling_resistance": 0.012,
    "front_drive": 0.5, "front_brake": 0.65,
}  # fmt: skip
"""Of a car whose file does not say: heights, tracks and radii over the wheelbase, the drag over the mass (1/m)."""


class SpeedCar(eqx.Module):
    """Masses (kg), lengths (m), stiffnesses (N/rad, of axles) and shares (-) of a car, as its file has them."""

    mass: jax.Array = positive("kg")
    front_axle_to_cg: jax.Array = positive("m")
    rear_axle_to_cg: jax.Array = positive("m")
    front_cornering_stiffness: jax.Array = positive("N/rad")
    rear_cornering_stiffness: jax.Array = positive("N/rad")
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
    def wheelbase(self) -> Any:
        """Distance of the axles, m."""
        return self.front_axle_to_cg + self.rear_axle_to_cg

    @property
    def cornering_stiffnesses(self) -> tuple[Any, Any]:
        """Of the front and the rear axle, N/rad."""
        return self.front_cornering_stiffness, self.rear_cornering_stiffness

    @property
    def loads(self) -> tuple[Any, Any]:
        """Load of a front and of a rear wheel at rest, N."""
        half = 0.5 * self.mass * GRAVITY / self.wheelbase
        return half * self.rear_axle_to_cg, half * self.front_axle_to_cg


def speed_car(car: CarSpecification) -> SpeedCar:
    """The numbers of a file; what it leaves out is a typical car's (`TYPICAL`), the steering's ratio 16."""
    scale = dict.fromkeys(("cg_height", "track_front", "track_rear", "wheel_radius"), car.wheelbase) | {
        "drag": car.mass
    }
    told = {name: getattr(car, name) for name in TYPICAL}
    numbers = {n: share * scale.get(n, 1.0) if told[n] is None else told[n] for n, share in TYPICAL.items()}
    return SpeedCar(
        mass=car.mass,
        front_axle_to_cg=car.front_axle_to_cg,
        rear_axle_to_cg=car.rear_axle_to_cg,
        front_cornering_stiffness=car.front_cornering_stiffness,
        rear_cornering_stiffness=car.rear_cornering_stiffness,
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
"""What turns torques at the wheels into a rate of the speed."""


def keys_of(car: CarSpecification, who: str, keys: dict[str, str]) -> dict[str, float]:
    """Numbers of the file by key. **Raises** `InputError` for one that it lacks, naming the key and its unit."""
    for name, unit in keys.items():
        if getattr(car, name) is None:
            raise InputError(f"speed, {who}: the car's file has no {name} ({unit}); give it.")
    return {name: getattr(car, name) for name in keys}


def forces_of_axles(car: SpeedCar, push: Any) -> tuple[Any, Any]:
    """Longitudinal force of a front and of a rear wheel (N) when all of them push with `push` (N), negative in braking.

    Driving is shared out as the drive does, braking as the brakes do; over a hundredth of the car's weight one becomes the other.
    """
    edge = 0.01 * car.mass * GRAVITY
    drives = jax.nn.sigmoid(4.0 * push / edge)
    share = drives * car.front_drive + (1.0 - drives) * car.front_brake
    return 0.5 * share * push, 0.5 * (1.0 - share) * push


def slip_stiffness(cornering: Any, load: Any) -> Any:
    """Slip stiffness of a tyre over its load (-) from the cornering stiffness of its axle (N/rad) and its load (N).

    Along its plane a tyre is about as stiff as across, and not as soft as an axle whose steering yields: at least 12, at
    most 25 loads, where most car tyres lie (H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., sec. 4.3.1 and appendix 3).
    """
    return jnp.clip(0.5 * cornering / load, 12.0, 25.0)
