"""What is different from now on: read from one GeoJSON file, a feature a change, and checked against the plan.

A feature has a site's `role` and the property `change`: `add` (the default), `remove`, `set` or, of a vehicle, `back`.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from shapely import MultiPolygon, Point, union_all

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.geojson import Document, opened, position_problem
from quarterdeck.geo.properties import GEOMETRIES, property_problems
from quarterdeck.geo.reader import added, read_additions
from quarterdeck.geo.scenario import Area, Obstacle, Site, Task, Vehicle, as_multipolygon
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.triage.plan import METHOD, on_foot, settings_of

# What each role's features can say beside `add`; `set` with the properties that it may give.
EDITS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "vehicle": {"remove": ("since",), "set": ("speed", "speed_factor", "battery", "endurance"), "back": ()},
    "obstacle": {"remove": ()},
    "area": {"remove": (), "set": ("priority",)},
    "task": {"remove": (), "set": ("priority", "service_time", "window")},
    "operating": {},
}


@dataclass(frozen=True, slots=True)
class Changes:
    """What is different from now on. Ids name what is in the plan; what is added comes in the scenario's types.

    `lost` vehicles did nothing any more from `since` on (seconds of the plan, by id; now where none is given). `back` are
    vehicles that were given up and work again, with where they are, (x, y) metres, or None for where they were last.
    `medics` are those of the `joined` who treat casualties. `speeds` in m/s, `batteries` Wh and `endurances` s that
    vehicles have left, `priorities` of areas, `edited` tasks in the place of those of the same id; `operating` is added.
    """

    lost: frozenset[str] = frozenset()
    joined: tuple[Vehicle, ...] = ()
    medics: frozenset[str] = frozenset()
    obstacles: tuple[Obstacle, ...] = ()
    gone: frozenset[str] = frozenset()
    areas: tuple[Area, ...] = ()
    withdrawn: frozenset[str] = frozenset()
    tasks: tuple[Task, ...] = ()
    since: Mapping[str, float] = field(default_factory=dict)
    back: Mapping[str, tuple[float, float] | None] = field(default_factory=dict)
    speeds: Mapping[str, float] = field(default_factory=dict)
    batteries: Mapping[str, float] = field(default_factory=dict)
    endurances: Mapping[str, float] = field(default_factory=dict)
    priorities: Mapping[str, int] = field(default_factory=dict)
    edited: tuple[Task, ...] = ()
    operating: MultiPolygon = field(default_factory=MultiPolygon)

    def __bool__(self) -> bool:
        """Whether anything is different."""
        return any(getattr(self, f.name) for f in fields(self) if f.name not in ("since", "operating")) or bool(
            self.operating.area
        )

    def __or__(self, other: "Changes") -> "Changes":
        """Return both together; of two values for one thing the other's holds."""
        both: dict[str, Any] = {}
        for f in fields(self):
            mine, more = getattr(self, f.name), getattr(other, f.name)
            if isinstance(mine, MultiPolygon):
                both[f.name] = as_multipolygon(union_all([mine, more]))
            else:
                both[f.name] = mine + more if isinstance(mine, tuple) else mine | more
        return Changes(**both)


def read_changes(source: str | Path | Document, mission: Mission) -> Changes:
    """Return the changes in a GeoJSON file, in metres of the mission's frame; `-` reads standard input.

    A site's file is one in which everything is added. Raises InputError with the first problem, in one line.
    """
    document = opened(source)
    name, features = document.name, document.content["features"]
    changes = Changes()
    try:
        for i, raw in enumerate(features):
            if not added(raw):
                changes |= _edited(_edit(i, raw), mission)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    if not any(added(raw) for raw in features):
        return changes
    new = read_additions(document, mission.frame, tasks=[t.id for t in mission.tasks])
    triage = mission.method == METHOD
    known = {"casualty": new.casualties, "medic": () if triage else new.medics, "rendezvous": new.rendezvous}
    if strange := next((role for role, some in known.items() if some), None):
        why = "a plan of triage can change no" if triage else "a plan has no"
        raise InputError(f"{name}: {why} {strange}; leave it out")
    medics = tuple(on_foot(m, xy, settings_of(mission)) for m, xy in new.medics)
    if new.spacing is not None and mission.spacing is not None and abs(new.spacing - mission.spacing) > 1e-6:
        raise InputError(f"{name}: spacing {new.spacing:g} m, but the plan's is {mission.spacing:g} m; leave it out")
    widened = any(added(raw) and raw["properties"]["role"] == "operating" for raw in features)
    return changes | Changes(
        joined=(*new.vehicles, *medics),
        medics=frozenset(v.id for v in medics),
        obstacles=new.site.obstacles,
        areas=new.site.areas,
        tasks=new.tasks,
        operating=new.site.operating if widened else MultiPolygon(),
    )


@dataclass(frozen=True, slots=True)
class _Edit:
    """A feature that changes something in the plan; `given` are its properties."""

    place: str
    role: str
    change: str
    id: str
    given: Mapping[str, Any]
    geometry: Any


def _edit(index: int, raw: dict[str, Any]) -> _Edit:
    """Return what a feature with a `change` that is not `add` says."""
    properties = raw["properties"]
    change = properties["change"]
    given = {k: v for k, v in properties.items() if v is not None}
    identity = given.get("id", raw.get("id"))
    place = f"features[{index}]" + (f" ({identity!r})" if identity is not None else "")
    role = given.get("role")
    if not isinstance(role, str) or role not in EDITS:
        near = get_close_matches(str(role), EDITS, n=1)
        known = f"; did you mean {near[0]!r}?" if near else ""
        other = isinstance(role, str) and role in GEOMETRIES
        raise InputError(
            f"{place}: " + (f"a plan has no {role}" if other else f"role {str(role)[:40]!r} is unknown") + known
        )
    if not isinstance(change, str) or change not in EDITS[role]:
        near = get_close_matches(str(change), EDITS[role], n=1)
        words = ", ".join(["add", *EDITS[role]])
        raise InputError(
            f"{place}: change {str(change)[:40]!r} of role {role} must be one of {words}"
            + (f"; did you mean {near[0]!r}?" if near else "")
        )
    if not isinstance(identity, str | int) or isinstance(identity, bool):
        raise InputError(f'{place}: give it the "id" of the {role} in the plan')
    return _Edit(place, role, change, str(identity), given, raw.get("geometry"))


def _edited(edit: _Edit, mission: Mission) -> Changes:
    """Return the change that one feature makes."""
    names = EDITS[edit.role][edit.change]
    known = {
        "vehicle": [v.id for v in (mission.lost if edit.change == "back" else mission.vehicles)],
        "obstacle": [*(o.id for o in mission.site.obstacles), *(wreck_name(v.id) for v in mission.vehicles)],
        "area": [a.id for a in mission.site.areas],
        "task": [t.id for t in mission.tasks],
    }[edit.role]
    if edit.change != "back":
        _known(edit.role, edit.id, known, f"{edit.place}: ")
    if edit.change == "set":
        return _set(edit, names, mission)
    if edit.change == "back":
        return Changes(back={edit.id: _position(edit, mission)})
    if edit.role == "vehicle":
        since = edit.given.get("since")
        if since is not None and (isinstance(since, bool) or not isinstance(since, int | float) or not 0 <= since < 1e12):
            raise InputError(f"{edit.place}: since must be a number of seconds from 0, not {str(since)[:40]!r}")
        return Changes(lost=frozenset({edit.id}), since={} if since is None else {edit.id: float(since)})
    one = frozenset({edit.id})
    return Changes(gone=one) if edit.role == "obstacle" else Changes(withdrawn=one)


def _position(edit: _Edit, mission: Mission) -> tuple[float, float] | None:
    if edit.geometry is None:
        return None
    point = edit.geometry if isinstance(edit.geometry, dict) else {}
    if point.get("type") != "Point":
        raise InputError(f"{edit.place}: the geometry of a vehicle that is back is a Point, where it is, or null")
    if problem := position_problem(point.get("coordinates")):
        raise InputError(f"{edit.place}: {problem}")
    x, y = mission.frame.to_metres(np.array(point["coordinates"][:2], dtype=float))[0]
    return float(x), float(y)


def _set(edit: _Edit, names: tuple[str, ...], mission: Mission) -> Changes:
    given = {k: v for k, v in edit.given.items() if k in names}
    if not given:
        raise InputError(f"{edit.place}: set changes nothing; give {' or '.join(names)} of the {edit.role}")
    factor = given.pop("speed_factor", None)
    if problems := property_problems(edit.role, given):
        raise InputError(f"{edit.place}: {problems[0]}")
    if edit.role == "area":
        return Changes(priorities={edit.id: given["priority"]})
    if edit.role == "vehicle":
        if factor is not None and "speed" in given:
            raise InputError(f"{edit.place}: give speed or speed_factor, not both")
        if (
            isinstance(factor, bool)
            or not isinstance(factor, int | float | None)
            or (factor is not None and not factor > 0)
        ):
            raise InputError(f"{edit.place}: speed_factor must be a number above 0, not {str(factor)[:40]!r}")
        if factor is not None:
            given["speed"] = factor * mission.vehicle(edit.id).speed
        speeds, batteries, endurances = (
            {edit.id: float(given[name])} if name in given else {} for name in ("speed", "battery", "endurance")
        )
        return Changes(speeds=speeds, batteries=batteries, endurances=endurances)
    task = next(t for t in mission.tasks if t.id == edit.id)
    if "window" in given:
        low, high = map(float, given["window"])
        if not 0 <= low <= high:
            raise InputError(f"{edit.place}: window {[low, high]} must be [earliest, latest], earliest first")
        given["window"] = (low, high)
    return Changes(edited=(replace(task, **given),))


def wreck_name(lost: str) -> str:
    """Return what a vehicle that is lost is called as an obstacle."""
    return f"wreck of {lost}"


def _known(what: str, name: str, known: Collection[str], place: str = "") -> None:
    """Raise InputError with the nearest id if there is no such thing."""
    if name in known:
        return
    near = get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"the plan has {', '.join(known)}" if known else "the plan has none"
    raise InputError(f"{place}unknown {what} {name!r}; {hint}")


def check_changes(mission: Mission, changes: Changes) -> None:
    """Raise InputError if a change names what is not in the plan, contradicts another, or means nothing to its method."""
    site = mission.site
    ids, lost = [v.id for v in mission.vehicles], [v.id for v in mission.lost]
    areas, tasks = [a.id for a in site.areas], [t.id for t in mission.tasks]
    for what, named, known in (
        ("vehicle", {*changes.lost, *_set_anew(changes)}, [*ids, *changes.back]),
        ("obstacle", changes.gone, [*(o.id for o in site.obstacles), *map(wreck_name, sorted(changes.lost))]),
        ("area or task", changes.withdrawn, [*areas, *tasks]),
        ("area", changes.priorities, areas),
    ):
        for name in sorted(named):
            _known(what, name, known)
    for name in sorted(changes.back):
        if name in ids:
            raise InputError(f"vehicle {name!r} is back, but the plan never gave it up; leave that out")
        _known("vehicle that was given up", name, lost)
    both = changes.lost & {*_set_anew(changes), *changes.back}
    if both:
        raise InputError(f"vehicle {min(both)!r} is lost and works at once; leave one of the two out")
    models = {v.id: v.model for v in (*mission.vehicles, *mission.lost)}
    for name, speed in changes.speeds.items():
        if not 0 < speed <= models[name].max_speed:
            top = models[name].max_speed
            raise InputError(f"vehicle {name!r}: speed {speed:g} m/s must be above 0 and at most {top:g} m/s")
    _check_new(mission, changes, {*ids} - changes.lost | {*changes.back})
    if mission.method == "assign":
        of_areas = [*(a.id for a in changes.areas), *changes.priorities, *changes.withdrawn & ({*areas} - {*tasks})]
        if of_areas:
            raise InputError(f"area {of_areas[0]!r}: a plan of tasks covers no areas; make one with `quarterdeck plan`")
    elif changes.tasks or changes.edited or changes.withdrawn - {*areas}:
        raise InputError(f"a plan made by {mission.method!r} does no tasks; a plan of `quarterdeck assign` does")
    elif mission.method == METHOD:
        if changes.priorities:
            raise InputError(
                f"area {min(changes.priorities)!r}: all of the field is searched alike; leave its priority out"
            )
        if at_sea := [v.id for v in changes.joined if v.domain == "surface"]:
            raise InputError(f"vehicle {at_sea[0]!r}: on water it has no part in triage; give a UGV, a UAV or a medic")


def _set_anew(changes: Changes) -> set[str]:
    """Return the vehicles of which something is set."""
    return {*changes.speeds, *changes.batteries, *changes.endurances}


def _check_new(mission: Mission, changes: Changes, working: Collection[str]) -> None:
    """Raise InputError if something new has the id of something else, or stands where nobody can be."""
    site = mission.site
    for what, new, old, hint in (
        ("task", [t.id for t in changes.tasks], {t.id for t in mission.tasks}, "another id, or change it with `set`"),
        ("area", [a.id for a in changes.areas], {a.id for a in site.areas} - changes.withdrawn, "another id"),
        ("vehicle", [v.id for v in changes.joined], {*working}, "another id, or change it with `set`"),
    ):
        again = [i for i in new if i in old or new.count(i) > 1]
        if again:
            raise InputError(f"{what} {again[0]!r} is there already; give the new one {hint}")
    operating = as_multipolygon(union_all([site.operating, changes.operating, *(a.polygon for a in changes.areas)]))
    for vehicle in changes.joined:
        for word, xy in (("joins", vehicle.start), ("ends", vehicle.home)):
            away = operating.distance(Point(xy))
            if away > vehicle.clearance + 1e-3:
                raise InputError(
                    f"vehicle {vehicle.id!r} {word} {away:,.0f} m outside the operating area; add a feature of role "
                    '"operating" around it'
                )


def changed_site(site: Site, changes: Changes) -> Site:
    """Return the site as it is from now on. Obstacles that have the name of another are numbered."""
    areas = (
        replace(a, priority=changes.priorities.get(a.id, a.priority)) for a in site.areas if a.id not in changes.withdrawn
    )
    kept = tuple(o for o in site.obstacles if o.id not in changes.gone)
    operating = as_multipolygon(union_all([site.operating, changes.operating, *(a.polygon for a in changes.areas)]))
    return Site((*areas, *changes.areas), operating, (*kept, *_numbered(changes.obstacles, {o.id for o in kept})))


def changed_tasks(tasks: Sequence[Task], changes: Changes) -> tuple[Task, ...]:
    """Return the tasks that are asked for from now on, done or not."""
    edited = {t.id: t for t in changes.edited}
    return (*(edited.get(t.id, t) for t in tasks if t.id not in changes.withdrawn), *changes.tasks)


def _numbered(obstacles: Sequence[Obstacle], taken: set[str]) -> list[Obstacle]:
    named = []
    for obstacle in obstacles:
        name, number = obstacle.id, 1
        while name in taken:
            number += 1
            name = f"{obstacle.id} ({number})"
        taken.add(name)
        named.append(replace(obstacle, id=name))
    return named
