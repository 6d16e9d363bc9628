"""A triage mission from now on: how far it has come, what is different, and what everybody does next."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf

import numpy as np
import shapely
from shapely import MultiPolygon, Point, union_all
from shapely.ops import nearest_points

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Scenario, as_multipolygon
from quarterdeck.mission.changes import Changes
from quarterdeck.mission.director import State
from quarterdeck.mission.mission import Layer, Mission, Route, Waypoint
from quarterdeck.mission.progress import Progress
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.timing import commanded_route, shortfalls
from quarterdeck.mission.triage import medic, uav, ugv
from quarterdeck.mission.triage.desk import Desk
from quarterdeck.mission.triage.outcome import run_members
from quarterdeck.mission.triage.plan import scenario_of, settings_of, team_at, team_of
from quarterdeck.mission.triage.records import XY, Belief, Entry, Medic, Memory, Record, Section, Stand, Uav, Ugv
from quarterdeck.mission.triage.search import Search, search_paths
from quarterdeck.mission.triage.settings import METHODS
from quarterdeck.mission.triage.sight import seen_by
from quarterdeck.mission.triage.stand import stand_document
from quarterdeck.mission.triage.team import field_of, ways_in
from quarterdeck.mission.world import Fault

_ROOM = {Ugv: ugv, Uav: uav, Medic: medic}
_THINNED = 0.05  # m that a track may lose where it is kept with fewer corners
_WORTH = 1.0  # m2: less of the field is not searched for


def planned_stand(mission: Mission, time: float, *, stopped: Mapping[str, float] | None = None) -> Progress:
    """Return the progress at `time` by the fast world, except that members in `stopped` did nothing from then on.

    Raises InputError if a member in `stopped` is unknown.
    """
    known = [v.id for v in mission.vehicles]
    for name in stopped or {}:
        if name not in known:
            raise InputError(f"unknown vehicle {name!r}; the plan has {', '.join(known)}")
    team, settings = team_of(mission), settings_of(mission)
    method, scenario = mission.parameters["method"], scenario_of(mission)
    faults = [Fault(name, since) for name, since in (stopped or {}).items() if since < time]
    run = run_members(scenario, team, method, settings, seed=mission.seed, faults=faults, until=time)
    return progress_of(mission, time, run.states, run.left, run.memory, run.tracks)


def progress_of(
    mission: Mission,
    time: float,
    states: Mapping[str, State],
    left: Mapping[str, tuple[Waypoint, ...]],
    memory: Memory,
    tracks: Mapping[str, np.ndarray],
) -> Progress:
    """Return the progress of a run, in whichever world, that has come to `time`.

    `states` and `left` are how everybody stands and what of his command is left to do, `tracks` (n, 3) seconds, x, y.
    """
    team = team_of(mission)
    agents, left = dict(memory.agents), dict(left)
    for name, record in agents.items():
        if isinstance(record, Ugv) and record.state == "explore" and name in states:
            agents[name] = replace(record, rest=record.rest + states[name].reached)
        if isinstance(record, Medic) and record.state == "treat" and left.get(name):
            hold = max(0.0, record.treat_until - team.began - time)
            left[name] = (replace(left[name][0], hold=hold), *left[name][1:])
    stand = Stand(
        team.began + time,
        replace(memory, agents=agents, wake=inf),
        {name: tuple(replace(w, time=w.time and w.time + team.began) for w in rest) for name, rest in left.items()},
        {name: tuple((w.x, w.y) for w in robot.path) for name, robot in team.ugvs.items()},
        {name: robot.home for name, robot in team.uavs.items()},
        team.depots,
        seen_by(team, {name: track + np.array([team.began, 0.0, 0.0]) for name, track in tracks.items()}, surely=True),
        dict(team.gone) | {name: (s.x, s.y) for name, s in states.items() if not s.alive},
        team.stand.shared_out if team.stand else 0.0,
    )
    return Progress(
        time,
        {name: (s.x, s.y, s.z if name in team.uavs else 0.0) for name, s in states.items()},
        {name: s.energy_used for name, s in states.items()},
        tuple(
            shapely.get_coordinates(shapely.simplify(shapely.LineString(tracks[name][:, 1:]), _THINNED))
            for name in team.ugvs
            if name in tracks and len(tracks[name]) > 1
        ),
        stand=stand,
    )


def triage_from_now(mission: Mission, scenario: Scenario, progress: Progress, changes: Changes, *, seed: int) -> Mission:
    """Return a triage mission from now on; `scenario` has the site and the vehicles that go on, where they are.

    What everybody knows, has found, told and treated stays so, and what was seen of the field need not be seen again. Where
    the site or who searches it is different, the UGVs that go on share out what is left; what only a lost one had found is
    searched for again, and whom only a lost medic was told of, another is told of. Without changes everybody goes on with
    what he was about to do.

    Raises InputError if it is not known how far the mission has come, or no medic is left.
    """
    stand = progress.stand
    if stand is None:
        raise InputError("tracks do not tell who was found, told of and treated; give --at, or the --state of `simulate`")
    vehicles = scenario.vehicles
    working = {v.id for v in vehicles}
    medics = [*mission.parameters["medics"], *sorted(changes.medics)]
    if not working & {*medics}:
        raise InputError(f"medic {medics[0]!r} is lost and no other is left to treat anybody; add one of role medic")
    lost = tuple(v for v in (*mission.vehicles, *mission.lost) if v.id not in working)
    now = replace(
        mission,
        site=scenario.site,
        vehicles=vehicles,
        lost=lost,
        parameters=dict(mission.parameters) | {"medics": medics},
        seed=seed,
    )
    reasons: list[Reason] = []
    if changes:
        stand, missed, reasons = _changed(now, mission, stand, progress, changes)
        now = replace(now, parameters=dict(now.parameters) | {"missed": missed})
    routes = tuple(_route(now, v.id, progress, stand) for v in vehicles)
    reasons += [line for v, r in zip(vehicles, routes, strict=True) for line in shortfalls(v, r)]
    if (missed := now.parameters["missed"]) > 0:
        reasons.append(Reason(f"{missed:,.0f} m2 of the field cannot be seen from where the UGVs can go"))
    return replace(
        now,
        parameters=dict(now.parameters) | {"stand": stand_document(stand)},
        routes=routes,
        figures={
            "length": sum(r.length for r in routes),
            "makespan": max(r.duration for r in routes),
            "energy": sum(r.energy for r in routes),
        },
        layers=(Layer("searched", (stand.seen,), ({"fill": "#9ecae1", "fill-opacity": 0.3, "stroke": "#9ecae1"},)),),
        reasons=tuple(reasons),
    )


def _route(mission: Mission, name: str, progress: Progress, stand: Stand) -> Route:
    """Return what is left of a member's command as a route."""
    vehicle, left = mission.vehicle(name), stand.left.get(name, ())
    here = (*vehicle.start, progress.positions[name][2] if name in progress.positions else 0.0)
    return commanded_route(vehicle, here, [replace(w, task=None) for w in left])


def _changed(
    now: Mission, before: Mission, stand: Stand, progress: Progress, changes: Changes
) -> tuple[Stand, float, list[Reason]]:
    """Return the stand after changes, what of the field cannot be seen from then on, and what cannot be done."""
    here = {v.id: v.start for v in (*now.vehicles, *now.lost)} | {v: p[:2] for v, p in progress.positions.items()}
    here |= {v.id: v.start for v in now.vehicles}
    gone = {v.id: here[v.id] for v in now.lost}
    memory = stand.memory
    out, back = frozenset(memory.out - changes.back.keys() | gone.keys()), frozenset(changes.back)
    memory = replace(memory, out=out, mute=memory.mute - back)
    site_differs = changes.obstacles or changes.gone or changes.areas or changes.withdrawn or changes.operating.area
    homes, depots = stand.homes, stand.depots
    if site_differs:  # nobody can meet inside an obstacle
        ground = _room(now)
        homes = {u: tuple((t, _nearest(ground, xy)) for t, xy in places) for u, places in homes.items()}
        depots = tuple(_nearest(ground, xy) for xy in depots)
    paths = {v: stand.paths.get(v, (here[v],)) for v in _ugvs(now)}
    stand = replace(stand, memory=memory, gone=gone, homes=homes, depots=depots, paths=paths, left={})
    team = team_at(now, stand)
    agents = _joined(now, stand, {m: here[m] for m in team.medics})
    missed, reasons = float(before.parameters["missed"]), list[Reason]()
    if site_differs or _seekers(now) != _seekers(before):
        seekers = [u for u in team.ugvs if u not in gone and agents[u].state != "home"]
        seen = _seen_for_sure(stand, agents, gone, {u: r.sees for u, r in team.ugvs.items()})
        stand = replace(stand, seen=seen)
        search = _search(now, seen, [here[u] for u in seekers], min(r.sees for r in team.ugvs.values()))
        if search is None:
            left = field_of(scenario_of(now)).difference(seen).area
            reasons.append(Reason(f"{left:,.0f} m2 of the field are not searched, and no UGV is left to do it"))
        else:
            missed = search.missed
            divided = {u: tuple(map(tuple, p.tolist())) for u, p in zip(seekers, search.paths, strict=True)}
            paths = {u: divided.get(u, (here[u],)) for u in team.ugvs}
            log = (*memory.log, *(Entry(stand.time, u, "shared out", u, *here[u]) for u in team.ugvs if u not in divided))
            stand = replace(stand, paths=paths, shared_out=stand.time, memory=replace(memory, log=log))
            agents = _anew(agents, stand, divided)
    stand = replace(stand, memory=replace(stand.memory, agents=agents, look={}))
    return _restarted(now, stand, here), missed, reasons


def _ugvs(mission: Mission) -> set[str]:
    medics = mission.parameters["medics"]
    return {v.id for v in (*mission.vehicles, *mission.lost) if v.domain == "ground" and v.id not in medics}


def _room(mission: Mission) -> MultiPolygon:
    """Return where UGVs may be."""
    everybody = {v.id: v.clearance for v in (*mission.vehicles, *mission.lost)}
    return mission.site.navigable("ground", max(everybody[u] for u in _ugvs(mission)))


def _seekers(mission: Mission) -> set[str]:
    return _ugvs(mission) - {v.id for v in mission.lost}


def _nearest(room: MultiPolygon, place: XY) -> XY:
    near = nearest_points(room, Point(place))[0]
    return (float(near.x), float(near.y)) if not room.covers(Point(place)) else place


def _joined(now: Mission, stand: Stand, medics: Mapping[str, XY]) -> dict[str, Record]:
    """Return everybody's records, with those of who joins; all know of lost and new medics, and of their speeds."""
    settings, agents = settings_of(now), dict(stand.memory.agents)
    board = next(iter(agents.values())).board
    speeds = {v.id: v.speed for v in now.vehicles if v.id in medics}
    fresh = {
        m: Belief(stand.time, *xy, speeds.get(m, settings.medic_speed), settings.treat["red"]) for m, xy in medics.items()
    }
    for vehicle in now.vehicles:
        if vehicle.id in agents:
            continue
        if vehicle.id in medics:
            agents[vehicle.id] = Medic(board, last=vehicle.start)
        elif vehicle.domain == "aerial":
            agents[vehicle.id] = Uav(board, beliefs=fresh, visits={}, misses={})
        else:
            agents[vehicle.id] = Ugv(vehicle.id, board, beliefs=fresh)
    for name, record in agents.items():
        if isinstance(record, Medic):
            continue
        known = {**fresh, **(record.beliefs or {})}
        beliefs = {m: replace(known[m], speed=speeds.get(m, known[m].speed)) for m in fresh}
        agents[name] = replace(record, beliefs=beliefs, unreachable=frozenset(stand.gone.keys() & {*medics}))
    uavs = {name for name, record in agents.items() if isinstance(record, Uav)}
    if uavs and uavs <= stand.gone.keys():  # nobody waits for whom all know to be lost
        agents = {n: replace(r, relay_lost=True) if isinstance(r, Ugv) else r for n, r in agents.items()}
    order = (Ugv, Uav, Medic)
    return dict(sorted(agents.items(), key=lambda item: order.index(type(item[1]))))


def _seen_for_sure(
    stand: Stand, agents: Mapping[str, Record], gone: Mapping[str, XY], sees: Mapping[str, float]
) -> MultiPolygon:
    """Return what was seen, but for where somebody lies of whom only those knew who are gone."""
    known: set[str] = set()
    for name, record in agents.items():
        if name not in gone:
            known |= record.known if isinstance(record, Medic) else {*()}
            known |= {r.id for r in record.reports} if isinstance(record, Ugv) else {*()}
            known |= {r.id for r, _ in record.load} | record.closed if isinstance(record, Uav) else {*()}
    forgotten = [
        Point(r.x, r.y).buffer(sees[name])
        for name, record in agents.items()
        if name in gone and isinstance(record, Ugv)
        for r in record.reports
        if r.id not in known
    ]
    return as_multipolygon(stand.seen.difference(union_all(forgotten)))


def _search(now: Mission, seen: MultiPolygon, starts: list[XY], sees: float) -> Search | None:
    """Return how UGVs at `starts` search what of the field is not seen yet; None if there are none and much is left."""
    left = as_multipolygon(field_of(scenario_of(now)).difference(seen))
    if not starts:
        return Search((), 0.0) if left.area < _WORTH else None
    ground = _room(now)
    spacing = now.spacing or settings_of(now).spacing
    return search_paths(left, ground, tuple(starts), spacing, sees, ways_in(ground), rest=True)


def _anew(agents: Mapping[str, Record], stand: Stand, divided: Mapping[str, tuple[XY, ...]]) -> dict[str, Record]:
    """Return everybody's records after the search was shared out: whoever searches sets out for his new section."""
    time = stand.time
    board = {
        u: Section(time, 0, divided[u][0], u) if u in divided else Section(time, -1, place[0], u)
        for u, place in stand.paths.items()
    }
    visits = {u: (time, 0 if u in divided else -1, place[0]) for u, place in stand.paths.items()}
    found: dict[str, Record] = {}
    for name, record in agents.items():
        mine = replace(record, board=board)
        if isinstance(mine, Uav):
            mine = replace(mine, visits=visits, misses={})
        elif isinstance(mine, Ugv) and name in divided:
            state = "return" if mine.state in ("explore", "done") else mine.state
            mine = replace(mine, section=name, rest=0, left=divided[name][0], searched=False, state=state, sweeps=0)
        found[name] = mine
    return found


def _restarted(now: Mission, stand: Stand, here: Mapping[str, XY]) -> Stand:
    """Return the stand with what everybody sets out to do from where he is; the queues of lost medics go to the nearest."""
    team, settings = team_at(now, stand), settings_of(now)
    states = {name: State(*xy, alive=name not in stand.gone) for name, xy in here.items()}
    desk = Desk(team, METHODS[now.parameters["method"]], settings, stand.time, states, stand.memory)
    able = [name for name in desk.agents if name not in stand.gone]
    medics = [name for name in able if name in team.medics]
    for name in team.medics.keys() & stand.gone.keys():
        record = desk.agents[name]
        if record.state == "treat":
            desk.tags -= {record.queue[0].id}
        nearest = min(medics, key=lambda m: (desk.distance(m, name), m))
        medic.learn(desk, nearest, record.queue)
        desk.change(name, queue=(), state="idle")
    for name in able:
        if name not in desk.out:
            _ROOM[type(desk.agents[name])].restart(desk, name)
    return replace(stand, memory=desk.memory(), left={name: c.waypoints for name, c in desk.commands.items()})
