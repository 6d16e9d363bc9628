"""The one local metric frame of a scenario: transverse Mercator centred on the site."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from pyproj import Transformer

MAX_RADIUS = 200_000.0  # m from the frame's origin: beyond it the projection's scale is off by more than 0.05 %


@dataclass(frozen=True, slots=True)
class Frame:
    """A transverse Mercator frame: x east, y north, metres, true to scale at its origin.

    `lon` and `lat` are the origin in WGS84 degrees. A site that crosses the antimeridian needs nothing special.
    """

    lon: float
    lat: float

    def to_metres(self, lonlat: np.ndarray) -> np.ndarray:
        """Return (n, 2) metres of (n, 2) longitudes and latitudes in degrees."""
        lonlat = np.asarray(lonlat, dtype=float).reshape(-1, 2)
        return np.column_stack(_transformer(self.lon, self.lat).transform(lonlat[:, 0], lonlat[:, 1]))

    def to_degrees(self, xy: np.ndarray) -> np.ndarray:
        """Return (n, 2) longitudes in [-180, 180) and latitudes in degrees of (n, 2) metres; NaN off the Earth."""
        xy = np.asarray(xy, dtype=float).reshape(-1, 2)
        lon, lat = _transformer(self.lon, self.lat).transform(xy[:, 0], xy[:, 1], direction="INVERSE")
        lon, lat = (np.where(np.isfinite(c), c, np.nan) for c in (lon, lat))
        return np.column_stack([(lon + 180.0) % 360.0 - 180.0, lat])


@lru_cache(maxsize=64)
def _transformer(lon: float, lat: float) -> Transformer:
    crs = f"+proj=tmerc +lat_0={lat!r} +lon_0={lon!r} +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m +no_defs"
    return Transformer.from_crs("EPSG:4326", crs, always_xy=True)
