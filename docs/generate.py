"""Write what is generated, `make docs` runs it: the format, vehicles, state machines, reproductions, the JSON Schema."""

import json
from pathlib import Path

from quarterdeck.geo.models import DEFAULT_MODEL, load_model, model_names
from quarterdeck.geo.properties import GEOMETRIES, PROPERTIES, json_schema
from quarterdeck.mission.triage.machines import MACHINES, as_markdown
from quarterdeck.reproduce.all import PAPERS, section

ROOT = Path(__file__).parents[1]

INTRODUCTION = """# The GeoJSON that you write

Made by `make docs` from `geo/properties.py`; the JSON Schema is `geo/site.schema.json` and ships with the package.

A site is a FeatureCollection (RFC 7946) in WGS84, longitude before latitude. Draw it in QGIS, geojson.io or beside a chart,
and give each feature a `role`. `quarterdeck check SITE` lists every problem with its place, and what `plan` or `assign`
would refuse; `quarterdeck init` writes a sample to start from.

What is repaired silently: ring direction, repeated vertices, obstacles that overlap each other or the border. What is
refused, because what was meant is not known: a ring that is unclosed or crosses itself, fewer than 4 positions, a `crs`
other than WGS84, coordinates out of range, a site that reaches more than 200 km from its centre. A property that is `null`
counts as absent. Properties that are not ours are ignored, unless they look like a misspelling of one that is.

| `role` | geometry | what it is |
|---|---|---|
"""

MEANINGS = {
    "area": "to be covered; several allowed; along a line: a corridor `width` metres across, square at its ends",
    "operating": "where vehicles may move, hence the fence; default: the hull of areas, starts and tasks, with clearance",
    "obstacle": "never covered; crossed only by the domains that it does not block",
    "vehicle": "where a vehicle starts; several may share a point",
    "task": "a place to visit (`quarterdeck assign`)",
    "casualty": "somebody to be found (`quarterdeck triage`)",
    "medic": "where a medic starts (`quarterdeck triage`)",
    "rendezvous": "where UGVs and UAV meet (`quarterdeck triage`)",
    "sounding": "a depth that was sounded, for the swath of a multibeam sonar (sensors.md)",
}

EXAMPLES = {
    "area": '{"role": "area", "spacing": 40}',
    "operating": '{"role": "operating"}',
    "obstacle": '{"role": "obstacle", "id": "islet", "blocks": ["surface", "ground"], "height": 12}',
    "vehicle": '{"role": "vehicle", "id": "usv-1", "model": "otter", "share": 0.4, "clearance": 15}',
    "task": '{"role": "task", "id": "valve", "priority": 2, "after": [{"task": "pump", "mode": "same_robot"}]}',
    "casualty": '{"role": "casualty", "id": "c1", "colour": "yellow"}',
    "medic": '{"role": "medic", "id": "medic-1"}',
    "rendezvous": '{"role": "rendezvous", "id": "gate"}',
    "sounding": '{"role": "sounding", "depth": 7.4}',
}


def geojson_page() -> str:
    """Return docs/geojson.md."""
    lines = [INTRODUCTION.rstrip("\n")]
    lines += [f"| `{role}` | {' or '.join(kinds)} | {MEANINGS[role]} |" for role, kinds in GEOMETRIES.items()]
    for role, properties in PROPERTIES.items():
        lines += [
            "",
            f"## {role}",
            "",
            f"Properties of an example: `{EXAMPLES[role]}`",
            "",
            "| property | value | meaning |",
        ]
        lines += ["|---|---|---|"]
        lines += [f"| `{name}` | {known.words} | {known.meaning} |" for name, known in properties.items()]
    return "\n".join(lines) + "\n"


def machines_page() -> str:
    """Return docs/triage-machines.md."""
    head = "# The state machines of triage\n"
    made = "Made by `make docs` from `mission/triage/machines.py`, which the director runs.\n"
    return "\n".join([head, made, *(as_markdown(kind) for kind in MACHINES)])


VEHICLES = """# Vehicle files

A vehicle's model is a TOML file. These ship with the package, in `data/vehicles/`; the table is made of them by `make
docs`. A site names one, `"model": "otter"`, or the path of your own, `"model": "our_boat.toml"`; its domain's default is
the one in bold. [How to make your own](extending.md).

| model | domain | length m | cruise m/s | most m/s | turn radius m | clearance m | battery Wh | source |
|---|---|---|---|---|---|---|---|---|
"""

VEHICLE_FIGURES = """
## What a file has

`name`, `domain` (`surface`, `ground`, `aerial`) and `source`, a text that says where the figures are from; then three
tables.

| `[limits]` | unit | planners |
|---|---|---|
| `length`, `width` | m | keep other vehicles clear of the hull |
| `speed`, `max_speed` | m/s | cruise at the one; never beyond the other |
| `turn_radius` | m | round corners by it at cruise; 0: stop and turn on the spot |
| `turn_rate` | rad/s | count the time of turns on the spot |
| `acceleration` | m/s2 | count the time of starting and stopping |
| `clearance` | m | keep it from obstacles and the fence |
| `climb_rate`, `descent_rate` | m/s | aerial: count climbing and landing |
| `altitude` | m | aerial: fly so high above ground where the site says nothing |

| `[energy]` | unit | meaning |
|---|---|---|
| `battery` | Wh | of which a reserve is kept |
| `power_idle` | W | at rest, or hovering |
| `power_cruise` | W | at cruise speed in calm water or air |
| `power_exponent` | - | how the difference of the two grows with speed |

`[dynamics]` is what [the simulation](simulation.md) integrates; each domain has its own figures, named with their units
in the packaged files: masses, damping and propellers of a vessel; wheels, slip and lag of a rover; rotors, drag and the
attitude loop of a multirotor. A figure that lacks, or is no number, is refused in one line that names it.

A site may override `speed`, `turn_radius`, `clearance`, `battery`, `endurance` and `altitude` for one vehicle: see
[the format](geojson.md).

## Where it fails

- Power depends on speed alone: a planned route knows no current, wind or payload; the simulation counts them by thrust.
- Limits and dynamics are two statements about one vehicle. Nothing forces them to agree but the simulation's verdict; for
  the packaged models the tests hold them together.
"""


def vehicles_page() -> str:
    """Return docs/vehicles.md."""
    rows = []
    for name in model_names():
        m = load_model(name)
        shown = f"**{name}**" if name in DEFAULT_MODEL.values() else name
        figures = (m.length, m.speed, m.max_speed, m.turn_radius, m.clearance, m.battery)
        rows.append(f"| {shown} | {m.domain} | {' | '.join(f'{v:g}' for v in figures)} | {m.source} |")
    return VEHICLES + "\n".join(rows) + "\n" + VEHICLE_FIGURES


REPRODUCTION = """# The papers' tables beside ours

Made by `make docs` of what `quarterdeck reproduce all` prints, in about a minute. Each part stands under the command that
prints it alone, whose options draw the papers' figures too. Seconds and fitted exponents are of the machine that made this
page; all else is the same on every machine of one kind.
"""


def reproduction_page() -> str:
    """Return docs/reproduce.md: runs the four studies."""
    lines = [REPRODUCTION]
    for paper, title in PAPERS.items():
        command, text, _ = section(paper)
        lines += [f"## {title}\n", f"    {command}\n", f"```text\n{text}```\n"]
    return "\n".join(lines)


def schema_text() -> str:
    """Return geo/site.schema.json."""
    return json.dumps(json_schema(), indent=1) + "\n"


if __name__ == "__main__":
    (ROOT / "docs" / "geojson.md").write_text(geojson_page(), encoding="utf-8")
    (ROOT / "docs" / "triage-machines.md").write_text(machines_page(), encoding="utf-8")
    (ROOT / "docs" / "vehicles.md").write_text(vehicles_page(), encoding="utf-8")
    (ROOT / "docs" / "reproduce.md").write_text(reproduction_page(), encoding="utf-8")
    (ROOT / "geo" / "site.schema.json").write_text(schema_text(), encoding="utf-8")
