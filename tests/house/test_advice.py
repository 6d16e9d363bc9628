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


def spaced(spacing):
    """Return the change that gives areas another spacing."""
    return lambda features: [f["properties"].update(spacing=spacing) for f in features if f["properties"]["role"] == "area"]


@pytest.mark.parametrize(
    ("site", "change", "place"),
    [
        ("dalian_harbour", no_spacing, "features[0] ('harbour'): "),
        ("dalian_harbour", spaced(0.01), "features[0] ('harbour'): "),
        ("dalian_harbour", spaced(450), "features[0] ('harbour'): "),
        ("dalian_harbour", without("vehicle"), ""),
        ("west_ant_island", lambda features: features[-1]["properties"].update(share=0.5), ""),
    ],
)
def test_what_plan_refuses_is_a_problem(capsys, tmp_path, site, change, place):
    """`check` says, in one line that names the area, what `plan` says when it refuses the site."""
    status, out, _ = checked(capsys, tmp_path, site, change)
    _, _, refusal = checked(capsys, tmp_path, site, change, "plan", "-o", "/dev/null")
    assert status == 2
    assert out == place + refusal.splitlines()[-1].removeprefix("quarterdeck: ") + "\n"


def test_what_assign_refuses_is_a_problem(capsys, tmp_path):
    """Each task that nobody can do is named, not the first alone."""

    def change(features):
        for f in features:
            if f["properties"]["role"] == "task":
                f["properties"]["needs"] = ["drill"]

    status, out, _ = checked(capsys, tmp_path, "inspection_hall", change)
    assert status == 2
    assert out.count("needs drill; no vehicle is and can") == 5


def test_tasks_in_a_circle_are_a_problem(capsys, tmp_path):
    """Two tasks that wait for each other are named before anything is assigned."""

    def change(features):
        first, second = [f for f in features if f["properties"]["role"] == "task"][:2]
        first["properties"]["after"], second["properties"]["after"] = [second["id"]], [first["id"]]

    status, out, _ = checked(capsys, tmp_path, "inspection_hall", change)
    assert status == 2
    assert "tasks wait for each other in a circle" in out


def test_guards_need_no_spacing(capsys, tmp_path):
    """Where all vehicles have a range the site can be planned as it is, by guards: that is a note."""

    def change(features):
        no_spacing(features)
        features[-1]["properties"]["range"] = 20

    status, out, err = checked(capsys, tmp_path, "dalian_harbour", change)
    assert (status, out) == (0, "")
    assert "note: `plan` will need --method guards, or more: no spacing" in err


@pytest.mark.parametrize(
    ("site", "role", "words"),
    [
        ("dalian_harbour", "vehicle", 'no feature has the role "vehicle"'),
        ("inspection_hall", "vehicle", 'no feature has the role "vehicle"'),
        ("triage_drill", "medic", "no medic"),
        ("triage_drill", "vehicle", "no UGV"),
    ],
)
def test_what_a_verb_cannot_do_without_is_a_problem(capsys, tmp_path, site, role, words):
    """A site that nothing can plan is not passed."""
    status, out, _ = checked(capsys, tmp_path, site, without(role))
    assert status == 2
    assert words in out


def test_the_field_of_a_drill_can_be_planned(capsys, tmp_path):
    """Triage is only one of two uses of a field with vehicles and a spacing."""

    def change(features):
        spaced(3)(features)
        without("medic")(features)

    status, out, err = checked(capsys, tmp_path, "triage_drill", change)
    assert (status, out) == (0, "")
    assert "note: `triage` will need more: no medic" in err


def test_a_fault_hides_no_other(capsys, tmp_path):
    """A misspelt property, a wrong model and an open ring are all told, whoever has them; nothing that follows is."""

    def change(features):
        v1, v2, area = (next(f for f in features if f["id"] == i) for i in ("usv-1", "usv-2", "survey"))
        v1["properties"] |= {"modell": "otter", "model": "titanic", "domain": "sea", "sensor": {"kind": "camera"}}
        v2["properties"] |= {"speed": 99, "end": [200, 0]}
        features.append({**v2, "id": "uav", "properties": {"role": "vehicle", "domain": "arial", "speed": 12}})
        area["geometry"]["coordinates"][0].pop()

    _, out, _ = checked(capsys, tmp_path, "west_ant_island", change)
    words = ("unknown property 'modell'", "ground, aerial, not 'sea'", "unknown vehicle model 'titanic'",
             "speed 99 m/s exceeds", "end: longitude 200", "is not closed", "did you mean 'aerial'?")  # fmt: skip
    assert [sum(word in line for line in out.splitlines()) for word in words] == [1] * len(words)
    assert len(out.splitlines()) == len(words)


@pytest.mark.parametrize("verb", [("check",), ("plan", "--spacing", "80", "-o", "/dev/null")])
def test_a_vehicle_far_off_without_a_fence_is_told(capsys, tmp_path, verb):
    """A slip of the longitude is told before the boat drives there; with a fence it is what was drawn."""
    _, _, err = checked(capsys, tmp_path, "dalian_harbour", far, *verb)
    assert "starts 16.9 km from what is to be done, which is 701 m across" in err
