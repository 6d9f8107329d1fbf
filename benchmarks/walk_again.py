"""Does a second recording at the places that a run suggests mend its doubtful diameters?

    benchmarks/walk_again.py --seed 3 --places 5 [--lidar VLP-16] [--work FOLDER]

Records a short walk, maps it, and takes the best places of the layer look_again. At each of them it
records the same trees again on a loop of 5 m in 9 s. For comparison it does so at that point of the
first path that is nearest to the place's trees. A tree is mended if the second map lists it with a
standard deviation of the diameter of at most 30 %. The program is build/understory, or the one that
UNDERSTORY_PROGRAM names. Needs numpy."""

import argparse
import csv
import os
import pathlib
import sqlite3
import struct
import subprocess
import tempfile

import numpy as np

PROGRAM = os.environ.get("UNDERSTORY_PROGRAM", str(pathlib.Path(__file__).resolve().parents[1] / "build/understory"))
SAME_M = 0.5
DOUBTFUL = 0.3
HALF_STAND_M = 29.5  # of the site `demo`


def run(*words):
    done = subprocess.run([PROGRAM, "--quiet", *map(str, words)], capture_output=True, text=True)
    assert done.returncode in (0, 4), (words, done.stderr)


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def places_of(trees):
    return np.array([[float(tree["x"]), float(tree["y"])] for tree in trees])


def doubt(tree):
    return float(tree["dbh_sd_m"]) / float(tree["dbh_m"])


def heading(pose):
    x, y, z, w = pose[4:8]
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def rigid(source, target):
    """Rotation and shift in the plane that lay the source on the target, by least squares."""
    a, b = source.mean(0), target.mean(0)
    u, _, v = np.linalg.svd((source - a).T @ (target - b))
    turn = v.T @ np.diag([1, np.linalg.det(v.T @ u.T)]) @ u.T
    return turn, b - turn @ a


def matched(folder, truth):
    """The listed tree of each true one, by its number; and the way from the map to the truth."""
    trees, true = rows(folder / "trees.csv"), rows(truth / "trees.csv")
    path, true_path = np.loadtxt(folder / "trajectory.tum"), np.loadtxt(truth / "trajectory.tum")
    at = np.searchsorted(true_path[:, 0], path[:, 0] - 1e-4).clip(0, len(true_path) - 1)
    angle = heading(true_path[at[0]]) - heading(path[0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shift = true_path[at, 1:3].mean(0) - turn @ path[:, 1:3].mean(0)
    for _ in range(3):
        apart = np.linalg.norm((places_of(trees) @ turn.T + shift)[:, None] - places_of(true)[None], axis=2)
        nearest, near = apart.argmin(1), apart.min(1) < SAME_M
        turn, shift = rigid(places_of(trees)[near], places_of(true)[nearest[near]])
    return {int(true[nearest[k]]["id"]): trees[k] for k in np.flatnonzero(near)}, turn, shift


def point_of(geometry):
    at = 8 + [0, 32, 48, 48, 64][(geometry[3] >> 1) & 7]
    return struct.unpack("<dd", geometry[at + 5:at + 21])


def look_again(folder):
    """Places and numbers of their trees. The trees, which are in both frames, lead from the layer's to the world frame."""
    with sqlite3.connect(folder / "trees.gpkg") as package:
        layer = {number: point_of(shape) for number, shape in package.execute("select id, geom from trees")}
        found = list(package.execute("select geom, tree_ids from look_again order by fid"))
    trees = rows(folder / "trees.csv")
    turn, shift = rigid(np.array([layer[int(tree["id"])] for tree in trees]), places_of(trees))
    return [(turn @ np.array(point_of(shape)) + shift, [int(i) for i in ids.split(", ")]) for shape, ids in found]


class Stand:
    def __init__(self, given, work):
        self.common = ["--set", f"seed={given.seed}", "--set", f"lidar.model={given.lidar}"]
        self.work = work
        self.short = ["--set", "duration_s=9", "--set", "carrier.length_m=5", "--set", "carrier.still_s=1"]
        self.make("first", ["--set", "duration_s=22"])
        self.first, self.turn, self.shift = matched(work / "first", work / "first.truth")
        self.true = rows(work / "first.truth" / "trees.csv")
        self.path = np.loadtxt(work / "first.truth" / "trajectory.tum")[:, 1:3]
        run("simulate", "demo", "-o", work / "empty.mcap", *self.common, *self.short, "--set", "stand.trees_per_ha=0")
        self.middle = np.loadtxt(work / "empty.truth" / "trajectory.tum")[:, 1:3].mean(0)  # of the short loop

    def make(self, name, settings):
        recording = self.work / f"{name}.mcap"
        run("simulate", "demo", "-o", recording, *self.common, *settings)
        run("map", recording, "-o", self.work / name, "--profile", "handheld")
        recording.unlink()

    def again(self, name, place):
        """The same trees around another place, which lies in the middle of the short loop."""
        moved = self.middle - place
        inside = [tree for tree, at in zip(self.true, places_of(self.true) + moved) if abs(at).max() < HALF_STAND_M]
        with open(self.work / f"{name}.csv", "w", newline="") as file:
            table = csv.writer(file)
            table.writerow(["id", "x", "y", "dbh_m", "height_m"])
            for tree, at in zip(inside, places_of(inside) + moved):
                table.writerow([tree["id"], f"{at[0]:.4f}", f"{at[1]:.4f}", tree["dbh_m"], tree["height_m"]])
        self.make(name, [*self.short, "--set", f"stand.trees={self.work / name}.csv"])
        found, *_ = matched(self.work / name, self.work / f"{name}.truth")
        there = rows(self.work / f"{name}.truth" / "trees.csv")
        number = {}
        for tree, at in zip(there, places_of(there) - moved):
            apart = np.linalg.norm(places_of(self.true) - at, axis=1)
            if apart.min() < 0.05:
                number[int(tree["id"])] = int(self.true[int(apart.argmin())]["id"])
        return {number[i]: tree for i, tree in found.items() if i in number}


def figures(name, stand, seen):
    """`seen`: number of a true tree, its row in the second map or None."""
    dbh = {int(tree["id"]): float(tree["dbh_m"]) for tree in stand.true}
    found = [(number, tree) for number, tree in seen if tree is not None]
    mended = sum(doubt(tree) <= DOUBTFUL for _, tree in found)

    def rms(pairs):
        return 100 * np.sqrt(np.mean([(float(tree["dbh_m"]) / dbh[number] - 1) ** 2 for number, tree in pairs]))

    before = [(number, stand.first[number]) for number, _ in found]
    print(f"{name}: {len(seen)} trees, {len(found)} listed again, {mended} mended; of those listed again, sd (median) "
          f"{100 * np.median([doubt(t) for _, t in before]):.0f} % -> {100 * np.median([doubt(t) for _, t in found]):.0f} %, "
          f"error (RMS) {rms(before):.0f} % -> {rms(found):.0f} %")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--places", type=int, default=5)
    parser.add_argument("--lidar", default="OS0-128")
    parser.add_argument("--work", type=pathlib.Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        stand = Stand(given, given.work or pathlib.Path(scratch))
        number = {int(tree["id"]): true for true, tree in stand.first.items()}
        suggested, control = [], []
        for k, (place, ids) in enumerate(look_again(stand.work / "first")[:given.places]):
            trees = [number[i] for i in ids if i in number]
            middle = places_of([t for t in stand.true if int(t["id"]) in trees]).mean(0)
            old = stand.path[np.linalg.norm(stand.path - middle, axis=1).argmin()]
            for seen, name, at in ((suggested, f"place{k}", stand.turn @ place + stand.shift), (control, f"old{k}", old)):
                found = stand.again(name, at)
                seen += [(tree, found.get(tree)) for tree in trees]
        doubtful = sum(doubt(tree) > DOUBTFUL for tree in stand.first.values())
        print(f"{doubtful} of {len(stand.first)} diameters are doubtful")
        figures("at the suggested places", stand, suggested)
        figures("on the first path", stand, control)


if __name__ == "__main__":
    main()
