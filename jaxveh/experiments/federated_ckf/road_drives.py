"""Drives on roads with several frictions, also with rear wheels that turn."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics, roads, sweeps
from jaxveh._core.errors import check_whole
from jaxveh._core.names import record
from jaxveh._core.parameter import parameter, positive
from jaxveh._core.progress import Progress, silent
from jaxveh.experiments.federated_ckf.drives import Drive, drive_on, with_four_angles
from jaxveh.experiments.federated_ckf.settings import Study
from jaxveh.manoeuvres import AbstractDriver, AbstractSpeed, DriverInputs
from jaxveh.manoeuvres import kit as manoeuvres_kit
from jaxveh.sweeps import IN_MEMORY, Stores
from jaxveh.vehicles import Motion, sets


class LaneSlalom(AbstractDriver):
    """A slalom about the middle of the road (the world's x axis), so that left and right wheels keep to their sides.

    The steer is a sine of `steer` (rad) and `frequency` (Hz), faded in over the first second, plus `-per_offset y - per_yaw
    yaw` (rad/m, -) of the car's position and heading. The rear wheels turn by `rear` (-) times as much as the front ones.
    """

    speed: AbstractSpeed
    duration: float = eqx.field(static=True)
    frequency: float = eqx.field(static=True)
    steer: jax.Array = parameter("rad", scale=0.1)
    per_offset: jax.Array = parameter("rad/m", scale=0.02)
    per_yaw: jax.Array = parameter("-", scale=0.3)
    rear: jax.Array = parameter("-", scale=0.3, default=0.0)

    @property
    def state_names(self):
        return ()

    @property
    def fastest_rate(self):
        return 2.0 * np.pi * self.frequency

    def start(self, t: Any, motion: Motion) -> Any:
        return record("DriverState", {})

    def inputs(self, t: Any, motion: Motion, state: Any) -> Any:
        t = manoeuvres_kit.as_time(t, self.steer)
        v_x, v_x_rate = self.speed.at(t)
        wave = self.steer * numerics.sin(2.0 * np.pi * self.frequency * t) * numerics.smooth_step(t)
        steer = wave - self.per_offset * motion.y - self.per_yaw * motion.yaw
        return with_four_angles(DriverInputs(steer, v_x, v_x_rate), self.rear)

    def derivatives(self, t: Any, motion: Motion, state: Any) -> Any:
        return record("DriverState", {})


LANE_RATE, LANE_DAMPING = 0.5, 0.7
"""How fast the driver returns to the middle (rad/s), slowly compared with the slalom, and the damping ratio."""


def lane_slalom(study: Study, speed: AbstractSpeed, rear: Any) -> LaneSlalom:
    """The driver whose offset y obeys y'' + 2 D w y' + w^2 y = 0 beside the slalom: yaw' = v steer / L and y' = v yaw."""
    turning = study.speed / sets.ev().wheelbase
    return LaneSlalom(
        speed=speed,
        duration=study.duration,
        frequency=study.lane_frequency,
        steer=study.steer,
        per_offset=LANE_RATE**2 / (turning * study.speed),
        per_yaw=2.0 * LANE_DAMPING * LANE_RATE / turning,
        rear=rear,
    )


class Patches(roads.AbstractRoad):
    """A level road with the frictions `left` and `right` of its middle up to `at_distance` (m), and `beyond` after it."""

    left: jax.Array = positive("-")
    right: jax.Array = positive("-")
    beyond: jax.Array = positive("-")
    at_distance: jax.Array = parameter("m", scale=10.0)

    def at(self, s: Any, y: Any = 0.0) -> roads.Surface:
        before = roads.SplitMu(self.left, self.right).at(s, y)
        share = roads.MuJump(1.0, 2.0, self.at_distance).at(s, y).friction - 1.0
        return before._replace(friction=before.friction + (self.beyond - before.friction) * share)


NEVER = 1e6
"""m: farther than any drive."""


class RoadCase(NamedTuple):
    """Frictions on the `left`, on the `right` and `beyond` a distance (m), and the angle of the `rear` wheels over that of
    the front ones; whether filters are told the rear wheels' angles; and a description, `what`."""

    left: float
    right: float
    beyond: float
    at_distance: float
    rear: float
    rear_told: bool
    what: str


def road_cases(study: Study) -> dict[str, RoadCase]:
    """The roads for every estimator."""
    low, high, jump, rear = study.friction, study.other_friction, study.jump_at, study.rear_steer
    turned = f"mu {low:g}, rear wheels turn by {rear:g} of the front ones"
    return {
        "one friction": RoadCase(low, low, low, NEVER, 0.0, True, f"mu {low:g} everywhere"),
        "split mu": RoadCase(low, high, high, NEVER, 0.0, True, f"mu {low:g} on the left, {high:g} on the right"),
        "mu jump": RoadCase(high, high, low, jump, 0.0, True, f"mu {high:g}, and {low:g} from {jump:g} m on"),
        "rear steer": RoadCase(low, low, low, NEVER, rear, True, turned),
        "rear steer, untold": RoadCase(low, low, low, NEVER, rear, False, f"{turned}; filters take them as straight"),
    }


def drives_on_roads(study: Study, seeds: int, key, *, progress: Progress = silent, stores: Stores = IN_MEMORY) -> Drive:
    """Drives of each case, one per seed: (cases, seeds, T, ...)."""
    check_whole("seeds", seeds, 2)
    cases = road_cases(study).values()
    numbers = np.array([case[:5] for case in cases])

    def run(point, key):
        *ground, rear = jnp.asarray(numbers)[point.case.astype(int)]
        driver = lambda speed: lane_slalom(study, speed, rear)
        return drive_on(study, Patches(*ground), driver, jnp.asarray(study.speed_std), key)

    found = stores.sweep("road-drives", run, sweeps.Design(case=range(len(cases))), seeds, key, progress=progress)
    told = np.array([[1.0, 1.0, case.rear_told, case.rear_told] for case in cases])
    drives = Drive(**{name: np.asarray(found[name]) for name in Drive._fields})
    return drives._replace(steer=drives.steer * told[:, None, None])
