"""What is printed of a run: its table on a terminal of 80 columns."""

from types import SimpleNamespace

from quarterdeck.cli.verdict import print_report
from quarterdeck.physics.report import CrossTrack, Report, VehicleReport


def test_long_figures_fold_no_short_name(capsys, monkeypatch):
    """However wide the figures are, `vehicle` and names of few letters stand in one line, and no figure is cut."""
    monkeypatch.setenv("COLUMNS", "80")
    off = CrossTrack(1.0, 2276.1, 3000.0, 9)
    ran = VehicleReport("usv-1", "surface", True, False, off, off, 0, (), 0.0, 14.8, 0.0, "", 18.9, 0.0, "", 13_717.0,
                        time=37_710.0, energy_planned=686.0, energy=1910.0, length_planned=1e5, length=1e5)  # fmt: skip
    figures = dict.fromkeys(("coverage_planned", "tasks_planned", "lost", "localisation_p95"))
    figures |= {"legs_p95": 2276.1, "collisions": 0, "finished": 1}
    mission = SimpleNamespace(name="West Ant Island", spacing=None)
    print_report(mission, Report("m", "0", {}, {}, figures, (ran,), (), ""))
    said = capsys.readouterr().err.split()
    assert {"vehicle", "usv-1", "10:28:30", "+174.9", "1,910", "+178.4", "2276.10", "14.8", "18.9"} <= set(said)
