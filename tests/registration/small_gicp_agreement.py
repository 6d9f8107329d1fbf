"""`understory register` agrees with the Python package small_gicp on real scans of a car's lidar.

The four scans of data/kitti00_0-3, one pair after another, from no guess at all. Every method that takes
points but ndt_d2d agrees with small_gicp's GICP (voxels of 0.25 m) within 3 cm and 0.1 degrees.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import small_gicp

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
DATA = Path(os.environ["UNDERSTORY_DATA"]) / "kitti00_0-3"
MOST_M = 0.03
MOST_DEG = 0.1


def read_scan(path):
    return np.fromfile(path, np.float32).reshape(-1, 4)[:, :3].astype(np.float64)


def difference(a, b):
    step = np.linalg.inv(a) @ b
    # The angle from the skew part: the trace loses small angles to rounding.
    axis = [step[2, 1] - step[1, 2], step[0, 2] - step[2, 0], step[1, 0] - step[0, 1]]
    return np.linalg.norm(step[:3, 3]), np.degrees(np.arcsin(min(1.0, np.linalg.norm(axis) / 2)))


def register(target, source, method):
    command = [PROGRAM, "register", str(target), str(source), "--method", method, "--json", "--quiet"]
    answer = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert answer["status"] == "converged", answer["reason"]
    return np.array(answer["a_from_b"]).reshape(4, 4)


def main():
    files = [DATA / f"{i:06d}.bin" for i in range(4)]
    if not all(file.exists() for file in files):
        print(f"skipped: {DATA} is not there")
        return 77
    failures = 0
    for target, source in zip(files, files[1:]):
        peer = small_gicp.align(read_scan(target), read_scan(source), registration_type="GICP",
                                downsampling_resolution=0.25).T_target_source
        for method in ("ndt", "icp", "gicp", "vgicp", "point_to_gaussian",
                       "gaussian_to_gaussian"):
            metres, degrees = difference(peer, register(target, source, method))
            good = metres < MOST_M and degrees < MOST_DEG
            failures += not good
            print(f"{source.name} {method}: {100 * metres:.2f} cm, {degrees:.3f} deg",
                  "" if good else "TOO FAR")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
