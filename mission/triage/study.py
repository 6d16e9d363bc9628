"""Many cases of several variants, the same casualties seed by seed: paired, so that differences have narrow intervals."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from itertools import chain
from math import ceil

import numpy as np
from scipy.stats import binomtest

from quarterdeck.geo.scenario import Scenario
from quarterdeck.mission.triage.figures import figures
from quarterdeck.mission.triage.generate import FEWEST, FIELD, MOST, generate, paper_team
from quarterdeck.mission.triage.outcome import Outcome, run_triage
from quarterdeck.mission.triage.settings import Settings

_CHUNK = 25  # cases handed to a process at a time
_RESAMPLES = 10_000


@dataclass(frozen=True, slots=True)
class Variant:
    """A method with its settings and team; what is not named is the paper's. `size` and speeds (UGV, UAV) in m and m/s."""

    method: str = "relay"
    settings: Settings = field(default_factory=Settings)
    ugvs: int = 3
    uavs: int = 1
    medics: int = 1
    size: tuple[float, float] = FIELD
    speeds: tuple[float, float] = (2.5, 8.0)
    casualties: tuple[int, int] = (FEWEST, MOST)
    clustered: bool = False


def run_case(variant: Variant, seed: int) -> dict[str, float]:
    """Return the figures of one seeded case; `complete` is 1 if all was searched, found and treated, else 0."""
    outcome = case_outcome(variant, seed)
    return figures(outcome) | {"seed": float(seed), "complete": float(not outcome.reasons)}


def case_outcome(variant: Variant, seed: int, site: Scenario | None = None) -> Outcome:
    """Return what became of one seeded case: on a site with its own team, or on the variant's field with its team."""
    team = site or paper_team(
        ugvs=variant.ugvs, uavs=variant.uavs, medics=variant.medics, size=variant.size, speeds=variant.speeds
    )
    scenario = generate(team, seed, casualties=variant.casualties, clustered=variant.clustered)
    return run_triage(scenario, variant.method, variant.settings, seed=seed)


def run_study(
    variants: Mapping[str, Variant], seeds: Sequence[int], *, jobs: int = 1, progress: Callable[[int], None] | None = None
) -> dict[str, dict[str, np.ndarray]]:
    """Return, by variant and figure, the (n,) values over the seeds, in their order whatever the number of `jobs`.

    `progress` is called with the number of cases done since the last call.
    """
    parts = [list(seeds[i : i + _CHUNK]) for i in range(0, len(seeds), _CHUNK)]
    work = [(variant, part) for variant in variants.values() for part in parts]
    rows: list[list[dict[str, float]]] = []
    if jobs == 1:
        results = map(_run_part, work)
        rows = _gather(results, progress)
    else:
        with ProcessPoolExecutor(jobs) as pool:
            rows = _gather(pool.map(_run_part, work), progress)
    per = ceil(len(seeds) / _CHUNK)
    found = {}
    for i, name in enumerate(variants):
        cases = list(chain.from_iterable(rows[i * per : (i + 1) * per]))
        found[name] = {k: np.array([c[k] for c in cases]) for k in (cases[0] if cases else {})}
    return found


def mean_interval(values: np.ndarray, *, seed: int = 0) -> tuple[float, float, float]:
    """Return the mean and its 95 % bootstrap interval, NaN left out (percentile method, 10,000 resamples)."""
    values = values[np.isfinite(values)]
    if not len(values):
        return (float("nan"),) * 3
    rng = np.random.default_rng(seed)
    means = np.concatenate(
        [values[rng.integers(0, len(values), (500, len(values)))].mean(axis=1) for _ in range(_RESAMPLES // 500)]
    )
    low, high = np.percentile(means, [2.5, 97.5])
    return float(values.mean()), float(low), float(high)


def difference(one: np.ndarray, other: np.ndarray) -> tuple[float, float, float]:
    """Return the mean of one minus other, pair by pair, and its 95 % bootstrap interval."""
    return mean_interval(one - other)


def share(wins: np.ndarray) -> tuple[float, float, float]:
    """Return the part of (n,) bool that is true and its 95 % Wilson interval."""
    if not len(wins):
        return (float("nan"),) * 3
    interval = binomtest(int(wins.sum()), len(wins)).proportion_ci(method="wilson")
    return float(wins.mean()), float(interval.low), float(interval.high)


def _run_part(work: tuple[Variant, list[int]]) -> list[dict[str, float]]:
    variant, seeds = work
    return [run_case(variant, seed) for seed in seeds]


def _gather(results: "object", progress: Callable[[int], None] | None) -> list[list[dict[str, float]]]:
    rows = []
    for part in results:  # type: ignore[attr-defined]
        rows.append(part)
        if progress is not None:
            progress(len(part))
    return rows
