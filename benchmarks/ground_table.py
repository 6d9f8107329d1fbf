#!/usr/bin/env python3
"""Our ground beside that of the cloth simulation filter, against the truth of simulations.

    understory simulate random -o s4.mcap --seed 4 --duration-s 30 --set truth.points=true
    benchmarks/ground_table.py s4.truth [TRUTH ...] [--within-m 15]

Each takes TRUTH/points.laz. The cloth simulation filter is that of its authors (W. Zhang et al.,
Remote Sensing 8(6):501, 2016; package cloth-simulation-filter), by their defaults and by a setting
for slopes. Its ground points become a terrain model: their mean in cells of 0.5 m, and between them
linear interpolation. Errors are heights less those of TRUTH/dtm.tif, metres, in all cells near the
path. Needs numpy, scipy, laspy, CSF and GDAL's gdal_translate.
"""
import argparse
import contextlib
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

PROGRAM = os.environ.get("UNDERSTORY_PROGRAM", "build/understory")
CELL_M = 0.5
FAR_OFF_M = 0.3
SETTINGS = {
    "cloth, defaults": {},
    "cloth, slopes": {"rigidness": 1, "bSloopSmooth": True, "class_threshold": 0.2},
}


class Terrain:
    """A height model of square cells; NaN where it has none."""

    def __init__(self, heights, left, top, cell):
        self.heights, self.left, self.top, self.cell = heights, left, top, cell

    def at(self, places):
        """Of the cell that holds each place."""
        column = np.floor((places[:, 0] - self.left) / self.cell).astype(int)
        row = np.floor((self.top - places[:, 1]) / self.cell).astype(int)
        inside = (row >= 0) & (column >= 0) & (row < self.heights.shape[0]) & (column < self.heights.shape[1])
        found = np.full(len(places), np.nan)
        found[inside] = self.heights[row[inside], column[inside]]
        return found


def read_terrain(path):
    with tempfile.TemporaryDirectory() as scratch:
        raw = f"{scratch}/dtm"
        subprocess.run(["gdal_translate", "-q", "-ot", "Float64", "-of", "XYZ", str(path), raw], check=True)
        x, y, z = np.loadtxt(raw).T
    columns = len(np.unique(x))
    z = np.where(np.abs(z) > 1e5, np.nan, z).reshape(-1, columns)
    cell = abs(x[1] - x[0])
    return Terrain(z, x.min() - 0.5 * cell, y.max() + 0.5 * cell, cell)


def our_ground(cloud):
    with tempfile.TemporaryDirectory() as scratch:
        begin = os.times().children_user
        subprocess.run([PROGRAM, "--quiet", "inventory", str(cloud), "-o", f"{scratch}/run", "--set", "extent=basic"], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return read_terrain(f"{scratch}/run/dtm.tif"), os.times().children_user - begin


@contextlib.contextmanager
def silence():
    """The filter tells its steps on stdout."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def cloth_ground(points, setting):
    import CSF
    from scipy.interpolate import griddata
    begin = time.process_time()
    cloth = CSF.CSF()
    for name, value in setting.items():
        setattr(cloth.params, name, value)
    cloth.setPointCloud(points)
    ground, other = CSF.VecInt(), CSF.VecInt()
    with silence():
        cloth.do_filtering(ground, other, False)
    kept = points[np.array(ground)]
    seconds = time.process_time() - begin
    left, top = kept[:, 0].min(), kept[:, 1].max()
    column = ((kept[:, 0] - left) / CELL_M).astype(int)
    row = ((top - kept[:, 1]) / CELL_M).astype(int)
    shape = (row.max() + 1, column.max() + 1)
    index = row * shape[1] + column
    count = np.bincount(index, minlength=shape[0] * shape[1])
    with np.errstate(invalid="ignore"):
        mean = np.bincount(index, kept[:, 2], minlength=len(count)) / count
    rows, columns = np.divmod(np.arange(len(count)), shape[1])
    known = count > 0
    mean = griddata((rows[known], columns[known]), mean[known], (rows, columns))
    return Terrain(mean.reshape(shape), left, top, CELL_M), seconds


def judge(name, terrain, seconds, truth, places):
    errors = terrain.at(places) - truth.at(places)
    known = errors[np.isfinite(errors)]
    print(f"| {name} | {100 * len(known) / len(errors):.1f} % | {np.median(known):+.3f} | {np.sqrt(np.mean(known ** 2)):.3f} | "
          f"{100 * np.mean(np.abs(known) > FAR_OFF_M):.2f} % | {seconds:.0f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("truth", nargs="+")
    parser.add_argument("--within-m", type=float, default=15.0)
    given = parser.parse_args()
    import laspy
    print(f"| ground | cells known | median | RMSE | over {FAR_OFF_M} m off | CPU s |\n|---|---|---|---|---|---|")
    for folder in map(Path, given.truth):
        truth = read_terrain(folder / "dtm.tif")
        path = np.loadtxt(folder / "trajectory.tum")[:, 1:3]
        rows, columns = np.indices(truth.heights.shape)
        places = np.column_stack([truth.left + (columns.ravel() + 0.5) * truth.cell, truth.top - (rows.ravel() + 0.5) * truth.cell])
        away = np.array([np.hypot(*(path - place).T).min() for place in places])
        places = places[(away < given.within_m) & np.isfinite(truth.at(places))]
        judge(f"{folder.name}, ours", *our_ground(folder / "points.laz"), truth, places)
        cloud = laspy.read(folder / "points.laz")
        points = np.ascontiguousarray(np.column_stack([cloud.x, cloud.y, cloud.z]))
        for name, setting in SETTINGS.items():
            judge(f"{folder.name}, {name}", *cloth_ground(points, setting), truth, places)


if __name__ == "__main__":
    main()
