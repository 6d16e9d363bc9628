"""Writing a site and reading it back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.writer import site_text

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
    assert [(c.id, c.colour) for c in first.casualties] == [(c.id, c.colour) for c in second.casualties]
    assert [replace(t, position=(0.0, 0.0)) for t in first.tasks] == [replace(t, position=(0.0, 0.0)) for t in second.tasks]
    assert site_text(second) == site_text(first)
