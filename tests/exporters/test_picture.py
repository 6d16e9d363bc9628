"""The picture: it is there, of the size asked for, and shows what happened."""

import io
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure
from shapely import LineString, Point, box

from quarterdeck.exporters.picture import picture
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.scenario import Area, Casualty, Obstacle
from quarterdeck.mission.mission import Guard, Layer, undone_layer
from quarterdeck.physics.moments import Moment
from quarterdeck.physics.report import CrossTrack, Report, VehicleReport
from quarterdeck.physics.trace import COLUMNS, Trace


def pixels(png):
    image = pytest.importorskip("PIL.Image", reason="Pillow is not installed").open(io.BytesIO(png))
    return np.asarray(image.convert("RGB")).astype(int)


def near(image, colour):
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return int((np.abs(image - rgb).max(axis=2) < 30).sum())


@pytest.mark.parametrize("frame", [None, Frame(179.9995, 75.0)])
def test_every_vehicle_is_seen(make_fleet, frame):
    """Each colour of the fleet covers pixels of the map, whatever the place."""
    image = pixels(picture(make_fleet(4, frame), width=900, height=600))
    assert image.shape == (600, 900, 3)
    assert all(near(image, colour) > 100 for colour in ("#0072b2", "#d55e00", "#009e73", "#cc79a7"))


def test_a_mission_without_a_name_is_drawn(make_fleet):
    """A site may have an empty one."""
    assert pixels(picture(replace(make_fleet(1), name=""), width=300, height=200)).shape == (200, 300, 3)


def told(png_of, *args, **options):
    """Return the texts of the legend and of the map that a picture is drawn with."""
    chart, panel = drawn_by(png_of, *args, **options).axes
    written = [text.get_text() for text in (*chart.texts, *panel.texts)]
    return {text.get_text() for text in panel.get_legend().get_texts()}, written


def drawn_by(png_of, *args, **options):
    """Return the figure that a picture is drawn with."""
    figures = []
    original = Figure.savefig

    def keep(figure, *a, **k):
        figures.append(figure)
        return original(figure, *a, **k)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", keep)
        png_of(*args, **options)
    return figures[0]


def test_the_legend_has_what_is_drawn_and_nothing_else(make_fleet):
    """Layers, regions, casualties and kinds of obstacles that are there are told; what is not there is not."""
    line, area = LineString([(0, 0), (1, 1)]), box(0, 0, 9, 9)
    layers = (
        Layer("surveyed", (line,), ({"stroke": "#999999"},)),
        undone_layer([(area, "no energy left")]),
        Layer("region", (area,), ({"vehicle": "usv1"},)),
        Layer("line", (line,), ({"vehicle": "usv1"},)),
    )
    plain = make_fleet(1)
    common = {"survey", "transit, turn", "operating area", "area", "obstacle", "start"}
    assert told(picture, plain)[0] == common
    rich = replace(plain, layers=layers, casualties=(Casualty("c1", (50.0, 50.0), "red"),))
    assert told(picture, rich)[0] - common == {"surveyed", "undone", "region, by vehicle", "casualty: red (immediate)"}
    flat = tuple(replace(o, blocks=frozenset({"ground"})) for o in plain.site.obstacles)
    crossed = replace(plain, site=replace(plain.site, obstacles=flat))
    assert told(picture, crossed)[0] == common - {"obstacle"} | {"not covered, may be crossed"}


def test_what_a_plan_and_its_run_leave_undone_has_one_sign(make_fleet):
    """A plan that leaves something undone is followed by another that does."""
    mission = make_fleet(2)
    mission = replace(mission, layers=(undone_layer([(box(0, 0, 5, 5), "w")]),))
    legend = drawn_by(picture, mission, followed=mission).axes[1].get_legend()
    assert [text.get_text() for text in legend.get_texts()].count("undone") == 1


def test_a_run_is_not_drawn_over_the_plan_that_it_replaced(make_fleet):
    """Of a plan as told its first regions are not shown, nor of its run guards that nobody goes to."""
    mission, area = make_fleet(1), box(0, 0, 9, 9)
    mission = replace(mission, layers=(Layer("region", (area,), ({"vehicle": "usv1"},)),))
    guards = (Guard(5.0, 5.0, 9.0, "usv1", 0), Guard(30.0, 30.0, 9.0, None, None))
    assert "region, by vehicle" in told(picture, mission)[0]
    recovered = replace(mission, parameters={**mission.parameters, "told_at": [30.0]}, guards=guards)
    stands = {name: np.zeros((1, 1), kind) for name, kind in COLUMNS.items()}
    chart, panel = drawn_by(picture, recovered, Trace(vehicles=("usv1",), time=np.zeros(1), **stands)).axes
    assert "region, by vehicle" not in {text.get_text() for text in panel.get_legend().get_texts()}
    dots = {tuple(line.get_xydata()[0]) for line in chart.lines if line.get_zorder() == 6.5}
    assert dots == {(5.0, 5.0)}


def test_a_loss_hides_no_number_of_a_start(make_fleet):
    """Words beside a loss stand on a side where they cover no others."""
    plan = make_fleet(2)
    x, y = plan.vehicles[0].start
    chart = drawn_by(picture, plan, moments=(Moment(60.0, "usv1", "lost", x - 1.0, y + 6.0),)).axes[0]
    words, number = (next(t for t in chart.texts if t.get_text() == name) for name in ("usv1 lost 1:00", "1"))
    assert not words.get_window_extent().overlaps(number.get_window_extent())


def test_a_legend_has_no_sign_of_specks(make_fleet):
    """Of what is too small to see, or out of sight, there is none."""
    plan = make_fleet(1)
    small = Obstacle("wreck of usv9", Point(50.0, 50.0).buffer(0.01))
    far = replace(plan, site=replace(plan.site, obstacles=(*plan.site.obstacles, small)))
    far = replace(far, layers=(undone_layer([(box(1e5, 1e5, 1.1e5, 1.1e5), "w")]),))
    assert not {"wreck or find", "undone"} & told(picture, plan, followed=far)[0]


def test_a_legend_of_long_names_is_not_cut(make_fleet):
    """It stands within the picture, whatever layers are named, and lines beside it end above it."""
    names = ("what an addon of ours calls the part that is done first", "what it calls the part that is done in the end")
    layers = tuple(Layer(name, (box(0, 0, 9, 9),), ({"stroke": "#999999"},)) for name in names)
    moments = tuple(Moment(float(n), "usv1", "told", 1.0, 2.0) for n in range(100))
    figure = drawn_by(picture, replace(make_fleet(2), layers=layers), moments=moments)
    panel = figure.axes[1]
    box_of = panel.get_legend().get_window_extent()
    assert box_of.x1 <= figure.bbox.x1
    lines = [text for text in panel.texts if "lines more" in text.get_text()]
    assert len(lines) == 1
    assert lines[0].get_window_extent().y0 >= box_of.y1


def test_long_figures_stand_apart(make_fleet):
    """Of a row of the table no figure reaches into the one before, however far off its legs a vehicle was."""
    off = CrossTrack(1.0, 2985.43, 3000.0, 9)
    vehicles = tuple(
        VehicleReport(name, "surface", True, False, off, off, 0, (), 0.0, None, 0.0, "", None, 0.0, "", 1e5, time=136_168.0,
                      energy_planned=1e5, energy=98_000.0, length_planned=1e5, length=115_116.0)
        for name in ("usv1", "usv2")
    )  # fmt: skip
    report = Report("m", "0", {}, {}, {}, vehicles, (), "")
    panel = drawn_by(picture, make_fleet(2), report=report).axes[1]
    rows = {}
    for text in panel.texts:
        rows.setdefault(round(text.get_position()[1], 6), []).append(text)
    worst = [text.get_text() for text in panel.texts if text.get_weight() == "bold"]
    assert {"230", "2985"} <= {text.split(".")[0] for text in worst}
    ends = [[(t.get_window_extent(), t.get_text()) for t in row] for row in rows.values()]
    crowded = [(a, b) for row in ends for (one, a), (other, b) in pairwise(row) if one.x1 >= other.x0]
    assert not crowded


def test_areas_of_a_priority_have_their_names_on_the_map(make_fleet):
    """Of two areas each is named, with its priority."""
    plain = make_fleet(1)
    areas = (Area("berth", plain.site.areas[0].polygon, 2), Area("bay", plain.site.areas[0].polygon))
    signs, written = told(picture, replace(plain, site=replace(plain.site, areas=areas)))
    assert "area, its name" in signs
    assert {"berth, priority 2", "bay"} <= set(written)


def test_who_is_lost_and_who_takes_over_is_marked(make_fleet):
    """A loss and a new route have their marks with the time, a line beside the map, and what was kept clear of is drawn."""
    plan = make_fleet(2)
    moments = (Moment(300.0, "usv2", "lost", 50.0, 50.0), Moment(3930.0, "usv1", "told", 100.0, 20.0))
    wreck = Obstacle("wreck of usv2", Point(50.0, 50.0).buffer(5.0))
    followed = replace(plan, site=replace(plan.site, obstacles=(*plan.site.obstacles, wreck)))
    signs, written = told(picture, plan, moments=moments, followed=followed)
    assert {"lost: where and when", "told a new route, when", "wreck or find"} <= signs
    assert {"usv2 lost 5:00", "1:05:30", "usv2 lost", "usv1 told a new route"} <= set(written)
    signs, written = told(picture, replace(plan, lost=(replace(plan.vehicles[0], id="usv9"),)))
    assert "usv9 lost" in written
    assert "lost: where" in signs


def test_fifty_vehicles_fit(make_fleet):
    """Fifty vehicles make one picture and no warning, which tests take for an error."""
    assert picture(make_fleet(50))[:8] == b"\x89PNG\r\n\x1a\n"
