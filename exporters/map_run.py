"""What a map shows of a run over its plan: tracks, misses, contacts, who was lost where, and who took over."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation

from quarterdeck.exporters.map_furniture import clock, fill, in_sight
from quarterdeck.exporters.map_site import HALO, Sign
from quarterdeck.geo.scenario import Site
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.routes import survey_lines
from quarterdeck.physics.moments import WORDS, Moment
from quarterdeck.physics.swath import driven_tracks
from quarterdeck.physics.trace import Trace

MISSED = "#d7191c"
CONTACT: dict[str, Any] = {"marker": "X", "color": MISSED, "markeredgecolor": "white", "markersize": 8, "linestyle": "none"}
LOST: dict[str, Any] = {
    "marker": "8",
    "markeredgecolor": "black",
    "markeredgewidth": 1.6,
    "markersize": 9,
    "linestyle": "none",
}
TOLD: dict[str, Any] = {"marker": "D", "markeredgecolor": "black", "markersize": 5, "linestyle": "none"}
MARKED = 12  # so many new routes at the most have their time on the map: more would cover it


def run(chart: Axes, mission: Mission, trace: Trace, palette: Mapping[str, str]) -> list[Sign]:
    """Draw the driven tracks, where anything was touched, and what of the plan's swaths was missed; return the signs."""
    signs: list[Sign] = [Line2D([], [], color="#333333", linewidth=1.2, label="driven")]
    for i, vehicle in enumerate(trace.vehicles):
        runs = [np.column_stack([trace.x[known, i], trace.y[known, i]]) for known in trace.known(i)]
        chart.add_collection(LineCollection(runs, colors=palette[vehicle], linewidths=0.7, zorder=6))
        touched = trace.contact[:, i]
        chart.plot(trace.x[touched, i], trace.y[touched, i], **CONTACT, zorder=9)
    missed = shapely.MultiPolygon() if mission.spacing is None else _missed(mission, trace, mission.spacing)
    fill(chart, missed, facecolor=MISSED, linewidth=0, zorder=5.5)
    signs += [] if missed.is_empty else [Patch(facecolor=MISSED, label="missed of the plan's swaths")]
    return signs + ([Line2D([], [], **CONTACT, label="contact")] if trace.contact.any() else [])


def _missed(mission: Mission, trace: Trace, spacing: float) -> shapely.Geometry:
    planned, driven = (
        shapely.union_all([shapely.buffer(shapely.linestrings(track), spacing / 2, quad_segs=8) for track in tracks])
        for tracks in (survey_lines(mission.routes), driven_tracks(trace))
    )
    missed = planned.intersection(mission.site.coverable).difference(driven)
    # Slivers along every track's edge, which no eye resolves, would colour the whole map.
    return missed.buffer(-0.02 * spacing).buffer(0.02 * spacing)


def lost(chart: Axes, mission: Mission, moments: Sequence[Moment], palette: Mapping[str, str]) -> list[Sign]:
    """Mark where vehicles were when they were lost, or told a new route, with the times; and who a plan says is lost."""
    told = [m for m in moments if m.what == "told"]
    gone = [(m.vehicle, (m.x, m.y), f"{m.vehicle} {WORDS[m.what]} {clock(m.time)}") for m in moments if m.what != "told"]
    marked = {name for name, _, _ in gone}
    gone += [(v.id, v.start, f"{v.id} lost") for v in mission.lost if v.id not in marked]
    for moment in told:
        chart.plot(moment.x, moment.y, **TOLD, color=palette[moment.vehicle], zorder=8.5)
        if len(told) <= MARKED:
            _name(chart, (moment.x, moment.y), clock(moment.time), weight="normal")
    for vehicle, place, words in gone:
        chart.plot(*place, **LOST, color=palette[vehicle], zorder=9)
        _name(chart, place, words, weight="bold")
    label = "lost: where and when" if marked else "lost: where"
    signs: list[Sign] = [Line2D([], [], **LOST, color="white", label=label)] if gone else []
    return signs + ([Line2D([], [], **TOLD, color="white", label="told a new route, when")] if told else [])


def _name(chart: Axes, place: tuple[float, float], words: str, *, weight: str) -> None:
    """Write words beside a place: on the first of its sides where they stay on the map and cover no other words."""
    look: dict[str, Any] = {"fontsize": 7, "weight": weight, "bbox": HALO, "annotation_clip": True, "parse_math": False}
    there, frame = [text.get_window_extent() for text in chart.texts], chart.get_window_extent()
    tried: list[tuple[bool, int, int, Annotation]] = []
    for dx, dy in ((6, -9), (-6, -9), (6, 9), (-6, 9), (6, -20), (-6, -20)):
        side = "left" if dx > 0 else "right"
        text = chart.annotate(words, place, xytext=(dx, dy), textcoords="offset points", ha=side, zorder=9.5, **look)
        box = text.get_window_extent()
        tried.append((not (frame.x0 <= box.x0 and box.x1 <= frame.x1), sum(map(box.overlaps, there)), len(tried), text))
    for *_, text in sorted(tried, key=lambda t: t[:3])[1:]:
        text.remove()


def found(chart: Axes, site: Site, followed: Mission) -> list[Sign]:
    """Draw what the last plan made in a run kept clear of, beside what the `site` has: wrecks, and what robots found."""
    known = {obstacle.id for obstacle in site.obstacles}
    new = [obstacle for obstacle in followed.site.obstacles if obstacle.id not in known]
    look: dict[str, Any] = {"facecolor": "none", "edgecolor": "#7a0177", "hatch": "xxxx", "linewidth": 0.8}
    for obstacle in new:
        fill(chart, obstacle.polygon, **look, zorder=3.5)
    seen = any(in_sight(chart, obstacle.polygon) for obstacle in new)
    return [Patch(**look, label="wreck or find")] if seen else []
