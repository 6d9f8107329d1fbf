#!/usr/bin/env python3
"""What an inventory makes of a cloud whose scans do not lie on each other.

    benchmarks/two_passes.py [--scatter M] [RUN/map.laz ...]

Makes a stand of 36 stems (10 to 44 cm, on a plain of 30 m) as two passes of a scanner saw it. The second pass is moved
along x. Each pass saw all sides of each stem, or the same half, or the other half. Each row is a cloud. It has the stems
that were listed, bias and RMS error of the diameters, and their median standard deviation. Then come the share of errors
within two deviations, the words of the column quality, and the reason where the result is untrusted. Of a tree that is
listed twice the first row counts. Needs numpy and laspy, and the program in UNDERSTORY_PROGRAM (else build/understory).
"""
import argparse
import collections
import csv
import json
import os
import subprocess
import tempfile
from pathlib import Path

import laspy
import numpy as np

PROGRAM = os.environ.get("UNDERSTORY_PROGRAM", "build/understory")
ROWS, SPACING_M, RETURNS, CROWN_RETURNS = 6, 5.0, 9000, 3000
SIDES = ("all sides", "the same half", "the other half")
APART_M = (0.0, 0.03, 0.06, 0.10, 0.20, 0.40)


def stem_points(random, radius, height, turns, scatter):
    z = random.uniform(0.05, 0.9 * height, len(turns))
    r = np.maximum(0.01, radius * (1.0 - 0.9 * (z - 1.3) / (height - 1.3))) + random.normal(0.0, scatter, len(turns))
    return np.column_stack([r * np.cos(turns), r * np.sin(turns), z])


def stand(apart, side, scatter):
    """Points of the cloud, and x, y and diameter of its stems in the first pass."""
    random = np.random.default_rng(1)
    size = ROWS * SPACING_M
    parts = [np.column_stack([random.uniform(0, size, 200000), random.uniform(0, size, 200000), random.normal(0, 0.02, 200000)])]
    truth = []
    for k in range(ROWS * ROWS):
        x, y = SPACING_M * (np.array(divmod(k, ROWS)) + 0.5) + random.uniform(-1.0, 1.0, 2)
        radius, height = random.uniform(0.05, 0.22), random.uniform(12.0, 20.0)
        truth.append((x, y, 2.0 * radius))
        for move in (0, 1):
            half = {"all sides": (0.0, 2.0), "the same half": (0.5, 1.5), "the other half": (0.5 - move, 1.5 - move)}[side]
            turns = np.pi * random.uniform(*half, RETURNS)
            parts.append(stem_points(random, radius, height, turns, scatter) + [x + move * apart, y, 0.0])
        away, turn = 1.5 * np.sqrt(random.uniform(0, 1, CROWN_RETURNS)), random.uniform(0, 2 * np.pi, CROWN_RETURNS)
        z = 0.5 * height * (1.0 + random.uniform(0, 1, CROWN_RETURNS) * (1.0 - away / 1.6))
        parts.append(np.column_stack([x + away * np.cos(turn), y + away * np.sin(turn), z]))
    return np.vstack(parts), truth


def write_cloud(path, points):
    cloud = laspy.create(point_format=1)
    cloud.header.scales = [0.001] * 3
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(path)


def inventory_of(folder, name):
    """Rows of trees.csv, and run.json, of the inventory of a cloud."""
    out = folder / f"{name}.out"
    done = subprocess.run([PROGRAM, "--quiet", "inventory", folder / f"{name}.laz", "-o", out], capture_output=True,
                          text=True, check=False)
    assert done.returncode in (0, 4), done.stderr
    with open(out / "trees.csv", encoding="utf-8") as table:
        trees = list(csv.DictReader(table))
    return trees, json.loads((out / "run.json").read_text(encoding="utf-8"))


def tell(name, listed, run, truth, apart):
    """One row: `truth` has x, y and diameter in the first pass."""
    errors = []
    for x, y, dbh in truth:
        near = [t for t in listed if np.hypot(float(t["x"]) - x - 0.5 * apart, float(t["y"]) - y) < 0.5]
        errors += [(float(t["dbh_m"]) - dbh, float(t["dbh_sd_m"])) for t in near[:1]]
    error, sd = 100.0 * np.array(errors).T
    words = ", ".join(f"{count} {word}" for word, count in collections.Counter(t["quality"] for t in listed).most_common())
    print(f"| {name}, {100 * apart:.0f} cm | {len(listed)} of {len(truth)} | {error.mean():+.1f}, {np.sqrt(np.mean(error**2)):.1f} | "
          f"{np.median(sd):.1f} | {100 * np.mean(np.abs(error) < 2 * sd):.0f} % | {words} | {'; '.join(run['reasons']) or run['status']} |",
          flush=True)


def made_by_hand(folder, scatter):
    for side in SIDES:
        for apart in APART_M:
            points, truth = stand(apart, side, scatter)
            name = f"{side.replace(' ', '_')}_{apart}"
            write_cloud(folder / f"{name}.laz", points)
            tell(side, *inventory_of(folder, name), truth, apart)


def torn_apart(folder, path, number):
    """The cloud of a run whose points of the second half of its time are moved."""
    cloud = laspy.read(path)
    x, stamps = np.array(cloud.x), np.array(cloud.gps_time)
    late = stamps > 0.5 * (stamps.min() + stamps.max())
    truth = []
    for apart in APART_M:
        name = f"cloud{number}_{apart}"
        cloud.x = x + apart * late
        cloud.write(folder / f"{name}.laz")
        listed, run = inventory_of(folder, name)
        listed = [t for t in listed if t["dbh_m"]]
        truth = truth or [(float(t["x"]), float(t["y"]), float(t["dbh_m"])) for t in listed]
        tell(Path(path).parent.name, listed, run, truth, apart)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clouds", nargs="*", metavar="RUN/map.laz")
    parser.add_argument("--scatter", type=float, default=0.008, help="of the points across the bark, m")
    given = parser.parse_args()
    print("| cloud, second pass moved by | stems listed | diameters: bias, RMS, cm | sd, cm | within two | quality | result |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        for number, path in enumerate(given.clouds):
            torn_apart(Path(scratch), path, number)
        if not given.clouds:
            made_by_hand(Path(scratch), given.scatter)


if __name__ == "__main__":
    main()
