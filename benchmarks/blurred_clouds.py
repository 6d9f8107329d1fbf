#!/usr/bin/env python3
"""How many stems of a cloud are still found when its points are blurred.

    benchmarks/blurred_clouds.py CLOUD [CLOUD ...] [--noise-cm 2 3 4 5]

Normal noise is added to x, y and z of each point (LAS, LAZ; the seed is the noise in centimetres). Lists of `understory
inventory` are compared with that of the cloud itself. A stem of 10 cm and more is found if one of 5 cm and more lies within
30 cm. Others are stems of 5 cm and more that lie at none of the cloud's own trees. Errors of diameters are the differences of
found stems. Needs numpy, laspy and lazrs. The program is build/understory, or the one that UNDERSTORY_PROGRAM names.
"""
import argparse
import csv
import pathlib
import shutil
import tempfile

import laspy
import numpy as np

import program

REACH_M = 0.3
LEAST_DBH_M = 0.1
LEAST_FOUND_DBH_M = 0.05


def inventory(cloud, folder):
    """x, y and diameter of each tree, 0 without one; whether the report calls the cloud blurred."""
    program.understory("inventory", cloud, "-o", folder, accept=(program.DONE, program.UNTRUSTED))
    with open(folder / "trees.csv", encoding="utf-8") as file:
        trees = [[float(row["x"]), float(row["y"]), float(row["dbh_m"] or 0)] for row in csv.DictReader(file)]
    said = "The cloud is blurred" in (folder / "run.json").read_text(encoding="utf-8")
    return np.array(trees).reshape(-1, 3), said


def write_noisy(points, noise_cm, path):
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [1e-4] * 3, np.floor(points.min(axis=0))
    cloud = laspy.LasData(header)
    cloud.xyz = points + np.random.default_rng(noise_cm).normal(0.0, noise_cm / 100, points.shape)
    cloud.write(str(path))


def nearest(places, others):
    """Of each place the distance to the nearest of the others, and its number."""
    if not len(others):
        return np.full(len(places), np.inf), np.zeros(len(places), dtype=int)
    apart = np.linalg.norm(places[:, None, :2] - others[None, :, :2], axis=2)
    return apart.min(axis=1), apart.argmin(axis=1)


def line(name, noise_cm, own, trees, said):
    stems = own[own[:, 2] >= LEAST_DBH_M]
    trees = trees[trees[:, 2] >= LEAST_FOUND_DBH_M]
    away, number = nearest(stems, trees)
    found = away < REACH_M
    others = int(np.sum(nearest(trees, own)[0] >= REACH_M)) if len(trees) else 0
    error = 100 * (trees[number[found], 2] - stems[found, 2]) if found.any() else np.array([np.nan])
    return (f"| {name} | {noise_cm} | {found.sum()} of {len(stems)} | {others} | {error.mean():+.1f}, "
            f"{np.sqrt(np.mean(error ** 2)):.1f} | {'yes' if said else 'no'} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--noise-cm", type=int, nargs="+", default=[2, 3, 4, 5])
    parser.add_argument("clouds", nargs="+", type=pathlib.Path)
    options = parser.parse_args()
    print("| cloud | noise added, cm | found | others | diameters, cm: mean, RMS | said |\n|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as temporary:
        work = pathlib.Path(temporary)
        for cloud in options.clouds:
            own, said = inventory(cloud, work / "own")
            print(line(cloud.stem, 0, own, own, said), flush=True)
            points = np.array(laspy.read(cloud).xyz)
            for noise_cm in options.noise_cm:
                write_noisy(points, noise_cm, work / "noisy.laz")
                print(line(cloud.stem, noise_cm, own, *inventory(work / "noisy.laz", work / "noisy")), flush=True)
                (work / "noisy.laz").unlink()
                shutil.rmtree(work / "noisy")
            shutil.rmtree(work / "own")


if __name__ == "__main__":
    main()
