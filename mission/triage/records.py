"""What each member of the team knows: the director's memory. Nothing passes between two records but in range."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

from shapely import MultiPolygon

from quarterdeck.mission.mission import Waypoint

XY = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Report:
    """A casualty as seen: `sort` is the colour that the sight gives (red, yellow, green), `by` and `at` who and when."""

    id: str
    x: float
    y: float
    sort: str
    by: str
    at: float


@dataclass(frozen=True, slots=True)
class Belief:
    """What somebody believes of a medic: at `time` he was at (`x`, `y`), busy for `busy` s, then walks through `stops`.

    A stop is (x, y, rank); he walks at `speed` and treats `treat` seconds at each.
    """

    time: float
    x: float
    y: float
    speed: float
    treat: float
    busy: float = 0.0
    stops: tuple[tuple[float, float, int], ...] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """What is known of a UGV's section: at `time` it was searched up to waypoint `rest` of its path (-1: all of it).

    `by` searches it, and was, or left it, at `place`.
    """

    time: float
    rest: int
    place: XY
    by: str


@dataclass(frozen=True, slots=True)
class Ugv:
    """`reports` no medic is known to have yet; `told`: those of them told undeliverable; `around`: urgent, not visited yet.

    It searches the path of `section`; `rest` is the first waypoint not reached when it left the path at `left`; `gathered`
    counts N. `board`, here as with all others: what is known of the sections, by name.
    """

    section: str
    board: Mapping[str, Section]

    state: str = "explore"
    moving: bool = False
    reports: tuple[Report, ...] = ()
    told: frozenset[str] = frozenset()
    known: frozenset[str] = frozenset()
    around: tuple[Report, ...] = ()
    gathered: int = 0
    rest: int = 0
    left: XY | None = None
    searched: bool = False
    relay_lost: bool = False
    sweeps: int = 0
    unreachable: frozenset[str] = frozenset()
    beliefs: Mapping[str, Belief] | None = None


@dataclass(frozen=True, slots=True)
class Uav:
    """`load`: (report, medic it is meant for). `closed`: ids that a medic has. `home` is the index of its rendezvous.

    `target` is the medic or, in a round robin, the UGV it flies to; `visits` where each UGV was on its path, and when.
    """

    board: Mapping[str, Section]

    state: str = "return"
    moving: bool = False
    load: tuple[tuple[Report, str], ...] = ()
    closed: frozenset[str] = frozenset()
    told: frozenset[str] = frozenset()
    target: str = ""
    sweeps: int = 0
    unreachable: frozenset[str] = frozenset()
    beliefs: Mapping[str, Belief] | None = None
    visits: Mapping[str, tuple[float, int, XY]] | None = None
    misses: Mapping[str, int] | None = None


@dataclass(frozen=True, slots=True)
class Medic:
    """`queue` in the order of treatment, the first being walked to or treated, in treatment until `treat_until`.

    `examined` is the category of whom he has seen, `walked` metres since the start, `last` where he last set out,
    `looked` how often he has searched around where the first of his queue should be, `called` the UGVs he has walked to.
    """

    board: Mapping[str, Section]

    state: str = "idle"
    moving: bool = False
    queue: tuple[Report, ...] = ()
    known: frozenset[str] = frozenset()
    treated: tuple[str, ...] = ()
    heading_for: str = ""
    treat_until: float = 0.0
    helpers: int = 0
    walked: float = 0.0
    looked: int = 0
    last: XY = (0.0, 0.0)
    examined: Mapping[str, str] | None = None
    called: frozenset[str] = frozenset()


Record = Ugv | Uav | Medic


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the log. `what`: found, handed, delivered, treatment, treated, undeliverable, lost, heard again, searched,
    takes over, turns home, state.
    """

    time: float
    who: str
    what: str
    about: str
    x: float
    y: float
    whom: str = ""


@dataclass(frozen=True, slots=True)
class Memory:
    """All that the director keeps: records by id, who is `out` of the mission, whose devices are `mute`, `tags` on
    casualties in treatment or treated (seen on the spot), log; `look`, the seconds at which each robot looks at its battery
    again, and `wake`, when the director is to be called for it.
    """

    agents: Mapping[str, Record]
    out: frozenset[str] = frozenset()
    mute: frozenset[str] = frozenset()
    tags: frozenset[str] = frozenset()
    log: tuple[Entry, ...] = ()
    look: Mapping[str, float] = field(default_factory=dict)
    wake: float = inf


@dataclass(frozen=True, slots=True)
class Stand:
    """How far a mission has come `time` seconds after it began: what the director has in mind, as of then.

    `left` is what remains of each member's command, `paths` what each UGV searches, `homes` where UAVs hover and from which
    second on, `depots` as in a team; `seen` is what of the field UGVs have seen, `gone` are members that are not there any
    more, with where they were last, `shared_out` when the search was divided as it is.
    """

    time: float
    memory: Memory
    left: Mapping[str, tuple[Waypoint, ...]]
    paths: Mapping[str, tuple[XY, ...]]
    homes: Mapping[str, tuple[tuple[float, XY], ...]]
    depots: tuple[XY, ...]
    seen: MultiPolygon
    gone: Mapping[str, XY]
    shared_out: float
