"""The library's front door: `read_scenario`, `plan`, `simulate`, `export` tell the whole story.

Each stage is imported when it is first called, so that importing the package costs nothing.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args

from quarterdeck.geo.addons import METHODS, addon, addon_names
from quarterdeck.geo.deadline import abandoning, limited
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Scenario
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.planfile import plan_text, read_plan

__all__ = ["assign", "export", "plan", "plan_text", "read_plan", "read_scenario", "simulate", "write_plan"]


Method = Literal["stc", "lines", "guards"]


def plan(
    scenario: Scenario,
    *,
    method: Method | str | None = None,
    seed: int = 0,
    terrain: Terrain | None = None,
    tolerance: float = 5.0,
    time_limit: float | None = None,
    **options: Any,
) -> Mission:
    """Return a mission that covers the scenario's areas.

    `stc` divides a placed grid and walks spanning trees (`quarterdeck.mission.cover.cover`), `lines` surveys by parallel
    lines (`quarterdeck.mission.lines.plan_lines`), `guards` sees every point from within a limited range
    (`quarterdeck.mission.guards.plan_guards`); packages may add methods (docs/extending.md); `options` are theirs. None:
    lines where a vehicle has a sensor, else stc.
    Over `terrain` what flies holds its height above ground within `tolerance` metres (`quarterdeck.mission.follow.follow`).
    After `time_limit` seconds searches end with the best so far, which the mission's header tells.
    Raises InputError if the scenario cannot be planned as it is.
    """
    method = method or default_method(scenario)
    planner = _planner(method)
    return _at_height(within(time_limit, lambda: planner(scenario, seed=seed, **options)), terrain, tolerance)


def _planner(method: str) -> Callable[..., Mission]:
    if method == "guards":
        from quarterdeck.mission.guards import plan_guards

        return plan_guards
    if method == "lines":
        from quarterdeck.mission.lines import plan_lines

        return plan_lines
    if method == "stc":
        from quarterdeck.mission.cover import cover

        return cover
    added = addon_names(METHODS)
    if method in added:
        return addon(METHODS, method)
    raise InputError(f"unknown method {method!r}; use one of {', '.join([*get_args(Method), *added])}")


def within(time_limit: float | None, make: Callable[[], Mission]) -> Mission:
    """Return the mission that `make` makes, its searches ended after `time_limit` seconds: its header tells the limit and
    which searches it, or Ctrl-C, cut short.
    """
    with limited(time_limit) as limit:
        mission = make()
    told: dict[str, Any] = {"cut": limit.cut} if limit.cut or time_limit is not None else {}
    told |= {"stopped": limit.cause} if limit.interrupted else {}
    parameters = {**mission.parameters, **({} if time_limit is None else {"time_limit": time_limit})}
    return replace(mission, parameters=parameters, figures={**mission.figures, **told})


def _at_height(mission: Mission, terrain: Terrain | None = None, tolerance: float = 5.0) -> Mission:
    """Return the mission over the terrain, if there is one, its ceilings looked at."""
    from quarterdeck.mission.follow import follow
    from quarterdeck.mission.heights import too_high
    from quarterdeck.mission.reason import Reason

    if terrain is not None:
        mission = follow(mission, terrain, tolerance=tolerance)
    return replace(mission, reasons=tuple(dict.fromkeys([*mission.reasons, *map(Reason, too_high(mission))])))


def default_method(scenario: Scenario) -> Method:
    """Return the method that survey teams expect: lines where a vehicle has a sensor, else spanning trees."""
    return "lines" if any(v.sensor for v in scenario.vehicles) else "stc"


def assign(scenario: Scenario, *, seed: int = 0, time_limit: float | None = None, **options: Any) -> Mission:
    """Return a mission in which the scenario's vehicles do its tasks (`quarterdeck.mission.assign.assign`).

    Raises OutOfTimeError if `time_limit` seconds do not suffice for the ways between tasks.
    """
    from quarterdeck.mission.assign import assign as share_out

    with abandoning("allow more time, or give a coarser resolution or fewer tasks"):
        return _at_height(within(time_limit, lambda: share_out(scenario, seed=seed, time_limit=time_limit, **options)))


def simulate(mission: Mission, **options: Any) -> Any:
    """Execute a mission in PyBullet and return its run: trace and report (`quarterdeck.physics.simulate.simulate`)."""
    from quarterdeck.physics.simulate import simulate as run

    return run(mission, **options)


def export(mission: Mission, to: str | Iterable[str], out: str | Path, **options: Any) -> list[Path]:
    """Write a mission in other formats into a folder and return the paths (`quarterdeck.exporters.export.export`)."""
    from quarterdeck.exporters.export import export as leave

    return leave(mission, to, out, **options)


def write_plan(mission: Mission, path: str | Path, *, force: bool = False) -> Path:
    """Write the PLAN file and return its path. Raises InputError if it exists and not `force`, or cannot be written."""
    from quarterdeck.geo.files import write_file

    return write_file(Path(path), plan_text(mission), force=force)
