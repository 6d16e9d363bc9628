"""What a camera or sonar sees, hence how far apart tracks are and how often pictures are taken.

Camera: pinhole, pointing down, its long side across the track, over flat ground (Wolf, Dewitt and Wilkinson, Elements of
Photogrammetry, ch. 6 and 18). Sonar: flat bottom at the least depth, so that no line leaves a gap where it is deeper.
"""

import math
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Sensor

# name: focal length mm, sensor width and height mm, image width and height pixels. The Sonys' are those of QGroundControl's
# list (QGCCameraManager.cc), the RedEdge's of MicaSense's integration guide. DJI publishes pixels, format and equivalent
# focal length alone: theirs are the formats' sizes (1 inch, 4/3) with the focal lengths that pictures' EXIF carry.
CAMERAS: dict[str, tuple[float, float, float, int, int]] = {
    "dji-mavic-3e": (12.29, 17.3, 13.0, 5280, 3956),
    "dji-phantom-4-pro": (8.8, 13.2, 8.8, 5472, 3648),
    "micasense-rededge-mx": (5.4, 4.8, 3.6, 1280, 960),
    "sony-a6000-16mm": (16.0, 23.5, 15.6, 6000, 4000),
    "sony-rx1r2": (35.0, 35.9, 24.0, 7952, 5304),
}
_FIGURES = ("focal_length", "sensor_width", "sensor_height", "image_width", "image_height")
_MOST_RESOLUTION = 10.0  # m a pixel: more is a mistake of units


def fit(
    given: Mapping[str, Any], altitude: float | None, default_altitude: float = 0.0, least_depth: float | None = None
) -> tuple[Sensor, float]:
    """Return the sensor with its `swath`, and the altitude to fly at, in metres.

    `given` is the scenario's object: `kind`, and for a camera `camera` (a name of CAMERAS) or its five figures (mm and
    pixels), `frontal_overlap` and `side_overlap` (default 0.7), and if `altitude` is None maybe `ground_resolution` in
    metres a pixel, from which it follows. A sonar has `depth` (the least, m; without it `least_depth`, as sounded, and
    the parameters have none, for it differs from place to place) and `angle` (whole opening, degrees), or
    `range` (slant, m) and `height` above the bottom, and `overlap` (default 0.2). The swath is what a pass adds: overlap
    is taken off. Raises InputError naming the figure that is missing or wrong.
    """
    kind = given["kind"]
    flown = default_altitude if altitude is None else altitude
    figures = {
        k: float(v) for k, v in given.items() if isinstance(v, int | float) and not isinstance(v, bool) and k != "swath"
    }
    if kind == "swath" or (given.get("swath") is not None):
        if given.get("swath") is None or not 0 < float(given["swath"]) < math.inf:
            raise InputError('a sensor of kind "swath" needs "swath", metres above 0')
        return Sensor(kind, float(given["swath"]), figures), flown
    if kind == "sonar":
        sounded = {"depth": least_depth} if least_depth is not None and "angle" in figures else {}
        return Sensor("sonar", sonar_swath(sounded | figures), figures), flown
    return _camera(given, figures, altitude, default_altitude)


def _camera(
    given: Mapping[str, Any], figures: dict[str, float], altitude: float | None, default_altitude: float
) -> tuple[Sensor, float]:
    figures |= dict(zip(_FIGURES, camera(given["camera"]), strict=True)) if "camera" in given else {}
    for name in _FIGURES:
        if not figures.get(name, 0.0) > 0:
            raise InputError(f'a camera needs "{name}" above 0, or "camera", one of {", ".join(CAMERAS)}')
    front = figures["frontal_overlap"] = _overlap(figures, "frontal_overlap", 0.7)
    side = figures["side_overlap"] = _overlap(figures, "side_overlap", 0.7)
    pitch = figures["sensor_width"] / figures["image_width"] / figures["focal_length"]  # metres a pixel at 1 m
    if altitude is None and "ground_resolution" in figures:
        if not 0 < figures["ground_resolution"] <= _MOST_RESOLUTION:
            raise InputError(f'"ground_resolution" is in metres a pixel, above 0, at most {_MOST_RESOLUTION:g}')
        flown = figures["ground_resolution"] / pitch
    else:
        flown = default_altitude if altitude is None else altitude
    if not flown > 0:
        raise InputError('a camera needs the vehicle\'s "altitude" above 0, or "ground_resolution"')
    across, along = footprint(figures, flown)
    figures |= {"ground_resolution": flown * pitch, "trigger_distance": along * (1 - front)}
    return Sensor("camera", across * (1 - side), figures), flown


def camera(name: str) -> tuple[float, float, float, int, int]:
    """Return a built-in camera's focal length, sensor width and height in mm, image width and height in pixels."""
    if name not in CAMERAS:
        near = get_close_matches(str(name), CAMERAS, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(CAMERAS)}; or give its figures"
        raise InputError(f"unknown camera {name!r}; {hint}")
    return CAMERAS[name]


def footprint(figures: Mapping[str, float], altitude: float) -> tuple[float, float]:
    """Return metres across and along the track that a picture shows from `altitude` metres above ground."""
    scale = altitude / figures["focal_length"]
    return figures["sensor_width"] * scale, figures["sensor_height"] * scale


def sonar_swath(figures: Mapping[str, float]) -> float:
    """Return metres that a pass of a sonar adds: multibeam from depth and angle, side-scan from range and height."""
    keep = 1 - _overlap(figures, "overlap", 0.2)
    if "angle" in figures:
        if not 0 < figures["angle"] < 180:
            raise InputError('"angle" is the whole opening in degrees, above 0 and below 180')
        return 2 * _positive(figures, "depth") * math.tan(math.radians(figures["angle"] / 2)) * keep
    reach, height = _positive(figures, "range"), figures.get("height", 0.0)
    if not 0 <= height < reach:
        raise InputError('"height" above the bottom must be from 0 and below "range"')
    return 2 * math.sqrt(reach**2 - height**2) * keep


def swath(sensor: Sensor, distance: float | None = None) -> float:
    """Return metres that a pass adds: its own, or a camera's from another altitude, a sonar's at another depth."""
    if distance is None or sensor.kind == "swath":
        if sensor.swath is None:
            raise InputError("the sensor has no swath")
        return sensor.swath
    if sensor.kind == "camera":
        return footprint(sensor.parameters, distance)[0] * (1 - sensor.parameters["side_overlap"])
    return sonar_swath({**sensor.parameters, ("depth" if "angle" in sensor.parameters else "height"): distance})


def follows_depth(sensor: Sensor | None) -> bool:
    """Return whether a sensor is a multibeam sonar whose swath follows the depths that were sounded."""
    return (
        sensor is not None and sensor.kind == "sonar" and "angle" in sensor.parameters and "depth" not in sensor.parameters
    )


def _overlap(figures: Mapping[str, float], name: str, default: float) -> float:
    value = figures.get(name, default)
    if not 0 <= value <= 0.95:
        raise InputError(f'"{name}" is a part from 0 to 0.95, not {value:g}')
    return value


def _positive(figures: Mapping[str, float], name: str) -> float:
    if not figures.get(name, 0.0) > 0:
        raise InputError(f'a sonar needs "depth" and "angle", or "range": "{name}" is missing or not above 0')
    return figures[name]
