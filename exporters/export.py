"""How a mission leaves: one registry of formats, one function that writes them.

An exporter is a module with `files(mission, settings, **options)`, which returns the content of each file by its name and
writes nothing. So an export is whole or not at all: every file is made and every name checked before one is written.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from quarterdeck.geo import addons
from quarterdeck.geo.addons import addon, addon_names
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.files import write_files
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.check import check_mission, unsound
from quarterdeck.mission.follow import follow
from quarterdeck.mission.heights import knows_ground
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.timing import shortfalls

Autopilot = Literal["ardupilot", "px4"]
Altitude = Literal["relative", "terrain", "amsl"]
AUTOPILOTS: tuple[Autopilot, ...] = ("ardupilot", "px4")
ALTITUDES: tuple[Altitude, ...] = ("relative", "terrain", "amsl")
STORAGES = (4, 8, 15, 16, 32)  # kB of ArduPilot boards; most have 16

# format: (module, its options, what it is)
FORMATS: dict[str, tuple[str, dict[str, Any], str]] = {
    "csv": ("waypoint_table", {}, "every waypoint, a row each"),
    "geojson": ("geojson", {}, "styled routes and site for geojson.io, GitHub, QGIS"),
    "gpx": ("gpx", {}, "routes for chart plotters, OpenCPN, receivers"),
    "html": ("page", {}, "a page that pans, zooms and plays without a network"),
    "kml": ("kml", {}, "routes and site for Google Earth"),
    "kmz": ("kml", {"packed": True}, "the same, zipped"),
    "moos": ("moos", {}, "MOOS-IvP behaviours"),
    "nav2": ("nav2", {}, "GPS waypoints for ROS 2's Nav2"),
    "png": ("picture", {}, "map of the plan"),
    "qgc-plan": ("qgc_plan", {}, "mission, fence and rally points for QGroundControl and MAVSDK"),
    "qgc-wpl": ("qgc_wpl", {}, "mission, fence and rally files for ArduPilot, PX4, Mission Planner, QGroundControl"),
    "qgis": ("qgis", {}, "layers of routes and site, styled for QGIS"),
    "rerun": ("recording", {}, "recording for the rerun viewer"),
    "rtz": ("rtz", {"version": "1.0"}, "routes for ECDIS, version 1.0, the most widely read"),
    "rtz-1.1": ("rtz", {"version": "1.1"}, "the same, version 1.1"),
    "rtz-1.2": ("rtz", {"version": "1.2"}, "the same, version 1.2"),
}

NAMED = 8  # failed checks that fit into one line
SEEN = ("geojson", "html", "png", "qgis", "rerun")  # formats for people; all others something may follow


@dataclass(frozen=True, slots=True)
class Settings:
    """What an export is for: the `autopilot`; `tell`, called with a line for what the user should know; what heights count
    from, `altitude`, and the `ground`'s metres above mean sea level, for those that count from there. `storage` is
    that of an ArduPilot board in kB, which limits its mission and fence; `depart` is when the mission begins, UTC.
    """

    autopilot: Autopilot = "ardupilot"
    tell: Callable[[str], None] = lambda _line: None
    altitude: Altitude = "relative"
    ground: float = 0.0
    storage: int = 16
    depart: datetime | None = None


def export(
    mission: Mission,
    to: str | Iterable[str],
    out: str | Path,
    *,
    autopilot: Autopilot = "ardupilot",
    altitude: Altitude = "relative",
    ground: float | None = None,
    terrain: Terrain | None = None,
    tolerance: float = 5.0,
    storage: int = 16,
    depart: datetime | None = None,
    split: bool = False,
    force: bool = False,
    unsafe: bool = False,
    tell: Callable[[str], None] | None = None,
) -> list[Path]:
    """Write `mission` in each of the formats `to` (names of `FORMATS`) into the folder `out`; return the files' paths.

    Heights in autopilots' files count from home (`relative`), from the terrain that the autopilot knows (`terrain`,
    ArduPilot only), or from mean sea level (`amsl`, with the `ground`'s metres above it, or those of a plan made over
    terrain). Over `terrain` what flies is held at its height within `tolerance` metres, as `plan` does. With `split` a
    mission beyond a
    vehicle's endurance is written as sorties (`mission.sorties`), each round into a folder `sortie-1`, `sortie-2` and on.
    `tell` is called with one line for each limit that the mission meets in a format. Raises InputError, and writes nothing,
    for a plan that makes no sense; one that fails a check (`mission.check`) in a format that vehicles follow, unless
    `unsafe`; an unknown format, autopilot or altitude, two formats
    that would write the same file, and where a file stands already and not `force`.
    """
    names = [to] if isinstance(to, str) else list(to)
    if autopilot not in AUTOPILOTS:
        raise InputError(f"unknown autopilot {autopilot!r}; known: {', '.join(AUTOPILOTS)}")
    if altitude not in ALTITUDES:
        raise InputError(f"unknown altitude {altitude!r}; known: {', '.join(ALTITUDES)}")
    if storage not in STORAGES:
        raise InputError(f"no board has {storage} kB of storage; known: {', '.join(map(str, STORAGES))}")
    if altitude == "terrain" and autopilot == "px4":
        raise InputError("PX4 takes no mission items above terrain; export relative or amsl altitudes")
    told: dict[str, None] = {}
    if problems := unsound(mission):
        raise InputError(f"the plan makes no sense: {problems[0]}{_more(problems)}; plan it again")
    if terrain is not None:
        mission = follow(mission, terrain, tolerance=tolerance)
    elif "terrain" in mission.parameters and not knows_ground(mission):
        raise InputError("the plan was made over terrain and has changed since; export it with --terrain FILE")
    if ground is not None and knows_ground(mission):
        raise InputError("the plan knows its ground from the terrain; leave out --ground")
    if altitude == "amsl" and not knows_ground(mission) and (ground is None or not math.isfinite(ground)):
        raise InputError("altitudes above mean sea level need the ground's: give --ground METRES, or --terrain FILE")
    settings = Settings(autopilot, lambda line: told.setdefault(line), altitude, ground or 0.0, storage, depart)
    for line in mission.figures.get("notes", ()):
        settings.tell(line)
    made: dict[str, bytes | str] = {}
    for within, part in _parts(mission, split, terrain, tolerance):
        _check(part, names, settings, unsafe=unsafe)
        for name in dict.fromkeys(names):
            for file, content in _exporter(name)(part, settings).items():
                if within + file in made:
                    raise InputError(f"{name} and another of the formats both write {file}; export them one by one")
                made[within + file] = content
    folder = Path(out)
    for file in made:
        if not (folder / file).resolve().is_relative_to(folder.resolve()):  # names are made safe: a defect of ours
            raise RuntimeError(f"{file} is not in the folder of the export")
    written = write_files({folder / file: content for file, content in made.items()}, force=force)
    if tell is not None:  # only now, for a refusal is the only thing said
        for line in told:
            tell(line)
    return written


def _parts(mission: Mission, split: bool, terrain: Terrain | None, tolerance: float) -> list[tuple[str, Mission]]:
    """The missions to write and the folder of each: the mission itself, or its rounds of sorties."""
    if not split or not any(shortfalls(mission.vehicle(route.vehicle), route) for route in mission.routes):
        return [("", mission)]
    if terrain is None and knows_ground(mission):
        raise InputError("sorties of a plan over terrain have new ways home; export them with --terrain FILE")
    away = _rounds(mission) if terrain is None else _rounds_over(mission, terrain, tolerance)
    return [(f"sortie-{number}/", part) for number, part in enumerate(away, 1)]


def _rounds(mission: Mission) -> list[Mission]:
    from quarterdeck.mission.sorties import sorties  # its shortest paths are slow to import

    return [replace(m, routes=tuple(r for r in m.routes if len(r.waypoints) > 1)) for m in sorties(mission)]


def _rounds_over(mission: Mission, terrain: Terrain, tolerance: float) -> list[Mission]:
    """Sorties over terrain: ways out and home climb too, so that each has as much less to do as they need."""
    part = 1.0
    while True:
        limited = tuple(replace(v, endurance=part * v.endurance, battery=part * v.battery) for v in mission.vehicles)
        rounds = [replace(m, vehicles=mission.vehicles) for m in _rounds(replace(mission, vehicles=limited))]
        away = [follow(m, terrain, tolerance=tolerance) for m in rounds]
        if not any(shortfalls(mission.vehicle(r.vehicle), r) for m in away for r in m.routes):
            return away
        part *= 0.95


def _check(mission: Mission, names: Iterable[str], settings: Settings, *, unsafe: bool) -> None:
    """Tell what a check of the mission finds. Raises InputError if it finds anything and something may follow the files."""
    problems = check_mission(mission)
    followed = [name for name in names if name not in SEEN]
    if problems and followed and not unsafe:
        short = any(shortfalls(mission.vehicle(route.vehicle), route) for route in mission.routes)
        way = "plan it again, export it with --sorties" if short else "plan it again"
        raise InputError(
            f"the plan fails {len(problems)} check{'s'[: len(problems) > 1]}; {way}, or give --unsafe to export it so: "
            f"{'; '.join(problems[:NAMED])}{_more(problems, NAMED)}"
        )
    for problem in problems:
        settings.tell(f"the plan fails a check: {problem}")


def _more(problems: Sequence[str], named: int = 1) -> str:
    return f" (and {len(problems) - named} more: `quarterdeck check` lists them)" if len(problems) > named else ""


def _exporter(name: str) -> Callable[[Mission, Settings], Mapping[str, bytes | str]]:
    """Return the function that makes a format's files, ours or a package's that the user has installed."""
    if name in FORMATS:
        module, options, _ = FORMATS[name]
        return partial(import_module(f"quarterdeck.exporters.{module}").files, **options)
    added = addon_names(addons.FORMATS)
    if name in added:
        return addon(addons.FORMATS, name)
    near = get_close_matches(name, [*FORMATS, *added], n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(sorted([*FORMATS, *added]))}"
    raise InputError(f"unknown format {name!r}; {hint}")
