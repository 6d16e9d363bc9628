"""Vehicle files: what a planner cannot do without is asked for."""

from pathlib import Path

import pytest

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.models import load_model, model_names

VEHICLES = Path(__file__).parents[2] / "data" / "vehicles"


@pytest.mark.parametrize("line", ["", "climb_rate = 0\n"])
def test_an_aerial_vehicle_climbs(tmp_path, line):
    """Without a climb rate it would never be up: the file is refused."""
    lines = (VEHICLES / "survey-quad.toml").read_text(encoding="utf-8").splitlines(keepends=True)
    path = tmp_path / "still.toml"
    path.write_text("".join(line if text.startswith("climb_rate") else text for text in lines), encoding="utf-8")
    with pytest.raises(InputError, match="climb_rate"):
        load_model(str(path))


def test_who_turns_on_the_spot_has_room_to() -> None:
    """A hull that keeps its clearance touches nothing whichever way it points."""
    for name in model_names():
        model = load_model(name)
        if model.domain == "ground" and model.turn_radius == 0:
            assert model.clearance >= (model.length**2 + model.width**2) ** 0.5 / 2, name
