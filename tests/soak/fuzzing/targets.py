"""What is fed to whom: for each target, sound files, which of them are damaged, and the command line that reads them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from fuzzing.mutate import damaged
from fuzzing.samples import (
    CHANGES,
    DATA,
    DISTANCES,
    DRILL,
    LOG,
    MAP,
    STUDY,
    TERRAIN,
    TRACK,
    image,
    raster,
    room,
    sites,
    small_site,
    terrain_npz,
)

FORMATS = (
    "csv",
    "geojson",
    "gpx",
    "html",
    "kml",
    "kmz",
    "moos",
    "nav2",
    "qgc-plan",
    "qgc-wpl",
    "qgis",
    "rtz",
    "rtz-1.2",
    "all",
)
ODD = (
    "2.5",
    "3",
    "30",
    "0.01",
    "100000",
    "1,1",
    "",
    "0",
    "-1",
    "nan",
    "inf",
    "1e400",
    "1e-9",
    "x",
    "1,2",
    "é",
    "999999999999",
    "--",
    "-",
    "0.5",
)


@dataclass(frozen=True, slots=True)
class Request:
    """Files by name, a command line, and which file is standard input, if any."""

    files: dict[str, bytes]
    args: list[str]
    stdin: str | None = None


Maker = Callable[[np.random.Generator], Request]


SOUND = {  # PLANs and what comes of them, each made of those before it
    "stc.geojson": ["plan", "site.geojson", "--method", "stc"],
    "lines.geojson": ["plan", "site.geojson", "--method", "lines", "--run", "4"],
    "guards.geojson": ["plan", "site.geojson", "--method", "guards", "--range", "25"],
    "tasks.geojson": ["assign", "site.geojson", "--iterations", "2"],
    "report.json": ["simulate", "stc.geojson", "--json"],
    "trace.npz": ["simulate", "stc.geojson", "--trace"],
}


def make_sound(run: Callable[..., dict]) -> dict[str, bytes]:
    """Return the files of SOUND, made by the command line; `run` is a worker's."""
    made: dict[str, bytes] = {}
    for name, args in SOUND.items():
        last = [] if args[-1] == "--json" else [f"out/{name}"] if args[-1] == "--trace" else ["-o", f"out/{name}"]
        if args[-1] == "--json":
            args, last = args[:-1], ["--report", f"out/{name}"]
        told = run({"site.geojson": small_site()} | made, [*args, *last], want=f"out/{name}")
        if told["broken"] or not told["made"]:
            raise RuntimeError(f"{name}: {told}")
        made[name] = told["made"]
    return made


def targets(sound: dict[str, bytes]) -> dict[str, tuple[int, Maker]]:
    """Return each target's weight and what makes a request for it; `sound` are the files of SOUND."""
    whole = sites()
    plans = {name: data for name, data in sound.items() if name.endswith(".geojson")}
    logs = {"log.csv": LOG, "log.gpx": TRACK, "trace.npz": sound["trace.npz"]}
    small = {name: whole[name] for name in ("ground.geojson", "surface.geojson", "aerial.geojson")}
    toml = {path.name: path.read_bytes() for path in sorted((DATA / "vehicles").glob("*.toml"))}
    pictures = {"map.pgm": image()}
    chart = {name: (DATA / name).read_bytes() for name in ("sample_chart.000", "sample_chart.001")}
    terrains = {"terrain.asc": TERRAIN, "terrain.npz": terrain_npz()} | raster()

    def check_site(rng: np.random.Generator) -> Request:
        name, data = _one(whole, rng)
        return _with_stdin(name, damaged(name, data, rng), ["check"], rng)

    def check_plan(rng: np.random.Generator) -> Request:
        name, data = _one(plans, rng)
        return _with_stdin(name, damaged(name, data, rng), ["check"], rng)

    def vehicle(rng: np.random.Generator) -> Request:
        name, data = _one(toml, rng)
        domain = (
            "aerial"
            if "quad" in name or "crazy" in name
            else "surface"
            if name in ("otter.toml", "wam-v.toml")
            else "ground"
        )
        site = small_site(domain).replace(b'"id": "v1"', b'"id": "v1", "model": "own.toml"')
        verb = _pick(
            rng, ["check", "site.geojson"], ["check", "site.geojson"], ["plan", "site.geojson", "--placement", "none"]
        )
        return Request({"own.toml": damaged(name, data, rng), "site.geojson": site}, verb)

    def plan(rng: np.random.Generator) -> Request:
        name, data = _one(small, rng)
        data = damaged(name, data, rng) if rng.random() < 0.8 else data
        method = _pick(
            rng,
            ["stc", "--placement", "none"],
            ["stc", "--edge", "lap"],
            ["lines", "--run", "3"],
            ["lines", "--lap"],
            ["guards"],
            ["guards", "--inspect", "border"],
        )
        odd = _options(rng, "--spacing", "--angle", "--range", "--run", "--cross-every", "--entry", "--alternate", "--seed")
        return _with_stdin(name, data, ["plan", "-o", "out/plan.geojson", "--method", *method, *odd], rng)

    def assign(rng: np.random.Generator) -> Request:
        odd = _options(
            rng, "--weights", "--priority-function", "--resolution", "--iterations", "--map-origin", "--heuristic"
        )
        args = ["assign", "-o", "out/plan.geojson", "--iterations", "2", *odd]
        if rng.random() < 0.4:
            which = rng.random()
            files = {
                "map.yaml": damaged("map.yaml", MAP, rng) if which < 0.7 else MAP,
                "map.pgm": damaged("map.pgm", pictures["map.pgm"], rng) if which > 0.6 else pictures["map.pgm"],
                "site.geojson": small["ground.geojson"],
            }
            return Request(files, [*args, "site.geojson", "--map", "map.yaml"])
        name, data = _one(small, rng)
        objective = _pick(rng, [], [], ["--tiers"], ["--objective", "paper"], ["--write-map", "out/map.yaml"])
        return _with_stdin(name, damaged(name, data, rng), [*args, *objective], rng)

    def triage(rng: np.random.Generator) -> Request:
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
        data = damaged(name, whole[name], rng)
        return _with_stdin(name, data, ["triage", "-o", "out/t.geojson", *extra, *odd], rng)

    def simulate(rng: np.random.Generator) -> Request:
        name, data = _one(plans, rng)
        files, kind = {name: data}, rng.random()
        args = ["simulate", name, "--report", "out/report.json"]
        if kind < 0.4:
            files[name] = damaged(name, data, rng)
        elif kind < 0.75:
            ground, heights = _one(terrains, rng)
            files[ground] = damaged(ground, heights, rng)
            args += ["--terrain", ground]
        else:
            files["more.geojson"] = damaged("a.geojson", small["ground.geojson"], rng)
            args += ["--unmapped", "more.geojson"]
        odd = _options(rng, "--current", "--wind", "--gusts", "--fail", "--delay", "--limit", "--step", "--seed")
        return Request(
            files, [*args, *odd, *_pick(rng, [], [], ["--recover"], ["--gnss", "sbas"], ["--lidar"], ["--json"])]
        )

    def replan(rng: np.random.Generator) -> Request:
        name, data = _one(plans, rng)
        args = ["replan", name, "-o", "out/after.geojson", "--at", _pick(rng, "0", "20", "100", "1e9", *ODD)]
        kind = rng.random()
        if kind < 0.4:
            files = {name: damaged(name, data, rng)}
        elif kind < 0.7:
            files = {name: data, "changes.geojson": damaged("a.geojson", CHANGES, rng)}
            args += ["--changes", "changes.geojson"]
        else:
            files = {name: data, "add.geojson": damaged("a.geojson", small["ground.geojson"], rng)}
            args += ["--add", "add.geojson"]
        return Request(
            files,
            [
                *args,
                *_pick(rng, [], ["--lost", "v2"], ["--lost", "v2@10"], ["--gone", "shed"], ["--withdrawn", "t1"]),
                *_options(rng, "--lost", "--gone", "--withdrawn", "--seed"),
            ],
        )

    def export(rng: np.random.Generator) -> Request:
        name, data = _one(plans, rng)
        odd = _options(rng, "--autopilot", "--altitude", "--ground")
        to = _pick(rng, *FORMATS[:-1], "csv,gpx,rtz,kml", *ODD[:3]) if rng.random() < 0.98 else "all"
        args = ["export", "-o", "out/files", "--to", to, *_pick(rng, [], ["--sorties"], ["--autopilot", "px4"]), *odd]
        return _with_stdin(name, damaged(name, data, rng), args, rng)

    def charts(rng: np.random.Generator) -> Request:
        which = _pick(rng, "sample_chart.000", "sample_chart.001")
        files = chart | {which: damaged(which, chart[which], rng)}
        odd = _options(rng, "--tide", "--margin", "--avoid", "--bounds", "--start", "--spacing", "--clearance")
        return Request(files, ["chart", "sample_chart.000", "--draught", "1.5", "-o", "out/site.geojson", *odd])

    def campaign(rng: np.random.Generator) -> Request:
        study = _pick(rng, STUDY, DRILL)
        files = {"study.toml": damaged("study.toml", study, rng), "site.geojson": small["ground.geojson"]}
        return Request(
            plans | files, ["campaign", "study.toml", "-o", "out/runs", "--jobs", "1", *_options(rng, "--least", "--worst")]
        )

    def report(rng: np.random.Generator) -> Request:
        name, data = _one(logs, rng)
        files = {"stc.geojson": plans["stc.geojson"], name: damaged(name, data, rng)}
        track = _pick(rng, name, f"v1={name}", f"v9={name}")
        args = ["report", "stc.geojson", "--track", track, "--report", "out/r.json", *_options(rng, "--start", "--limit")]
        return Request(files, [*args, *_pick(rng, [], [], ["--gaps", "out/gaps.geojson"], ["--json"])])

    def replay(rng: np.random.Generator) -> Request:
        which = _pick(rng, "report.json", "stc.geojson")
        files = {"report.json": sound["report.json"], "stc.geojson": plans["stc.geojson"], "site.geojson": small_site()}
        files[which] = damaged(which, files[which], rng)
        return Request(files, _pick(rng, ["replay", "report.json"], ["replay", "stc.geojson", "--site", "site.geojson"]))

    def reproduce(rng: np.random.Generator) -> Request:
        if rng.random() < 0.7:
            files = {"d.json": damaged("d.json", DISTANCES, rng)}
            return Request(files, ["reproduce", "inspection", "--distances", "d.json", "--json"])
        files = {"room.geojson": damaged("a.geojson", room(), rng)}
        return Request(files, ["reproduce", "guards", "room.geojson", "--robots", "2", "--json", *_options(rng, "--range")])

    def arguments(rng: np.random.Generator) -> Request:
        words = (
            "check",
            "plan",
            "assign",
            "triage",
            "simulate",
            "replan",
            "export",
            "chart",
            "campaign",
            "reproduce",
            "init",
        )
        options = (
            "--help",
            "--force",
            "--to",
            "--spacing",
            "--at",
            "-o",
            "--json",
            "--seed",
            "--draught",
            "--method",
            "--fail",
            "site.geojson",
            "stc.geojson",
            "out",
            "out/x/y.geojson",
            "sea",
            "harbour",
            "guards",
            "no such",
            *ODD,
        )
        count = int(rng.integers(0, 6))
        args = [
            _pick(rng, *words) if rng.random() < 0.95 else _pick(rng, *ODD),
            *(_pick(rng, *options) for _ in range(count)),
        ]
        if args[0] == "reproduce":  # its studies are long by nature
            args.append("--no-such-option")
        return Request({"site.geojson": small["ground.geojson"], "stc.geojson": plans["stc.geojson"]}, args)

    return {
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


def _one(files: dict[str, bytes], rng: np.random.Generator) -> tuple[str, bytes]:
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
