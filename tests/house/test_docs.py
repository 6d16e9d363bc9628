"""The README and the documents: what they tell to run runs, and prints what they quote; links lead somewhere."""

import contextlib
import io
import os
import re
import runpy
import shlex
import signal
import socket
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from quarterdeck.cli import main

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted((DOCS / "tutorials").glob("*.md")), DOCS / "api.md", DOCS / "extending.md"]
FENCE = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)


def blocks(page: Path) -> Iterator[tuple[str, str, str]]:
    """Yield each fenced block of a page: its language, its text, and the name of the file that it is, if it is told."""
    text = page.read_text(encoding="utf-8")
    for found in FENCE.finditer(text):
        named = re.search(r"this as `([\w./-]+)`:\s*$", text[: found.start()])
        yield found[1], found[2], named[1] if named else ""


class Shell:
    """Runs the commands of a page in the working folder: `quarterdeck` in this process unless it is to be `apart` or in a
    pipe, a line that ends with & in the background.
    """

    def __init__(self, *, apart: bool = False) -> None:
        self.said = ""
        self.apart = apart
        self.running: list[subprocess.Popen] = []

    def run(self, line: str) -> int:
        """Run a line, keep what it says, and return its exit status."""
        python = f"{shlex.quote(sys.executable)} -m "
        if line.endswith("&"):
            line, quiet = re.sub(r"^dask ", f"{python}dask ", line[:-1]), subprocess.DEVNULL
            self.running.append(subprocess.Popen(shlex.split(line), stdout=quiet, stderr=quiet, start_new_session=True))
            return 0
        if self.apart or "|" in line or not line.startswith("quarterdeck "):
            line = re.sub(r"(^|\| )quarterdeck ", rf"\1{python}quarterdeck ", line)
            done = subprocess.run(line, shell=True, capture_output=True, text=True, check=False)
            self.said += done.stdout + done.stderr
            return done.returncode
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
            status = 0
            try:
                main(shlex.split(line)[1:])
            except SystemExit as stop:
                status = int(stop.code or 0)
        self.said += out.getvalue() + err.getvalue()
        return status

    def close(self) -> None:
        """Stop what runs in the background."""
        for process in self.running:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def install(folder: Path, pyproject: dict[str, Any]) -> None:
    """Make the entry points of a pyproject.toml known in a folder, as pip would."""
    project = pyproject["project"]
    made = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    made.mkdir()
    (made / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = [f"[{g}]\n" + "".join(f"{k} = {v}\n" for k, v in e.items()) for g, e in project["entry-points"].items()]
    (made / "entry_points.txt").write_text("\n".join(groups))


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_a_page_runs_and_prints_what_it_quotes(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command, in order, ends with the status told (else 0); every quoted line is in what was said since the last."""
    if page.stem != "export":
        pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
    if page.stem == "cluster":
        pytest.importorskip("distributed", reason="Dask is absent (extra `cluster`)")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(tmp_path)]))
    (tmp_path / "data").symlink_to(ROOT / "data")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])  # in place of the scheduler's, which another test run may have taken
    shell, names = Shell(apart=page.stem == "extending"), {}
    try:
        for language, text, name in blocks(page):
            if name:
                Path(name).write_text(text, encoding="utf-8")
            elif language == "sh":
                for line in text.splitlines():
                    if line.startswith("make "):  # that these targets exist is looked at in test_readme.py
                        continue
                    command, _, told = line.partition("  # exit status ")
                    status = shell.run(command.replace("18786", port))
                    assert status == int(told or 0), f"{command}: {status}\n{shell.said}"
            elif language == "python":
                exec(compile(text, str(page), "exec"), names)
            elif language == "toml":
                install(tmp_path, tomllib.loads(text))
            elif language == "text":
                said = " ".join(shell.said.split())
                for line in text.splitlines():
                    assert " ".join(line.split()) in said, f"not said: {line}\n{shell.said}"
                shell.said = ""
    finally:
        shell.close()


def test_examples_of_extending_are_short() -> None:
    """Adding a vehicle, an exporter or a planner takes fewer than 60 lines."""
    sizes = {name: len(text.splitlines()) for _, text, name in blocks(DOCS / "extending.md") if name}
    assert set(sizes) == {"catamaran.toml", "sailing_plan.py", "rings.py"}
    assert max(sizes.values()) < 60


def test_the_site_builds_without_a_broken_link(tmp_path: Path) -> None:
    """MkDocs, strict: every link and anchor leads somewhere, every page is in the navigation."""
    pytest.importorskip("mkdocs", reason="MkDocs is not installed")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "tutorials" / "survey" / "index.html").exists()


def test_every_picture_is_shown_and_every_link_of_the_readme_leads_somewhere() -> None:
    """No picture is left over, and the README's relative links are files."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = readme + "".join(p.read_text(encoding="utf-8") for p in DOCS.rglob("*.md"))
    assert [p.name for p in (DOCS / "pictures").iterdir() if f"pictures/{p.name}" not in shown] == []
    links = re.findall(r"\]\(([^)#:]+)\)", readme)
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_the_table_of_vehicles_is_current() -> None:
    """docs/vehicles.md is what docs/generate.py writes."""
    made = runpy.run_path(str(DOCS / "generate.py"))
    assert (DOCS / "vehicles.md").read_text(encoding="utf-8") == made["vehicles_page"]()
