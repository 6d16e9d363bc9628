"""What `check` and `plan` say of a site that is sound, and lacks something or may not be meant."""

import json
from pathlib import Path

import pytest

from quarterdeck.cli import main

DATA = Path(__file__).parents[2] / "data"


def checked(capsys, tmp_path, site, change, *verb):
    """Return exit status, standard output and standard error of `check`, or another verb, for a changed sample."""
    document = json.loads((DATA / f"{site}.geojson").read_text(encoding="utf-8"))
    change(document["features"])
    path = tmp_path / "site.geojson"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(SystemExit) as stop:
        main([*(verb or ["check"]), str(path)])
    told = capsys.readouterr()
    return stop.value.code or 0, told.out, told.err


def without(*roles):
    """Return the change that takes out features of these roles."""
    return lambda features: features.__setitem__(slice(None), [f for f in features if f["properties"]["role"] not in roles])


def no_spacing(features):
    """Take out what says the spacing."""
    for f in features:
        f["properties"].pop("spacing", None)
        f["properties"].pop("sensor", None)


def far(features):
    """Move the vehicles away by 0.2 degrees, and take out the fence."""
    without("operating")(features)
    for f in features:
        if f["properties"]["role"] == "vehicle":
            f["geometry"]["coordinates"][0] += 0.2


@pytest.mark.parametrize("site", [p.stem for p in sorted(DATA.glob("*.geojson"))])
def test_samples_need_no_advice(capsys, tmp_path, site):
    """Nothing is said of a sample."""
    status, out, err = checked(capsys, tmp_path, site, lambda _: None)
    assert (status, out, len(err.splitlines())) == (0, "", 1)


def test_a_site_without_spacing_can_be_planned_with_the_option(capsys, tmp_path):
    """That is a note, no problem."""
    status, out, err = checked(capsys, tmp_path, "dalian_harbour", no_spacing)
    assert (status, out) == (0, "")
    assert "note: no spacing: `plan` will need --spacing" in err


@pytest.mark.parametrize(
    ("site", "role", "words"),
    [
        ("dalian_harbour", "vehicle", "no vehicle"),
        ("inspection_hall", "vehicle", "no vehicle"),
        ("triage_drill", "medic", "no medic"),
        ("triage_drill", "vehicle", "no UGV"),
    ],
)
def test_what_no_option_makes_up_for_is_a_problem(capsys, tmp_path, site, role, words):
    """A site that nothing can plan is not passed; triage is only one of two uses of a field with vehicles."""
    status, out, err = checked(capsys, tmp_path, site, without(role))
    if (site, role) == ("triage_drill", "medic"):
        assert status == 0
        assert f"note: `triage` will need more: {words}" in err
    else:
        assert status == 2
        assert words in out


@pytest.mark.parametrize("verb", [("check",), ("plan", "--spacing", "80", "-o", "/dev/null")])
def test_a_vehicle_far_off_without_a_fence_is_told(capsys, tmp_path, verb):
    """A slip of the longitude is told before the boat drives there; with a fence it is what was drawn."""
    _, _, err = checked(capsys, tmp_path, "dalian_harbour", far, *verb)
    assert "starts 16.9 km from what is to be done, which is 701 m across" in err
