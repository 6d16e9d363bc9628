"""A process that runs one request after another and says how each ended; a crash or a hang takes only it down.

A request is a line of JSON on standard input, `{"files": {name: base64}, "args": [...], "stdin": name or null}`: the
command line is called with the arguments in a folder that holds the files. The answer is a line of JSON on standard
output: `status`; `broken`, what is not allowed about how it ended, or nothing; `said`, the end of standard error; `made`,
the bytes of the file that is wanted.
"""

import base64
import io
import itertools
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path

MEMORY = 2_000_000_000  # bytes that a run may take more than the process had
LONGEST = 1500  # characters of a refusal's line


def serve() -> None:
    """Answer requests until standard input ends."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    nowhere = os.open(os.devnull, os.O_RDWR)
    requests = os.fdopen(os.dup(0), encoding="utf-8")
    for descriptor in (0, 1, 2):
        os.dup2(nowhere, descriptor)
    sys.unraisablehook = lambda *_: None
    _prepare()
    for line in requests:
        answers.write(json.dumps(_answer(json.loads(line))) + "\n")
        answers.flush()


def _prepare() -> None:
    """What a run would start is done here: a campaign's processes become calls of the first few cases."""
    from quarterdeck.campaign import execute

    def here(text, todo, limits, jobs):
        return (execute.run_case(text, case, limits) for case in itertools.islice(todo, 2))

    execute.over_processes = here
    held = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (held + 2 * MEMORY, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_FSIZE, (500_000_000, 500_000_000))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)


def _answer(request: dict) -> dict:
    from quarterdeck.cli import main

    folder = Path(tempfile.mkdtemp(prefix="soak-"))
    try:
        for name, data in request["files"].items():
            (folder / name).write_bytes(base64.b64decode(data))
        before = {p: p.read_bytes() for p in folder.iterdir()}
        (folder / "out").mkdir()
        os.chdir(folder)
        given = (folder / request["stdin"]).read_bytes() if request.get("stdin") else b""
        sys.stdin = io.TextIOWrapper(io.BytesIO(given), encoding="utf-8")
        out, err = io.BytesIO(), io.BytesIO()
        sys.stdout = io.TextIOWrapper(out, encoding="utf-8", write_through=True)
        sys.stderr = io.TextIOWrapper(err, encoding="utf-8", write_through=True)
        signal.signal(signal.SIGPROF, _too_long)
        signal.setitimer(signal.ITIMER_PROF, request["deadline"])  # of this process's own time: the machine may be busy
        _forget_peak()
        start, held = time.process_time(), _held()
        status, broken = 0, ""
        try:
            main(request["args"])
        except SystemExit as stop:
            status = stop.code if isinstance(stop.code, int) else 0
        except BaseException as error:
            broken = "".join(traceback.format_exception(error))[-6000:]
        signal.setitimer(signal.ITIMER_PROF, 0)
        seconds, took = time.process_time() - start, _peak() - held
        said = err.getvalue().decode("utf-8", "replace")
        broken = broken or _broken(status, out.getvalue(), said, folder, before)
        if not broken and took > MEMORY:
            broken = f"took {took / 1e6:,.0f} MB"
        made = (folder / request["want"]).read_bytes() if request.get("want") and not broken else b""
        told = {"status": status, "broken": broken, "said": said[-500:], "made": base64.b64encode(made).decode()}
        return told | {"seconds": seconds, "mb": round(took / 1e6)}
    finally:
        os.chdir("/")
        shutil.rmtree(folder, ignore_errors=True)


def _too_long(*_: object) -> None:
    raise TimeoutError("took longer than its deadline")


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def _peak() -> int:
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) * 1024


def _held() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def _broken(status: int, out: bytes, said: str, folder: Path, before: dict[Path, bytes]) -> str:
    """Return what is not allowed about how a run ended, or nothing."""
    made = [p for p in (folder / "out").rglob("*") if p.is_file()]
    if status not in (0, 1, 2):
        return f"exit status {status}"
    if "out of memory" in said:
        return said
    if "Traceback" in said:
        return f"a traceback on standard error: {said[-2000:]}"
    if any(p.read_bytes() != data for p, data in before.items()):
        return "an input file was changed"
    if strays := [p for p in folder.iterdir() if p not in before and p.name != "out" and not p.name.endswith(".runs")]:
        return f"wrote outside its folder: {strays[0].name}"
    if status == 2:
        if made:
            return f"refused, yet wrote {made[0].name}"
        lines = [line for line in said.strip().splitlines() if not line.startswith("note: ")]
        usage = lines and lines[0].startswith("Usage:")
        if not lines and out.strip():  # `check` lists the problems of a site as its result
            return ""
        if not usage and len(lines) != 1:
            return f"refused in {len(lines)} lines: {said[:2000]}"
        if len(lines[-1]) > LONGEST:
            return f"refused in a line of {len(lines[-1])} characters: {lines[-1][:200]}"
    for path in made:
        if path.name.startswith("."):
            return f"left {path.name}"
        if path.suffix in (".json", ".geojson"):
            try:
                json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse)
            except ValueError as error:
                return f"wrote {path.name}, which is no JSON: {error}"
    return ""


def _refuse(text: str) -> None:
    raise ValueError(f"{text} is no number in JSON")


if __name__ == "__main__":
    serve()
