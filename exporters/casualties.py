"""What became of each casualty, for responders: GeoJSON for a map, CSV for a list, Cursor-on-Target for their devices.

Colours, never numbers: responders count 1 as immediate, the paper 3 as most urgent. `sort` is a robot's estimate (SALT's
first step gives an order, not a diagnosis), `category` what the medic confirmed.
"""

import csv
import io
from collections.abc import Iterable
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from lxml import etree

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.features import collection, feature, point_feature
from quarterdeck.geo.palette import CASUALTY
from quarterdeck.geo.version import VERSION
from quarterdeck.mission.triage.figures import figures
from quarterdeck.mission.triage.outcome import Fate, Outcome
from quarterdeck.mission.triage.settings import as_parameters

MEANING = {"red": "immediate", "yellow": "delayed", "green": "minimal", "grey": "expectant", "black": "dead"}
_TIMES = ("found", "reported", "delivered", "reached", "treated")
_BY = ("found_by", "reported_by", "delivered_by", "treated_by")
_STALE = timedelta(hours=1)
_UNKNOWN = "9999999.0"  # Cursor on Target's own word for an unknown height or error
# The 9-line request (ATAK's b-r-f-h-c) counts patients by precedence; there is none for the dead.
_PRECEDENCE = {"red": "urgent", "yellow": "priority", "green": "routine", "grey": "routine"}


def casualties_geojson(outcome: Outcome) -> str:
    """Return the casualties that somebody found as GeoJSON text, with position, uncertainty, colour, who and when.

    The first feature has no geometry; it has the mission's figures and, as a PLAN's header, all that they came of: version,
    settings, faults, seed and the site's SHA-256. Times are seconds from the mission's start.
    """
    plain = {k: None if not np.isfinite(v) else round(v, 3) for k, v in figures(outcome).items()}
    head = feature(
        "triage",
        None,
        version=VERSION,
        method=outcome.method,
        reasons=outcome.reasons,
        seed=outcome.seed,
        parameters={
            "settings": as_parameters(outcome.settings),
            "faults": [asdict(f) | {"until": f.until if np.isfinite(f.until) else None} for f in outcome.faults],
        },
        figures=plain,
        input_hash=outcome.scenario.input_hash,
    )
    features = [head]
    for fate in outcome.fates:
        if fate.found is None:
            continue
        place = known_position(outcome, fate)
        features.append(point_feature(outcome.scenario.frame, "casualty", place, fate.id, **_properties(outcome, fate)))
    return collection(outcome.scenario.name, features)


def casualties_csv(outcome: Outcome) -> str:
    """Return one row for each casualty found: where, what colour, who and when, in seconds from the mission's start."""
    rows = []
    for fate in outcome.fates:
        if fate.found is not None:
            lon, lat = outcome.scenario.frame.to_degrees(np.array(known_position(outcome, fate)))[0]
            rows.append({"id": fate.id, "lon": f"{lon:.9f}", "lat": f"{lat:.9f}"} | _properties(outcome, fate))
    columns = ["id", "lon", "lat", *_properties(outcome, Fate("", 0.0, 0.0, "red"))]
    return _csv(columns, rows)


def log_csv(outcome: Outcome) -> str:
    """Return what happened, a row an event: seconds, who, what, about whom, with whom, where in degrees."""
    degrees = outcome.scenario.frame.to_degrees(np.array([(e.x, e.y) for e in outcome.log], dtype=float))
    rows = (
        {"time": f"{e.time:.3f}", "who": e.who, "what": e.what, "about": e.about, "with": e.whom}
        | {"lon": f"{lon:.9f}", "lat": f"{lat:.9f}"}
        for e, (lon, lat) in zip(outcome.log, degrees, strict=True)
    )
    return _csv(["time", "who", "what", "about", "with", "lon", "lat"], rows)


def cursor_on_target(outcome: Outcome, start: str) -> bytes:
    """Return Cursor-on-Target events (version 2.0) as one XML document: each casualty as last known, each robot and medic.

    `start` is when the mission began, ISO 8601 with its zone, such as 2026-05-01T09:00:00Z. The casualty is ATAK's 9-line
    marker; `how` says that a simulation made it. Raises InputError for a `start` that is no such time.
    """
    began = _moment(start)
    root = etree.Element("events")
    frame = outcome.scenario.frame
    for fate in outcome.fates:
        if fate.found is None:
            continue
        last = max(t for n in _TIMES if (t := getattr(fate, n)) is not None)
        lon, lat = frame.to_degrees(np.array(known_position(outcome, fate)))[0]
        sigma = _sigma(outcome, fate)
        event = _event(root, f"{outcome.scenario.name}.{fate.id}", "b-r-f-h-c", began, last, lon, lat, f"{sigma:.1f}")
        detail = etree.SubElement(event, "detail")
        etree.SubElement(detail, "contact", callsign=fate.id)
        colour = fate.category or fate.sort or fate.colour
        precedence = {_PRECEDENCE[colour]: "1"} if colour in _PRECEDENCE else {}
        walks = {"ambulatory" if colour == "green" else "litter": "1"}
        etree.SubElement(detail, "_medevac_", title=fate.id, casevac="true", **precedence, **walks)
        etree.SubElement(detail, "remarks").text = f"{colour} ({MEANING[colour]}), {_words(fate)}"
    kinds = [(outcome.team.ugvs, "a-f-G-E-V"), (outcome.team.uavs, "a-f-A-M-H-Q"), (outcome.team.medics, "a-f-G-U-C")]
    for names, kind in kinds:
        for name in names:
            time, x, y = outcome.run.tracks[name][-1]
            lon, lat = frame.to_degrees(np.array([x, y]))[0]
            event = _event(root, f"{outcome.scenario.name}.{name}", kind, began, float(time), lon, lat, _UNKNOWN)
            etree.SubElement(etree.SubElement(event, "detail"), "contact", callsign=name)
    document = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return bytes(document)


def known_position(outcome: Outcome, fate: Fate) -> tuple[float, float]:
    """Return where a casualty is by what is known at the end: where a medic saw it, else where a robot says it is."""
    if fate.reached is not None:
        return fate.x, fate.y
    return outcome.told.get(fate.id, (fate.x, fate.y))


def _sigma(outcome: Outcome, fate: Fate) -> float:
    return 0.0 if fate.reached is not None else outcome.settings.position_error


def _properties(outcome: Outcome, fate: Fate) -> dict[str, Any]:
    colour = fate.category or fate.sort or fate.colour
    seconds = {n: None if (t := getattr(fate, n)) is None else round(t, 3) for n in _TIMES}
    return {
        "state": fate.state,
        "colour": colour,
        "meaning": MEANING[colour],
        "sort": fate.sort,
        "confidence": outcome.settings.confidence,
        "category": fate.category,
        "uncertainty": _sigma(outcome, fate),
        **seconds,
        **{n: getattr(fate, n) for n in _BY},
        "marker-color": CASUALTY[colour],
    }


def _words(fate: Fate) -> str:
    if fate.category:
        return f"treated by {fate.treated_by}"
    return f"sorted by {fate.found_by}, not yet seen by a medic" if fate.sort else f"found by {fate.found_by}"


def _csv(columns: list[str], rows: Iterable[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _moment(text: str) -> datetime:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"start {text!r} is not a time; write it as 2026-05-01T09:00:00Z") from None
    if moment.tzinfo is None:
        raise InputError(f"start {text!r} has no zone; add Z for UTC, as 2026-05-01T09:00:00Z")
    return moment.astimezone(UTC)


def _event(root: Any, uid: str, kind: str, began: datetime, seconds: float, lon: float, lat: float, error: str) -> Any:
    moment = began + timedelta(seconds=seconds)
    event = etree.SubElement(
        root,
        "event",
        version="2.0",
        uid=uid,
        type=kind,
        how="m-s",
        time=_stamp(moment),
        start=_stamp(moment),
        stale=_stamp(moment + _STALE),
    )
    etree.SubElement(event, "point", lat=f"{lat:.9f}", lon=f"{lon:.9f}", hae=_UNKNOWN, ce=error, le=_UNKNOWN)
    return event


def _stamp(moment: datetime) -> str:
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{moment.microsecond // 1000:03d}Z"
