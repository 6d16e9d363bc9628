"""Writing a site and reading it back."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quarterdeck.geo.models import load_model
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.writer import UNLIMITED, site_text

DATA = sorted((Path(__file__).parents[2] / "data").glob("*.geojson"))


@pytest.mark.parametrize("path", DATA, ids=lambda p: p.stem)
def test_a_written_site_reads_as_the_one_it_was(path: Path, tmp_path: Path) -> None:
    """Shapes and positions come back within a millimetre, vehicles and names exactly; writing again changes no byte."""
    first = read_scenario(path)
    (tmp_path / "site.geojson").write_text(site_text(first), encoding="utf-8")
    second = read_scenario(tmp_path / "site.geojson")
    assert first.site.area.symmetric_difference(second.site.area).area <= 1e-3 * first.site.area.length
    assert [o.id for o in first.site.obstacles] == [o.id for o in second.site.obstacles]
    for a, b in zip(first.vehicles, second.vehicles, strict=True):
        assert np.hypot(*np.subtract(a.start, b.start)) < 1e-3
        assert (a.id, a.model.name, a.speed, a.clearance, a.share, a.can) == (
            b.id,
            b.model.name,
            b.speed,
            b.clearance,
            b.share,
            b.can,
        )
    for a, b in zip([*first.tasks, *first.casualties], [*second.tasks, *second.casualties], strict=True):
        assert np.hypot(*np.subtract(a.position, b.position)) < 1e-3
    assert [(c.id, c.colour) for c in first.casualties] == [(c.id, c.colour) for c in second.casualties]
    assert [replace(t, position=(0.0, 0.0)) for t in first.tasks] == [replace(t, position=(0.0, 0.0)) for t in second.tasks]
    assert site_text(second) == site_text(first)


def test_a_users_model_and_open_ends_are_kept(tmp_path: Path) -> None:
    """A vehicle file goes out as its path, a window's start without an end and an unlimited battery as numbers."""
    own = tmp_path / "my2.toml"
    text = (DATA[0].parent / "vehicles" / "husky.toml").read_text(encoding="utf-8")
    own.write_text(text.replace('name = "husky"', 'name = "mine"'), encoding="utf-8")
    hall = read_scenario(DATA[0].parent / "inspection_hall.geojson")
    vehicle = replace(hall.vehicles[0], model=load_model(str(own)), battery=math.inf)
    task = replace(hall.tasks[0], window=(10.0, math.inf))
    site = replace(hall, vehicles=(vehicle, *hall.vehicles[1:]), tasks=(task, *hall.tasks[1:]))
    (tmp_path / "site.geojson").write_text(site_text(site), encoding="utf-8")
    back = read_scenario(tmp_path / "site.geojson")
    assert back.vehicles[0].model == vehicle.model
    assert back.vehicles[0].battery == UNLIMITED
    assert back.tasks[0].window == (10.0, UNLIMITED)
