"""`./run bench stem-heights [STEMS TRAJECTORY]`: what the heights of a file of stems can tell of the
heights of the path. Without arguments Wild-Places V-03 of the example data.

The true rotations and the true places in the plane are given. All that is left is the height of each
view, which all sights of all trees together determine. What these heights miss, no matching of the
same points can find.
"""

import csv
import gzip
import os
import sys
from pathlib import Path

import numpy as np

CELL_M = 0.4  # sights that fall into one square are of one tree
FEWEST_SIGHTS = 5
NEAR_M = 5.0  # the body is carried over the feet so near
AHEAD_M = 25.0  # the slope of the feet is taken within this distance ...
ASIDE_M = 6.0  # ... and this one of the line of the path


def example():
    root = Path(os.environ.get("UNDERSTORY_DATA", Path(__file__).resolve().parents[2] / "shared/data"))
    return root / "wild_places_v03/stems.csv.gz", root / "wild_places_v03/trajectory.tum"


def rotations(quaternions):
    x, y, z, w = quaternions.T
    return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
                     2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                     2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
                    axis=1).reshape(-1, 3, 3)


def read(stems, trajectory):
    """Per sight its view and its place from the body, turned by the true rotation; true places."""
    path = np.loadtxt(trajectory, ndmin=2)
    at = {round(row[0], 4): k for k, row in enumerate(path)}
    turned = rotations(path[:, 4:8])
    views, points = [], []
    with gzip.open(stems, "rt") as file:
        for row in csv.DictReader(file):
            k = at.get(round(float(row["timestamp"]), 4))
            if k is not None:
                views.append(k)
                points.append([float(row[c]) for c in "xyz"])
    views = np.array(views)
    return views, np.einsum("nij,nj->ni", turned[views], np.array(points)), path[:, 1:4]


def carried(views, sights, places):
    """The views with three feet near them, and the height of the body above these."""
    seen, heights = [], []
    near = np.hypot(*sights[:, :2].T) < NEAR_M
    of, rise = views[near], sights[near, 2]
    for k in range(len(places)):
        feet = -rise[of == k]
        if len(feet) >= 3:
            seen.append(k)
            heights.append(np.median(feet))
    return np.array(seen), np.array(heights)


def left_of(values, *columns):
    """Standard deviation of what the best sum of these columns leaves."""
    columns = np.stack(columns, axis=1)
    return (values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]).std()


def slope_share(views, sights, places):
    """Slope of the feet along the path in each view, over that of the path itself."""
    feet, path = [], []
    for k in range(10, len(places) - 10):
        way = places[k - 10:k + 11] - places[k]
        along = way[-1, :2] - way[0, :2]
        if np.linalg.norm(along) < 15.0:
            continue
        along /= np.linalg.norm(along)
        seen = sights[views == k]
        ahead, aside = seen[:, :2] @ along, seen[:, :2] @ [-along[1], along[0]]
        near = (abs(ahead) < AHEAD_M) & (abs(aside) < ASIDE_M)
        if near.sum() >= 8:
            feet.append(np.polyfit(ahead[near], seen[near, 2], 1)[0])
            path.append(np.polyfit(way[:, :2] @ along, way[:, 2], 1)[0])
    return np.polyfit(path, feet, 1)[0] if path else np.nan


def trees_of(views, sights, places):
    cells = np.floor((places[views, :2] + sights[:, :2]) / CELL_M).astype(np.int64)
    _, tree, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    enough = count[tree.ravel()] >= FEWEST_SIGHTS
    return enough, np.unique(tree.ravel()[enough], return_inverse=True)[1].ravel()


def solved_heights(views, tree, rise, count):
    """Robust least squares: height of the view + rise of the sight = height of the tree."""
    order = np.argsort(tree, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(tree))[:-1])
    weight = np.ones(len(rise))
    for _ in range(12):
        normal, right = 1e-9 * np.eye(count), np.zeros(count)
        for group in groups:
            v, w = views[group], weight[group]
            mean = (w * rise[group]).sum() / w.sum()
            np.add.at(normal, (v, v), w)
            np.add.at(normal, (v[:, None], v[None, :]), -np.outer(w, w) / w.sum())
            np.add.at(right, v, -w * (rise[group] - mean))
        heights = np.linalg.solve(normal, right)
        sum_w = np.bincount(tree, weight)
        of_tree = np.bincount(tree, weight * (heights[views] + rise)) / sum_w
        left = heights[views] + rise - of_tree[tree]
        spread = 1.4826 * np.median(abs(left))
        weight = 1.0 / (1.0 + (left / spread) ** 2 / 3.0)
    return heights, spread


def main():
    stems, trajectory = sys.argv[1:3] if len(sys.argv) > 2 else example()
    views, sights, places = read(stems, trajectory)
    seen, above = carried(views, sights, places)
    low, middle, high = np.percentile(above, [5, 50, 95])
    enough, tree = trees_of(views, sights, places)
    heights, spread = solved_heights(views[enough], tree, sights[enough, 2], len(places))
    plane = np.ones(len(places)), places[:, 0], places[:, 1]
    fitted = *plane, heights, np.interp(np.arange(len(places)), seen, above)
    print(f"body above the feet within {NEAR_M:.0f} m, 5 / 50 / 95 % of the views: "
          f"{low:.2f} / {middle:.2f} / {high:.2f} m")
    print(f"slope of the feet along the path over that of the path: "
          f"{slope_share(views, sights, places):.2f}")
    print(f"sights of a tree agree in height, robust sd: {100 * spread:.1f} cm")
    print(f"heights of the path from all sights, true rotations and places in the plane, a plane "
          f"taken off: {left_of(places[:, 2] - heights, *plane):.2f} m off")
    print(f"with the best factors on these heights and on the height above the feet: "
          f"{left_of(places[:, 2], *fitted):.2f} m off")


if __name__ == "__main__":
    main()
