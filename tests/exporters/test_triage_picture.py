"""Pictures of triage: nothing is cut, the legend has what is drawn, colours are those of all other files."""

from functools import cache
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from quarterdeck.exporters.triage_picture import field_legend, looks, map_png, snapshots_png
from quarterdeck.exporters.triage_timeline import timeline_png
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.layers import fleet_colours
from quarterdeck.mission.triage.outcome import run_triage
from quarterdeck.mission.triage.plan import plan_triage
from quarterdeck.mission.world import Fault

DRILL = Path(__file__).parents[2] / "data" / "triage_drill.geojson"


@cache
def failed():
    """Return the drill in which a UGV is lost after a minute."""
    return run_triage(read_scenario(DRILL), faults=[Fault("ugv1", 60.0)])


@pytest.mark.parametrize("draw", [map_png, timeline_png, snapshots_png])
def test_no_text_is_cut(draw, monkeypatch):
    """Every text of a picture is within what is saved of the figure."""
    saved = []
    original = Figure.savefig

    def keep(figure, *args, **options):
        saved.append((figure, options))
        return original(figure, *args, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    draw(failed())
    [(figure, options)] = saved
    box = figure.get_tightbbox() if options.get("bbox_inches") == "tight" else figure.bbox_inches
    children = [text for ax in figure.axes for text in (ax.xaxis.label, ax.yaxis.label, *ax.get_children())]
    for text in (t for t in children if isinstance(t, Text) and t.get_text()):
        seen = text.get_window_extent().transformed(figure.dpi_scale_trans.inverted())
        assert seen.x0 >= box.x0 - 0.01, text
        assert seen.y0 >= box.y0 - 0.01, text
        assert seen.x1 <= box.x1 + 0.01, text
        assert seen.y1 <= box.y1 + 0.01, text


def test_a_member_has_one_colour_in_the_plan_and_in_the_pictures():
    """The field's colours are those of the PLAN, and so of its export, page and recording."""
    members = {name: colour for name, (colour, _) in looks(failed()).items()}
    assert members == fleet_colours(plan_triage(read_scenario(DRILL)))


def test_the_legend_is_of_the_moment():
    """At first nobody is lost, found or treated; in the end nobody is left to be found."""
    first, last = ({h.get_label() for h in field_legend(failed(), [time])} for time in (0.0, failed().end))
    assert "not found yet" in first
    assert not {"lost", "treated", "a medic knows"} & first
    assert {"lost", "treated", "a medic knows", "black (dead)", "obstacle"} <= last
    assert not {"not found yet", "searched"} & last
