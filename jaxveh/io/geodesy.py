"""From latitude and longitude to metres east and north, as on a map of one drive; directions that go on beyond a turn."""

from __future__ import annotations

import numpy as np

SEMI_MAJOR, FLATTENING = 6_378_137.0, 1.0 / 298.257223563
"""The ellipsoid of WGS 84: m, -."""


def east_and_north(latitude, longitude) -> tuple[np.ndarray, np.ndarray]:
    """Return metres east and north, (n,) each, of the first place that is known; NaN where one is not.

    `latitude`, `longitude`: (n,), rad, positive to the north and to the east. Metres are those along the ellipsoid of WGS 84 in
    its curvatures at the first place: at 50 degrees of latitude they are off by up to 3 m 5 km away, and by 43 m 20 km away.
    """
    latitude, longitude = np.asarray(latitude, np.float64), np.asarray(longitude, np.float64)
    known = np.isfinite(latitude) & np.isfinite(longitude)
    if not known.any():
        return np.full(latitude.shape, np.nan), np.full(latitude.shape, np.nan)
    first = int(np.argmax(known))
    squared = FLATTENING * (2.0 - FLATTENING)
    root = np.sqrt(1.0 - squared * np.sin(latitude[first]) ** 2)
    along_meridian = SEMI_MAJOR * (1.0 - squared) / root**3
    along_parallel = SEMI_MAJOR * np.cos(latitude[first]) / root
    # Across the date line the difference of the longitudes is small, too.
    turn = np.remainder(longitude - longitude[first] + np.pi, 2.0 * np.pi) - np.pi
    east, north = along_parallel * turn, along_meridian * (latitude - latitude[first])
    return np.where(known, east, np.nan), np.where(known, north, np.nan)


def without_turns(angles: np.ndarray) -> np.ndarray:
    """Return angles (n,) without steps of a whole turn, also across missing ones."""
    known = np.isfinite(angles)
    found = np.full(angles.shape, np.nan)
    found[known] = np.unwrap(angles[known])
    return found
