"""Campaigns end to end: run, killed, gone on with, replayed, on a cluster."""

import errno
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from quarterdeck.campaign.execute import over_cluster, run_case
from quarterdeck.campaign.journal import Journal
from quarterdeck.campaign.study import cases, read_study
from quarterdeck.cli import main
from quarterdeck.geo.errors import InputError

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")

Writer = Callable[[str], Path]
STUDY = """runs = 12
[conditions]
faults = [[], ["random:2"]]
gnss = "sbas"
[limits]
cross_track = 2.5
coverage_loss = 0.5
"""


def campaign(*args: object) -> int:
    """Run the command line and return its exit status."""
    with pytest.raises(SystemExit) as stop:
        main(["campaign", *map(str, args)])
    return int(stop.value.code or 0)


def rows(folder: Path) -> list[dict[str, object]]:
    """Return the rows in a journal, in the order in which they were done."""
    return [json.loads(line) for line in (folder / "runs.jsonl").read_bytes().splitlines()[1:]]


@pytest.fixture(scope="module")
def undisturbed(study: Writer, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of a campaign that nothing disturbed, computed here and now."""
    asked, folder = read_study(study(STUDY)), tmp_path_factory.mktemp("whole")
    with Journal(folder, asked.hash) as journal:
        for case in cases(asked):
            journal.add(run_case(asked.text, case, dict(asked.limits)))
    assert campaign(study(STUDY), "-o", folder) == 0
    return folder


@pytest.fixture
def whole(undisturbed: Path, tmp_path: Path) -> Path:
    """A copy of them."""
    return Path(shutil.copytree(undisturbed, tmp_path / "whole"))


def test_a_killed_campaign_goes_on_where_it_was(study: Writer, whole: Path, tmp_path: Path, capfd) -> None:
    """Killed without warning, with a line half written, it loses no run that was done, does none twice, ends up the
    same.
    """
    folder, path = tmp_path / "killed", study(STUDY)
    command = [sys.executable, "-m", "quarterdeck", "campaign", str(path), "-o", str(folder), "--jobs", "1"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE)
    try:
        deadline = time.monotonic() + 120
        while not (folder / "runs.jsonl").exists() or len(rows(folder)) < 3:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        with pytest.raises(InputError, match="another campaign"):
            Journal(folder, read_study(path).hash)
    finally:
        process.kill()
        process.communicate()
    done = rows(folder)
    with (folder / "runs.jsonl").open("ab") as file:
        file.write(b'{"number":23,"pas')
    assert campaign(path, "-o", folder, "--jobs", 1) == 0
    assert f"{len(done)} of 24 runs are done already" in capfd.readouterr().err
    numbers = [row["number"] for row in rows(folder)]
    assert sorted(numbers) == list(range(24))
    assert rows(folder)[: len(done)] == done
    assert (folder / "runs.csv").read_bytes() == (whole / "runs.csv").read_bytes()


def test_a_time_limit_ends_a_campaign_that_goes_on_later(study: Writer, whole: Path, tmp_path: Path, capfd) -> None:
    """What is done by then is summed up, the rest is told, and done by the next call."""
    folder, path = tmp_path / "limited", study(STUDY)
    assert campaign(path, "-o", folder, "--jobs", 1, "--time-limit", 0.01) == 0
    done = rows(folder)
    assert len(done) < 24
    assert json.loads((folder / "summary.json").read_text())["runs"] == len(done)
    assert f"cut short by --time-limit: {len(done)} of 24 runs are done" in capfd.readouterr().err
    assert campaign(path, "-o", folder, "--jobs", 1) == 0
    assert (folder / "runs.csv").read_bytes() == (whole / "runs.csv").read_bytes()


def test_the_summary_tells_and_the_worst_can_be_replayed(study: Writer, whole: Path, tmp_path: Path, capfd) -> None:
    """Faults lower the probability of success; the command of the worst run makes the very same trajectory."""
    summary = json.loads((whole / "summary.json").read_text(encoding="utf-8"))
    calm, faulty = summary["levels"]
    assert calm["levels"] == {"faults": []}
    assert calm["probability"] == 1.0
    assert faulty["probability"] < 1.0
    assert faulty["low"] < faulty["probability"] < faulty["high"]
    assert summary["runs"] == summary["asked"] == 24
    assert (summary["seed"], len(summary["study_hash"])) == (0, 64)
    assert summary["passed"] == calm["passed"] + faulty["passed"]
    assert summary["reasons"]
    worst = summary["worst"][0]
    assert not worst["passed"]
    report = tmp_path / "again.json"
    words = shlex.split(worst["replay"])[1:]
    with pytest.raises(SystemExit) as stop:
        main([*words, "--report", str(report)])
    assert stop.value.code == 1
    again = json.loads(report.read_text(encoding="utf-8"))
    assert again["trace_hash"] == worst["trace_hash"]
    assert " | ".join(again["reasons"]) == worst["reasons"]
    capfd.readouterr()
    assert campaign(study(STUDY), "-o", whole, "--least", 0.999, "--json") == 1
    assert json.loads(capfd.readouterr().out) == summary


def test_results_of_another_study_are_not_mixed(study: Writer, whole: Path, capfd) -> None:
    """Another seed is another study: refused in one line, started anew only by force."""
    path = study("seed = 1\n" + STUDY.replace("runs = 12", "runs = 1"))
    assert campaign(path, "-o", whole, "--jobs", 1) == 2
    err = capfd.readouterr().err
    assert "another study" in err
    assert len(err.strip().splitlines()) == 1
    assert len(rows(whole)) == 24
    assert campaign(path, "-o", whole, "--jobs", 1, "--force") == 0
    assert len(rows(whole)) == 2


def test_a_full_disk_ends_a_campaign_in_one_line(study: Writer, tmp_path: Path, monkeypatch, capfd) -> None:
    """What was done before is kept, and done no more when there is room again."""
    path, folder = study(STUDY.replace("runs = 12", "runs = 2")), tmp_path / "runs"
    sync, calls = os.fsync, []

    def full(number: int) -> None:
        calls.append(number)
        if len(calls) == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(number)

    monkeypatch.setattr(os, "fsync", full)
    assert campaign(path, "-o", folder, "--jobs", 1) == 2
    assert "cannot be written (No space left on device)" in capfd.readouterr().err.strip().splitlines()[-1]
    assert campaign(path, "-o", folder, "--jobs", 1) == 0
    assert len(rows(folder)) == 4


def test_a_run_that_goes_wrong_is_a_row(study: Writer, monkeypatch: pytest.MonkeyPatch) -> None:
    """An exception inside a run is told in its row and ends nothing."""

    def broken(*args: object, **options: object) -> None:
        raise ZeroDivisionError("on purpose")

    asked = read_study(study(STUDY))
    monkeypatch.setattr("quarterdeck.physics.simulate.simulate", broken)
    row = run_case(asked.text, next(cases(asked)), {})
    assert row["error"] == "ZeroDivisionError: on purpose"
    assert not row["passed"]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """A real Dask scheduler with two workers of one thread each, on loopback: its address, and the workers."""
    pytest.importorskip("distributed", reason="Dask is absent (extra `cluster`)")
    started, place, quiet = [], tmp_path / "scheduler.json", subprocess.DEVNULL
    base = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    started.append(subprocess.Popen([*base, "--scheduler-file", str(place)], stdout=quiet, stderr=quiet, cwd=tmp_path))
    try:
        deadline = time.monotonic() + 60
        while not place.exists() or not place.read_text(encoding="utf-8").strip():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        address = json.loads(place.read_text(encoding="utf-8"))["address"]
        base = [
            sys.executable,
            "-m",
            "distributed.cli.dask_worker",
            address,
            "--nthreads",
            "1",
            "--no-nanny",
            "--no-dashboard",
        ]
        base += ["--host", "127.0.0.1", "--local-directory", str(tmp_path)]
        started += [subprocess.Popen(base, stdout=quiet, stderr=quiet, cwd=tmp_path) for _ in range(2)]
        yield address, started[1:]
    finally:
        for process in started:
            process.kill()
            process.wait()


@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning", "ignore:Port .* is already in use")
def test_a_cluster_survives_the_loss_of_a_worker(study: Writer, whole: Path, tmp_path: Path, cluster) -> None:
    """Of two workers one is killed in the middle: every run is done, once, with the results of this machine."""
    address, workers = cluster
    folder = tmp_path / "cluster"
    command = [
        sys.executable,
        "-m",
        "quarterdeck",
        "campaign",
        str(study(STUDY)),
        "-o",
        str(folder),
        "--scheduler",
        address,
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE)
    try:
        deadline = time.monotonic() + 180
        while not (folder / "runs.jsonl").exists() or len(rows(folder)) < 4:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        os.kill(workers[0].pid, signal.SIGKILL)
        left = 24 - len(rows(folder))
        _, err = process.communicate(timeout=180)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0, err.decode()
    assert left > 0
    assert sorted(row["number"] for row in rows(folder)) == list(range(24))
    assert (folder / "runs.csv").read_bytes() == (whole / "runs.csv").read_bytes()


@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning", "ignore:Port .* is already in use")
def test_a_run_that_times_out_on_a_cluster_is_heard_of(study: Writer, cluster, monkeypatch) -> None:
    """A run's own TimeoutError is no time limit: it does not end a campaign as if all were done."""

    def late(*_: object) -> None:
        raise TimeoutError("on purpose")

    monkeypatch.setattr("quarterdeck.campaign.execute.run_case", late)
    asked = read_study(study(STUDY))
    with pytest.raises(TimeoutError, match="on purpose"):
        list(over_cluster(asked.text, list(cases(asked))[:2], {}, cluster[0]))


def test_nobody_at_the_address_is_one_line(study: Writer, tmp_path: Path, capfd) -> None:
    """A scheduler that does not answer."""
    pytest.importorskip("distributed", reason="Dask is absent (extra `cluster`)")
    assert campaign(study(STUDY), "-o", tmp_path / "none", "--scheduler", "tcp://127.0.0.1:9") == 2
    assert "no Dask scheduler answers" in capfd.readouterr().err.strip().splitlines()[-1]
