"""Executing a mission in PyBullet: director, guidance, vehicles and world, step by step, to a trace and a verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from quarterdeck.geo.deadline import cause, time_is_up
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.occupancy import Occupancy
from quarterdeck.geo.scenario import Site
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.changes import Changes
from quarterdeck.mission.director import Director
from quarterdeck.mission.fast import run_fast
from quarterdeck.mission.inspection import default_director
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.recovery import asked_for
from quarterdeck.mission.recovery_memory import followed, left_out, relieved, tellings, undone
from quarterdeck.mission.served import served_tasks
from quarterdeck.mission.told import Telling, as_told
from quarterdeck.mission.triage.plan import METHOD, run_plan
from quarterdeck.physics.faults import in_fast_world, read_faults
from quarterdeck.physics.mapping import agreement
from quarterdeck.physics.measure import measure
from quarterdeck.physics.moments import Moment, moments
from quarterdeck.physics.obstacles import spans, standing, turns_of
from quarterdeck.physics.report import Report, check_limits
from quarterdeck.physics.running import DECIDE, Running
from quarterdeck.physics.sensing import Sensing
from quarterdeck.physics.terrain import check_terrain
from quarterdeck.physics.trace import Trace, TraceBuilder
from quarterdeck.physics.triage import Compared, compare, of_devices
from quarterdeck.physics.wind import Wind
from quarterdeck.physics.world import open_world

TRIAGE = 7200.0  # s that a triage mission may take at the least, before it is cut short
LATE = 2.5  # times as long as the fast world, which turns in no time, a triage mission may take


@dataclass(frozen=True, slots=True)
class Run:
    """A mission executed: what happened, and what it comes to."""

    trace: Trace
    report: Report
    triage: Compared | None = None  # of a triage mission: what became of its casualties
    site: Site | None = None  # what was there in the end, and what was to be covered by then
    map: Occupancy | None = None  # what robots that drew a map made of it
    told: Mission | None = None  # the plan as its vehicles were told it, of the site and the tasks asked for in the end
    followed: Mission | None = None  # the last plan that was made in the run
    moments: tuple[Moment, ...] = ()  # who was lost or told a new route, where and when


def simulate(
    mission: Mission,
    *,
    director: Director | None = None,
    seed: int = 0,
    step: float = 0.1,
    sample: float | None = None,
    current: tuple[float, float] = (0.0, 0.0),
    wind: tuple[float, float] = (0.0, 0.0),
    gusts: float = 0.0,
    faults: Sequence[str] = (),
    sensing: Sensing | None = None,
    terrain: Terrain | None = None,
    limits: Mapping[str, float] | None = None,
    duration: float | None = None,
    progress: Callable[[float, float], None] | None = None,
    expected: Director | None = None,
    changes: Sequence[tuple[float, Changes]] = (),
) -> Run:
    """Execute `mission` in PyBullet under `director` (default: its routes, or its schedule of tasks) and judge it.

    `step` seconds a PyBullet step (at most 0.1; the models integrate in smaller ones), `sample` seconds between
    samples of the trace (default: every step). `current` and `wind` are (east, north) m/s, `gusts` the standard
    deviation of Dryden gusts in m/s. `faults` are texts as `faults.read_faults` takes them; `sensing` says what is sensed
    instead of known (default: all is known). `terrain` is the ground (default: flat). `limits` change the verdict's
    (see report.LIMITS). The run ends when every vehicle is done, or after `duration` seconds (default: twice the planned
    time and ten minutes; of all vehicles' times together where a director may replan). `progress` is told seconds done and
    expected. Under `expected`, such as `director` without its side effects (default without a director: the plan's), the
    mission is run in the fast world too, and stands beside the run in the report.

    `changes` are what is asked anew or stands otherwise from a second on, each with its second, of which `director` knows
    too (`mission.recovery.recovering`): obstacles come and go in the world, and what is asked in the end is judged by.

    Raises InputError for a vehicle model without its dynamics or a wrong option, UnavailableError where PyBullet is
    absent.
    """
    _check(mission, step, sample, current, wind, gusts)
    check_limits(limits or {})
    if terrain is not None:
        check_terrain(terrain, mission)
    planned = max((max(r.duration, r.length / mission.vehicle(r.vehicle).speed) for r in mission.routes), default=0.0)
    worst = planned if director is None else sum(r.duration for r in mission.routes)
    until = 2.0 * max(planned, worst) + 600.0 if duration is None else duration
    ids = [v.id for v in mission.vehicles]
    befalling, sensing = read_faults(faults, ids, planned, seed), sensing or Sensing()
    triage = mission.method == METHOD
    if triage:
        befalling = of_devices(befalling, mission)
        # Its routes are those without a find; what casualties add to them shows only in the run.
        until = max(until, TRIAGE) if duration is None else until
        limits = {"delay": LATE} | dict(limits or {})
    if expected is None and director is None:
        expected = default_director(mission)
    # Before the run, whose time may be limited: what it is held against is not cut short with it.
    known_faults = in_fast_world(befalling, {v.id: v.domain for v in mission.vehicles})
    aside = run_plan(mission, known_faults) if triage else None
    fast = run_fast(mission, expected, known_faults, until=until) if expected and not triage else None
    known, director = mission.site, director or default_director(mission)
    there = known.obstacles if sensing.world is None else sensing.world
    plan, mission = mission, replace(mission, site=replace(known, obstacles=(*there, *sensing.unmapped)))
    turns = turns_of(mission.site, changes)
    with open_world(step) as world:
        air = Wind(np.array([*wind, 0.0]), gusts, len(ids), seed)
        run = Running(mission, director, world, seed, np.array(current), air, befalling, sensing, known, terrain, turns)
        trace, cut = _drive(run, until, sample, planned, progress)
    compared = None
    if aside is not None:
        late = cut or ("" if run.done else f"the mission was not over after {until:,.0f} s")
        compared = compare(mission, run.memory, trace, late, aside, run.standing())
        mission = compared.expected
    elif cut:
        run.status.trouble.append(cut)
    settings: dict[str, Any] = {
        "seed": seed,
        "step": step,
        "current": list(current),
        "wind": list(wind),
        "gusts": gusts,
        "faults": [str(f) for f in befalling],
        **_sensed(sensing, terrain),
    }
    reliefs = _reliefs(run)
    told = _told(plan, run, [wish for when, wish in changes if when <= run.time], reliefs)
    served, servers = run.link.served, run.link.servers
    if told is not plan and plan.method == "guards":  # each plan numbers its guards anew
        found = served_tasks(told, trace.tracks())
        served, servers = {task: when for task, (when, _) in found.items()}, {task: who for task, (_, who) in found.items()}
    ever, during = (*mission.site.obstacles, *(o for turn in turns for o in turn.new)), spans(turns)
    left = replace(told.site, obstacles=standing(ever, during, run.time))
    report = measure(
        mission if compared else replace(told, site=left),
        trace,
        finished=run.finished.tolist(),
        aground=run.status.aground.tolist(),
        served=served,
        limits=limits or {},
        settings=settings,
        lost=run.status.lost.tolist(),
        trouble=[*run.status.trouble, *(compared.driven.reasons if compared else ())],
        localisation=run.senses.report() if run.senses else None,
        triage=compared.document() if compared else None,
        servers=servers,
        undone=undone(run.memory),
        relieved={r.route.vehicle: r.time for r in reliefs},
        left_out=left_out(run.memory),
        during=during,
        was=replace(mission.site, obstacles=ever),
        fast=fast,
    )
    made = None
    if sensing.mapping and run.router is not None:
        made = replace(run.router.findings.shared.occupancy(), place=(mission.frame.lon, mission.frame.lat))
        report = replace(report, figures={**report.figures, **agreement(made, mission.site)})
    happened = moments(trace, run.status.gone, run.status.lost, _orders(run, compared))
    return Run(trace, report, compared, left, made, told, followed(run.memory), happened)


def _drive(
    run: Running,
    until: float,
    sample: float | None,
    planned: float,
    progress: Callable[[float, float], None] | None,
) -> tuple[Trace, str]:
    """Let the run go on until all is done or it is `until` seconds; return its trace, and why it was cut short or ""."""
    step, cut, count = run.world.step, "", 0
    builder = TraceBuilder(tuple(run.ids))
    every = max(1, round((sample or step) / step))
    run.decide()
    run.record(builder)
    while not run.done and run.time < until - step / 2:
        if time_is_up("the run"):
            cut = f"the run was stopped at {run.time:,.0f} s of the mission ({cause()})"
            run.record(builder)
            break
        run.advance()
        count += 1
        run.time = count * step
        if count % round(DECIDE / step) == 0:
            run.decide()
            if progress is not None:
                progress(run.time, min(max(planned, run.time), until))
        if count % every == 0 or run.done:
            run.record(builder)
    return builder.trace(), cut


def _sensed(sensing: Sensing, terrain: Terrain | None) -> dict[str, Any]:
    """Return what was sensed and what there was to sense, as the report's settings tell it."""
    return {
        "gnss": sensing.gnss,
        "lidar": sensing.lidar or sensing.amcl,
        "amcl": sensing.amcl,
        "field": sensing.field,
        "terrain": None if terrain is None else [*terrain.origin, terrain.cell, *terrain.heights.shape],
        "mapping": sensing.mapping,
        "unmapped": [o.id for o in sensing.unmapped],
        "world": None if sensing.world is None else [o.id for o in sensing.world],
    }


def _reliefs(run: Running) -> list[Telling]:
    """Return how far those had come who are dead and whose part was given to others."""
    dead = {v for v, alive in zip(run.ids, run.status.alive.tolist(), strict=True) if not alive}
    return [relief for v, relief in relieved(run.memory).items() if v in dead]


def _told(plan: Mission, run: Running, heeded: Sequence[Changes], reliefs: Sequence[Telling]) -> Mission:
    """Return the plan as its vehicles were told it, of what was asked for in the end."""
    orders = tellings(run.memory)
    return as_told(asked_for(plan, heeded), orders, reliefs) if heeded or orders or reliefs else plan


def _orders(run: Running, compared: Compared | None) -> list[tuple[float, str]]:
    """Return when vehicles were told new routes, or took over others' parts: seconds of the run, and vehicles."""
    told = [(t.time, t.route.vehicle) for t in tellings(run.memory)]
    if compared is None:
        return told
    began = compared.driven.team.began  # the log's times are the mission's, and it tells of what was before the run too
    return told + [(e.time - began, e.who) for e in compared.driven.log if e.what == "takes over" and e.time >= began]


def _check(
    mission: Mission,
    step: float,
    sample: float | None,
    current: tuple[float, float],
    wind: tuple[float, float],
    gusts: float,
) -> None:
    if not 0.001 <= step <= 0.1 or abs(round(DECIDE / step) * step - DECIDE) > 1e-9:
        raise InputError(f"step {step} s must be from 0.001 to 0.1 and divide a second; try 0.1, 0.05 or 0.02")
    if sample is not None and not step <= sample <= 60:
        raise InputError(f"sample {sample} s must be from the step, {step}, to 60")
    if not np.all(np.isfinite([*current, *wind, gusts])) or gusts < 0:
        raise InputError(f"current {current}, wind {wind} and gusts {gusts} must be finite, gusts not negative")
    if not mission.vehicles:
        raise InputError("the plan has no vehicles; there is nothing to simulate")
    routed = [route.vehicle for route in mission.routes]
    for route in mission.routes:
        if route.vehicle not in {v.id for v in mission.vehicles}:
            raise InputError(f"the plan has a route for {route.vehicle!r}, which is not among its vehicles; plan it anew")
        if routed.count(route.vehicle) > 1:
            raise InputError(f"the plan has two routes for {route.vehicle!r}; plan it anew")
        if not np.isfinite(route.xyz).all():
            raise InputError(f"the route of {route.vehicle!r} has a position that is not finite; plan it anew")
