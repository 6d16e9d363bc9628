"""The colours of vehicles, sites and casualties, the same in every file and picture."""

import re
from collections.abc import Iterable
from itertools import cycle, islice

# Okabe and Ito's colours, which the colour-blind tell apart; black is kept for text and yellow is too pale for a line.
_FIRST = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
_BESIDE_CASUALTIES = ("#0072b2", "#cc79a7", "#56b4e9", "#4b1d73", "#6b4c00")  # none that a casualty has
# The others are each as far as can be from all before it, in CIELAB, as seen with and without red-green blindness.
_OTHERS = (
    "#0000ff", "#443311", "#112299", "#cc33ff", "#aabb66", "#770066", "#cc0044", "#884400", "#1100bb", "#337777", "#772244",
    "#114499", "#aa77ee", "#ff8899", "#11bbcc", "#226633", "#8833cc", "#aa8844", "#775588", "#0044ff", "#119900", "#ff9944",
    "#3377ff", "#bb44bb", "#bb0066", "#66aa66", "#551177", "#996655", "#00ccaa", "#334477", "#884499", "#990022", "#ddaa88",
    "#88aaff", "#ff77cc", "#0044dd", "#66cc44", "#bb77cc", "#776622", "#4422bb", "#ee00dd", "#009999", "#1100dd", "#7744bb",
)  # fmt: skip

SITE = {"operating": "#555555", "area": "#5b7f99", "obstacle": "#444444"}  # of borders; fills are the same, let through
FILL = {"operating": 0.0, "area": 0.1, "obstacle": 0.4}  # opacity
TASK = "#666666"
# Triage's own colours, in tints that differ in brightness too.
CASUALTY = {"red": "#d7191c", "yellow": "#f2c200", "green": "#009e73", "grey": "#b0b0b0", "black": "#000000"}


def colours(count: int, *, casualties: bool = False) -> list[str]:
    """Return `count` colours as #rrggbb: five or six that all can tell apart, then fifty in all before one comes again.

    Where there are `casualties`, the first are none of theirs.
    """
    return list(islice(cycle((*(_BESIDE_CASUALTIES if casualties else _FIRST), *_OTHERS)), count))


def colours_of(names: Iterable[str], *, casualties: bool = False) -> dict[str, str]:
    """Return a colour for each vehicle by name; in the names' order, numbers in them by size, so that all files agree."""
    ordered = sorted(
        sorted(set(names)), key=lambda name: [int(p) if p.isdecimal() else p for p in re.split(r"(\d+)", name)]
    )
    return dict(zip(ordered, colours(len(ordered), casualties=casualties), strict=True))
