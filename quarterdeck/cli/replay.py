"""`quarterdeck replay`: run a report, a plan or a drill again and compare."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from hashlib import sha256
from importlib import import_module
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from quarterdeck.cli.files import reads, takes
from quarterdeck.cli.output import console
from quarterdeck.cli.parameters import Real
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.files import read_bytes
from quarterdeck.geo.kinds import FATES, PLAN, REPORT, kind_of

if TYPE_CHECKING:
    from quarterdeck.geo.geojson import Document
    from quarterdeck.geo.scenario import Scenario
    from quarterdeck.mission.mission import Mission

    Differences = list[tuple[str, Any, Any]]

SHOWN = 20  # differences that are printed; --json has all


@click.command(short_help="Run a report, a plan or a drill again, and compare.")
@takes("file")
@reads("--plan", help="The report's plan, where it is not found.")
@reads("--site", pipe=True, help="The plan's or the drill's site: it is planned again too, with its seed and parameters.")
@click.option("--within", type=Real(min=0), default=0.0, show_default=True,
              help="By what numbers may differ: a fraction, near 0 an amount; 0: to the last digit.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Write all differences as JSON to standard output.")
def command(file: str, plan: str | None, site: str | None, within: float, as_json: bool) -> int:
    """Run again what FILE came of, and print what differs.

    FILE is a report of `simulate` or `report`, or with --site a PLAN or what `triage` wrote of casualties.

    A report's files are looked for where its command had them, from here and from the report's folder and those above it,
    and beside the report; their hashes tell whether they are the same. Exit status 1 if anything differs. Another version
    of Quarterdeck is told, and is no difference by itself.
    """
    from quarterdeck.geo.geojson import Document, opened

    found: Differences = []
    read = _read(file)
    if isinstance(read, Document):
        if site is None or plan is not None:
            how = "to run it again give its site by --site, and no --plan"
            raise InputError(f"{file}: is {kind_of(read.data)}; {how}")
        found += (drill_again if kind_of(read.data) == FATES else plan_again)(read, site, within)
    else:
        options = _with_files(read, file, plan)
        if site is not None:
            found += plan_again(opened(str(options.get("plan"))), site, within)
        found += report_again(read, options, within)
    if as_json:
        click.echo(json.dumps([{"where": where, "was": was, "is": now} for where, was, now in found], indent=1))
    screen = console()
    for where, was, now in found[:SHOWN]:
        screen.print(f"{where}: was {_short(was)}, is {_short(now)}", soft_wrap=True)
    if len(found) > SHOWN:
        screen.print(f"and {len(found) - SHOWN:,} more")
    same = all(where.endswith("version") for where, _, _ in found)
    screen.print(f"{file}: {'the same again' if same else 'not the same'}", soft_wrap=True)
    return 0 if same else 1


def _read(file: str) -> Document | dict[str, Any]:
    """Return a PLAN, what became of casualties, or a report as JSON. Raises InputError if it is none of them."""
    from quarterdeck.geo.geojson import Document, parse, parse_json

    data = read_bytes(file)
    kind = kind_of(data)
    try:
        if kind in (PLAN, FATES):
            return Document(file, data, parse(data))
        if kind == REPORT:
            return dict(parse_json(data))
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    raise InputError(f"{file}: is {kind or 'neither a report nor a PLAN'}")


def _with_files(report: dict[str, Any], file: str, plan: str | None) -> dict[str, Any]:
    """Return the options of the command that a report came of, its files where they lie now.

    Raises InputError if the report tells no command, or one of the files is not found as it was.
    """
    command = report.get("command")
    given, files = (command.get(name) for name in ("options", "files")) if isinstance(command, dict) else (None, None)
    if not isinstance(given, dict) or not isinstance(files, dict):
        raise InputError(f"{file}: does not tell the command that it came of; it was made from Python")
    home = Path(file).resolve().parent
    options = given | ({"plan": plan} if plan is not None else {})
    lay = {name: str(options.get(name, name)) for name in files}  # logs are told by their paths
    found = {name: _found(name if name in options else "log", lay[name], was, home, plan) for name, was in files.items()}
    logs = {name: path for name, path in found.items() if name not in options}
    options |= {name: path for name, path in found.items() if name in options}
    for name in ("tracks", "changes"):
        if isinstance(options.get(name), list):
            options[name] = [_moved(str(track), logs) for track in options[name]]
    return options


def _moved(track: str, logs: dict[str, str]) -> str:
    """Return a --track, or --changes, with its file's path as it is now."""
    for lay, path in logs.items():
        before, is_it, after = track.partition(lay)
        if is_it and before[-1:] in ("", "=") and after[:1] in ("", "#", "@"):
            return before + path + after
    return track


def _found(name: str, lay: str, was: str, home: Path, plan: str | None) -> str:
    """Return the path of a report's file, one with the same SHA-256, by where it lay and the folder of the report."""
    advice = "give it by --plan" if name == "plan" else "put it beside the report"
    if name == "plan" and plan is not None:
        places = [Path(plan)]
    elif lay == "-":
        raise InputError(f"the report's {name} came by standard input; {advice}")
    else:
        places = [Path(lay), *(folder / lay for folder in (home, *home.parents)), home / Path(lay).name]
    there = [place for place in places if os.path.isfile(place)]  # noqa: PTH113 - any name, however long
    for place in there:
        if sha256(read_bytes(place)).hexdigest() == was:
            return str(place)
    if there:
        raise InputError(f"{there[0]}: is not the {name} that the report was made with (another SHA-256); {advice}")
    raise InputError(f"{lay}: the report's {name} is not there, from here or from {home}; {advice}")


def report_again(report: dict[str, Any], options: dict[str, Any], within: float) -> Differences:
    """Run a report's verb with its options and return what differs. Raises InputError if they cannot be used."""
    verb = import_module(f"quarterdeck.cli.{'report' if report['command'].get('verb') == 'report' else 'simulate'}")
    context = click.Context(verb.command)
    try:
        given = {
            p.name: p.type_cast_value(context, _tuples(options[p.name])) for p in verb.command.params if p.name in options
        }
    # click's types are for what is typed
    except (click.BadParameter, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise InputError(f"the report's options cannot be used ({error}); run its verb again") from None
    try:
        _, run = verb.execute(**given)
    except TypeError as error:  # options that are lacking
        raise InputError(f"the report's options cannot be used ({error}); run its verb again") from None
    told = {"command": report["command"], "state": report.get("state")}
    if verb.__name__.endswith("report"):  # where the logs lie is no difference
        told["settings"] = {**run.report.settings, "tracks": report["command"]["options"].get("tracks")}
    again = json.loads(replace(run.report, **told).to_json())
    found = differences(report, again, within)
    return [d for d in found if not (within and d[0] == "trace_hash")]


def plan_again(plan: Document, site: str, within: float) -> Differences:
    """Plan a site again as a plan's header tells, and return what differs, by feature."""
    from quarterdeck.geo.reader import read_scenario
    from quarterdeck.mission.planfile import plan_text, read_plan

    made = remade(read_plan(plan), read_scenario(site), plan.name, site)
    return list(differences(_features(plan.content), _features(json.loads(plan_text(made))), within))


def drill_again(drill: Document, site: str, within: float) -> Differences:
    """Run triage on a site again as the header of what became of casualties tells, and return what differs, by feature.

    Raises InputError if it was not of this site, or the header is damaged.
    """
    from quarterdeck.exporters.casualties import casualties_geojson
    from quarterdeck.geo.reader import read_scenario
    from quarterdeck.geo.typed import fits, from_json
    from quarterdeck.mission.triage.outcome import run_triage
    from quarterdeck.mission.triage.settings import METHODS, Settings
    from quarterdeck.mission.world import Fault

    scenario, features = read_scenario(site), _features(drill.content)
    try:
        header = features["triage"]["properties"]
        method, seed, given = header["method"], header["seed"], header["parameters"]
        settings = from_json(given["settings"], Settings)
        faults = [from_json(fault, Fault) for fault in given["faults"]]
        if method not in METHODS or not fits(seed, int) or seed < 0:
            raise ValueError(f"method {method!r}, seed {seed!r}")
        was = header["input_hash"]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{drill.name}: does not tell what it came of ({error}); run triage again") from None
    if was != scenario.input_hash:
        raise InputError(f"{site}: is not the site that {drill.name} was made of (another SHA-256)")
    outcome = run_triage(scenario, method, settings, seed=seed, faults=faults)
    return list(differences(features, _features(json.loads(casualties_geojson(outcome))), within))


def remade(plan: Mission, scenario: Scenario, file: str, site: str) -> Mission:
    """Return the mission that a plan's method, seed and parameters make of the scenario.

    Raises InputError if the plan was not made of this site, or in a way that its header does not tell.
    """
    from quarterdeck.api import assign
    from quarterdeck.api import plan as cover
    from quarterdeck.mission.triage.plan import METHOD as TRIAGE
    from quarterdeck.mission.triage.plan import plan_triage, settings_of

    if plan.input_hash != scenario.input_hash:
        raise InputError(f"{site}: is not the site that {file} was made of (another SHA-256)")
    options = dict(plan.parameters)
    own_map = options.pop("map", "site") != "site"
    if (
        own_map
        or {"replanned_at", "told_at", "sortie", "terrain"} & set(options)
        or plan.method not in ("stc", "lines", "guards", "assign", TRIAGE)
    ):
        raise InputError(
            f"{file}: was not made of a site alone (replanned, told in a run, over terrain, on a map, or by hand); "
            "plan it as it was"
        )
    scenario = replace(scenario, name=plan.name)
    try:
        if plan.method == TRIAGE:
            return plan_triage(scenario, options["method"], settings_of(plan), seed=plan.seed)
        if plan.method == "assign":
            return assign(scenario, seed=plan.seed, **options)
        return cover(scenario, method=plan.method, seed=plan.seed, **options)
    except (KeyError, TypeError) as error:
        raise InputError(f"{file}: its parameters cannot be used ({error}); plan the site again") from None


def _features(document: dict[str, Any]) -> dict[str, Any]:
    """Return a plan's features by a name that tells them: role, id or vehicle."""
    named: dict[str, Any] = {}
    for feature in document["features"]:
        own = feature if isinstance(feature, dict) else {}  # a plan's reader leaves out what is no feature
        given = own["properties"] if isinstance(own.get("properties"), dict) else {}
        words = [given.get("role"), own.get("id") or given.get("vehicle") or given.get("layer")]
        name = " ".join(str(w) for w in words if w is not None)
        named[f"{name} {len(named)}" if name in named else name] = feature
    return named


def differences(was: Any, now: Any, within: float = 0.0, where: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield (place, was, is) for what differs in two JSON documents; numbers may by `within`, near 0 an amount."""
    if isinstance(was, dict) and isinstance(now, dict):
        for key in [*was, *(k for k in now if k not in was)]:
            yield from differences(was.get(key), now.get(key), within, f"{where}.{key}" if where else key)
    elif isinstance(was, list) and isinstance(now, list):
        for i, (a, b) in enumerate(zip_longest(was, now)):
            yield from differences(a, b, within, f"{where}[{i}]")
    elif was != now and not (_number(was) and _number(now) and math.isclose(was, now, rel_tol=within, abs_tol=within)):
        yield where, was, now


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."
