"""Pairs of scans by kiss-matcher without a guess, a line of JSON a pair, as verdict_pairs prints ours.

    kiss_matcher_pairs.py FOLDER [MOST_APART_M [VOXEL_M]]

FOLDER is as pair_scans writes it: scan_NNN.bin (x y z intensity, float32) and poses.txt (world from
lidar, 12 numbers a line). Runs in kiss-matcher's own environment, on one thread. Times are CPU: for
both clouds' features, matching and solving, as its estimate() does all of them.
"""

import json
import sys
import time
from pathlib import Path

import kiss_matcher
import numpy as np


def read_scan(path):
    points = np.fromfile(path, np.float32).reshape(-1, 4)[:, :3]
    return points[np.isfinite(points).all(axis=1)]


def read_poses(path):
    poses = []
    for row in np.loadtxt(path).reshape(-1, 12):
        pose = np.eye(4)
        pose[:3] = row.reshape(3, 4)
        poses.append(pose)
    return poses


def off(pose, truth):
    difference = np.linalg.inv(truth) @ pose
    cosine = np.clip((np.trace(difference[:3, :3]) - 1) / 2, -1, 1)
    return np.linalg.norm(difference[:3, 3]), np.degrees(np.arccos(cosine))


def main():
    folder = Path(sys.argv[1])
    most_apart = float(sys.argv[2]) if len(sys.argv) > 2 else 25.0
    voxel = float(sys.argv[3]) if len(sys.argv) > 3 else 0.3
    poses = read_poses(folder / "poses.txt")
    scans = [read_scan(folder / f"scan_{i:03d}.bin") for i in range(len(poses))]
    for i, target in enumerate(scans):
        for j in range(i + 1, len(scans)):
            truth = np.linalg.inv(poses[i]) @ poses[j]
            if np.linalg.norm(truth[:3, 3]) > most_apart:
                continue
            matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(voxel))
            start = time.process_time()
            found = matcher.estimate(scans[j], target)
            ms = 1e3 * (time.process_time() - start)
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = found.rotation, np.ravel(found.translation)
            off_m, off_deg = off(pose, truth)
            print(json.dumps({"i": i, "j": j, "off_m": round(float(off_m), 4),
                              "off_deg": round(float(off_deg), 4),
                              "inliers": matcher.get_num_final_inliers(), "ms": round(ms, 1)}),
                  flush=True)


if __name__ == "__main__":
    main()
