import json
from pathlib import Path

import pytest
import shapely
from click.testing import CliRunner

from quarterdeck.cli.reproduce import command
from quarterdeck.reproduce.guard_maps import ROOM, random_room, read_map


def test_the_papers_claims_hold_in_our_room_but_for_lemma_1(tmp_path: Path) -> None:
    """Properties and theorems hold, one tree has no bridge as printed, and the picture is a PNG."""
    result = CliRunner().invoke(command, ["guards", "--json", "-o", str(tmp_path / "figures.png")])
    assert result.exit_code == 0, result.output
    claims = json.loads(result.output)["claims"][0]
    assert claims["property_1"]
    assert claims["orders_kept"] == claims["orders"] == 6
    assert claims["unseen"] < 1e-9 * ROOM.area
    assert claims["without_bridge_as_printed"] == 1
    assert (tmp_path / "figures.png").read_bytes().startswith(b"\x89PNG")


def test_random_rooms_are_valid_and_as_large_as_asked() -> None:
    """Rooms for the complexity table hang together and have about the vertices asked for."""
    for size in (100, 800):
        room = random_room(size, seed=1)
        assert room.is_valid
        assert len(shapely.get_coordinates(room)) == pytest.approx(size * 4 / 3, rel=0.2)  # rings repeat their first


def test_a_file_that_is_no_map_is_told(tmp_path: Path) -> None:
    """A text file is refused in one line."""
    path = tmp_path / "map.json"
    path.write_text("nothing")
    with pytest.raises(ValueError, match="not a map"):
        read_map(path)
