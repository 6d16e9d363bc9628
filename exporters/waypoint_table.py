"""CSV: every waypoint of the fleet, a row each, for spreadsheets and scripts."""

import csv
import io

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.mavlink import compass
from quarterdeck.exporters.places import degrees, file_stems
from quarterdeck.mission.mission import Mission

COLUMNS = (
    "vehicle", "number", "latitude", "longitude", "height_m", "leg", "course_deg", "speed_m_s", "hold_s", "time_s", "task",
    "x_m", "y_m", "ground_m",
)  # fmt: skip


def files(mission: Mission, settings: Settings) -> dict[str, str]:  # noqa: ARG001 - no autopilot reads it
    """Return `<mission>.csv`; `leg` and `course_deg` are of the leg that ends at the waypoint, metres are of the frame.

    `ground_m` is the ground above mean sea level, where a plan knows it.
    """
    fleet, _ = file_stems(mission)
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for route in mission.routes:
        places, courses = degrees(mission.frame, route.xyz[:, :2]), compass(route.xyz[:, :2])
        for number, (w, (lon, lat), course) in enumerate(zip(route.waypoints, places, courses, strict=True)):
            row = (f"{lat:.8f}", f"{lon:.8f}", f"{w.z:.3f}", w.leg, f"{course:.2f}", f"{w.speed:.3f}", f"{w.hold:.1f}")
            metres = (f"{w.time:.2f}", _text(w.task or ""), f"{w.x:.3f}", f"{w.y:.3f}")
            ground = "" if w.ground is None else f"{w.ground:.3f}"
            writer.writerow((_text(route.vehicle), number, *row, *metres, ground))
    return {f"{fleet}.csv": buffer.getvalue()}


def _text(text: str) -> str:
    # A cell that begins with one of these is run as a formula by spreadsheets.
    return f"'{text}" if text[:1] in "=+-@\t\r" and text else text
