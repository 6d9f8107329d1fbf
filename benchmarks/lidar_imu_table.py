#!/usr/bin/env python3
"""`./run bench lidar-imu`: does `calibrate lidar-imu` state its errors honestly? On simulated walks with a clock put in.

  ./run bench lidar-imu                              60 walks of 60 s, seeds 121 to 180
  ./run bench lidar-imu --seeds 1 2 3 --seconds 30   seeds to tune on (to 19, 101 to 120), shorter walks
  ./run bench lidar-imu --keep DIR                   rows stay there; run again, it goes on where it was

Site `handheld` with a VLP-16. The seed draws a lateness of the IMU within 20 ms. Errors are found less true.
The rotation is a vector in the frame of the IMU, the place one in that of the lidar. The
normalised squared error is e' C^-1 e by the covariance that is stated, over the number of values. Values that
the motion does not tell (covariance zero) are left out. Floors: 1 ms, 0.1 degrees, 2 cm; 0.8 to 1.25 pooled.
Needs numpy.
"""

import argparse
import json
import random
import sys
from pathlib import Path

import numpy as np

from program import PROGRAM, KeptRows, machine, run, understory, version

SETTINGS = ("lidar.model=VLP-16", "gnss.enabled=false")
TRUE_PLACE = np.array([0.0, 0.0, -0.06])  # of the IMU in the lidar's frame, by the site; no turn
LARGEST_S = 0.02


def late_s(seed):
    return round(random.Random(seed).uniform(-LARGEST_S, LARGEST_S), 5)


def rotation_vector(quaternion):
    """Of x y z w."""
    q = np.array(quaternion) * (1 if quaternion[3] >= 0 else -1)
    sine = np.linalg.norm(q[:3])
    return 2.0 * np.arctan2(sine, q[3]) * q[:3] / sine if sine > 0 else np.zeros(3)


def measured(work, seed, seconds):
    """What one walk gives: errors and covariance, or why there is none."""
    walk, rig = work / "walk.mcap", work / "rig"
    words = [w for s in (*SETTINGS, f"imu.time_offset_s={late_s(seed)}") for w in ("--set", s)]
    understory("simulate", "handheld", "-o", walk, "--overwrite", "--seed", seed, "--duration-s", seconds, *words)
    done = run(PROGRAM, "--quiet", "calibrate", "lidar-imu", walk, "-o", rig, "--overwrite")
    row = {"seed": seed, "code": done.code}
    if done.code not in (0, 4):
        return row | {"said": done.stderr.strip()[-300:]}
    told = json.loads((rig / "calibration.json").read_text())
    place = told["lidar_from_imu"]
    errors = [*rotation_vector(place["rotation_xyzw"]), *(np.array(place["translation_m"]) - TRUE_PLACE),
              told["imu_late_s"] - late_s(seed)]
    return row | {"errors": errors, "covariance": told["covariance"], "said": "; ".join(told.get("reasons", []))}


def squared(row):
    """(normalised squared error, values) of a row."""
    covariance, errors = np.array(row["covariance"]), np.array(row["errors"])
    told = np.flatnonzero(np.diag(covariance) > 0)
    part = covariance[np.ix_(told, told)]
    return float(errors[told] @ np.linalg.solve(part, errors[told])), len(told)


def summary(rows):
    good = [r for r in rows if "errors" in r and r["code"] == 0]
    if not good:
        return "no walk gave a result"
    errors = np.array([r["errors"] for r in good])
    squares = [squared(r) for r in good]
    pooled = sum(s for s, _ in squares) / sum(n for _, n in squares)
    variances = np.array([np.diag(r["covariance"]) for r in good])
    told = np.where(variances > 0, variances, np.nan)
    errors = np.where(variances > 0, errors, np.nan)
    each = np.nanmean(errors ** 2 / told, axis=0)

    def root(values):
        return float(np.sqrt(np.nanmean(values ** 2)))
    axes = np.degrees(np.sqrt(np.nanmean(errors[:, :3] ** 2, axis=0)))
    place = 100 * np.sqrt(np.nanmean(errors[:, 3:6] ** 2, axis=0))
    return (f"{len(good)} of {len(rows)} walks found all\n"
            f"rms: lateness {1000 * root(errors[:, 6]):.2f} ms; rotation "
            f"{np.degrees(root(np.linalg.norm(errors[:, :3], axis=1))):.3f} degrees as vectors, "
            f"{', '.join(f'{v:.3f}' for v in axes)} along the axes; place "
            f"{100 * root(np.linalg.norm(errors[:, 3:6], axis=1)):.2f} cm as vectors, "
            f"{', '.join(f'{v:.2f}' for v in place)} along the axes\n"
            f"normalised squared error: {pooled:.2f} pooled over {sum(n for _, n in squares)} values; by value "
            f"{', '.join(f'{v:.2f}' for v in each)}")


def main():
    parser = argparse.ArgumentParser(prog="./run bench lidar-imu", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(121, 181)))
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    kept, rows = KeptRows(options.keep, "lidar-imu"), []
    print(f"{version()}, {machine()}, walks of {options.seconds:g} s")
    for seed in options.seeds:
        rows.append(kept.get(f"{seed} {options.seconds:g}", lambda: measured(kept.folder, seed, options.seconds)))
        row = rows[-1]
        if "errors" not in row:
            print(f"seed {seed}: exit {row['code']}, {row['said']}", flush=True)
            continue
        e = np.array(row["errors"])
        square, count = squared(row)
        print(f"seed {seed}: exit {row['code']}, {1000 * e[6]:+.2f} ms, {np.degrees(np.linalg.norm(e[:3])):.3f} degrees, "
              f"{100 * np.linalg.norm(e[3:6]):.2f} cm, squared error {square:.1f} of {count} {row['said']}", flush=True)
    print(summary(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
