"""`understory inventory --slice` on real thin cuts: the rings that the eye finds, and exact circles.

Twenty cut stems, nearly without noise: each diameter is that of the least-squares circle of its points. Two pairs of
stems that have grown together, and a noisy ring, by eye. A cut read without --slice is not taken for an empty stand.
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
EXACT = DATA / "fortls" / "diameters.laz"
CUTS = DATA / "arbor_dbh_slices"
BY_EYE = {"double_ring_slice0": [0.45, 0.46], "complex_slice0": [0.38, 0.44], "ring50": [0.25]}


def measure(cloud, folder, *options):
    run = folder / cloud.stem
    status = subprocess.run([PROGRAM, "inventory", str(cloud), "-o", str(run), "--overwrite", *options],
                            capture_output=True, text=True, check=False)
    with open(run / "trees.csv", encoding="utf-8") as file:
        return status.returncode, list(csv.DictReader(file)), run


def circle_diameter(points):
    """Of the least-squares circle (linear form)."""
    system = np.column_stack([2.0 * points, np.ones(len(points))])
    solved = np.linalg.lstsq(system, (points ** 2).sum(axis=1), rcond=None)[0]
    return 2.0 * np.sqrt(solved[2] + solved[0] ** 2 + solved[1] ** 2)


def check_exact(folder):
    code, trees, run = measure(EXACT, folder, "--slice")
    assert code == 0 and len(trees) == 20, (code, len(trees))
    cloud = laspy.read(EXACT)
    points = np.column_stack([cloud.x, cloud.y])
    worst = 0.0
    for tree in trees:
        assert not tree["height_m"] and not tree["lean_deg"] and abs(float(tree["z"]) - 1.3) < 0.11
        near = points[np.hypot(points[:, 0] - float(tree["x"]), points[:, 1] - float(tree["y"])) < 0.6]
        worst = max(worst, abs(circle_diameter(near) - float(tree["dbh_m"])))
    print(f"exact: 20 stems, at most {1000 * worst:.2f} mm from the circle of their points")
    assert worst < 0.0005
    assert not (run / "dtm.tif").exists() and not (run / "map.laz").exists()
    assert json.loads((run / "run.json").read_text())["status"] == "complete"


def check_slope(folder):
    """The same stems on a slope of 30 degrees: a cut may follow the ground."""
    las = laspy.read(EXACT)
    z = np.asarray(las.z) + np.tan(np.radians(30.0)) * np.asarray(las.x)
    las.z = z
    las.write(str(folder / "slope.laz"))
    code, trees, _ = measure(folder / "slope.laz", folder, "--slice")
    assert code == 0 and len(trees) == 20, (code, len(trees))
    for tree in trees:
        assert abs(float(tree["z"]) - 1.3 - np.tan(np.radians(30.0)) * float(tree["x"])) < 0.6
    print("slope: 20 stems")


def main():
    if not EXACT.exists() or not CUTS.exists():
        return 77
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        check_exact(folder)
        for name, expected in BY_EYE.items():
            code, trees, _ = measure(CUTS / f"{name}.las", folder, "--slice")
            found = sorted(float(tree["dbh_m"]) for tree in trees)
            print(f"{name}: {[f'{100 * d:.1f} cm' for d in found]}")
            assert code == 0 and len(found) == len(expected)
            assert all(abs(a - b) < 0.01 for a, b in zip(found, expected))
        check_slope(folder)
        whole = DATA / "spanner_mls_uas_als" / "MLS_Clip.laz"
        refused = subprocess.run([PROGRAM, "inventory", str(whole), "--slice", "-o", str(folder / "whole")],
                                 capture_output=True, text=True, check=False)
        assert refused.returncode == 3 and "m thick" in refused.stderr, refused.stderr
        assert not (folder / "whole" / "trees.csv").exists()
        code, trees, _ = measure(EXACT, folder)
        assert code == 4 and not trees
        assert "--slice" in json.loads((folder / EXACT.stem / "run.json").read_text())["reasons"][0]
    return 0


if __name__ == "__main__":
    sys.exit(main())
