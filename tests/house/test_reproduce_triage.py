"""`quarterdeck reproduce triage`: the claims on few cases, the scripted figures, the statistics."""

import json

import numpy as np
import pytest

from quarterdeck.cli import main
from quarterdeck.mission.triage.scripted import laboratory_case, simulation_case
from quarterdeck.mission.triage.study import Variant, difference, mean_interval, run_case, run_study, share
from quarterdeck.reproduce.triage import check_claims, draw


def test_table_and_claims_of_forty_cases(capsys: pytest.CaptureFixture[str]) -> None:
    """Forty paired seeds are enough for every claim but the exact percentages."""
    with pytest.raises(SystemExit) as stop:
        main(["reproduce", "triage", "--cases", "40", "--jobs", "1", "--json"])
    result = json.loads(capsys.readouterr().out)
    assert stop.value.code == 0
    assert [c["holds"] for c in result["claims"]] == [True] * 7
    assert set(result["figures"]) == {"relay", "no relay", "must look", "no priority", "constant"}
    mean, low, high = result["figures"]["relay"]["red_wait"]
    assert low < mean < high


def test_a_claim_that_does_not_hold_is_told() -> None:
    """With relay and no priority exchanged, the claims about them fail."""
    variants = {n: Variant(n.replace(" ", "-")) for n in ("relay", "no relay", "no priority", "constant")}
    results = run_study(variants, range(20))
    results["relay"], results["no priority"] = results["no priority"], results["relay"]
    failed = [c["claim"] for c in check_claims(results) if not c["holds"]]
    assert any("score" in c for c in failed)
    assert any("red waiting" in c for c in failed)


def test_the_scripted_case_has_what_the_paper_tells_of_its() -> None:
    """5 red, 3 yellow, 3 green; the red at (10, 15) reaches the medic only after he has seen to the yellow at (55, 12)."""
    outcome = simulation_case().run()
    colours = [f.colour for f in outcome.fates]
    assert [colours.count(c) for c in ("red", "yellow", "green")] == [5, 3, 3]
    red = next(f for f in outcome.fates if (f.x, f.y) == (10.0, 15.0))
    yellow = next(f for f in outcome.fates if (f.x, f.y) == (55.0, 12.0))
    assert (red.colour, yellow.colour) == ("red", "yellow")
    assert red.delivered is not None
    assert yellow.treated is not None
    assert yellow.treated < red.delivered
    assert red.delivered_by == "uav1"


def test_the_laboratory_case_goes_as_fig_9() -> None:
    """UGV1 finds the first red; UGV2 one in the upper right while the medic walks to the upper left; reds first."""
    outcome = laboratory_case().run()
    f = {fate.id: fate for fate in outcome.fates}
    assert (f["r1"].found_by, f["r3"].found_by) == ("ugv1", "ugv2")
    assert f["r2"].delivered < f["r3"].found < f["r2"].reached  # type: ignore[operator]
    order = sorted(outcome.fates, key=lambda fate: fate.reached or 0.0)
    assert [fate.colour for fate in order] == ["red"] * 3 + ["yellow"] * 2 + ["green"]


def test_figures_6_to_9_are_drawn() -> None:
    """Four PNGs."""
    pictures = draw()
    assert sorted(pictures) == ["fig6.png", "fig7.png", "fig8.png", "fig9.png"]
    assert all(p[:4] == b"\x89PNG" for p in pictures.values())


def test_a_study_is_the_same_in_one_process_or_two_and_paired() -> None:
    """The order of the cases is that of the seeds, whatever ran them."""
    variants = {"a": Variant("relay"), "b": Variant("constant", ugvs=2, medics=2)}
    one, two = run_study(variants, range(30)), run_study(variants, range(30), jobs=2)
    for name, variant in variants.items():
        assert one[name]["seed"].tolist() == list(range(30))
        assert all(np.array_equal(one[name][k], two[name][k], equal_nan=True) for k in one[name])
        assert one[name]["time"][7] == run_case(variant, 7)["time"]


def test_intervals_cover_what_they_should() -> None:
    """Intervals of known samples: normal means, paired shifts, a share beside Wilson's published example."""
    rng = np.random.default_rng(1)
    sample = rng.normal(5.0, 2.0, 400)
    mean, low, high = mean_interval(sample)
    assert mean == pytest.approx(sample.mean())
    assert (high - low) / 2 == pytest.approx(1.96 * sample.std() / 20, rel=0.1)
    noise = rng.normal(0.0, 50.0, 200)
    shift, low, high = difference(noise + 1.0, noise)
    assert (shift, low, high) == pytest.approx((1.0, 1.0, 1.0))
    part, low, high = share(np.arange(10) < 5)
    assert (part, low, high) == pytest.approx((0.5, 0.2366, 0.7634), abs=1e-4)
    assert np.isnan(mean_interval(np.array([np.nan]))).all()
