"""What a site lacks for planning, and what in it may not be meant: told by `check`, and by the verbs that plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from quarterdeck.cli.output import console, print_reason

if TYPE_CHECKING:
    from collections.abc import Iterator

    from quarterdeck.geo.geojson import Document
    from quarterdeck.geo.scenario import Scenario

NEAR = 100.0  # m: so near to the work no vehicle is far from it


def lacks(scenario: Scenario) -> dict[str, str]:
    """Return, for each verb that the roles of a site suggest, what keeps it from planning; "" for nothing."""
    domains = {v.domain for v in scenario.vehicles}
    vehicle = "" if domains else 'no vehicle; add a Point with "role": "vehicle" where one starts'
    found = {"plan": vehicle} if scenario.site.areas else {}
    if scenario.tasks:
        found["assign"] = vehicle
    if scenario.casualties:
        found["triage"] = (
            'no UGV to search with; add a vehicle with "domain": "ground"' if "ground" not in domains
            else 'no medic; add a Point with "role": "medic"' if not scenario.medics
            else 'no field to search; give the polygon to be searched "role": "area"' if not scenario.site.areas
            else ""
        )  # fmt: skip
    return found


def notes(scenario: Scenario, document: Document) -> Iterator[str]:
    """Yield what will have to be given when the site is planned, then what may be a mistake."""
    blocked = {verb: what for verb, what in lacks(scenario).items() if what}
    if len(blocked) < len(lacks(scenario)):
        yield from (f"`{verb}` will need more: {what}" for verb, what in blocked.items())
    given = scenario.spacing is not None or any(v.sensor is not None for v in scenario.vehicles)
    if scenario.site.areas and not scenario.casualties and not given:
        yield (
            'no spacing: `plan` will need --spacing METRES, or an area the property "spacing", or vehicles a sensor; '
            "--method guards needs --range METRES, or vehicles the property"
        )
    if "aerial" not in {v.domain for v in scenario.vehicles} and scenario.casualties:
        yield 'no UAV: `triage` will need --method no-relay, or a vehicle with "domain": "aerial"'
    yield from far_off(scenario, document)


def far_off(scenario: Scenario, document: Document) -> Iterator[str]:
    """Yield which vehicles start or end farther from the work than that is across, where no operating area is drawn."""
    from shapely import GeometryCollection, Point

    fenced = any((f.get("properties") or {}).get("role") == "operating" for f in document.content["features"])
    work = GeometryCollection([*(a.polygon for a in scenario.site.areas), *(Point(t.position) for t in scenario.tasks)])
    if fenced or work.is_empty:
        return
    west, south, east, north = work.bounds
    across = ((east - west) ** 2 + (north - south) ** 2) ** 0.5
    for vehicle in scenario.vehicles:
        ends = {"starts": vehicle.start} | ({"ends": vehicle.end} if vehicle.end is not None else {})
        for verb, place in ends.items():
            if (off := work.distance(Point(place))) > max(across, NEAR):
                yield (
                    f"vehicle {vehicle.id!r} {verb} {_far(off)} from what is to be done, which is {_far(across)} across: "
                    'is that its place? Nothing fences the way there; draw a polygon with "role": "operating"'
                )


def _far(metres: float) -> str:
    return f"{metres / 1000:,.1f} km" if metres >= 1000 else f"{metres:.0f} m"


def print_notes(lines: Iterator[str]) -> None:
    """Print notes on standard error."""
    for line in lines:
        print_reason(console(), "note", line)
