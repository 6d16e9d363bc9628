"""Reading a study, and the runs that it asks for."""

import math
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from quarterdeck.campaign.study import cases, read_study
from quarterdeck.geo.errors import InputError

Writer = Callable[[str], Path]


def test_every_combination_is_run_so_many_times(study: Writer) -> None:
    """Two speeds by three schedules by four runs; numbers count up, seeds repeat in each combination."""
    path = study(
        'runs = 4\nseed = 10\n[conditions]\nwind_speed = [0, 5]\nfaults = [[], ["ugv-1@5"], ["random:1"]]\ngusts = 1.5\n'
    )
    asked = read_study(path)
    got = list(cases(asked))
    assert asked.count == len(got) == 24
    assert [c.number for c in got] == list(range(24))
    assert [c.seed for c in got] == [10, 11, 12, 13] * 6
    assert {(c.levels["wind_speed"], c.faults) for c in got} == {
        (w, f) for w in (0.0, 5.0) for f in ((), ("ugv-1@5",), ("random:1",))
    }
    assert {c.gusts for c in got} == {1.5}


def test_combinations_are_compared_under_the_same_luck(study: Writer) -> None:
    """What is drawn is drawn for a run, not for a case: run r is alike in all combinations; and it repeats."""
    text = "runs = 5\n[conditions]\ngusts = [0, 1]\nwind_speed = { normal = [4, 3] }\nwind_from = { uniform = [0, 360] }\n"
    first, again = (list(cases(read_study(study(text)))) for _ in range(2))
    assert first == again
    assert [c.wind for c in first[:5]] == [c.wind for c in first[5:]]
    assert len({c.wind for c in first}) == 5
    other = list(cases(read_study(study(text.replace("runs", "seed = 1\nruns")))))
    assert [c.wind for c in other] != [c.wind for c in first]


def test_directions_are_a_sailors(study: Writer) -> None:
    """Wind comes from, current goes to: a westerly blows east, a current towards south flows south."""
    text = "runs = 1\n[conditions]\nwind_speed = 3\nwind_from = 270\ncurrent_speed = 0.5\ncurrent_towards = 180\n"
    (case,) = cases(read_study(study(text)))
    assert case.wind == pytest.approx((3.0, 0.0))
    assert case.current == pytest.approx((0.0, -0.5))


def test_drawn_speeds_are_never_negative(study: Writer) -> None:
    """A normal distribution about zero is cut there."""
    asked = read_study(study("runs = 50\n[conditions]\ngusts = { normal = [0, 1] }\n"))
    gusts = [c.gusts for c in cases(asked)]
    assert min(gusts) == 0
    assert max(gusts) > 0.5
    assert not any(math.copysign(1, g) < 0 for g in gusts)


def test_a_range_of_nothing_draws_its_one_value(study: Writer) -> None:
    """Minus zero is no less than zero."""
    (case,) = cases(read_study(study("runs = 1\n[conditions]\ncurrent_speed = { uniform = [0, -0.0] }\n")))
    assert case.current == (0.0, 0.0)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("runs = 0", "'runs' must be a whole number from 1"),
        ("run = 3", "did you mean 'runs'"),
        ("[conditions]\nwind = 3", "did you mean 'wind_"),
        ("[conditions]\nwind_speed = -3", "m/s, mean"),
        ("[conditions]\nwind_speed = 1" + "0" * 400, "m/s, mean"),
        ("[conditions]\nwind_speed = { uniform = [5, 1] }", "wrong way round"),
        ("[conditions]\nwind_speed = { poisson = [5, 1] }", "{ uniform = [low, high] }"),
        ("[conditions]\nfaults = 'ugv-1@5'", "list of texts"),
        ("[conditions]\nfaults = ['ugv-3@5']", "no vehicle 'ugv-3'"),
        ("[conditions]\nfaults = [[], ['gnss:ugv-3@5']]", "no vehicle 'ugv-3'"),
        ("[conditions]\ngnss = 'best'", "rtk, sbas, single"),
        ("[conditions]\nlidar = 'yes'", "true or false"),
        ("[conditions]\ngusts = []", "empty list"),
        ("[limits]\ncolisions = 1", "did you mean 'collisions'"),
        ("[limits]\ncross_track = 1" + "0" * 400, "must be numbers"),
        ("[conditions", "not valid TOML"),
    ],
)
def test_a_wrong_study_is_one_clear_line(study: Writer, text: str, told: str) -> None:
    """The line names the file and the key."""
    with pytest.raises(InputError) as error:
        read_study(study(text + "\n"))
    assert told in str(error.value)
    assert "study.toml" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_plan_is_one_clear_line(tmp_path: Path) -> None:
    """The plan is sought beside the study."""
    path = tmp_path / "study.toml"
    path.write_text('plan = "away.geojson"\n', encoding="utf-8")
    with pytest.raises(InputError, match="cannot be read"):
        read_study(path)


def test_what_the_results_depend_on_changes_the_hash(study: Writer) -> None:
    """Comments and spaces do not; a condition, a limit, the seed and the plan do."""
    base = read_study(study("runs = 3\n")).hash
    assert read_study(study("# a note\nruns   = 3\n")).hash == base
    for text in (
        "runs = 4\n",
        "runs = 3\nseed = 1\n",
        "runs = 3\n[conditions]\ngusts = 1\n",
        "runs = 3\n[limits]\ndelay = 2\n",
    ):
        assert read_study(study(text)).hash != base


def test_the_replay_says_all(study: Writer) -> None:
    """Every condition of the case stands in the command, to the last digit."""
    asked = read_study(
        study(
            "runs = 1\nseed = 3\n[conditions]\nwind_speed = 1\nwind_from = 33\ngusts = 0.5\nfaults = ['ugv-1@5']\n"
            "gnss = 'sbas'\namcl = true\n[limits]\ndelay = 3\n"
        )
    )
    (case,) = cases(asked)
    words = shlex.split(case.replay(str(asked.source), asked.limits))
    assert words[:2] == ["quarterdeck", "simulate"]
    assert f"--wind={case.wind[0]!r},{case.wind[1]!r}" in words
    for pair in (("--seed", "3"), ("--gusts", "0.5"), ("--fail", "ugv-1@5"), ("--gnss", "sbas"), ("--limit", "delay=3.0")):
        assert words[words.index(pair[0]) + 1] == pair[1]
    assert "--amcl" in words
    assert case.row()["wind_east"] == case.wind[0]


def test_the_documented_study_is_one(study: Writer) -> None:
    """The study that docs/campaign.md shows can be read, and asks for as many runs as is said there."""
    text = (Path(__file__).parents[2] / "docs" / "campaign.md").read_text(encoding="utf-8")
    shown = text.split("```toml\n")[1].split("```")[0].split("\n", 1)[1].replace("usv-2", "ugv-2")
    assert read_study(study(shown)).count == 3 * 3 * 2 * 100
