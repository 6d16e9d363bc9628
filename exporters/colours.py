"""One colour for each vehicle, the same in every format."""

import colorsys

# Okabe and Ito's colours, which the colour-blind tell apart; black is kept for text and yellow is too pale for a line.
_FIRST = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
_GOLDEN = 0.6180339887498949


def colours(count: int) -> list[str]:
    """Return `count` colours as #rrggbb: six that all can tell apart, then hues far from their neighbours."""
    return [_FIRST[i] if i < len(_FIRST) else _spread(i) for i in range(count)]


def _spread(i: int) -> str:
    rgb = colorsys.hls_to_rgb((i * _GOLDEN) % 1.0, (0.38, 0.52, 0.30)[i % 3], (0.85, 0.65, 0.60)[i % 3])
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)
