"""Memory and time of a full inventory of a very large cloud.

    benchmarks/large_cloud.py [--points 2e8] [--seeds 1 2 4 5] [--work FOLDER]

Walks of 20 s through sites `random` are mapped by our own SLAM. A hectare around the path of each is written again and again,
side by side, until the cloud has so many points. Needs numpy and laspy, 10 GB of disk for 2e8 points, and half an hour. The program is
build/understory, or the one that UNDERSTORY_PROGRAM names."""

import argparse
import json
import math
import pathlib
import tempfile

import laspy
import numpy as np

import program
from stem_forms import understory

HECTARE_M = 100.0


def clip(work, seed):
    """The points of a map within 50 m of the middle of its path, from there."""
    run, site = work / f"map-{seed}", work / f"site-{seed}.mcap"
    if not run.exists():
        understory("simulate", "random", "-o", site, "--seed", seed, "--duration-s", 20)
        understory("map", site, "-o", run, "--set", "georeference.enabled=false")
        site.unlink()
    las = laspy.read(run / "map.laz")
    points = np.c_[las.x, las.y, las.z] - np.loadtxt(run / "trajectory.tum")[:, 1:4].mean(0)
    return points[np.abs(points[:, :2]).max(1) < 0.5 * HECTARE_M]


def write(path, clips, wanted):
    """Returns how many points and hectares."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [0.0] * 3
    side = math.ceil(math.sqrt(wanted / np.mean([len(points) for points in clips])))
    written = hectares = 0
    with laspy.open(path, "w", header=header) as file:
        while written < wanted:
            points = clips[hectares % len(clips)] + [HECTARE_M * (hectares % side), HECTARE_M * (hectares // side), 0.0]
            record = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
            record.x, record.y, record.z = points.T
            file.write_points(record)
            written, hectares = written + len(points), hectares + 1
    return written, hectares


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=float, default=2e8)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 4, 5, 6, 8, 9, 10])
    parser.add_argument("--work", type=pathlib.Path, help="keeps maps, cloud and inventory; a temporary folder otherwise")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        work = given.work or pathlib.Path(scratch)
        work.mkdir(parents=True, exist_ok=True)
        cloud = work / "large.laz"
        points, hectares = write(cloud, [clip(work, seed) for seed in given.seeds], given.points)
        done = program.run(program.PROGRAM, "--quiet", "inventory", cloud, "-o", work / "inventory", "--overwrite")
        assert done.code in (0, 4), done.stderr
        told = json.loads((work / "inventory/run.json").read_text())
        print(f"{points} points on {hectares} ha: {done.wall_s:.0f} s, {done.cpu_s:.0f} s of CPU, "
              f"{told['peak_memory_mb']:.0f} MB, {told['counts']['trees']} trees, status {told['status']}")


if __name__ == "__main__":
    main()
