"""KISS-Matcher on pairs of scans without a guess, beside our `global` on the same pairs.

    kiss_matcher_pairs.py VERDICT_PAIRS FOLDER [MOST_PAIRS [VOXEL_M]]

Folders as pair_scans writes them. Runs in an environment with benchmarks/peers/newcomers/kiss-matcher.txt.
Every so-manieth pair is taken, at most MOST_PAIRS; ours is run first on all pairs. It prints, for pairs
that share half of their points and for the others, how many answers lie within 0.5 m and 2 degrees, and
CPU time. KISS-Matcher's time holds its thinning and its features; ours leaves the preparation out.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import kiss_matcher
import numpy as np


def poses_of(folder):
    rows = np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)
    return [np.vstack([row, [0, 0, 0, 1]]) for row in rows]


def off(pose, truth):
    error = np.linalg.inv(truth) @ pose
    turn = np.degrees(np.arccos(np.clip(0.5 * (np.trace(error[:3, :3]) - 1), -1, 1)))
    return np.linalg.norm(error[:3, 3]), turn


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    most = int(sys.argv[3]) if len(sys.argv) > 3 else 100
    voxel_m = float(sys.argv[4]) if len(sys.argv) > 4 else 0.3
    told = subprocess.run([program, folder, folder, "global", "1"], check=True, capture_output=True, text=True)
    ours = [json.loads(line) for line in told.stdout.splitlines()]
    ours = ours[::max(1, len(ours) // most)]
    poses = poses_of(folder)
    scans = [np.fromfile(folder / f"scan_{i:03d}.bin", np.float32).reshape(-1, 4)[:, :3] for i in range(len(poses))]
    rows = []
    for pair in ours:
        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(voxel_m))
        begin = time.process_time()
        found = matcher.estimate(list(scans[pair["j"]]), list(scans[pair["i"]]))
        spent = 1e3 * (time.process_time() - begin)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = found.rotation, np.ravel(found.translation)
        rows.append((pair, *off(pose, np.linalg.inv(poses[pair["i"]]) @ poses[pair["j"]]), spent))
    for name, part in (("half overlap and more", [r for r in rows if r[0]["overlap"] >= 0.5]),
                       ("less", [r for r in rows if r[0]["overlap"] < 0.5])):
        if not part:
            continue
        right = lambda metres, degrees: metres < 0.5 and degrees < 2.0
        print(f"{folder.name}, {name}: {len(part)} pairs; right ours "
              f"{sum(right(r[0]['off_m'], r[0]['off_deg']) for r in part)}, KISS-Matcher {sum(right(r[1], r[2]) for r in part)}; "
              f"CPU ms ours {np.mean([r[0]['ms'] for r in part]):.0f}, KISS-Matcher {np.mean([r[3] for r in part]):.0f}")


if __name__ == "__main__":
    main()
