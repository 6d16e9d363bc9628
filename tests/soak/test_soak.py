"""Nothing that a user feeds it breaks it: damaged input gives a right result or one clear line, never anything else."""

import re
import sys
from collections import Counter

import numpy as np
import pytest
from fuzzing.pool import Worker
from fuzzing.targets import AUTOPILOTS, TARGETS, make_sound

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")


@pytest.fixture(scope="module")
def worker():
    """Return the process that runs the command line."""
    with Worker() as process:
        yield process


@pytest.fixture(scope="module")
def sound(worker):
    """Return sound PLANs and what comes of them, by name."""
    return make_sound(worker.run)


def test_damaged_input(worker, sound, soak_cases, soak_from, tmp_path_factory):
    """Every reader and every verb: a result, or one line and exit status 2; no crash, hang, flood or half a file."""
    _feed(TARGETS, range(soak_from, soak_from + soak_cases), worker, sound, tmp_path_factory.getbasetemp())


def test_damaged_logs_of_autopilots(worker, sound, soak_cases, soak_from, tmp_path_factory):
    """The same for ArduPilot's .bin and .tlog, of which one is fed for every twenty others."""
    pytest.importorskip("pymavlink", reason="the extra `logs` is not installed: it makes and reads these logs")
    cases = range(soak_from // 20, (soak_from + soak_cases) // 20)
    _feed(AUTOPILOTS, cases, worker, sound, tmp_path_factory.getbasetemp())


def _feed(known, cases, worker, sound, folder):
    """Run the cases, each by the seed of its number; tell what came of them; fail where something was not allowed."""
    names = list(known)
    weights = np.array([weight for weight, _ in known.values()], dtype=float)
    ended, seconds, broken = Counter(), Counter(), {}
    for case in cases:
        rng = np.random.default_rng(case)
        name = names[rng.choice(len(names), p=weights / weights.sum())]
        request = known[name][1](rng, sound)
        told = worker.run(request.files, request.args, stdin=request.stdin)
        ended[name, told["status"]] += 1
        seconds[name] += told["seconds"]
        if told["broken"]:
            broken.setdefault(_signature(told["broken"]), []).append((case, name, request, told["broken"]))
    lines = [f"{n}: { {s: c for (m, s), c in ended.items() if m == n} } {seconds[n]:.1f} CPU s" for n in names]
    sys.stderr.write("\n".join([*lines, f"{len(cases)} cases, {sum(seconds.values()):.1f} CPU s", ""]))
    for alike in broken.values():
        case, name, request, why = alike[0]
        kept = folder / f"case-{name}-{case}"
        kept.mkdir()
        for file, data in request.files.items():
            (kept / file).write_bytes(data)
        every = [c for c, *_ in alike]
        sys.stderr.write(f"\n{len(alike)} cases {every[:8]}, {name}, in {kept}: {' '.join(request.args)}\n{why}\n")
    assert not broken, f"{sum(map(len, broken.values()))} of {len(cases)} cases, of {len(broken)} kinds: see standard error"
    for name in names:  # all are fed, and damage leaves something to do for each: else only refusals are tried
        count = sum(count for (n, _), count in ended.items() if n == name)
        assert count or len(cases) < 1000, f"no case of {name}"
        assert count < 100 or ended[name, 0] + ended[name, 1], f"no case of {name} was sound"


def _signature(why: str) -> str:
    """Return what cases of one cause have in common: the innermost line of ours and the kind of error."""
    lines = why.strip().splitlines()
    own = [line.strip() for line in lines if "/quarterdeck/" in line]
    return f"{own[-1] if own else ''} {re.split(r'[:0-9]', lines[-1])[0]}"
