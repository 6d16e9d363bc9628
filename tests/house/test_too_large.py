"""What is larger than the tool can hold is refused at once, in one line, with what would work."""

import re
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path

import pytest

from quarterdeck.cli import main
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.travel import travel

DATA = Path(__file__).parents[2] / "data"
CASES = {
    "stc": ["plan", "west_ant_island", "--method", "stc", "--spacing", "0.5"],
    "lines": ["plan", "west_ant_island", "--method", "lines", "--spacing", "0.5"],
    "guards": ["plan", "west_ant_island", "--method", "guards", "--range", "0.5"],
    "map": ["assign", "inspection_hall", "--resolution", "0.001"],
    "triage": ["triage", "triage_drill", "--spacing", "0.01"],
}


@pytest.mark.parametrize("case", ["stc", "lines", "guards", "map", "triage"])
def test_too_fine_is_refused_with_what_works(case, tmp_path, capsys):
    """A spacing, range or resolution that makes too much costs little, and is told with the way out."""
    verb, site, *options = CASES[case]
    if case == "triage":  # its site may give the spacing itself
        text = (DATA / f"{site}.geojson").read_text()
        path = tmp_path / "site.geojson"
        path.write_text(re.sub(r'"role": "area"', '"role": "area", "spacing": 0.01', text))
    else:
        path = DATA / f"{site}.geojson"
    start = time.process_time()
    tracemalloc.start()
    with pytest.raises(SystemExit) as stop:
        main([verb, str(path), *options, "-o", str(tmp_path / "out.geojson")])
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert stop.value.code == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert len(told.err.strip().splitlines()) == 1
    assert re.search(r"at least [\d.e+-]+ m works|give a longer range", told.err), told.err
    assert not (tmp_path / "out.geojson").exists()
    assert time.process_time() - start < 20
    assert most < 500e6


def test_too_many_tasks_are_refused_with_what_works(monkeypatch, capsys, tmp_path):
    """The ways between all pairs are counted before any is looked for; as many tasks as are told are taken."""
    monkeypatch.setattr("quarterdeck.mission.travel.MOST_BYTES", 20_000)
    scenario = read_scenario(str(DATA / "inspection_hall.geojson"))
    assert travel(replace(scenario, tasks=scenario.tasks[:4]), quick=True).seconds.shape[1] == 4
    with pytest.raises(InputError, match="too many to hold"):
        travel(replace(scenario, tasks=scenario.tasks[:5]), quick=True)
    command = ["assign", str(DATA / "inspection_hall.geojson"), "--iterations", "1", "-o", str(tmp_path / "plan.geojson")]
    with pytest.raises(SystemExit) as stop:
        main(command)
    assert stop.value.code == 2
    assert "too many to hold; at most 4 tasks work" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("words", [["simulate", ""], ["plan", "x", "--terrain", ""]])
def test_an_empty_path_is_refused(words, capsys):
    """It would be the folder that one is in."""
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    assert "no path" in capsys.readouterr().err
