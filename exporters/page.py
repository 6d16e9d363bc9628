"""One HTML page of a plan that needs no network: a map that pans, zooms and plays, and each vehicle's figures."""

import json
import re
from html import escape

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from quarterdeck.exporters.casualties import MEANING
from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.places import file_stems, spacing_words
from quarterdeck.geo.palette import CASUALTY
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.mission.layers import fleet_colours
from quarterdeck.mission.mission import Mission, Route


def files(mission: Mission, settings: Settings) -> dict[str, str]:  # noqa: ARG001 - no autopilot reads it
    """Return `<mission>.html`."""
    return {f"{file_stems(mission)[0]}.html": page(mission)}


def page(mission: Mission) -> str:
    """Return the page. The map is SVG in metres, y to the south; the pointer's degrees come from the map's corners."""
    low, high = _extent(mission)
    size = high - low
    palette = fleet_colours(mission)
    corners = np.array([[low[0], high[1]], [high[0], high[1]], [low[0], low[1]], [high[0], low[1]]])
    degrees = mission.frame.to_degrees(corners)
    degrees[:, 0] = np.unwrap(degrees[:, 0], period=360.0)
    facts = {
        "box": [round(v, 2) for v in (low[0], -high[1], size[0], size[1])],
        "degrees": np.round(degrees, 9).tolist(),
        "ways": [_way(route) for route in mission.routes],
        "end": max((route.duration for route in mission.routes), default=0.0),
    }
    state = "feasible" if mission.feasible else "INFEASIBLE: " + "; ".join(map(str, mission.reasons))
    spacing = "" if mission.spacing is None else f", {spacing_words(mission)}"
    routes = [(i, route, palette[route.vehicle]) for i, route in enumerate(mission.routes)]
    parts = {
        "TITLE": escape(mission.name),
        "LINE": escape(f"{mission.method}{spacing}, seed {mission.seed}: {state}"),
        "SITE": _site(mission),
        "KEY": _key(mission),
        "ROUTES": "".join(_route(*route) for route in routes),
        "ROWS": "".join(_row(*route) for route in routes),
        "FACTS": json.dumps(facts, allow_nan=False),
    }
    return re.sub("@([A-Z]+)@", lambda found: parts[found[1]], _PAGE)  # in one go: a name may look like a place


def _extent(mission: Mission) -> tuple[np.ndarray, np.ndarray]:
    points = [route.xyz[:, :2] for route in mission.routes]
    points += [shapely.get_coordinates(mission.site.operating), shapely.get_coordinates(mission.site.area)]
    every = np.vstack(points)
    room = 0.03 * np.ptp(every, axis=0).max() + 1.0
    return every.min(axis=0) - room, every.max(axis=0) + room


def _way(route: Route) -> list[list[float]]:
    return [[round(w.time, 1), round(w.time + w.hold, 1), round(w.x, 2), round(-w.y, 2)] for w in route.waypoints]


def _site(mission: Mission) -> str:
    shapes = [f'<path class="operating" d="{_outline(mission.site.operating)}"/>']
    named = [("area", f"{a.id}, priority {a.priority}", a.polygon) for a in mission.site.areas]
    named += [(_kind(mission, o), o.id, o.polygon) for o in mission.site.obstacles]
    for kind, name, polygon in named:
        shapes.append(f'<path class="{kind}" d="{_outline(polygon)}"><title>{escape(name)}</title></path>')
    shapes += [
        f'<path class="task" d="M{t.position[0]:.2f} {-t.position[1]:.2f}h0"><title>{escape(t.id)}</title></path>'
        for t in mission.tasks
    ]
    shapes += [
        f'<path class="hurt rim" d="{(d := f"M{c.position[0]:.2f} {-c.position[1]:.2f}h0")}"/>'
        f'<path class="hurt" stroke="{CASUALTY[c.colour]}" d="{d}"><title>{escape(c.id)}, {c.colour}</title></path>'
        for c in mission.casualties
    ]
    shapes += [
        f'<path class="lost" d="M{v.start[0]:.2f} {-v.start[1]:.2f}h0"><title>{escape(v.id)} lost</title></path>'
        for v in mission.lost
    ]
    return "".join(shapes)


def _kind(mission: Mission, obstacle: Obstacle) -> str:
    """Whether any of the vehicles has to keep out of an obstacle, or it is only not covered."""
    return "obstacle" if obstacle.blocks & {v.domain for v in (*mission.vehicles, *mission.lost)} else "crossed"


def _key(mission: Mission) -> str:
    """Return the legend of what is on the map besides the vehicles."""
    kinds = {_kind(mission, o) for o in mission.site.obstacles}
    signs = [
        ("survey", "survey", any(route.survey.any() for route in mission.routes)),
        ("transit", "transit, turn", any(not route.survey[1:].all() for route in mission.routes)),
        ("area", "area", bool(mission.site.areas)),
        ("operating", "operating area", True),
        ("obstacle", "obstacle", "obstacle" in kinds),
        ("crossed", "not covered, may be crossed", "crossed" in kinds),
        ("task", "task", bool(mission.tasks)),
        ("lost", "lost", bool(mission.lost)),
    ]
    lines = [(f'<path class="{name}" stroke="#333"', text) for name, text, there in signs if there]
    hurt = {c.colour for c in mission.casualties}
    lines += [(f'<path class="hurt" stroke="{CASUALTY[c]}"', f"casualty: {c} ({MEANING[c]})") for c in MEANING if c in hurt]
    shapes = dict.fromkeys(("area", "operating", "obstacle", "crossed"), "M1 1h24v10h-24z")
    shapes |= dict.fromkeys(("survey", "transit"), "M1 6h24")
    key = ""
    for sign, text in lines:
        place = shapes.get(sign.split('"')[1], "M13 6h0")
        key += f'<svg width="26" height="12" viewBox="0 0 26 12">{sign} d="{place}"/></svg> {text}<br>'
    return key


def _outline(geometry: BaseGeometry) -> str:
    rings = [ring for part in getattr(geometry, "geoms", [geometry]) for ring in (part.exterior, *part.interiors)]
    return "".join(f"M{_path(np.asarray(ring.coords)[:-1])}Z" for ring in rings)


def _path(xy: np.ndarray) -> str:
    return " ".join(f"{x:.2f} {-y:.2f}" for x, y in xy[:, :2])


def _route(number: int, route: Route, colour: str) -> str:
    xy = route.xyz[:, :2]
    covers = route.survey
    legs = {kind: _lines(xy, np.flatnonzero(covers[1:] == kind) + 1) for kind in (True, False)}
    start = f'<path class="start" d="M{xy[0, 0]:.2f} {-xy[0, 1]:.2f}h0"/>'
    lines = f'<path class="transit" d="{legs[False]}"/><path class="survey" d="{legs[True]}"/>'
    now = f'<path class="now" id="n{number}" d="M0 0h0"/>'
    return f'<g id="r{number}" stroke="{colour}"><title>{escape(route.vehicle)}</title>{lines}{start}{now}</g>'


def _lines(xy: np.ndarray, ends: np.ndarray) -> str:
    return "".join(f"M{_path(xy[i - 1 : i + 1])}" for i in ends)


def _row(number: int, route: Route, colour: str) -> str:
    minutes, seconds = divmod(round(route.duration), 60)
    cells = (f"{route.length / 1000:.2f}", f"{minutes}:{seconds:02d}", f"{route.energy:.0f}")
    figures = "".join(f"<td>{cell}</td>" for cell in cells)
    box = f'<input type="checkbox" checked data-route="{number}">'
    return f'<tr><th><label>{box}<i style="background:{colour}"></i>{escape(route.vehicle)}</label></th>{figures}</tr>'


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>@TITLE@</title><style>
body{margin:0;display:flex;height:100vh;font:14px system-ui,sans-serif;color:#222}
#map{flex:1;min-width:0;background:#e9ecef;cursor:grab;touch-action:none}
aside{width:21em;overflow:auto;padding:0 1em;border-left:1px solid #ccc}
h1{font-size:1.2em;margin:.8em 0 .2em}p{margin:.2em 0 .8em;color:#555}
table{border-collapse:collapse;width:100%}th{text-align:left;font-weight:normal;overflow-wrap:anywhere}
td{text-align:right;padding:1px 0 1px .6em;font-variant-numeric:tabular-nums}
i{display:inline-block;width:1.2em;height:.5em;margin:0 .4em}
svg path{fill:none;vector-effect:non-scaling-stroke}
.operating{fill:#f4f7fa!important;stroke:#555;stroke-dasharray:6 4}.area{fill:#dcebf5!important;stroke:#5b7f99}
.obstacle{fill:#8c8c8c!important;stroke:#444}.crossed{stroke:#444;stroke-dasharray:2 3}svg path{fill-rule:evenodd}
.survey{stroke-width:2}.transit{stroke-width:1;opacity:.7}
.start{stroke-width:7;stroke-linecap:round}.now{stroke-width:12;stroke-linecap:round}
.task{stroke:#b8860b;stroke-width:8;stroke-linecap:square}
.hurt{stroke-width:8;stroke-linecap:square}.rim{stroke:#000;stroke-width:10}
.lost{stroke:#000;stroke-width:14;stroke-linecap:round}
#play{width:100%}output{font-variant-numeric:tabular-nums}
</style></head><body>
<svg id="map" xmlns="http://www.w3.org/2000/svg"><g>@SITE@</g>@ROUTES@</svg>
<aside><h1>@TITLE@</h1><p>@LINE@</p>
<label>time <output id="clock">0:00</output><input id="play" type="range" min="0" max="1000" value="0"></label>
<p><output id="where">drag to pan, wheel to zoom, double click to see all</output><br><output id="scale"></output></p>
<table><thead><tr><th>vehicle</th><td>km</td><td>time</td><td>Wh</td></tr></thead><tbody>@ROWS@</tbody></table>
<p>@KEY@north is up; names appear under the pointer</p></aside>
<script>
"use strict";
const facts = @FACTS@;
const map = document.getElementById("map"), get = id => document.getElementById(id);
let box = facts.box.slice();
function show() {
  map.setAttribute("viewBox", box.join(" "));
  const metres = 1 / map.getScreenCTM().a;
  get("scale").textContent = "1 cm of screen is about " + (37.8 * metres).toFixed(metres < 0.1 ? 1 : 0) + " m";
}
function at(event) {
  return new DOMPoint(event.clientX, event.clientY).matrixTransform(map.getScreenCTM().inverse());
}
map.addEventListener("wheel", event => {
  event.preventDefault();
  const p = at(event), factor = Math.exp(event.deltaY * 0.0015);
  box = [p.x + (box[0] - p.x) * factor, p.y + (box[1] - p.y) * factor, box[2] * factor, box[3] * factor];
  show();
}, {passive: false});
let held = null;
map.addEventListener("pointerdown", event => { held = at(event); map.setPointerCapture(event.pointerId); });
map.addEventListener("pointerup", () => { held = null; });
map.addEventListener("pointermove", event => {
  const p = at(event);
  if (held) { box[0] += held.x - p.x; box[1] += held.y - p.y; show(); return; }
  const [x, y, w, h] = facts.box, u = (p.x - x) / w, v = (p.y - y) / h, d = facts.degrees;
  const mix = k => (1 - v) * ((1 - u) * d[0][k] + u * d[1][k]) + v * ((1 - u) * d[2][k] + u * d[3][k]);
  get("where").textContent = mix(1).toFixed(6) + ", " + ((mix(0) + 540) % 360 - 180).toFixed(6);
});
map.addEventListener("dblclick", () => { box = facts.box.slice(); show(); });
document.querySelectorAll("[data-route]").forEach(input => input.addEventListener("change", () => {
  get("r" + input.dataset.route).style.display = input.checked ? "" : "none";
}));
function place(way, time) {
  let i = way.findIndex(w => w[1] > time);
  if (i < 0) return way[way.length - 1].slice(2);
  if (i === 0 || time >= way[i][0]) return way[i].slice(2);
  const a = way[i - 1], b = way[i], part = (time - a[1]) / Math.max(b[0] - a[1], 1e-9);
  return [a[2] + part * (b[2] - a[2]), a[3] + part * (b[3] - a[3])];
}
function play() {
  const time = facts.end * get("play").value / 1000, whole = Math.round(time);
  get("clock").textContent = Math.floor(whole / 60) + ":" + String(whole % 60).padStart(2, "0");
  facts.ways.forEach((way, i) => {
    const [x, y] = place(way, time);
    get("n" + i).setAttribute("d", "M" + x + " " + y + "h0");
  });
}
get("play").addEventListener("input", play);
addEventListener("resize", show);
show(); play();
</script></body></html>
"""
