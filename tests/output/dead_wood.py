"""Stumps and lying stems of a full inventory, on a simulated stand with many of them. The list is compared with the truth, and
layers, report and run.json with the list. Both lists are laid on each other by their trees."""

import json
import sqlite3
import tempfile
from pathlib import Path

import numpy as np

from full_inventory import into_truth, number, rows, run
from program import program, simulated

NEAR_M = 6.0  # of the path
APART_M = 0.3


def place(row, end=""):
    return np.array([number(row["x" + end]), number(row["y" + end])])


def off_line(point, a, b):
    t = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(point - a - t * (b - a))


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        walk = simulated("handheld", 6, 16, "gnss.enabled=false", "stand.size_x_m=70", "stand.size_y_m=70", "carrier.length_m=150",
                         "stand.stumps_per_ha=400", "stand.logs_per_ha=200", "stand.trees_per_ha=300")
        truth = walk.with_suffix(".truth")
        run("map", walk, "-o", folder / "run", "--inventory", "full")
        laid = into_truth(folder / "run", truth)
        path = np.loadtxt(truth / "trajectory.tum")[:, 1:3]
        listed, grown = rows(folder / "run/dead_wood.csv"), rows(truth / "dead_wood.csv")
        assert [int(row["id"]) for row in listed] == list(range(1, len(listed) + 1))

        stumps = [row for row in grown if row["kind"] == "stump" and np.linalg.norm(path - place(row), axis=1).min() < NEAR_M]
        feet = [(laid(place(row)), row) for row in listed if row["kind"] == "stump"]
        errors = []
        for true in stumps:
            near = [row for foot, row in feet if np.linalg.norm(foot - place(true)) < APART_M]
            if near:
                errors.append(number(near[0]["diameter_to_m"]) - number(true["diameter_to_m"]))
        wrong = [row for foot, row in feet if np.linalg.norm(path - foot, axis=1).min() < NEAR_M and
                 min(np.linalg.norm(foot - place(true)) for true in grown if true["kind"] == "stump") > APART_M]
        print(f"{len(errors)} of {len(stumps)} stumps, {len(wrong)} wrong; errors of diameters {np.round(100 * np.array(errors), 1)} cm")
        assert len(stumps) >= 8 and len(errors) > 0.7 * len(stumps), (len(errors), len(stumps))
        assert len(wrong) <= 2, wrong
        assert np.median(np.abs(errors)) < 0.015, errors

        logs = [row for row in listed if row["kind"] == "log"]
        true_logs = [(place(row), place(row, "_to"), row) for row in grown if row["kind"] == "log"]
        errors = []
        for row in logs:
            middle = laid(0.5 * (place(row) + place(row, "_to")))
            if np.linalg.norm(path - middle, axis=1).min() > NEAR_M:
                continue
            a, b, true = min(true_logs, key=lambda log: off_line(middle, log[0], log[1]))
            assert off_line(middle, a, b) < APART_M, f"no lying stem is there: {row}"
            t = np.clip((middle - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            right = number(true["diameter_m"]) + t * (number(true["diameter_to_m"]) - number(true["diameter_m"]))
            errors.append(0.5 * (number(row["diameter_m"]) + number(row["diameter_to_m"])) - right)
            assert number(row["length_m"]) < np.linalg.norm(b - a) + 0.7, (row, true)
        print(f"{len(errors)} lying stems; errors of diameters {np.round(100 * np.array(errors), 1)} cm")
        assert len(errors) >= 4 and np.median(np.abs(errors)) < 0.03, errors

        with sqlite3.connect(folder / "run/trees.gpkg") as layers:
            for layer, kind in (("stumps", "stump"), ("logs", "log")):
                ids = [row[0] for row in layers.execute(f"select id from {layer} order by id")]
                assert ids == [int(row["id"]) for row in listed if row["kind"] == kind], layer
        facts = json.loads((folder / "run/run.json").read_text())
        assert facts["counts"]["logs"] == len(logs) and facts["counts"]["stumps"] == len(feet)
        total = sum(number(row["volume_m3"]) for row in logs)
        assert abs(facts["quality"]["logs_volume_m3"] - total) < 1e-3
        page = (folder / "run/report.html").read_text()
        assert "Dead wood" in page and f"{len(logs)} lying stems" in page
        assert "layername=logs" in (folder / "run/map.qgs").read_text()

        # Thicker pieces only; and none in a basic inventory, which does not look for them.
        run("inventory", folder / "run", "-o", folder / "thick", "--set", "dead_wood.min_diameter_m=0.25")
        thick = rows(folder / "thick/dead_wood.csv")
        assert 0 < len(thick) < len(listed) and all(number(row["diameter_m"]) >= 0.249 or number(row["diameter_to_m"]) >= 0.249
                                                    for row in thick)
        # Where no tree is listed, as on a clear-cut.
        bare = program("inventory", folder / "run", "-o", folder / "bare", "--set", "stems.min_dbh_m=0.9")
        assert bare.returncode in (0, 4), bare.stderr  # 4: no tree below a high canopy
        assert not rows(folder / "bare/trees.csv") and len(rows(folder / "bare/dead_wood.csv")) > 10
        run("inventory", folder / "run/map.laz", "-o", folder / "basic", "--set", "extent=basic")
        assert not (folder / "basic/dead_wood.csv").exists()


if __name__ == "__main__":
    main()
