"""Sharing survey lines out among vehicles that are under way, so that all are done at about the same time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quarterdeck.geo.scenario import Vehicle

CLOSE = 1e-3  # of the level of finishing times: nearer to the least one than this is near enough


@dataclass(frozen=True, slots=True)
class Line:
    """A survey line: (n, 2) `points` in metres, `along` (n,) the metres up to each, `able` (k,) bool: who can get there."""

    points: np.ndarray
    along: np.ndarray
    able: np.ndarray

    @property
    def length(self) -> float:
        """Metres."""
        return float(self.along[-1])

    @property
    def backwards(self) -> "Line":
        """The same line from its other end."""
        return Line(self.points[::-1], self.along[-1] - self.along[::-1], self.able)

    def part(self, start: float, end: float) -> "Line":
        """Return the part between two distances along the line, in metres."""
        ends = np.array([[np.interp(at, self.along, c) for c in self.points.T] for at in (start, end)])
        inner = self.points[(self.along > start) & (self.along < end)]
        return line_of(np.vstack([ends[:1], inner, ends[1:]]), self.able)


def line_of(points: np.ndarray, able: np.ndarray) -> Line:
    """Return the line along (n, 2) points that the vehicles of `able` (k,) bool can get to."""
    points = np.asarray(points, dtype=float)
    return Line(points, np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))), able)


@dataclass(frozen=True, slots=True)
class Team:
    """k vehicles: `here` and `homes` (k, 2) metres (NaN: stays where its last line ends), `speeds` (k,) m/s between lines,
    `paces` (k,) seconds a metre of line, turns and all, `spent` (k,) seconds before its first line, `limits` (k,) seconds
    that it can be out.
    """

    here: np.ndarray
    homes: np.ndarray
    speeds: np.ndarray
    paces: np.ndarray
    spent: np.ndarray
    limits: np.ndarray

    def home(self, i: int, points: np.ndarray) -> np.ndarray:
        """Return the seconds home of vehicle i from (..., 2) places."""
        if np.isnan(self.homes[i, 0]):
            return np.zeros(np.shape(points)[:-1])
        away = points - self.homes[i]
        return np.asarray(np.hypot(away[..., 0], away[..., 1]) / self.speeds[i])


def team_of(vehicles: Sequence[Vehicle], paces: np.ndarray, spent: np.ndarray, limits: np.ndarray) -> Team:
    """Return vehicles that set out from their starts; `paces`, `spent` and `limits` (k,) as in `Team`."""
    homes = np.array([v.home if v.returns else (np.nan, np.nan) for v in vehicles])
    return Team(np.array([v.start for v in vehicles]), homes, np.array([v.speed for v in vehicles]), paces, spent, limits)


@dataclass(frozen=True, slots=True)
class Shares:
    """What each vehicle drives, in order, the seconds (k,) that it is out, by straight ways, and what nobody can do."""

    lines: list[list[Line]]
    times: np.ndarray
    left: list[Line]


def share_out(team: Team, own: Sequence[Sequence[Line]], released: Sequence[Line], *, crumb: float) -> Shares:
    """Return each vehicle's lines: its own in order, less what it gives away, then what it takes over.

    The least level of finishing times is sought, by bisection, at which what those above it give away, and the released
    lines, fit into the time of those below it. Nobody is out for longer than its limit; what does not fit is left. No piece
    is cut shorter than `crumb` metres.
    """
    prefixes = [_prefix(team, i, lines) for i, lines in enumerate(own)]
    most = _shared_at(np.inf, team, own, prefixes, released, crumb)
    if most.left:
        return most
    low, high = float(min(team.limits.max(), _least(team, own, released))), float(most.times.max())
    best = most
    while high - low > CLOSE * high:
        level = (low + high) / 2
        shared = _shared_at(level, team, own, prefixes, released, crumb)
        if shared.left or shared.times.max() > level * (1 + 1e-9):
            low = level
        else:
            best, high = shared, float(shared.times.max())
    return best


def times(team: Team, lines: Sequence[Sequence[Line]]) -> np.ndarray:
    """Return the (k,) seconds that vehicles are out if they drive these lines, by straight ways between them, and home."""
    ends = [own[-1].points[-1] if own else here for own, here in zip(lines, team.here, strict=True)]
    return np.array([_prefix(team, i, own)[-1] + team.home(i, ends[i]) for i, own in enumerate(lines)], dtype=float)


def _least(team: Team, own: Sequence[Sequence[Line]], released: Sequence[Line]) -> float:
    """Return seconds below which nothing can be: all work shared by all, without any way to it."""
    metres = sum(line.length for lines in [*own, released] for line in lines)
    return float((metres + (team.spent / team.paces).sum()) / (1 / team.paces).sum()) if metres else 0.0


def _prefix(team: Team, i: int, lines: Sequence[Line]) -> np.ndarray:
    """Return (n + 1,) seconds after which vehicle i has driven its first 0, 1, ... n lines."""
    if not lines:
        return np.array([team.spent[i]])
    firsts, lasts = np.array([x.points[0] for x in lines]), np.array([x.points[-1] for x in lines])
    ways = np.hypot(*(firsts - np.vstack([team.here[i], lasts[:-1]])).T) / team.speeds[i]
    drives = np.array([x.length for x in lines]) * team.paces[i]
    return np.asarray(team.spent[i] + np.append(0.0, np.cumsum(ways + drives)))


def _shared_at(
    level: float,
    team: Team,
    own: Sequence[Sequence[Line]],
    prefixes: Sequence[np.ndarray],
    released: Sequence[Line],
    crumb: float,
) -> Shares:
    """Return the lines such that, as far as can be, all is done within `level` seconds."""
    pool, lines, here, spent = list(released), [], team.here.copy(), team.spent.copy()
    levels = np.minimum(level, team.limits)
    for i, mine in enumerate(own):
        kept, given, spent[i] = _kept(team, i, mine, prefixes[i], levels[i], crumb)
        pool += given
        lines.append(kept)
        here[i] = kept[-1].points[-1] if kept else here[i]
    left = _taken(levels, team, lines, here, spent, pool, crumb)
    home = np.array([float(team.home(i, here[i])) for i in range(len(lines))])
    return Shares(lines, spent + home, left)


def _kept(
    team: Team, i: int, mine: Sequence[Line], prefix: np.ndarray, level: float, crumb: float
) -> tuple[list[Line], list[Line], float]:
    """Return what vehicle i does of its own lines within `level` seconds, what it gives away, and the seconds it takes."""
    if not mine:
        return [], [], float(prefix[0])
    done = prefix[1:] + team.home(i, np.array([line.points[-1] for line in mine]))
    over = np.flatnonzero(done > level)
    if not len(over):
        return list(mine), [], float(prefix[-1])
    first = int(over[0])
    line = mine[first]
    begun = prefix[first + 1] - line.length * team.paces[i]
    cut = _cut(team, i, line, level - begun, crumb)
    if cut == 0.0:
        return list(mine[:first]), list(mine[first:]), float(prefix[first])
    kept, rest = line.part(0.0, cut), line.part(cut, line.length)
    return [*mine[:first], kept], [rest, *mine[first + 1 :]], float(begun + cut * team.paces[i])


def _cut(team: Team, i: int, line: Line, room: float, crumb: float) -> float:
    """Return the metres of a line that vehicle i can drive and be home within `room` seconds; 0 if too few."""
    if line.length < 2 * crumb:
        return 0.0
    seconds = line.along * team.paces[i] + team.home(i, line.points)
    if seconds[0] > room:
        return 0.0
    at = int(np.argmax(seconds > room))
    low, high = line.along[at - 1], line.along[at]
    a, b = line.points[at - 1], line.points[at]
    while high - low > 0.01 * crumb:
        middle = (low + high) / 2
        place = a + (b - a) * (middle - line.along[at - 1]) / (line.along[at] - line.along[at - 1])
        if middle * team.paces[i] + float(team.home(i, place)) > room:
            high = middle
        else:
            low = middle
    cut = float(min(low, line.length - crumb))
    return cut if cut >= crumb else 0.0


def _taken(
    levels: np.ndarray,
    team: Team,
    lines: list[list[Line]],
    here: np.ndarray,
    spent: np.ndarray,
    pool: list[Line],
    crumb: float,
) -> list[Line]:
    """Move lines from the pool to vehicles that can do them within their levels; whoever is first done, the nearest to it.

    `lines`, `here` and `spent` are brought up to date. Returns what is left.
    """
    if not pool:
        return []
    k = len(lines)
    ends = np.array([[line.points[0], line.points[-1]] for line in pool])
    able = np.array([line.able for line in pool])
    lengths = np.array([line.length for line in pool])
    there = np.ones(len(pool), dtype=bool)
    busy = spent + np.array([float(team.home(i, here[i])) for i in range(k)])
    while there.any() and np.isfinite(busy).any():
        i = int(np.argmin(busy))
        mine = np.flatnonzero(there & able[:, i])
        way = np.hypot(ends[mine, :, 0] - here[i, 0], ends[mine, :, 1] - here[i, 1]) / team.speeds[i]
        drive = lengths[mine, None] * team.paces[i]
        done = spent[i] + way + drive + team.home(i, ends[mine][:, ::-1])
        fits = done <= levels[i]
        if fits.any():
            chosen, end = divmod(int(np.where(fits, way, np.inf).argmin()), 2)
            number = int(mine[chosen])
            nearer = way < way[chosen, end] - 1e-9
            partial = _first_cut(team, i, pool, mine, way, nearer, levels[i] - spent[i], crumb)
        else:
            number, end, nearer = -1, 0, np.ones_like(way, dtype=bool)
            partial = _first_cut(team, i, pool, mine, way, nearer, levels[i] - spent[i], crumb) if len(mine) else None
        if partial is not None:  # a nearer line fits in part: the last that it does
            number, end, cut = partial
            line = pool[number].backwards if end else pool[number]
            piece, pool[number] = line.part(0.0, cut), line.part(cut, line.length)
            ends[number] = pool[number].points[0], pool[number].points[-1]
            lengths[number] = pool[number].length
        elif number >= 0:
            piece = pool[number].backwards if end else pool[number]
            there[number] = False
        else:
            busy[i] = np.inf
            continue
        spent[i] += float(np.hypot(*(piece.points[0] - here[i]))) / team.speeds[i] + piece.length * team.paces[i]
        lines[i].append(piece)
        here[i] = piece.points[-1]
        busy[i] = np.inf if partial is not None else spent[i] + float(team.home(i, here[i]))
    return [line for line, left in zip(pool, there, strict=True) if left]


def _first_cut(
    team: Team,
    i: int,
    pool: Sequence[Line],
    mine: np.ndarray,
    way: np.ndarray,
    nearer: np.ndarray,
    room: float,
    crumb: float,
) -> tuple[int, int, float] | None:
    """Return the nearest line of which vehicle i can do a part: its number, which end first, how many metres; or None."""
    order = np.argsort(np.where(nearer, way, np.inf), axis=None, kind="stable")[: int(nearer.sum())]
    for flat in order[:4].tolist():
        chosen, end = divmod(flat, 2)
        line = pool[int(mine[chosen])]
        cut = _cut(team, i, line.backwards if end else line, room - way[chosen, end], crumb)
        if cut > 0.0:
            return int(mine[chosen]), end, cut
    return None
