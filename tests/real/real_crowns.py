"""`understory inventory` on clouds from aeroplanes: trees by their crowns, beside field trees and other clouds.

- 110 field trees of a plot in the Alps, with heights: those of the upper layer are found, and the heights agree.
- A stand of pines that was flown over and also scanned by a mobile scanner: heights of the same trees agree. So do
  those of a broken stem of 5.7 m, which the canopy model from above shows as well.
"""

import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np
from scipy.optimize import linear_sum_assignment

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
DATA = Path(os.environ.get("UNDERSTORY_DATA", "missing"))
ALPS = DATA / "chablais3" / "las_chablais3.laz"
FIELD = DATA / "chablais3" / "tree_inventory_chablais3.rda.tree_inventory_chablais3.csv"
PINES = DATA / "spanner_mls_uas_als"
FARTHEST_M = 3.5  # of a crown's top from the foot of its tree: trees on slopes lean
HIGHEST_M = 6.0   # difference of heights, those of the field are estimates


def inventory(cloud, folder):
    run = folder / f"run_{cloud.stem}"
    status = subprocess.run([PROGRAM, "inventory", str(cloud), "-o", str(run)],
                            capture_output=True, text=True, check=False)
    assert status.returncode == 0, status.stderr
    with open(run / "trees.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return run, [{key: float(value) for key, value in row.items() if value and key not in ("species", "quality")}
                 for row in rows]


def matched(found, known):
    """One to one, by place and height: indices into both."""
    apart = np.linalg.norm(found[:, None, :2] - known[None, :, :2], axis=2)
    higher = np.abs(found[:, None, 2] - known[None, :, 2])
    cost = (apart / 2.5) ** 2 + (higher / 4.0) ** 2
    cost[(apart > FARTHEST_M) | (higher > HIGHEST_M)] = 1e3
    i, j = linear_sum_assignment(cost)
    good = cost[i, j] < 1e3
    return i[good], j[good]


def check_field(folder):
    run, trees = inventory(ALPS, folder)
    assert trees and not any("dbh_m" in tree for tree in trees)
    with open(FIELD, encoding="utf-8") as file:
        known = np.array([[float(row["x"]), float(row["y"]), float(row["h"])]
                          for row in csv.DictReader(file)])
    found = np.array([[tree["x"], tree["y"], tree["height_m"]] for tree in trees])
    i, j = matched(found, known)
    high = known[:, 2] >= 20.0
    error = found[i, 2] - known[j, 2]
    within = np.all((found[:, :2] > known[:, :2].min(axis=0)) &
                    (found[:, :2] < known[:, :2].max(axis=0)), axis=1)
    print(f"field trees: {len(j)} of {len(known)} found, {high[j].sum()} of {high.sum()} from 20 m on; "
          f"{within.sum()} trees listed in their rectangle; heights: median difference "
          f"{np.median(np.abs(error)):.2f} m, bias {error.mean():+.2f} m")
    assert len(j) >= 55 and high[j].sum() >= 20 and within.sum() <= 90
    assert np.median(np.abs(error)) < 1.3 and abs(error.mean()) < 0.6
    check_points(run, trees)


def check_points(run, trees):
    """Each point of a crown lies near the top of its tree and no higher than it."""
    cloud = laspy.read(run / "map.laz")
    ids = np.asarray(cloud["tree_id"])
    height = np.asarray(cloud["HeightAboveGround"])
    top = {int(tree["id"]): tree for tree in trees}
    owned = ids > 0
    assert set(ids[owned]) <= set(top)
    at = np.array([[top[i]["x"], top[i]["y"], top[i]["height_m"]] for i in ids[owned]])
    apart = np.hypot(np.asarray(cloud.x)[owned] - at[:, 0], np.asarray(cloud.y)[owned] - at[:, 1])
    crown = height > 0.6 * np.max(height)
    print(f"points: {owned.mean():.0%} belong to a tree, {owned[crown].mean():.0%} of the high ones, "
          f"{np.percentile(apart, 99):.1f} m from the top at most (99 %)")
    assert owned[crown].mean() > 0.7 and np.max(apart) < 7.0
    assert np.all(height[owned] >= 1.5)


def check_pines(folder):
    above = np.array([[t["x"], t["y"], t["height_m"]] for t in inventory(PINES / "ALS_Clip.laz", folder)[1]])
    _, mobile = inventory(PINES / "MLS_Clip.laz", folder)
    _, flown = inventory(PINES / "UAS_Clip.laz", folder)
    below = np.array([[t["x"] + 0.65, t["y"], t["height_m"]] for t in mobile if "height_m" in t])
    i, j = matched(above, below)
    error = below[j, 2] - above[i, 2]
    print(f"pines from above: {len(above)} trees, {len(i)} of them among the {len(below)} of the mobile cloud; "
          f"heights: median difference {np.median(np.abs(error)):.2f} m")
    assert len(above) >= 14 and len(i) >= 12 and np.median(np.abs(error)) < 1.0
    broken = [t for t in mobile if 5.0 < t["height_m"] < 6.5 and t["dbh_m"] > 0.4]
    again = [t for t in flown if 5.0 < t["height_m"] < 6.5 and t.get("dbh_m", 0.0) > 0.4]
    assert len(broken) == 1 and len(again) == 1
    assert abs(broken[0]["height_m"] - again[0]["height_m"]) < 0.2
    crowns = [t for t in flown if "dbh_m" not in t]
    print(f"pines flown low: {len(flown) - len(crowns)} by their stems, {len(crowns)} by their crowns")
    assert len(crowns) >= 3
    for crown in crowns:
        assert all(np.hypot(crown["x"] - t["x"], crown["y"] - t["y"]) > 0.5 for t in flown if "dbh_m" in t)


def main():
    if not ALPS.exists() or not PINES.exists():
        return 77
    with tempfile.TemporaryDirectory() as temporary:
        check_field(Path(temporary))
        check_pines(Path(temporary))
    return 0


if __name__ == "__main__":
    sys.exit(main())
