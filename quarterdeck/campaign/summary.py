"""What a campaign proves: the probability of success and the figures with their confidence, why runs failed, the worst."""

import csv
import io
import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from quarterdeck.campaign.kind import BETWEEN, Case
from quarterdeck.campaign.study import Study
from quarterdeck.geo.version import VERSION


def wilson(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the interval of the probability of success (Wilson 1927); (0, 1) without any run."""
    from scipy.special import ndtri

    if not runs:
        return 0.0, 1.0
    z = float(ndtri(0.5 + confidence / 2))
    p, square = successes / runs, z * z / runs
    middle = (p + square / 2) / (1 + square)
    half = z * math.sqrt(p * (1 - p) / runs + square / (4 * runs)) / (1 + square)
    return max(0.0, middle - half), min(1.0, middle + half)


def mean_interval(values: Sequence[float]) -> tuple[float, float | None, float | None] | None:
    """Return the mean and its 95 % interval (Student's t), which one value does not have; None without any.

    In closed form, since a campaign may have a million runs.
    """
    from scipy.special import stdtrit

    if not len(values):
        return None
    sample = np.array(values, dtype=float)
    mean, n = float(sample.mean()), len(sample)
    if n < 2:
        return mean, None, None
    half = float(stdtrit(n - 1, 0.975) * sample.std(ddof=1) / math.sqrt(n))
    return mean, mean - half, mean + half


def summarise(study: Study, cases: Sequence[Case], rows: Mapping[int, Mapping[str, Any]], worst: int = 5) -> dict[str, Any]:
    """Return the campaign's figures: for all runs and for each combination of levels, and the `worst` runs with their
    replay.
    """
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for case in cases:
        if case.number in rows:
            groups.setdefault(json.dumps(case.levels), []).append(rows[case.number])
    first: Sequence[Mapping[str, Any]] = next(iter(groups.values()), [])
    names = study.kind.figures
    done = [row for case in cases if (row := rows.get(case.number)) is not None]
    by_number = {case.number: case for case in cases}
    return {
        "version": VERSION,
        "study": str(study.path),
        "study_hash": study.hash,
        "seed": study.seed,
        "source": None if study.source is None else str(study.source),
        "mission": study.name,
        "asked": study.count,
        **_success(done),
        "levels": [
            {"levels": json.loads(name), **_success(group), "means": _means(group, names)}
            | ({"differences": _differences(group, first, names)} if group is not first else {})
            for name, group in groups.items()
        ]
        if study.levels
        else [],
        "reasons": dict(Counter(kind for row in done for kind in sorted(kinds(row))).most_common()),
        "means": _means(done, names),
        "figures": {name: spread for name in names if (spread := _spread(done, name))},
        "worst": [
            {
                "number": row["number"],
                "passed": row["passed"],
                "reasons": row["error"] or row["reasons"],
                "trace_hash": row.get("trace_hash", ""),
                "replay": by_number[row["number"]].replay(str(study.source or ""), study.limits),
            }
            for row in sorted(done, key=badness)[:worst]
        ],
    }


def badness(row: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return a key by which the worst run sorts first: errors, failures by number of reasons, less coverage, less room,
    longer.
    """

    def low(name: str) -> float:
        value = row.get(name)
        return math.inf if value is None else value

    reasons = row["reasons"].count(BETWEEN) + 1 if row["reasons"] else 0
    return (
        not row["error"],
        row["passed"],
        -reasons,
        low("coverage_driven"),
        low("clearance"),
        -(row.get("time") or 0),
        row["number"],
    )


def as_csv(rows: Mapping[int, Mapping[str, Any]]) -> str:
    """Return the rows as CSV, in the order of their numbers: the same runs give the same bytes."""
    out = io.StringIO()
    writer = csv.DictWriter(out, columns(rows), restval="", lineterminator="\n")
    writer.writeheader()
    for number in sorted(rows):
        writer.writerow({k: "" if v is None else v for k, v in rows[number].items()})
    return out.getvalue()


def as_parquet(rows: Mapping[int, Mapping[str, Any]]) -> bytes | None:
    """Return the rows as Parquet, in the order of their numbers, or None where pyarrow is absent."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        return None
    ordered = [rows[number] for number in sorted(rows)]
    table = pa.table({name: [row.get(name) for row in ordered] for name in columns(rows)})
    out = pa.BufferOutputStream()
    parquet.write_table(table, out)
    return bytes(out.getvalue())


def columns(rows: Mapping[int, Mapping[str, Any]]) -> list[str]:
    """Return the names of all columns, in the order in which they first appear; a row with an error has fewer."""
    return list(dict.fromkeys(name for number in sorted(rows) for name in rows[number]))


def _success(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    passed = sum(bool(row["passed"]) for row in rows)
    low, high = wilson(passed, len(rows))
    return {
        "runs": len(rows),
        "passed": passed,
        "errors": sum(bool(row["error"]) for row in rows),
        "probability": passed / len(rows) if rows else None,
        "low": low,
        "high": high,
    }


def _means(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> dict[str, Any]:
    """Return the mean of each figure with its interval, over the runs that have it."""
    found = {name: mean_interval([row[name] for row in rows if row.get(name) is not None]) for name in names}
    return {name: interval for name, interval in found.items() if interval}


def _differences(
    rows: Sequence[Mapping[str, Any]], first: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> dict[str, Any]:
    """Return by how much each figure is above that of the first combination, run by run of the same seed."""
    other = {row["seed"]: row for row in first}
    pairs = [(row, other[row["seed"]]) for row in rows if row["seed"] in other]
    found = {
        name: mean_interval([a[name] - b[name] for a, b in pairs if a.get(name) is not None and b.get(name) is not None])
        for name in names
    }
    return {name: interval for name, interval in found.items() if interval}


def kinds(row: Mapping[str, Any]) -> set[str]:
    """Return the reasons of a run without names and figures, so that they can be counted."""
    if row["error"]:
        return {"error"}
    found = set()
    for reason in filter(None, row["reasons"].split(BETWEEN)):
        text = re.sub(r"^\S+: (?!.*did not finish)", "", reason) if not reason.startswith("collision") else "collision"
        found.add(re.split(r":| up to|\s*\(?-?\d", text)[0].strip() or reason)
    return found


def _spread(rows: Sequence[Mapping[str, Any]], name: str) -> dict[str, float] | None:
    values = [row[name] for row in rows if row.get(name) is not None]
    if not values:
        return None
    low, middle, high = np.percentile(np.array(values, dtype=float), [5, 50, 95]).tolist()
    return {"p5": low, "median": middle, "p95": high, "least": float(min(values)), "most": float(max(values))}
