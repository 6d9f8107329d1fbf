"""`understory inventory` on two real clouds: exactly the stems that the eye finds.

Pines scanned by a mobile scanner, and a plantation by a terrestrial one whose whorls of branches must
not become stems. The lists began as the program's own. Each place was looked at in cross sections 0.9 to
1.9 m above the ground and from the side. All were stems, and no other ring was found there. Three things
hold them that are not the program's list:
- the plantation's stems are the columns that a count of points finds, without circles or cones;
- both halves of the mobile cloud, every other point each, give the same places and diameters;
- a cloud of the same stand that was flown, by another sensor, gives the same diameters.
"""

import csv
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
DATA = Path(os.environ.get("UNDERSTORY_DATA", "missing"))
MOBILE = DATA / "spanner_mls_uas_als" / "MLS_Clip.laz"
FLOWN = DATA / "spanner_mls_uas_als" / "UAS_Clip.laz"
PLANTATION = DATA / "treels" / "pine_plot.laz"
MOBILE_ORIGIN = (470624.0, 3810208.0)
MOBILE_STEMS = [
    (5.3, 21.2), (5.6, 28.8), (8.2, 26.2), (10.7, 33.6), (11.7, 26.2), (12.1, 22.6), (14.1, 39.0),
    (14.2, 20.0), (14.2, 28.2), (15.2, 19.8), (17.3, 33.8), (17.7, 38.8), (17.8, 33.8),
    (18.2, 21.6), (18.3, 39.7), (19.6, 24.3), (20.7, 20.1), (21.3, 31.5), (22.6, 30.2),
    (23.2, 25.1), (24.2, 23.2), (24.3, 35.8), (24.5, 25.6), (27.7, 38.1), (27.7, 29.2),
    (28.9, 36.5), (29.1, 15.8)]
PLANTATION_STEMS = [
    (0.2, 2.0), (0.4, 0.0), (0.4, 4.0), (0.5, 8.2), (0.5, 6.0), (3.4, 3.5), (3.4, 5.6), (3.5, 1.4),
    (3.5, 7.6), (6.2, 1.0), (6.4, 4.7), (8.0, 4.6), (9.3, 7.5), (9.3, 5.4), (9.3, 3.4), (9.4, 1.2)]
FLOWN_SHIFT_M = 0.65  # of the flown cloud to the east of the mobile one
REACH_M = 0.3


def inventory(cloud, folder):
    run = folder / f"run_{cloud.stem}"
    status = subprocess.run([PROGRAM, "inventory", str(cloud), "-o", str(run)],
                            capture_output=True, text=True, check=False)
    assert status.returncode in (0, 4), status.stderr
    with open(run / "trees.csv", encoding="utf-8") as file:
        return [{key: float(value) for key, value in row.items() if value and key not in ("species", "quality")}
                for row in csv.DictReader(file)]


def pairs(trees, places):
    """(tree, place) one to one, nearest first."""
    near = sorted((((t["x"] - x) ** 2 + (t["y"] - y) ** 2) ** 0.5, i, j)
                  for i, t in enumerate(trees) for j, (x, y) in enumerate(places))
    found = {}
    taken = set()
    for distance, i, j in near:
        if distance <= REACH_M and i not in found and j not in taken:
            found[i] = j
            taken.add(j)
    return found


def check_stems(trees, places, name):
    found = pairs(trees, places)
    missed = [p for j, p in enumerate(places) if j not in found.values()]
    false = [(t["x"], t["y"]) for i, t in enumerate(trees) if i not in found]
    print(f"{name}: {len(found)} of {len(places)} stems, missed {missed}, not stems {false}")
    assert not missed and not false


def grouped(cells):
    """Cells that hang together over at most one empty cell between them."""
    left = set(cells)
    while left:
        open_cells, group = [left.pop()], []
        while open_cells:
            x, y = open_cells.pop()
            group.append((x, y))
            near = {(x + i, y + j) for i in range(-2, 3) for j in range(-2, 3)} & left
            left -= near
            open_cells += near
        yield group


def columns(cloud, low_m=1.0, high_m=5.0, slices=20, filled=16, cell_m=0.05):
    """Middles of the columns that have points in 16 of 20 slices from 1 to 5 m above the ground.

    The ground is the lowest point of each square metre, the median of nine. Nothing of a stem's
    form is asked for but that it stands.
    """
    las = laspy.read(cloud)
    points = np.column_stack([las.x, las.y, las.z])
    square = np.floor(points[:, :2]).astype(int)
    square -= square.min(axis=0)
    size = square.max(axis=0) + 1
    at = square[:, 0] * size[1] + square[:, 1]
    lowest = np.full(size[0] * size[1], np.inf)
    np.minimum.at(lowest, at, points[:, 2])
    padded = np.pad(np.where(np.isfinite(lowest), lowest, np.nan).reshape(size), 1, mode="edge")
    nine = [padded[i:i + size[0], j:j + size[1]] for i in range(3) for j in range(3)]
    above = points[:, 2] - np.nanmedian(nine, axis=0).ravel()[at]
    slice_of = np.floor((above - low_m) / (high_m - low_m) * slices).astype(int)
    inside = (slice_of >= 0) & (slice_of < slices)
    seen = {}
    for x, y, k in zip(*np.floor(points[inside, :2].T / cell_m).astype(int).tolist(),
                       slice_of[inside].tolist()):
        seen.setdefault((x, y), set()).add(k)

    def around(x, y):
        return set().union(*(seen.get((x + i, y + j), ()) for i in (-1, 0, 1) for j in (-1, 0, 1)))

    standing = [c for c, own in seen.items() if len(own) >= 3 and len(around(*c)) >= filled]
    for group in grouped(standing):
        if len(group) >= 4:
            yield tuple((np.min(group, axis=0) + np.max(group, axis=0) + 1) / 2 * cell_m)


def check_laid_otherwise(folder):
    """The plantation rounded to millimetres, mirrored, and without every seventh point. Bug: in the first and the last a
    circle of two whorls was taken for a stem."""
    las = laspy.read(PLANTATION)
    points = np.array(las.xyz)
    left = points[np.arange(len(points)) % 7 != 0]
    for name, laid, sign in (("rounded", points, 1), ("mirrored", points * [-1, 1, 1], -1), ("thinned", left, 1)):
        header = laspy.LasHeader(point_format=0, version="1.2")
        header.scales, header.offsets = [0.001] * 3, laid.min(axis=0)
        cloud = laspy.LasData(header)
        cloud.xyz = laid
        cloud.write(str(folder / f"{name}.laz"))
        trees = inventory(folder / f"{name}.laz", folder)
        check_stems(trees, [(sign * x, y) for x, y in PLANTATION_STEMS], f"plantation, {name}")


def check_halves(cloud, folder):
    las = laspy.read(cloud)
    lists = []
    for k in range(2):
        half = laspy.LasData(las.header)
        half.points = las.points[k::2].copy()
        half.write(str(folder / f"half_{k}.laz"))
        lists.append(inventory(folder / f"half_{k}.laz", folder))
    a, b = lists
    both = pairs(a, [(t["x"], t["y"]) for t in b])
    places = np.median([np.hypot(a[i]["x"] - b[j]["x"], a[i]["y"] - b[j]["y"]) for i, j in both.items()])
    diameters = np.median([abs(a[i]["dbh_m"] - b[j]["dbh_m"]) for i, j in both.items()])
    print(f"halves: {len(a)} and {len(b)} stems, {len(both)} in both, medians of the differences "
          f"{100 * places:.1f} cm and {100 * diameters:.1f} cm of the diameter")
    assert len(both) >= 14 and places < 0.04 and diameters < 0.015


def blurred(cloud, folder):
    """Trees of a cloud with 4 cm of noise added. The report has to say so first of all."""
    points = np.array(laspy.read(cloud).xyz)
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales, header.offsets = [0.001] * 3, np.floor(points.min(axis=0))
    noisy = laspy.LasData(header)
    noisy.xyz = points + np.random.default_rng(4).normal(0.0, 0.04, points.shape)
    noisy.write(str(folder / f"noisy_{cloud.stem}.laz"))
    trees = inventory(folder / f"noisy_{cloud.stem}.laz", folder)
    run = json.loads((folder / f"run_noisy_{cloud.stem}" / "run.json").read_text(encoding="utf-8"))
    assert run["notes"][0].startswith("the cloud is blurred: "), run["notes"]
    return trees


def check_blurred(folder, places):
    """Bug: 12 of the 27 stems of the mobile cloud were found, and nothing was said."""
    trees = blurred(MOBILE, folder)
    found = pairs(trees, places)
    print(f"blurred by 4 cm: {len(found)} of {len(places)} stems, {len(trees) - len(found)} others")
    assert len(found) >= 24 and len(trees) - len(found) <= 2
    blurred(FLOWN, folder)  # what crowns alone show of it does not keep the word back


def check_diameters(mobile, flown):
    places = [(t["x"] + FLOWN_SHIFT_M, t["y"]) for t in mobile]
    differences = sorted(abs(flown[i]["dbh_m"] - mobile[j]["dbh_m"])
                         for i, j in pairs(flown, places).items())
    middle = differences[len(differences) // 2]
    print(f"diameters of {len(differences)} stems from the air: median difference {middle:.3f} m")
    assert len(differences) >= 14
    assert middle < 0.025


def main():
    if not MOBILE.exists() or not PLANTATION.exists():
        return 77
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        mobile = inventory(MOBILE, folder)
        places = [(MOBILE_ORIGIN[0] + x, MOBILE_ORIGIN[1] + y) for x, y in MOBILE_STEMS]
        check_stems(mobile, places, "mobile")
        plantation = inventory(PLANTATION, folder)
        check_stems(plantation, PLANTATION_STEMS, "plantation")
        check_stems(plantation, list(columns(PLANTATION)), "plantation, columns of points")
        check_laid_otherwise(folder)
        check_halves(MOBILE, folder)
        check_blurred(folder, places)
        check_diameters(mobile, [t for t in inventory(FLOWN, folder) if "dbh_m" in t])
    return 0


if __name__ == "__main__":
    sys.exit(main())
