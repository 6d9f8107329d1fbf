#!/usr/bin/env python3
"""How the error of matches grows with their fitness: tau and theta of P4 (36), by method.

  ./run bench match-noise                            the tuning data: fits tau and theta of every method
  ./run bench match-noise --recordings SITE:SEED:SECONDS ... [--methods ndt gicp] [--keep DIR]

The error is that of a match relative to the match ten scans before, against the truth, in metres for
each axis. Fitness is over all points of a scan, the worse of the two. The deviation of an error is
sigma (1 + theta max(0, f - tau)^2). Tau is a quantile of the fitness, and all three make the errors
as likely as can be. The largest 0.5 % of errors are left out. Columns: best quarter and worst tenth
of the fitness. Growth and the last columns use the values that the program has, so on recordings that
did not choose them they are a check. Needs numpy and scipy.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp
from scipy.stats import spearmanr

from program import PROGRAM, TOP

METHODS = {"ndt": "ndt/ndt", "gicp": "gicp/gicp", "icp": "icp/icp", "loam": "loam/loam", "vgicp": "vgicp/vgicp",
           "ndt_d2d": "ndt_d2d/ndt_d2d"}
TUNING = ["handheld:3:30", "harvester:3:30", "lohja1:3:30"]
STEP = 10  # scans


def noise_of(method):
    """Tau and theta that the program has."""
    header = (TOP / "src/understory/registration" / f"{METHODS[method]}_matcher.h").read_text()
    return tuple(float(word) for word in re.search(r"kFitnessNoise\{([\d.]+), ([\d.]+)\}", header).groups())


def matched(recording, method, keep):
    site, seed, seconds = recording.split(":")
    folder = keep / f"{site}_{seed}_{seconds}_{method}"
    if not (folder / "truth/trajectory.tum").exists():
        uri = f"sim:{site}?seed={seed}&duration_s={seconds}&cache={keep / 'casts'}"
        subprocess.run([Path(PROGRAM).parent / "benchmarks/match_noise", uri, method, folder], check=True)
    return folder


def errors_of(folder):
    """Errors of matches along three axes, m, and the worse fitness of the two, m^2."""
    truth = np.loadtxt(folder / "truth/trajectory.tum", comments="#")
    rows = np.loadtxt(folder / "matches.txt")
    rows = rows[(rows[:, 0] >= truth[0, 0]) & (rows[:, 0] <= truth[-1, 0])]
    places, turns, fitness = rows[:, 1:4], Rotation.from_quat(rows[:, 4:8]), rows[:, 8]
    true_places = np.stack([np.interp(rows[:, 0], truth[:, 0], truth[:, k]) for k in (1, 2, 3)], 1)
    true_turns = Slerp(truth[:, 0], Rotation.from_quat(truth[:, 4:8]))(rows[:, 0])
    a, b = slice(None, -STEP), slice(STEP, None)
    step = turns[a].inv().apply(places[b] - places[a])
    true_step = true_turns[a].inv().apply(true_places[b] - true_places[a])
    return step - true_step, np.maximum(fitness[a], fitness[b])


def fitted(errors, fitness):
    """Tau and theta that make the errors most likely."""
    best = (np.inf, 0.0, 0.0)
    for share in np.arange(0.0, 0.95, 0.1):
        tau = np.quantile(fitness, share)
        for theta in np.geomspace(0.1, 3e4, 40):
            growth = 1.0 + theta * np.maximum(0.0, fitness - tau) ** 2
            sigma = np.sqrt(np.mean((errors / growth[:, None]) ** 2))
            cost = np.log(sigma) + np.mean(np.log(growth))
            best = min(best, (cost, tau, theta))
    return best[1:]


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def row(method, folders):
    parts = [errors_of(folder) for folder in folders]
    errors, fitness = (np.concatenate(part) for part in zip(*parts))
    size = np.linalg.norm(errors, axis=1)
    usual = size < np.quantile(size, 0.995)
    errors, fitness, size = errors[usual], fitness[usual], size[usual]
    tau, theta = fitted(errors, fitness)
    has_tau, has_theta = noise_of(method)
    growth = 1.0 + has_theta * np.maximum(0.0, fitness - has_tau) ** 2
    scaled = errors / growth[:, None]
    scaled /= rms(scaled)
    low, high = fitness <= np.quantile(fitness, 0.25), fitness >= np.quantile(fitness, 0.9)
    print(f"| `{method}` | {len(errors)} | {tau:.3f} | {theta:.0f} | {has_tau:g} | {has_theta:g} "
          f"| {spearmanr(fitness, size)[0]:.2f} | {100 * rms(errors[low]):.2f} cm | {100 * rms(errors[high]):.2f} cm "
          f"| {rms(growth[high]):.1f} | {rms(errors[high]) / rms(errors[low]):.1f} "
          f"| {rms(scaled[high]) / rms(scaled[low]):.1f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", nargs="+", default=TUNING, metavar="SITE:SEED:SECONDS")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keeps the matches there, and goes on from them")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        keep = (options.keep or Path(scratch)).resolve()
        (keep / "casts").mkdir(parents=True, exist_ok=True)
        print("| method | matches | tau fitted, m² | theta fitted, 1/m⁴ | tau | theta | rank correlation | error, best quarter "
              "| worst tenth | growth by (36) there | ratio of errors | the same over the growth |\n" + "|---" * 12 + "|")
        for method in options.methods:
            row(method, [matched(recording, method, keep) for recording in options.recordings])
    return 0


if __name__ == "__main__":
    sys.exit(main())
