"""What a site or a plan lacks, and what may not be meant: told by `check`, and by the verbs that plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from quarterdeck.cli.output import console, print_reason

if TYPE_CHECKING:
    from collections.abc import Iterator

    from quarterdeck.geo.geojson import Document
    from quarterdeck.geo.scenario import Scenario
    from quarterdeck.mission.mission import Mission

NAMED = 3  # problems, at the most
NEAR = 100.0  # m: so near to the work no vehicle is far from it


def lacks(scenario: Scenario, document: Document) -> dict[str, list[str]]:
    """Return, for each verb that the roles of a site suggest, all for which it would refuse the site without options."""
    from quarterdeck.mission.assign import refusals

    domains = {v.domain for v in scenario.vehicles}
    found = {"plan": _uncovered(scenario, document)} if scenario.site.areas else {}
    if scenario.tasks:
        found["assign"] = [str(error) for error in refusals(scenario)]
    if scenario.casualties:
        needs = {
            'no UGV to search with; add a vehicle with "domain": "ground"': "ground" in domains,
            'no medic; add a Point with "role": "medic"': scenario.medics,
            'no field to search; give the polygon to be searched "role": "area"': scenario.site.areas,
        }
        found["triage"] = [why for why, there in needs.items() if not there]
    return found


def _uncovered(scenario: Scenario, document: Document) -> list[str]:
    """Return why `plan` refuses the scenario, found as it finds it."""
    from quarterdeck.api import default_method
    from quarterdeck.coverage.placement import place
    from quarterdeck.geo.errors import InputError
    from quarterdeck.geo.reader import place_of
    from quarterdeck.mission.cover import covering, refusals, trackable
    from quarterdeck.mission.lines import dividing

    found = list(refusals(scenario))
    if not found:
        step = covering(scenario, None) if default_method(scenario) == "stc" else dividing(scenario, None)[0]
        try:
            place(trackable(scenario, step), step)
        except InputError as error:
            found = [("area", str(error))]
    elif all(role == "area" for role, _ in found) and all(v.range is not None for v in scenario.vehicles):
        return []
    areas = [(i, f) for i, f in enumerate(document.content["features"]) if f["properties"].get("role") == "area"]
    where = place_of(*min(areas, key=lambda area: area[1]["properties"].get("spacing") is None))  # the one that says it
    return [f"{where}: {why}" if role else why for role, why in found]


def notes(scenario: Scenario, document: Document, lacking: dict[str, list[str]]) -> Iterator[str]:
    """Yield what else will have to be given when the site is planned, then what may be a mistake."""
    from quarterdeck.mission.cover import refusals

    others = {verb: whys for verb, whys in lacking.items() if verb != "plan" or not scenario.casualties}
    if not all(lacking.values()):  # the field of a drill need not be one to plan
        yield from (f"`{verb}` will need more: {why}" for verb, whys in others.items() for why in whys)
    if others.get("plan") == []:  # by guards, then
        yield from (f"`plan` will need --method guards, or more: {why}" for _, why in refusals(scenario))
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


def refused(mission: Mission) -> Iterator[str]:
    """Yield what `check` will say of a plan that was made, beside why it is infeasible, and what helps."""
    from quarterdeck.mission.check import check_mission
    from quarterdeck.mission.waits import waits

    told = {str(reason) for reason in mission.reasons}
    problems = [problem for problem in check_mission(mission, prove=False) if problem not in told]
    yield from problems[:NAMED]
    if len(problems) > NAMED:
        yield f"and {len(problems) - NAMED} more, which `check` lists"
    if problems:
        later = " and ".join(f"{vehicle} sets out {wait:.0f} s later" for vehicle, wait in waits(mission).items())
        yield "`export` refuses that" + (f", but with --unsafe; nobody meets anybody if {later}" if later else "")


def print_notes(lines: Iterator[str]) -> None:
    """Print notes on standard error."""
    for line in lines:
        print_reason(console(), "note", line)
