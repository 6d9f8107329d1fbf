"""The truth of a simulation point by point: `simulate --set truth.points=true` and the site `random`.

points.laz must hold the points of the recording, with trees that trees.csv lists. Points of stems
must lie where the stems are, points of things where objects.csv has them. The site of the truth,
simulated again, must give the same recording.
"""

import csv
import json
import math
import os
import subprocess
import tempfile
from pathlib import Path

import laspy
import numpy as np

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
SETTINGS = ["--set", "lidar.model=OS1-64", "--set", "lidar.columns=512", "--set", "lidar.rays_per_beam=1",
            "--set", "stand.size_x_m=40", "--set", "stand.size_y_m=40", "--set", "truth.points=true"]


def run(*words, code=0):
    done = subprocess.run([PROGRAM, "--quiet", *map(str, words)], capture_output=True, text=True)
    assert done.returncode == code, (words, done.returncode, done.stderr)
    return done


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def number(text):
    return float(text) if text else math.nan


def check_points(folder, recorded):
    cloud = laspy.read(folder / "points.laz")
    assert len(cloud) == recorded, (len(cloud), recorded)
    trees = {int(row["id"]): row for row in rows(folder / "trees.csv")}
    ids = np.asarray(cloud.tree_id).astype(int)
    assert set(ids) - {0} <= set(trees)
    assert (np.asarray(cloud.classification)[ids > 0] == 5).all()
    places = np.column_stack([cloud.x, cloud.y, cloud.z])
    compared = 0
    for tree, row in trees.items():
        low = places[ids == tree]
        low = low[low[:, 2] < float(row["z"]) + 1.0]
        if len(low) < 20 or not number(row["crown_base_m"]) > 3.0:  # low branches are its own, too
            continue
        off = np.hypot(low[:, 0] - float(row["x"]), low[:, 1] - float(row["y"]))
        compared += 1
        assert np.median(off) < 0.5 * float(row["dbh_m"]) + 0.15, (tree, np.median(off))
    assert compared > 3, compared


def check_things(folder):
    cloud = laspy.read(folder / "points.laz")
    places = np.column_stack([cloud.x, cloud.y])[np.asarray(cloud.classification) == 6]
    assert len(places) > 100, len(places)
    least = np.full(len(places), np.inf)
    for row in rows(folder / "objects.csv"):
        turn = math.radians(float(row["yaw_deg"]))
        off = places - [float(row["x"]), float(row["y"])]
        along = np.abs(off @ [math.cos(turn), math.sin(turn)]) - 0.5 * (float(row["length_m"]) + float(row["walk_m"]))
        across = np.abs(off @ [-math.sin(turn), math.cos(turn)]) - 0.5 * float(row["width_m"])
        least = np.minimum(least, np.hypot(np.maximum(along, 0), np.maximum(across, 0)))
    assert least.max() < 0.5, least.max()


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run("simulate", "random", "-o", folder / "a.mcap", "--seed", 4, "--duration-s", 1.5, *SETTINGS)
        info = json.loads(run("info", folder / "a.mcap", "--json").stdout)
        lidar = [topic for topic in info["topics"] if topic["role"] == "lidar"]
        check_points(folder / "a.truth", sum(topic["points"] for topic in lidar))
        check_things(folder / "a.truth")
        crowns = [float(row["crown_area_m2"]) for row in rows(folder / "a.truth/trees.csv") if row["crown_area_m2"]]
        assert len(crowns) > 10 and min(crowns) > 0.3 and max(crowns) < 80.0, crowns
        run("simulate", folder / "a.truth/site.yaml", "-o", folder / "b.mcap")
        assert (folder / "a.mcap").read_bytes() == (folder / "b.mcap").read_bytes()
        said = run("map", "sim:random?truth.points=true", "-o", folder / "run", code=2).stderr
        assert "truth.points" in said, said


if __name__ == "__main__":
    main()
