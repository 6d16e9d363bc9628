"""Running the cases of a study: over processes of this machine, or on a Dask cluster."""

import os
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any

from quarterdeck.campaign.kind import Case
from quarterdeck.geo.deadline import time_is_up, time_left
from quarterdeck.geo.errors import InputError, UnavailableError
from quarterdeck.geo.version import VERSION

RUNS = "the runs"  # what a time limit cuts
TRIES = 3  # times that a case may take its worker down before it is given up


def run_case(text: str, case: Case, limits: dict[str, float]) -> dict[str, Any]:
    """Return the row of one run: the case, the verdict with its reasons, and the figures.

    What goes wrong inside becomes the row's `error`: one bad run does not end a campaign.
    """
    row = case.row()
    try:
        found = case.run(text, limits)
    except Exception as error:
        return row | {"passed": False, "error": f"{type(error).__name__}: {error}", "reasons": ""}
    return row | {"passed": found.pop("passed"), "error": "", "reasons": found.pop("reasons")} | found


def over_processes(text: str, todo: list[Case], limits: dict[str, float], jobs: int) -> Iterator[dict[str, Any]]:
    """Yield rows as runs are done, `jobs` processes at work. A process that dies takes down the runs in flight alone: they
    are tried again, and given up after TRIES. At the time limit those in flight are ended and no more are begun.
    """
    waiting, fallen = list(reversed(todo)), Counter[int]()
    while waiting:
        flying: dict[Future[dict[str, Any]], Case] = {}
        with ProcessPoolExecutor(jobs, get_context("spawn"), _mind_the_parent, (os.getpid(),)) as pool:
            try:
                broken = False
                while (waiting or flying) and not broken:
                    while waiting and len(flying) < jobs and not broken:
                        case = waiting.pop()
                        try:
                            flying[pool.submit(run_case, text, case, limits)] = case
                        except BrokenProcessPool:
                            waiting.append(case)
                            broken = True
                    for future in wait(flying, time_left(), FIRST_COMPLETED).done if flying else ():
                        try:
                            row = future.result()
                        except BrokenProcessPool:
                            broken = True
                            continue
                        del flying[future]
                        yield row
                    if time_is_up(RUNS):
                        _end(pool)
                        return
            except (KeyboardInterrupt, GeneratorExit):
                _end(pool)
                raise
        for case in flying.values():
            fallen[case.number] += 1
            if fallen[case.number] < TRIES:
                waiting.append(case)
            else:
                yield _given_up(case)


def _end(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool, in the midst of what they do."""
    processes = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.terminate()


def over_cluster(text: str, todo: list[Case], limits: dict[str, float], address: str) -> Iterator[dict[str, Any]]:
    """Yield rows as runs are done on the Dask cluster whose scheduler is at `address`; workers may come, go and die.

    At the time limit those in flight are given up and no more are begun.
    Raises UnavailableError where Dask is absent, InputError if nobody answers at the address.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError:
        raise UnavailableError("running on a cluster needs Dask: pip install 'quarterdeck[cluster]'") from None
    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at {address} ({error}); start one with `dask scheduler`") from None
    with client:
        others = {v for v in client.run(_version).values() if v != VERSION}
        if others:
            raise InputError(
                f"workers at {address} have quarterdeck {', '.join(sorted(others))}, here is {VERSION}; make them equal"
            )
        waiting = list(reversed(todo))

        def submit() -> Any:
            case = waiting.pop()
            future = client.submit(
                run_case, text, case, limits, pure=False, key=f"quarterdeck-{case.number}-{time.time_ns()}"
            )
            future.case = case
            return future

        # A few more than there are hands for, so that none waits; workers that join later are given work as it goes.
        hands = 2 * sum(client.nthreads().values()) + 2
        flying = as_completed([submit() for _ in range(min(len(waiting), hands))], loop=client.loop, timeout=time_left())
        try:
            for future in flying:
                try:
                    row = future.result()
                except KilledWorker:
                    row = _given_up(future.case)
                except CancelledError:
                    raise InputError(
                        f"the Dask scheduler at {address} went away; start it and call again to go on"
                    ) from None
                yield row
                if time_is_up(RUNS):
                    return
                if waiting:
                    flying.add(submit())
        except TimeoutError:  # of the wait; a run's own ends the campaign in the open
            if not time_is_up(RUNS):
                raise


def _version() -> str:
    return VERSION


def _given_up(case: Case) -> dict[str, Any]:
    return case.row() | {"passed": False, "error": f"took its worker down {TRIES} times", "reasons": ""}


def _mind_the_parent(parent: int) -> None:
    """End this worker when the campaign is killed: else it would wait for work for ever. Ctrl-C is the parent's to
    handle.
    """
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
