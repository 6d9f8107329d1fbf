"""`understory register` finds a known motion by each of its methods, and says what LOAM needs.

Two scans of a hall with posts on a slightly uneven floor, cast here, as PCD with rings. The same scans
without rings end with exit code 3 by LOAM.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
RINGS, COLUMNS = 48, 900
MOST_M, MOST_DEG = 0.04, 0.3
POSTS = np.random.default_rng(5).uniform([-9, -6], [9, 6], (14, 2))
METHODS = ("ndt", "ndt_d2d", "icp", "gicp", "vgicp", "point_to_gaussian", "gaussian_to_gaussian", "loam",
           "loam_ground")


def nearest(ranges):
    """The smallest positive range of each ray, of a list of candidates."""
    ranges = np.where(np.array(ranges) > 0.2, ranges, np.inf)
    return ranges.min(axis=0)


def floor_range(origin, rays):
    """Where rays meet the floor: height 0.15 sin(0.8 x) cos(0.6 y), by steps of the secant."""
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(rays[:, 2] < -1e-3, -origin[2] / rays[:, 2], np.inf)
        for _ in range(30):
            at = origin + np.minimum(s, 60.0)[:, None] * rays
            height = at[:, 2] - 0.15 * np.sin(0.8 * at[:, 0]) * np.cos(0.6 * at[:, 1])
            s = np.where(np.isfinite(s), s + 0.7 * height / np.maximum(-rays[:, 2], 1e-3), s)
    return s


def scan(pose, seed):
    """Points in the frame of the lidar and their rings."""
    ring, column = np.meshgrid(np.arange(RINGS), np.arange(COLUMNS))
    ring, azimuth = ring.ravel(), 2 * np.pi * column.ravel() / COLUMNS
    elevation = np.radians(-35 + 60 * ring / (RINGS - 1))
    local = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
                      np.sin(elevation)], axis=1)
    rays, origin = local @ pose[:3, :3].T, pose[:3, 3]
    candidates = [floor_range(origin, rays)]
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis, places in ((0, (-12.0, 12.0)), (1, (-8.0, 8.0)), (2, (5.0,))):
            candidates += [(place - origin[axis]) / rays[:, axis] for place in places]
        for x, y in POSTS:
            a = rays[:, 0] ** 2 + rays[:, 1] ** 2
            b = rays[:, 0] * (origin[0] - x) + rays[:, 1] * (origin[1] - y)
            c = (origin[0] - x) ** 2 + (origin[1] - y) ** 2 - 0.2 ** 2
            candidates.append((-b - np.sqrt(b * b - a * c)) / a)
    ranges = nearest(np.nan_to_num(candidates, nan=np.inf, posinf=np.inf, neginf=-1.0))
    ranges = ranges + np.random.default_rng(seed).normal(0.0, 0.01, len(ranges))
    seen = ranges < 50.0
    return (ranges[:, None] * local)[seen], ring[seen]


def write_pcd(path, points, rings):
    fields = ("x y z ring", "4 4 4 2", "F F F U", "1 1 1 1") if rings is not None else (
        "x y z", "4 4 4", "F F F", "1 1 1")
    head = "".join(f"{key} {value}\n" for key, value in zip(("FIELDS", "SIZE", "TYPE", "COUNT"), fields))
    columns = np.column_stack([points] if rings is None else [points, rings])
    with open(path, "w") as file:
        file.write(f"# .PCD v0.7\nVERSION 0.7\n{head}WIDTH {len(points)}\nHEIGHT 1\n"
                   f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA ascii\n")
        np.savetxt(file, columns, fmt="%.4f %.4f %.4f" + ("" if rings is None else " %d"))


def upright(x, y, z, yaw):
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:3, 3] = x, y, z
    return pose


def register(a, b, method):
    return subprocess.run([PROGRAM, "register", str(a), str(b), "--method", method, "--json", "--quiet"],
                          capture_output=True, text=True, check=False)


def main():
    poses = upright(0.0, 0.0, 1.6, 0.0), upright(0.25, 0.1, 1.63, 0.03)
    truth = np.linalg.inv(poses[0]) @ poses[1]
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{name}.pcd" for name in "ab"]
        bare = [Path(folder) / f"{name}_bare.pcd" for name in "ab"]
        for seed, pose in enumerate(poses):
            points, rings = scan(pose, seed)
            write_pcd(files[seed], points, rings)
            write_pcd(bare[seed], points, None)
        for method in METHODS:
            done = register(*files, method)
            if done.returncode != 0:
                wrong.append(f"{method}: exit {done.returncode} {done.stderr[-300:]}{done.stdout[:200]}")
                continue
            off = np.linalg.inv(truth) @ np.array(json.loads(done.stdout)["a_from_b"]).reshape(4, 4)
            metres = np.linalg.norm(off[:3, 3])
            degrees = np.degrees(np.arccos(np.clip((np.trace(off[:3, :3]) - 1) / 2, -1, 1)))
            print(f"{method}: {100 * metres:.2f} cm, {degrees:.3f} deg")
            if metres > MOST_M or degrees > MOST_DEG:
                wrong.append(f"{method}: {metres} m, {degrees} deg off")
        for method in ("loam", "loam_ground"):
            done = register(*bare, method)
            if done.returncode != 3 or "ring" not in done.stderr:
                wrong.append(f"{method} without rings: exit {done.returncode} {done.stderr}")
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
