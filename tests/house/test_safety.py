"""What is made of hostile names and files: nothing outside its folder, nothing that steers a terminal, no entity grown."""

import json
from pathlib import Path

import pytest
from fuzzing.samples import small_site
from lxml import etree

from quarterdeck.cli import main

NAMES = [
    "../../evil",
    "/etc/evil",
    "a\0b",
    "\u202eevil",
    "\x1b[31mred",
    "x" * 5000,
    "..",
    "",
    "CON",
    "<script>",
    "]]>",
    "v\n1",
]
FORMATS = "csv,geojson,gpx,html,kml,kmz,moos,nav2,qgc-plan,qgc-wpl,qgis,rtz"


def call(*words: object) -> int:
    """Return the exit status of the command line."""
    with pytest.raises(SystemExit) as stop:
        main([str(w) for w in words])
    assert isinstance(stop.value.code, int)
    return stop.value.code


@pytest.mark.parametrize("name", NAMES)
def test_names_go_nowhere(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A vehicle of any name is exported into the folder alone, in files that are read again, and shown as text."""
    folder = tmp_path / "a" / "b" / "c"
    folder.mkdir(parents=True)
    site = json.loads(small_site("surface"))
    for feature in site["features"]:
        if feature["properties"].get("id") == "v1":
            feature["properties"]["id"] = name
    (folder / "site.geojson").write_text(json.dumps(site | {"name": name}), encoding="utf-8")
    plan = folder / "plan.geojson"
    assert call("plan", folder / "site.geojson", "--method", "stc", "--placement", "none", "-o", plan) in (0, 1)
    assert call("export", plan, "--to", FORMATS, "-o", folder / "out", "--unsafe") == 0
    found = {path for path in tmp_path.rglob("*") if path.is_file()} - {plan, folder / "site.geojson"}
    assert all(folder / "out" in path.parents for path in found)
    for path in found:
        if path.suffix in (".kml", ".gpx", ".rtz", ".qgs"):
            etree.fromstring(path.read_bytes())
        assert path.suffix != ".html" or b"<script>: " not in path.read_bytes()
    told = capsys.readouterr()
    assert not {c for c in told.err if not c.isprintable()} - {"\n"}


def test_a_number_that_is_none_is_told_as_such(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is wrong with a site is said, not what a site is good for."""
    path = tmp_path / "site.geojson"
    for damage, words in ((b"NaN", "NaN is no number"), (b'"\\ud800"', "surrogate")):
        path.write_bytes(small_site().replace(b"5.0", damage, 1))
        assert call("plan", path, "-o", tmp_path / "plan.geojson") == 2
        assert words in capsys.readouterr().err
    assert not (tmp_path / "plan.geojson").exists()


LAUGHS = '<!ENTITY l0 "lol">' + "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))


@pytest.mark.parametrize("doctype", [LAUGHS, '<!ENTITY l11 SYSTEM "file:///etc/passwd">'])
def test_entities_of_gpx_logs_stay_what_they_are(doctype: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither does a billion laughs grow, nor is another file read: the log is of a vehicle that the plan has not."""
    site, plan = tmp_path / "site.geojson", tmp_path / "plan.geojson"
    site.write_bytes(small_site())
    assert call("plan", site, "--method", "stc", "--placement", "none", "-o", plan) in (0, 1)
    points = "".join(f'<trkpt lat="54" lon="10"><time>2026-05-01T09:00:{t:02}Z</time></trkpt>' for t in range(5))
    log = tmp_path / "log.gpx"
    log.write_text(f"<!DOCTYPE gpx [{doctype}]><gpx><trk><name>&l11;</name><trkseg>{points}</trkseg></trk></gpx>")
    assert call("report", plan, "--track", log) == 2
    said = capsys.readouterr().err
    assert len(said) < 2000
    assert "root:" not in said
