"""What is fed to whom: for each target, sound files, which of them are damaged, and the command line that reads them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from fuzzing import samples
from fuzzing.mutate import damaged
from fuzzing.samples import small_site

FORMATS = ["csv", "geojson", "gpx", "html", "kml", "kmz", "moos", "nav2", "qgc-plan", "qgc-wpl", "qgis", "rtz", "rtz-1.2"]
ODD = ["2.5", "3", "30", "0.01", "100000", "1,1", "", "0", "-1", "nan", "inf", "1e400", "1e-9", "x", "1,2", "é"]
ODD += ["999999999999", "--", "-", "0.5"]


@dataclass(frozen=True, slots=True)
class Request:
    """Files by name, a command line, and which file is standard input, if any."""

    files: dict[str, bytes]
    args: list[str]
    stdin: str | None = None


Files = Mapping[str, bytes]
Target = Callable[[np.random.Generator, Files], Request]  # the files are those of SOUND

SOUND = {  # PLANs and what comes of them, each made of those before it by a command line that ends where it goes
    "stc.geojson": ["plan", "site.geojson", "--method", "stc", "-o"],
    "lines.geojson": ["plan", "site.geojson", "--method", "lines", "--run", "4", "-o"],
    "guards.geojson": ["plan", "site.geojson", "--method", "guards", "--range", "25", "-o"],
    "tasks.geojson": ["assign", "site.geojson", "--iterations", "2", "-o"],
    "report.json": ["simulate", "stc.geojson", "--report"],
    "trace.npz": ["simulate", "stc.geojson", "--trace"],
}


def make_sound(run: Callable[..., dict]) -> dict[str, bytes]:
    """Return the files of SOUND, made by the command line; `run` is a worker's."""
    made: dict[str, bytes] = {}
    for name, args in SOUND.items():
        told = run({"site.geojson": small_site()} | made, [*args, f"out/{name}"], want=f"out/{name}")
        if told["broken"] or not told["made"]:
            raise RuntimeError(f"{name}: {told}")
        made[name] = told["made"]
    return made


def check_site(rng: np.random.Generator, _: Files) -> Request:
    """Every format of a site."""
    name, data = _one(_sites(), rng)
    return _with_stdin(name, damaged(name, data, rng), ["check"], rng)


def check_plan(rng: np.random.Generator, sound: Files) -> Request:
    """PLANs of every method."""
    name, data = _one(_plans(sound), rng)
    return _with_stdin(name, damaged(name, data, rng), ["check"], rng)


def vehicle(rng: np.random.Generator, _: Files) -> Request:
    """A vehicle's own TOML file, checked and planned with."""
    name, data = _one(_vehicles(), rng)
    aerial, surface = "quad" in name or "crazy" in name, name in ("otter.toml", "wam-v.toml")
    site = small_site("aerial" if aerial else "surface" if surface else "ground")
    site = site.replace(b'"id": "v1"', b'"id": "v1", "model": "own.toml"')
    check, plan = ["check", "site.geojson"], ["plan", "site.geojson", "--placement", "none"]
    verb = _pick(rng, check, check, plan)
    return Request({"own.toml": damaged(name, data, rng), "site.geojson": site}, verb)


METHODS = ["stc --placement none", "stc --edge lap", "lines --run 3", "lines --lap", "guards", "guards --inspect border"]


def plan(rng: np.random.Generator, _: Files) -> Request:
    """Sites and options, planned by every method."""
    name, data = _one(_small(), rng)
    data = damaged(name, data, rng) if rng.random() < 0.8 else data
    method = _pick(rng, *METHODS).split()
    odd = _options(rng, "--spacing", "--angle", "--range", "--run", "--cross-every", "--entry", "--alternate", "--seed")
    args = ["plan", "-o", "out/plan.geojson", "--time-limit", "20", "--method"]  # the largest that is taken is minutes
    return _with_stdin(name, data, [*args, *method, *odd], rng)


def assign(rng: np.random.Generator, _: Files) -> Request:
    """Tasks of sites, and of ROS maps."""
    odd = _options(rng, "--weights", "--priority-function", "--resolution", "--iterations", "--map-origin", "--heuristic")
    args = ["assign", "-o", "out/plan.geojson", "--iterations", "2", *odd]
    if rng.random() < 0.4:
        which, picture = rng.random(), samples.image()
        files = {
            "map.yaml": damaged("map.yaml", samples.MAP, rng) if which < 0.7 else samples.MAP,
            "map.pgm": damaged("map.pgm", picture, rng) if which > 0.6 else picture,
            "site.geojson": small_site("ground"),
        }
        return Request(files, [*args, "site.geojson", "--map", "map.yaml"])
    name, data = _one(_small(), rng)
    objective = _pick(rng, [], [], ["--tiers"], ["--objective", "paper"], ["--write-map", "out/map.yaml"])
    return _with_stdin(name, damaged(name, data, rng), [*args, *objective], rng)


def triage(rng: np.random.Generator, _: Files) -> Request:
    """Drills and what is written of them."""
    name = _pick(rng, "triage_drill.geojson", "ground.geojson")
    odd = _options(
        rng, "--fail", "--treat", "--talk", "--order", "--medic-speed", "--spacing", "--clusters", "--confidence"
    )
    extra = _pick(
        rng,
        [],
        ["--casualty-csv", "out/c.csv", "--log-csv", "out/log.csv"],
        ["--generate", "1"],
        ["--compare"],
        ["--cot", "out/cot.xml", "--start", "2026-05-01T09:00:00Z"],
        ["--rendezvous", "moving"],
    )
    data = damaged(name, _sites()[name], rng)
    args = ["triage", "-o", "out/t.geojson", "--time-limit", "20"]  # dozens of UGVs at one point are minutes
    return _with_stdin(name, data, [*args, *extra, *odd], rng)


def simulate(rng: np.random.Generator, sound: Files) -> Request:
    """PLANs, terrain and unmapped obstacles in simulation."""
    name, data = _one(_plans(sound), rng)
    files, kind = {name: data}, rng.random()
    args = ["simulate", name, "--report", "out/report.json"]
    if kind < 0.4:
        files[name] = damaged(name, data, rng)
    elif kind < 0.75:
        ground, heights = _one(_terrains(), rng)
        files[ground] = damaged(ground, heights, rng)
        args += ["--terrain", ground]
    else:
        files["more.geojson"] = damaged("a.geojson", small_site("ground"), rng)
        args += ["--unmapped", "more.geojson"]
    odd = _options(rng, "--current", "--wind", "--gusts", "--fail", "--delay", "--limit", "--step", "--seed")
    extra = _pick(rng, [], [], ["--recover"], ["--gnss", "sbas"], ["--lidar"], ["--json"])
    return Request(files, [*args, *odd, *extra])


def replan(rng: np.random.Generator, sound: Files) -> Request:
    """PLANs, changes and additions."""
    name, data = _one(_plans(sound), rng)
    args = ["replan", name, "-o", "out/after.geojson", "--at", _pick(rng, "0", "20", "100", "1e9", *ODD)]
    kind = rng.random()
    if kind < 0.4:
        files = {name: damaged(name, data, rng)}
    elif kind < 0.7:
        files = {name: data, "changes.geojson": damaged("a.geojson", samples.CHANGES, rng)}
        args += ["--changes", "changes.geojson"]
    else:
        files = {name: data, "add.geojson": damaged("a.geojson", small_site("ground"), rng)}
        args += ["--add", "add.geojson"]
    lost = _pick(rng, [], ["--lost", "v2"], ["--lost", "v2@10"], ["--gone", "shed"], ["--withdrawn", "t1"])
    return Request(files, [*args, *lost, *_options(rng, "--lost", "--gone", "--withdrawn", "--seed")])


def export(rng: np.random.Generator, sound: Files) -> Request:
    """PLANs in every format."""
    name, data = _one(_plans(sound), rng)
    odd = _options(rng, "--autopilot", "--altitude", "--ground")
    to = _pick(rng, *FORMATS, "csv,gpx,rtz,kml", *ODD[:3]) if rng.random() < 0.98 else "all"
    args = ["export", "-o", "out/files", "--to", to, *_pick(rng, [], ["--sorties"], ["--autopilot", "px4"]), *odd]
    return _with_stdin(name, damaged(name, data, rng), args, rng)


def charts(rng: np.random.Generator, _: Files) -> Request:
    """An ENC cell and its update."""
    which = _pick(rng, "sample_chart.000", "sample_chart.001")
    files = _chart() | {which: damaged(which, _chart()[which], rng)}
    odd = _options(rng, "--tide", "--margin", "--avoid", "--bounds", "--start", "--spacing", "--clearance")
    return Request(files, ["chart", "sample_chart.000", "--draught", "1.5", "-o", "out/site.geojson", *odd])


def campaign(rng: np.random.Generator, sound: Files) -> Request:
    """Studies of plans and of drills."""
    study = _pick(rng, samples.STUDY, samples.DRILL)
    files = {"study.toml": damaged("study.toml", study, rng), "site.geojson": small_site("ground")}
    args = ["campaign", "study.toml", "-o", "out/runs", "--jobs", "1", *_options(rng, "--least", "--worst")]
    return Request(_plans(sound) | files, args)


def reproduce(rng: np.random.Generator, _: Files) -> Request:
    """The papers' own inputs: distances between tasks, rooms."""
    if rng.random() < 0.7:
        files = {"d.json": damaged("d.json", samples.DISTANCES, rng)}
        return Request(files, ["reproduce", "inspection", "--distances", "d.json", "--json"])
    files = {"room.geojson": damaged("a.geojson", samples.room(), rng)}
    return Request(files, ["reproduce", "guards", "room.geojson", "--robots", "2", "--json", *_options(rng, "--range")])


def report(rng: np.random.Generator, sound: Files) -> Request:
    """Logs as text, and traces."""
    logs = {"log.csv": samples.LOG, "log.gpx": samples.TRACK, "trace.npz": sound["trace.npz"]}
    name, data = _one(logs, rng)
    files = {"stc.geojson": sound["stc.geojson"], name: damaged(name, data, rng)}
    track = _pick(rng, name, f"v1={name}", f"v9={name}")
    args = ["report", "stc.geojson", "--track", track, "--report", "out/r.json", *_options(rng, "--start", "--limit")]
    return Request(files, [*args, *_pick(rng, [], [], ["--gaps", "out/gaps.geojson"], ["--json"])])


def replay(rng: np.random.Generator, sound: Files) -> Request:
    """A report or a plan that is run again."""
    which = _pick(rng, "report.json", "stc.geojson")
    files = {name: sound[name] for name in ("report.json", "stc.geojson")} | {"site.geojson": small_site()}
    files[which] = damaged(which, files[which], rng)
    return Request(files, _pick(rng, ["replay", "report.json"], ["replay", "stc.geojson", "--site", "site.geojson"]))


VERBS = ["check", "plan", "assign", "triage", "simulate", "replan", "export", "chart", "campaign", "reproduce", "init"]
WORDS = ["--help", "--force", "--to", "--spacing", "--at", "-o", "--json", "--seed", "--draught", "--method", "--fail"]
WORDS += ["site.geojson", "stc.geojson", "out", "out/x/y.geojson", "sea", "harbour", "guards", "no such", *ODD]


def arguments(rng: np.random.Generator, sound: Files) -> Request:
    """Words of the command line in any order."""
    count = int(rng.integers(0, 6))
    args = [_pick(rng, *VERBS) if rng.random() < 0.95 else _pick(rng, *ODD), *(_pick(rng, *WORDS) for _ in range(count))]
    if args[0] == "reproduce":  # its studies are long by nature
        args.append("--no-such-option")
    return Request({"site.geojson": small_site("ground"), "stc.geojson": sound["stc.geojson"]}, args)


def dataflash(rng: np.random.Generator, sound: Files) -> Request:
    """ArduPilot's own logs."""
    return _autopilot_log("log.bin", rng, sound)


def telemetry(rng: np.random.Generator, sound: Files) -> Request:
    """What a ground station recorded."""
    return _autopilot_log("log.tlog", rng, sound)


TARGETS: dict[str, tuple[int, Target]] = {  # with the weight of each
    "check_site": (40, check_site),
    "check_plan": (14, check_plan),
    "vehicle": (8, vehicle),
    "plan": (8, plan),
    "assign": (6, assign),
    "triage": (4, triage),
    "simulate": (3, simulate),
    "replan": (4, replan),
    "export": (6, export),
    "charts": (5, charts),
    "campaign": (2, campaign),
    "reproduce": (1, reproduce),
    "report": (6, report),
    "replay": (2, replay),
    "arguments": (4, arguments),
}
AUTOPILOTS: dict[str, tuple[int, Target]] = {"dataflash": (1, dataflash), "telemetry": (1, telemetry)}  # by pymavlink


def _autopilot_log(name: str, rng: np.random.Generator, sound: Files) -> Request:
    """Return a request that reports or replans by a damaged log, or by halves of two that were joined."""
    logs = _logs(sound["trace.npz"])
    data = logs[name]
    if rng.random() < 0.1:
        other = logs[_pick(rng, *logs)]
        data = data[: rng.integers(0, len(data) + 1)] + other[rng.integers(0, len(other) + 1) :]
    files = {"stc.geojson": sound["stc.geojson"], name: damaged(name, data, rng)}
    track = ["stc.geojson", "--track", f"v1={name}" if rng.random() < 0.9 else name]
    track += ["--start", _pick(rng, "2026-05-28T20:26:40Z", *ODD)] if rng.random() < 0.1 else []
    if rng.random() < 0.4:
        args = ["--lost", "v2@10", "-o", "out/after.geojson", *_options(rng, "--at", "--lost")]
        return Request(files, ["replan", *track, *args])
    return Request(files, ["report", *track, "--report", "out/r.json", *_pick(rng, [], ["--gaps", "out/gaps.geojson"])])


@cache
def _logs(trace: bytes) -> dict[str, bytes]:
    return samples.autopilot_logs(trace)


@cache
def _sites() -> dict[str, bytes]:
    return samples.sites()


@cache
def _small() -> dict[str, bytes]:
    return {f"{domain}.geojson": small_site(domain) for domain in ("ground", "surface", "aerial")}


@cache
def _vehicles() -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((samples.DATA / "vehicles").glob("*.toml"))}


@cache
def _chart() -> dict[str, bytes]:
    return {name: (samples.DATA / name).read_bytes() for name in ("sample_chart.000", "sample_chart.001")}


@cache
def _terrains() -> dict[str, bytes]:
    return {"terrain.asc": samples.TERRAIN, "terrain.npz": samples.terrain_npz()} | samples.raster()


def _plans(sound: Files) -> dict[str, bytes]:
    return {name: data for name, data in sound.items() if name.endswith(".geojson")}


def _one(files: Files, rng: np.random.Generator) -> tuple[str, bytes]:
    return list(files.items())[rng.integers(0, len(files))]


def _pick(rng: np.random.Generator, *choices):
    return choices[rng.integers(0, len(choices))]


def _options(rng: np.random.Generator, *names: str) -> list[str]:
    """Return one option, now and then, with an odd value."""
    return [_pick(rng, *names), _pick(rng, *ODD)] if rng.random() < 0.12 else []


def _with_stdin(name: str, data: bytes, args: list[str], rng: np.random.Generator) -> Request:
    """Return a request whose file is named, or comes by standard input."""
    piped = rng.random() < 0.2
    return Request({name: data}, [args[0], "-" if piped else name, *args[1:]], name if piped else None)
