#!/usr/bin/env python3
"""Errors of a run's terrain model where no ground was seen, and of the feet of its trees.

    benchmarks/unseen_ground.py RUN TRUTH [RUN TRUTH ...]

RUN is the folder of `understory map`, TRUTH that of `understory simulate`. The map is laid on the truth by the path: a
turn about the vertical and a translation. Ground was seen in a cell of 0.5 m that holds three points of the class ground.
The first table has the cells up to 8 m from those: median and RMS error of dtm.tif against TRUTH/dtm.tif, by distance
from the path. The second one has the feet of the trees (z of trees.csv against the truth's) by distance from the path.
Needs numpy, scipy, laspy and GDAL's gdal_translate.
"""
import sys

import inventory_table
import laspy
import numpy as np
from ground_table import Terrain, read_terrain
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

CELL_M = 0.5
REACH_M = 8.0
SEEN_POINTS = 3
GROUND_CLASS = 2
BINS = ((5, 15), (15, 25), (25, 35), (35, 50))


def by_path(run, truth):
    """The function that lays places of the map on the truth, and the path of the truth."""
    own = np.loadtxt(f"{run}/trajectory.tum")
    true = np.loadtxt(f"{truth}/trajectory.tum")
    there = np.array([np.interp(own[:, 0], true[:, 0], true[:, axis]) for axis in (1, 2, 3)]).T
    middle, there_middle = own[:, 1:4].mean(axis=0), there.mean(axis=0)
    left, _, right = np.linalg.svd((there - there_middle)[:, :2].T @ (own[:, 1:4] - middle)[:, :2])
    turn = np.eye(3)
    turn[:2, :2] = left @ np.diag([1.0, np.sign(np.linalg.det(left @ right))]) @ right
    return (lambda places: (places - middle) @ turn.T + there_middle), there


def seen_cells(points):
    """Terrain of the mean heights of cells with enough points, NaN elsewhere."""
    low, high = points[:, :2].min(axis=0) - REACH_M, points[:, :2].max(axis=0) + REACH_M
    columns, rows = np.ceil((high - low) / CELL_M).astype(int)
    column = ((points[:, 0] - low[0]) / CELL_M).astype(int)
    row = ((low[1] + rows * CELL_M - points[:, 1]) / CELL_M).astype(int)
    sums, counts = np.zeros((rows, columns)), np.zeros((rows, columns))
    np.add.at(sums, (row, column), points[:, 2])
    np.add.at(counts, (row, column), 1)
    return Terrain(np.where(counts >= SEEN_POINTS, sums / np.maximum(counts, 1), np.nan), low[0], low[1] + rows * CELL_M, CELL_M)


def figures(errors):
    errors = errors[np.isfinite(errors)]
    return f"{np.median(errors):+.2f}, {np.sqrt(np.mean(errors**2)):.2f}" if len(errors) else "-"


def tell(name, errors, away):
    print(f"| {name} | {' | '.join(figures(errors[(away >= low) & (away < high)]) for low, high in BINS)} |")


def main():
    pairs = list(zip(sys.argv[1::2], sys.argv[2::2]))
    if not pairs or len(sys.argv) % 2 == 0:
        sys.exit(__doc__)
    header = f"| run | {' | '.join(f'{low} to {high} m' for low, high in BINS)} |\n{'|---' * (len(BINS) + 1)}|"
    print(f"terrain where no ground was seen: median, RMS, metres\n\n{header}")
    feet = []
    for run, truth in pairs:
        lay, path = by_path(run, truth)
        near = cKDTree(path[:, :2])
        cloud = laspy.read(f"{run}/map.laz")
        ground = np.asarray(cloud.classification) == GROUND_CLASS
        seen = seen_cells(lay(np.array([cloud.x, cloud.y, cloud.z]).T[ground]))
        known = np.isfinite(seen.heights)
        unseen = ~known & (distance_transform_edt(~known) * CELL_M <= REACH_M)
        # The terrain model in the frame of the truth, at its own cells.
        model = read_terrain(f"{run}/dtm.tif")
        row, column = np.nonzero(np.isfinite(model.heights))
        cells = lay(np.array([model.left + (column + 0.5) * model.cell, model.top - (row + 0.5) * model.cell,
                              model.heights[row, column]]).T)
        asked = Terrain(np.where(unseen, 1.0, np.nan), seen.left, seen.top, CELL_M).at(cells) == 1.0
        cells = cells[asked]
        tell(run, cells[:, 2] - read_terrain(f"{truth}/dtm.tif").at(cells), near.query(cells[:, :2])[0])
        own, true = inventory_table.Trees(f"{run}/trees.csv"), inventory_table.Trees(f"{truth}/trees.csv")
        places = lay(np.column_stack([own.place, own.ground]))
        same = inventory_table.pairs_of(places[:, :2], true.place)
        mine, theirs = list(same.keys()), list(same.values())
        feet.append((run, places[mine, 2] - true.ground[theirs], near.query(true.place[theirs])[0]))
    print(f"\nfeet of trees: median, RMS, metres\n\n{header}")
    for name, errors, away in feet:
        tell(name, errors, away)


if __name__ == "__main__":
    main()
