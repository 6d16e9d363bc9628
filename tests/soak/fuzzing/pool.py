"""A worker process that is started anew when a run crashes it or hangs in it, so that the run is known by name."""

import base64
import contextlib
import json
import os
import select
import signal
import subprocess
import sys
from pathlib import Path
from typing import Self

DEADLINE = 60  # CPU s for one run
HUNG = 600  # s after which a run is given up that no alarm ends, as one in native code


class Worker:
    """Runs the command line in a process of its own, again and again."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def run(self, files: dict[str, bytes], args: list[str], *, stdin: str | None = None, want: str = "") -> dict:
        """Return how the command line ended: `status`, `broken` (nothing, or what is not allowed), `said`, `seconds`; and
        `made`, the bytes of the file that is wanted.
        """
        encoded = {name: base64.b64encode(data).decode() for name, data in files.items()}
        request = {"files": encoded, "args": args, "stdin": stdin, "want": want, "deadline": DEADLINE}
        process = self.process = self.process or _start()
        process.stdin.write(json.dumps(request).encode() + b"\n")
        process.stdin.flush()
        if not select.select([process.stdout], [], [], HUNG)[0]:
            self.stop()
            return {"status": None, "broken": f"hung for {HUNG} s", "said": "", "seconds": DEADLINE}
        line = process.stdout.readline()
        if line:
            told = json.loads(line)
            return told | {"made": base64.b64decode(told["made"])}
        self.stop()
        code = process.returncode
        ended = signal.Signals(-code).name if code < 0 else f"status {code}"
        return {"status": None, "broken": f"crashed: {ended}", "said": "", "seconds": 0.0}

    def stop(self) -> None:
        """End the process."""
        if self.process is not None:
            try:
                self.process.wait(0.5)  # one that crashed has its own status
            except subprocess.TimeoutExpired:
                self.process.kill()
            with contextlib.suppress(BrokenPipeError):
                self.process.communicate()
            self.process = None


def _start() -> subprocess.Popen[bytes]:
    environment = os.environ | {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "COLUMNS": "120"}
    command = [
        sys.executable,
        "-P",
        "-W",
        "error",
        "-W",
        "ignore::PendingDeprecationWarning",
        str(Path(__file__).with_name("worker.py")),
    ]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)
