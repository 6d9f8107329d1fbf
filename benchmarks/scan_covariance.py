#!/usr/bin/env python3
"""Whether the stated covariance of scans follows their error: runs with truth, scan by scan.

    understory map REC -o RUN
    benchmarks/scan_covariance.py RUN TRUTH [RUN TRUTH ...]

The error of a scan is that of its pose relative to the last keyframe before it. It is measured against
the true relative pose, in the body frame. Each line gives the share of errors within one standard
deviation (of states.csv.gz), by degree of freedom and all together. 68 % is right for errors of a normal
distribution. Behind them stand the root mean square errors and the ratio of error and standard
deviation. Needs numpy and scipy.
"""
import gzip
import sys

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

NAMES = ("roll", "pitch", "yaw", "x", "y", "z")


def read_poses(path):
    rows = np.loadtxt(path, comments="#", ndmin=2)
    return rows[:, 0], rows[:, 1:4], Rotation.from_quat(rows[:, 4:8])


def at_times(poses, times):
    """Translations and rotations between poses; times outside of them are cut to their span."""
    stamps, places, turns = poses
    times = np.clip(times, stamps[0], stamps[-1])
    return np.stack([np.interp(times, stamps, places[:, i]) for i in range(3)], 1), Slerp(stamps, turns)(times)


def relative(places, turns, k):
    """Poses of all scans relative to those of index k."""
    back = turns[k].inv()
    return back.apply(places - places[k]), back * turns


def errors_of(run, truth):
    stamps, places, turns = read_poses(f"{run}/trajectory.tum")
    keyframes = read_poses(f"{run}/keyframes.tum")[0]
    true_places, true_turns = at_times(read_poses(f"{truth}/trajectory.tum"), stamps)
    last = np.searchsorted(keyframes, stamps - 1e-6, side="left") - 1
    use = (last >= 0) & ~np.isin(np.round(stamps, 5), np.round(keyframes, 5))
    k = np.clip(np.searchsorted(stamps, keyframes[np.maximum(last, 0)] - 1e-6), 0, len(stamps) - 1)
    here, turn = relative(places, turns, k)
    true_here, true_turn = relative(true_places, true_turns, k)
    error = np.hstack([(turn.inv() * true_turn).as_rotvec(), turn.inv().apply(true_here - here)])
    with gzip.open(f"{run}/states.csv.gz", "rt") as file:
        names = file.readline().strip().split(",")
        states = np.loadtxt(file, delimiter=",", ndmin=2)
    assert np.abs(states[:, 0] - stamps).max() < 1e-4, "states and trajectory are of different scans"
    deviation = np.sqrt(np.stack([states[:, names.index(f"c{i}{i}")] for i in range(6)], 1))
    return error[use], deviation[use]


def line(name, error, deviation):
    ratio = np.abs(error) / deviation
    share = 100 * (ratio < 1).mean(0)
    spread = np.sqrt((ratio ** 2).mean(0))
    size = np.sqrt((error ** 2).mean(0))
    shown = " ".join(f"{value:5.0f}" for value in [*share, 100 * (ratio < 1).mean()])
    print(f"{name:28} {len(error):5d} {shown}   " + " ".join(f"{value:5.2f}" for value in spread) +
          f"   {np.degrees(size[:3].max()):6.3f} {100 * size[3:].max():6.2f}")


def main():
    pairs = list(zip(sys.argv[1::2], sys.argv[2::2]))
    if not pairs:
        sys.exit(__doc__)
    print(f"{'run':28} {'scans':>5} " + " ".join(f"{n:>5}" for n in [*NAMES, "all"]) +
          "   error over its deviation             degrees     cm")
    every = []
    for run, truth in pairs:
        every.append(errors_of(run, truth))
        line(run.rstrip("/").rsplit("/", 1)[-1], *every[-1])
    line("all", *(np.concatenate(column) for column in zip(*every)))


if __name__ == "__main__":
    main()
