"""Triage as a study: the same journal, tables and summary as a plan's."""

import contextlib
import io
import json
import math
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ttest_1samp, ttest_rel

from quarterdeck.campaign.execute import run_case
from quarterdeck.campaign.study import cases, read_study
from quarterdeck.cli import main
from quarterdeck.geo.errors import InputError
from quarterdeck.mission.triage import study as triage

TEXT = 'runs = 6\nseed = 3\n[triage]\nmethod = ["relay", "constant"]\ncasualties = [3, 5]\n'


def write(folder: Path, text: str) -> Path:
    """Write a study file."""
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def call(*args: object) -> int:
    """Run the command line and return its exit status."""
    with pytest.raises(SystemExit) as stop:
        main([*map(str, args)])
    return int(stop.value.code or 0)


def test_a_triage_campaign_is_the_study_with_its_journal_and_intervals(tmp_path: Path) -> None:
    """Cut short and gone on with, by processes, its rows are run_case's; means and paired differences are scipy's t."""
    path, folder = write(tmp_path, TEXT), tmp_path / "runs"
    assert call("campaign", path, "-o", folder, "--jobs", 1) == 0
    journal = (folder / "runs.jsonl").read_bytes().splitlines(keepends=True)
    table = (folder / "runs.csv").read_bytes()
    (folder / "runs.jsonl").write_bytes(b"".join(journal[:9]) + b'{"number":1')
    assert call("campaign", path, "-o", folder, "--jobs", 2) == 0
    assert (folder / "runs.csv").read_bytes() == table
    assert (folder / "runs.jsonl").read_bytes().splitlines(keepends=True)[:9] == journal[:9]

    variants = {m: triage.Variant(m, casualties=(3, 5)) for m in ("relay", "constant")}
    wanted = {m: [triage.run_case(v, seed) for seed in range(3, 9)] for m, v in variants.items()}
    rows = [json.loads(line) for line in journal[1:]]
    assert [r["time"] for r in sorted(rows, key=lambda r: r["number"])] == [c["time"] for w in wanted.values() for c in w]
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["passed"] == summary["asked"] == 12
    relay, constant = summary["levels"]
    assert "differences" not in relay
    for name in ("ugv_distance", "red_wait"):
        a, b = (np.array([c[name] for c in w]) for w in wanted.values())
        a_has = a[np.isfinite(a)]
        low, high = ttest_1samp(a_has, 0.0).confidence_interval(0.95)
        assert relay["means"][name] == pytest.approx([a_has.mean(), low, high])
        both = np.isfinite(a) & np.isfinite(b)
        low, high = ttest_rel(b[both], a[both]).confidence_interval(0.95)
        assert constant["differences"][name] == pytest.approx([(b - a)[both].mean(), low, high])


def test_conditions_reach_the_mission_and_the_replay(tmp_path: Path, capsys) -> None:
    """On a site, drawn and listed conditions change the figures; the replayed commands give those of the row again."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert call("triage", "--generate", 1, "--team", 2, 1, 1, "--field", 40, 30) == 0
    (tmp_path / "site.geojson").write_text(out.getvalue(), encoding="utf-8")
    text = 'runs = 2\n[triage]\nsite = "site.geojson"\ntreat = [5, 60]\ntalk = { uniform = [2, 4] }\ncasualties = [3, 3]\n'
    asked = read_study(write(tmp_path, text))
    every = list(cases(asked))
    rows = [run_case(asked.text, case, {}) for case in every]
    assert [r["error"] for r in rows] == [""] * 4
    assert [r["talk"] for r in rows[:2]] == [r["talk"] for r in rows[2:]]
    assert rows[2]["time"] > rows[0]["time"]
    make, run = (shlex.split(w)[1:] for w in every[3].replay(str(asked.source), asked.limits).split(" | "))
    made, again = tmp_path / "case.geojson", tmp_path / "again.geojson"
    assert call(*make, "-o", made) == 0
    capsys.readouterr()
    assert call(*[made if w == "-" else w for w in run], "-o", again, "--json") == 0
    (figures,) = (v["figures"] for v in json.loads(capsys.readouterr().err).values())
    for name in ("time", "ugv_distance", "score"):
        assert math.isclose(figures[name], rows[3][name], rel_tol=1e-6), name


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("methods = ['relay']", "did you mean 'method'"),
        ("method = ['relay', 'radio']", "no-priority"),
        ("ugvs = 0", "whole number from 1"),
        ("talk = [2, 0]", "triage.talk must be a number above 0"),
        ("casualties = [9, 3]", "[fewest, most]"),
        ("talk = { normal = [2] }", "triage.talk must be a value"),
        ("site = 'site.geojson'\nugvs = 2", "triage.ugvs cannot be given with a site"),
        ("treat = 5\n[limits]\ndelay = 3", "unknown key limits"),
    ],
)
def test_a_wrong_triage_study_is_one_clear_line(tmp_path: Path, text: str, told: str) -> None:
    """The line names the file and the key."""
    with pytest.raises(InputError) as error:
        read_study(write(tmp_path, f"[triage]\n{text}\n"))
    assert told in str(error.value)
    assert "study.toml" in str(error.value)
    assert "\n" not in str(error.value)


def test_the_example_is_the_four_methods() -> None:
    """The study in examples/ can be read."""
    assert read_study(Path(__file__).parents[2] / "examples" / "triage.toml").count == 4 * 300
