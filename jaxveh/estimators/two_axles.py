"""What estimators share that know a car by its two axles."""

# No postponed annotations here: equinox does not see an AbstractVar in a string.

from typing import Any

import equinox as eqx
import jax

from jaxveh._core.parameter import check_parameters
from jaxveh.estimators.contract import Need

LATERAL = (Need("v_x", "m/s"), Need("steer", "rad"), Need("yaw_rate", "rad/s"), Need("a_y", "m/s^2"))
"""Speed, steer at the road wheels, yaw rate and lateral acceleration."""

LOWEST = 5.0
"""m/s: below this speed no lateral quantity is known."""

LONGEST = 0.3
"""s: a value that is older than this is no longer known."""


class AbstractAxlePlaces(eqx.Module):
    """A car whose axles are `front_axle_to_cg` and `rear_axle_to_cg` (m) away from the centre of gravity."""

    front_axle_to_cg: eqx.AbstractVar[jax.Array]
    rear_axle_to_cg: eqx.AbstractVar[jax.Array]

    def __check_init__(self):
        check_parameters(self)

    @property
    def wheelbase(self) -> Any:
        """Distance of the axles, m."""
        return self.front_axle_to_cg + self.rear_axle_to_cg


class AbstractAxleForces(AbstractAxlePlaces):
    """A car whose `mass` (kg) and `yaw_inertia` (kg m^2) give the forces of both axles."""

    mass: eqx.AbstractVar[jax.Array]
    yaw_inertia: eqx.AbstractVar[jax.Array]

    def axle_forces(self, a_y: Any, yaw_acceleration: Any) -> tuple[Any, Any]:
        """Lateral forces of both axles (N) from the inertial sensors, by equation 15 of the review for small steer (F_yr has no
        cosine of the steer: erratum)."""
        turn = self.yaw_inertia * yaw_acceleration
        lateral = self.mass * a_y
        front = (turn + self.rear_axle_to_cg * lateral) / self.wheelbase
        return front, (self.front_axle_to_cg * lateral - turn) / self.wheelbase
