"""Localise robots many times over: `python benchmarks/localisation.py --runs 100 --json`.

Three trials on random sites: tracking where the filter's assumptions hold exactly (is it consistent: does its covariance
tell its error?), tracking with the default lidar and odometry, and a robot that is kidnapped (or starts anywhere) and has
to find itself again within 30 s to half a metre.
"""

import argparse
import json
import time
from dataclasses import replace

import numpy as np
import shapely
from scipy.stats import chi2

from quarterdeck.geo.angles import wrap
from quarterdeck.physics.amcl import (
    ALARM,
    Belief,
    FilterParams,
    believe_anywhere,
    believe_at,
    estimate,
    lostness,
    move,
    recover,
    resample,
    weigh_scan,
)
from quarterdeck.physics.lidar import beam_angles, cast, edge_grid, noisy
from quarterdeck.physics.likelihood import distance_field
from quarterdeck.physics.positioning import ODOMETRY, OdometryModel, add_motion, body_motion, draw_faults, measure_motion

ANGLES, REACH, PERIOD = beam_angles(180), 30.0, 0.5
FOUND = 0.5  # m


def random_site(random: np.random.Generator, size: tuple[float, float], count: int) -> list[shapely.Polygon]:
    """Return turned boxes, at least 2 m apart."""
    boxes: list[shapely.Polygon] = []
    while len(boxes) < count:
        (x, y), (a, b) = random.uniform((0, 0), size), random.uniform(1, 5, 2)
        box = shapely.affinity.rotate(shapely.box(x - a, y - b, x + a, y + b), random.uniform(0, 180))
        if all(box.distance(other) > 2 for other in boxes):
            boxes.append(box)
    return boxes


def drive(random: np.random.Generator, solid: shapely.Geometry, size: tuple[float, float], steps: int) -> np.ndarray:
    """Return (steps + 1, 3) poses of a robot that wanders at 1 m/s and turns on the spot where it cannot."""

    def clear(pose: np.ndarray) -> bool:
        return bool(0 < pose[0] < size[0] and 0 < pose[1] < size[1] and not shapely.contains_xy(solid, *pose[:2]))

    pose = np.array([*random.uniform((0, 0), size), random.uniform(-np.pi, np.pi)])
    while not clear(pose):
        pose[:2] = random.uniform((0, 0), size)
    poses = [pose]
    while len(poses) <= steps:
        onward = add_motion(poses[-1][None], np.array([[PERIOD, 0.0, random.normal(0, 0.2)]]))[0]
        turned = add_motion(poses[-1][None], np.array([[0.0, 0.0, 0.5]]))[0]
        poses.append(onward if clear(onward) else turned)
    return np.array(poses)


def trial(
    seed: int,
    *,
    steps: int = 60,
    kidnap: bool = False,
    lost: bool = False,
    size: tuple[float, float] = (60.0, 40.0),
    params: FilterParams | None = None,
    odometry: OdometryModel = ODOMETRY["ground"],
    deviation: float = 0.03,
    scatter: float = 0.0,
) -> dict[str, np.ndarray]:
    """Return per step of one run: position `error` in metres, `nees`, number of `particles` and CPU `seconds`.

    `deviation` metres is the lidar's noise along its beams, `scatter` that of the beams' ends in every direction. A
    kidnapped robot drives `steps`, is put elsewhere and drives as many again; a lost one does not know where it starts.
    """
    params = params or FilterParams()
    random = np.random.default_rng(seed)
    boxes = random_site(random, size, round(size[0] * size[1] / 170))
    grid, field = edge_grid(boxes), distance_field(boxes, (0.0, 0.0, *size))
    solid = shapely.union_all(boxes).buffer(0.8)
    poses = drive(random, solid, size, steps)
    if kidnap:
        poses = np.vstack([poses, drive(random, solid, size, steps)])
    motions = body_motion(poses[:-1], poses[1:])
    if kidnap:
        motions[steps] = 0.0
    told = measure_motion(motions, PERIOD, odometry, draw_faults(1, odometry, random), random)
    scans = noisy(cast(grid, poses, ANGLES, REACH), random, deviation=deviation, dropout=0.01, reach=REACH)
    angles = np.broadcast_to(ANGLES, scans.shape)
    if scatter:
        with np.errstate(invalid="ignore"):
            scans, angles = scattered(scans, scatter, random)
    belief: Belief = (
        believe_anywhere(field, grid, ANGLES, scans[0], REACH, random=random, params=params)
        if lost
        else believe_at(poses[0], (0.1, 0.1, 0.05), params, random)
    )
    rows = []
    for motion, scan, angle, pose in zip(told, scans[1:], angles[1:], poses[1:], strict=True):
        began = time.process_time()
        belief = weigh_scan(move(belief, motion, PERIOD, params, random), field, angle, scan, params)
        part = lostness(belief)
        if part > ALARM:
            belief = recover(belief, part, field, grid, angle, scan, REACH, params, random)
        belief = resample(belief, params, random)
        best = estimate(belief)
        off = best.pose - pose
        off[2] = wrap(off[2])
        nees = float(off @ np.linalg.solve(best.covariance + 1e-12 * np.eye(3), off))
        rows.append((np.hypot(*off[:2]), nees, len(belief.weights), time.process_time() - began))
    return dict(zip(("error", "nees", "particles", "seconds"), np.array(rows).T, strict=True))


def scattered(scans: np.ndarray, deviation: float, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return ranges and angles (t, b) of scans whose ends are off by `deviation` metres in x and in y: what a likelihood
    field assumes, and no lidar does.
    """
    x, y = scans * np.cos(ANGLES), scans * np.sin(ANGLES)
    x, y = x + deviation * random.standard_normal(x.shape), y + deviation * random.standard_normal(y.shape)
    return np.where(np.isfinite(scans), np.hypot(x, y), np.inf), np.where(np.isfinite(scans), np.arctan2(y, x), ANGLES)


def matched() -> dict[str, object]:
    """Return the arguments of a trial in which all that the filter assumes is so."""
    params = replace(FilterParams(), random_part=0.001, least=2000)
    odometry = OdometryModel(params.along, params.across, params.drift, params.turn, params.gyro, scale=0.0)
    return {"params": params, "odometry": odometry, "deviation": 0.0, "scatter": params.hit}


def recovered(error: np.ndarray, after: int) -> bool:
    """Say whether a robot found itself within 30 s of step `after`, and stayed found."""
    within = error[after + round(30 / PERIOD) :]
    return bool(len(within) and (within < FOUND).all())


def main() -> None:
    """Run the trials and print their figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    trial(0, steps=2, kidnap=True)  # compile
    seeds = range(1, args.runs + 1)
    exact = np.array([trial(seed, **matched())["nees"] for seed in seeds])[:, 9:]
    tracking = [trial(seed) for seed in seeds]
    kidnapped = [trial(seed, kidnap=True, steps=90)["error"] for seed in seeds]
    lost = [trial(seed, lost=True, steps=90)["error"] for seed in seeds]
    low, high = chi2.ppf([0.025, 0.975], 3 * args.runs) / args.runs
    figures = {
        "runs": args.runs,
        "nees_mean": round(float(exact.mean()), 3),
        "nees_95_region": [round(float(low), 3), round(float(high), 3)],
        "nees_steps_within": round(float(((exact.mean(axis=0) > low) & (exact.mean(axis=0) < high)).mean()), 3),
        "default_nees_mean": round(float(np.mean([t["nees"][9:].mean() for t in tracking])), 3),
        "tracking_error_mean_m": round(float(np.mean([t["error"].mean() for t in tracking])), 4),
        "tracking_error_max_m": round(float(max(t["error"].max() for t in tracking)), 4),
        "ms_per_update": round(1000 * float(np.mean([t["seconds"].mean() for t in tracking])), 3),
        "particles_mean": round(float(np.mean([t["particles"].mean() for t in tracking])), 1),
        "kidnapped_recovered": sum(recovered(e, 90) for e in kidnapped),
        "lost_at_start_recovered": sum(recovered(e, 0) for e in lost),
    }
    print(json.dumps(figures) if args.json else "\n".join(f"{n:26} {v}" for n, v in figures.items()))


if __name__ == "__main__":
    main()
