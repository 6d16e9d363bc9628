"""What most formats share: positions in degrees, waypoints worth writing, names that files and XML can hold."""

import unicodedata

import numpy as np

from quarterdeck.geo.files import safe_names
from quarterdeck.geo.frame import Frame
from quarterdeck.mission.mission import Mission, Route


def degrees(frame: Frame, xy: np.ndarray) -> np.ndarray:
    """Return (n, 2) longitudes in [-180, 180) and latitudes, to 8 decimals (a millimetre), of (n, 2) metres."""
    lonlat = np.round(frame.to_degrees(xy), 8)
    lonlat[lonlat[:, 0] >= 180.0, 0] -= 360.0  # rounding may reach 180, which GPX and RTZ refuse
    return lonlat + 0.0  # no minus zero


def distinct(route: Route) -> list[int]:
    """Return the numbers of the waypoints that are not where the one before is, or where something is done."""
    xyz = route.xyz
    moved = np.linalg.norm(np.diff(xyz, axis=0), axis=1) > 0.01
    done = [w.hold > 0 or w.task is not None for w in route.waypoints]
    return [i for i in range(len(xyz)) if i == 0 or moved[i - 1] or done[i]]


def file_stems(mission: Mission) -> tuple[str, dict[str, str]]:
    """Return the stem of the fleet's files and of each vehicle's, all different and safe."""
    vehicles = [v.id for v in mission.vehicles]
    stems = safe_names(vehicles)
    fleet = safe_names([*vehicles, f"{mission.name}\n"])[f"{mission.name}\n"]  # a line break, so that it is no vehicle's id
    return fleet, stems


def spacing_words(mission: Mission) -> str:
    """Return how far apart tracks are, in words; lines that follow soundings have no one spacing."""
    if mission.spacing is None:
        return ""
    median = mission.parameters.get("spacing", mission.spacing) is None
    return f"spacing by depth, about {mission.spacing:.3g} m" if median else f"spacing {mission.spacing:g} m"


def printable(text: str) -> str:
    """Return the text without control characters, which XML cannot hold."""
    return "".join(c for c in text if unicodedata.category(c)[0] != "C") or "unnamed"
