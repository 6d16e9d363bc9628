"""What a file is that was given where another was wanted: its kind, and the verbs that take it."""

import json
import tomllib
from collections.abc import Mapping
from typing import Any

HEADS = (
    (b"\x89PNG", "a picture; no verb takes it"),
    (b"RRF2", "a recording: open it with `rerun`; no verb of ours takes it"),
    (b"QGC WPL", "an autopilot's mission; give the PLAN that it was exported from"),
    (b"\xa3\x95", "a log of ArduPilot; `report --track` and `replan --track` take it"),
)
PLAN = "a PLAN; `check`, `simulate`, `export`, `replan`, `report` and `replay --site` take it"
FATES = "what became of casualties, made by `triage`; `replay --site` takes it"
CHANGES = "a file of changes; `replan --changes` takes it"
SITE = "a site; `check`, `plan`, `assign` and `triage` take it"
COLLECTIONS = (PLAN, FATES, CHANGES, SITE)
SITE_ROLES = {"area", "task", "casualty"}
REPORT = "a report; `replay` and `replan --state` take it"
STUDY = "a study; `campaign` takes it"
MODEL = "a vehicle model; the `model` of a site's vehicle names it"
TRACE = "a trace of `simulate`; `report --track` and `replan --track` take it"
CELL = "an ENC cell; `chart` makes a site of it"


def kind_of(data: bytes) -> str | None:
    """Return what the file is that has these bytes, in words that say who takes it; None where it is none of ours."""
    for head, words in HEADS:
        if data.startswith(head):
            return words
    if data.startswith(b"PK") and b".npy" in data[:100]:
        return TRACE
    if data[:5].isdigit() and data[6:7] == b"L":  # the leader of ISO 8211
        return CELL
    try:
        text = data.decode("utf-8-sig")
        return kind_of_json(json.loads(text)) if text.lstrip()[:1] in ("{", "[") else _kind_of_toml(tomllib.loads(text))
    except (ValueError, RecursionError):
        return None


def kind_of_json(document: Any) -> str | None:
    """Return what a JSON document is, as `kind_of` does."""
    if not isinstance(document, dict):
        return None
    if document.get("type") == "quarterdeck-report":
        return REPORT
    features = document.get("features")
    found = [f.get("properties") for f in features if isinstance(f, dict)] if isinstance(features, list) else []
    given = [p for p in found if isinstance(p, dict)]
    roles = [p["role"] for p in given if isinstance(p.get("role"), str)]
    if "plan" in roles or "triage" in roles:
        return PLAN if "plan" in roles else FATES
    if any(p.get("change") is not None for p in given):
        return CHANGES
    return SITE if SITE_ROLES & set(roles) else None


def _kind_of_toml(document: Mapping[str, Any]) -> str | None:
    if document.keys() & {"runs", "plan", "triage"}:
        return STUDY
    return MODEL if {"name", "domain"} <= document.keys() else None
