"""How far a triage mission has come, as a PLAN's parameters and a report's state keep it."""

from math import inf
from typing import Any

from shapely.errors import ShapelyError

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.typed import as_json, from_json
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.triage.records import Stand


def stand_document(stand: Stand) -> dict[str, Any]:
    """Return a stand as JSON can hold it, in metres of the plan's frame: in a PLAN's parameters and a report's state."""
    document: dict[str, Any] = as_json(stand)
    return document


def read_stand(document: Any, mission: Mission, place: str = "the PLAN") -> Stand:
    """Return the stand that `stand_document` has written. Raises InputError for anything else, or of another team."""
    try:
        stand: Stand = from_json(document, Stand)
        members = {v.id: v for v in (*mission.vehicles, *mission.lost)}
        ugvs = {i for i, v in members.items() if v.domain == "ground"} - {*mission.parameters["medics"]}
        if not (stand.memory.agents.keys() >= members.keys() and stand.paths.keys() >= ugvs) or not all(
            stand.paths.values()
        ):
            raise ValueError("somebody is missing")
        if not 0 <= stand.time < inf:
            raise ValueError("its time is no number of seconds")
    except (TypeError, KeyError, ValueError, IndexError, AttributeError, ArithmeticError, ShapelyError) as error:
        raise InputError(f"{place}: how far its triage has come is damaged ({str(error)[:80]}); make it anew") from None
    return stand
