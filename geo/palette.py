"""The colours of vehicles, sites and casualties, the same in every file and picture."""

import colorsys

# Okabe and Ito's colours, which the colour-blind tell apart; black is kept for text and yellow is too pale for a line.
_FIRST = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
_GOLDEN = 0.6180339887498949

SITE = {"operating": "#555555", "area": "#5b7f99", "obstacle": "#444444"}  # of borders; fills are the same, let through
FILL = {"operating": 0.0, "area": 0.1, "obstacle": 0.4}  # opacity
TASK = "#666666"
# Triage's own colours, in tints that differ in brightness too.
CASUALTY = {"red": "#d7191c", "yellow": "#f2c200", "green": "#009e73", "grey": "#7f7f7f", "black": "#000000"}


def colours(count: int) -> list[str]:
    """Return `count` colours as #rrggbb: six that all can tell apart, then hues far from their neighbours."""
    return [_FIRST[i] if i < len(_FIRST) else _spread(i) for i in range(count)]


def _spread(i: int) -> str:
    rgb = colorsys.hls_to_rgb((i * _GOLDEN) % 1.0, (0.38, 0.52, 0.30)[i % 3], (0.85, 0.65, 0.60)[i % 3])
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)
