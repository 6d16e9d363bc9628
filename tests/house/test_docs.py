"""The documents: what the tutorials and pages tell to run runs, and prints what they quote; links lead somewhere."""

import contextlib
import io
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from quarterdeck.cli import main

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))
FENCE = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)


def blocks(page: Path) -> Iterator[tuple[str, str, str]]:
    """Yield each fenced block of a page: its language, its text, and the name of the file that it is, if it is told."""
    text = page.read_text(encoding="utf-8")
    for found in FENCE.finditer(text):
        named = re.search(r"this as `([\w./-]+)`:\s*$", text[: found.start()])
        yield found[1], found[2], named[1] if named else ""


class Shell:
    """Runs a tutorial's commands in a folder: `quarterdeck` in this process, a line that ends with & in the background."""

    def __init__(self) -> None:
        self.said = ""
        self.running: list[subprocess.Popen] = []

    def run(self, line: str) -> int:
        """Run a line, keep what it says, and return its exit status."""
        if line.endswith("&"):
            words = shlex.split(line[:-1])
            if words[0] == "dask":
                words = [sys.executable, "-m", "dask", *words[1:]]
            quiet = subprocess.DEVNULL
            self.running.append(subprocess.Popen(words, stdout=quiet, stderr=quiet, start_new_session=True))
            return 0
        words = shlex.split(line)
        if words[0] != "quarterdeck":
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            self.said += done.stdout + done.stderr
            return done.returncode
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
            status = 0
            try:
                main(words[1:])
            except SystemExit as stop:
                status = int(stop.code or 0)
        self.said += out.getvalue() + err.getvalue()
        return status

    def close(self) -> None:
        """Stop what runs in the background."""
        for process in self.running:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda p: p.stem)
def test_a_tutorial_runs_and_prints_what_it_quotes(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command, in order, ends with the status told (else 0); every quoted line is in what was said since the last."""
    if page.stem in ("survey", "inspect", "cluster"):
        pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
    if page.stem == "cluster":
        pytest.importorskip("distributed", reason="Dask is absent (extra `cluster`)")
    monkeypatch.chdir(tmp_path)
    shell = Shell()
    try:
        for language, text, name in blocks(page):
            if name:
                Path(name).write_text(text, encoding="utf-8")
            elif language == "sh":
                for line in text.splitlines():
                    command, _, told = line.partition("  # exit status ")
                    status = shell.run(command)
                    assert status == int(told or 0), f"{command}: {status}\n{shell.said}"
            elif language == "python":
                exec(compile(text, str(page), "exec"), {})
            elif language == "text":
                said = " ".join(shell.said.split())
                for line in text.splitlines():
                    assert " ".join(line.split()) in said, f"not said: {line}\n{shell.said}"
                shell.said = ""
    finally:
        shell.close()
