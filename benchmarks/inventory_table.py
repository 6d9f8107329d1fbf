#!/usr/bin/env python3
"""Figures of an inventory against the truth of a simulation, by class of size and distance.

    benchmarks/inventory_table.py RUN TRUTH [RUN TRUTH ...]

RUN is the folder of `understory inventory` or of `understory map --inventory full`, TRUTH that of
`understory simulate`. The figures of all pairs are pooled. The program is build/understory, or the
one that UNDERSTORY_PROGRAM names. Needs numpy.

The map is laid on the truth by turning it about the vertical, from the trees alone. A tree of the
list and one of the truth are the same within 0.5 m, nearest first. Distances are those from the
true path.
"""
import csv
import gzip
import json
import math
import os
import pathlib
import subprocess
import sys

import numpy as np

PROGRAM = os.environ.get("UNDERSTORY_PROGRAM", str(pathlib.Path(__file__).resolve().parents[1] / "build/understory"))
SAME_M = 0.5
FEWEST_RETURNS = 30
# Diameter from, to (m) and distance from the path that the figures are for.
CLASSES = [(0.10, 9.0, 15.0), (0.05, 0.10, 15.0), (0.02, 0.05, 5.0)]


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def number(text):
    return float(text) if text else math.nan


def column(rows, name):
    return np.array([number(row.get(name, "")) for row in rows])


class Trees:
    def __init__(self, path):
        rows = rows_of(path)
        self.id = column(rows, "id").astype(int)
        self.place = np.column_stack([column(rows, "x"), column(rows, "y")]).reshape(-1, 2)
        for name in ("dbh_m", "dbh_sd_m", "height_m", "stem_volume_m3", "stem_volume_sd_m3"):
            setattr(self, name, column(rows, name))
        self.felled = np.array([bool(row.get("felled_at")) for row in rows], dtype=bool)


def curves_of(path):
    """Tree id -> rows of height, diameter, standard deviation, measured."""
    curves = {}
    if not os.path.exists(path):
        return curves
    for row in rows_of(path):
        curves.setdefault(int(row["tree_id"]), []).append(
            (float(row["height_m"]), float(row["diameter_m"]), number(row.get("diameter_sd_m", "")), number(row.get("measured", "1"))))
    return {tree: np.array(rows) for tree, rows in curves.items()}


def aligned(run, truth, trees):
    said = subprocess.run([PROGRAM, "evaluate", "trees", run, truth, "--align", "yaw", "--json"], capture_output=True, text=True, check=True)
    found = json.loads(said.stdout)["alignment_found"]
    turn = math.radians(found["yaw_deg"])
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    return trees.place @ rotation.T + np.array(found["translation_m"][:2])


def distances(places, path):
    """Of each place from the path, in plane."""
    return np.array([np.sqrt(((path - place) ** 2).sum(axis=1)).min() for place in places])


def pairs_of(places, truth_places):
    """Index of the list -> index of the truth, nearest first, one to one."""
    gaps = np.sqrt(((places[:, None, :] - truth_places[None, :, :]) ** 2).sum(axis=2))
    pairs = {}
    taken = set()
    for flat in np.argsort(gaps, axis=None):
        i, j = np.unravel_index(flat, gaps.shape)
        if gaps[i, j] > SAME_M:
            break
        if i in pairs or j in taken:
            continue
        pairs[int(i)] = int(j)
        taken.add(int(j))
    return pairs


class Pool:
    """What the pairs of all runs add to."""

    def __init__(self):
        self.expected = [0] * len(CLASSES)
        self.found = [0] * len(CLASSES)
        self.listed = [0] * len(CLASSES)
        self.false = [0] * len(CLASSES)
        self.dbh = []  # distance, error, stated sd, true
        self.height = []  # distance, error
        self.curve = []  # distance, height, error, stated sd, measured
        self.volume = []  # distance, estimate, true, stated sd
        self.position = []

    def add(self, run, truth_folder):
        run_trees = Trees(f"{run}/trees.csv")
        truth = Trees(f"{truth_folder}/trees.csv")
        path = np.loadtxt(f"{truth_folder}/trajectory.tum")[:, 1:3]
        returns = {}
        with gzip.open(f"{truth_folder}/returns.csv.gz", "rt") as file:
            for row in csv.DictReader(file):
                tree = int(row["tree_id"])
                returns[tree] = returns.get(tree, 0) + int(row["returns"])
        places = aligned(run, truth_folder, run_trees)
        pairs = pairs_of(places, truth.place)
        away = distances(truth.place, path)
        own_away = distances(places, path)
        seen = np.array([returns.get(int(tree), 0) >= FEWEST_RETURNS for tree in truth.id])
        matched = set(pairs.values())
        for k, (least, most, reach) in enumerate(CLASSES):
            expected = [j for j in range(len(truth.id))
                        if least <= truth.dbh_m[j] < most and away[j] <= reach and seen[j] and not truth.felled[j]]
            self.expected[k] += len(expected)
            self.found[k] += sum(j in matched for j in expected)
            listed = [i for i in range(len(run_trees.id)) if least <= run_trees.dbh_m[i] < most and own_away[i] <= reach]
            self.listed[k] += len(listed)
            self.false[k] += sum(i not in pairs for i in listed)
        curves = curves_of(f"{run}/stem_curves.csv")
        truth_curves = curves_of(f"{truth_folder}/stem_curves.csv")
        for i, j in pairs.items():
            self.position.append((away[j], *(places[i] - truth.place[j])))
            self.dbh.append((away[j], run_trees.dbh_m[i] - truth.dbh_m[j], run_trees.dbh_sd_m[i], truth.dbh_m[j]))
            self.height.append((away[j], run_trees.height_m[i] - truth.height_m[j]))
            self.volume.append((away[j], run_trees.stem_volume_m3[i], truth.stem_volume_m3[j], run_trees.stem_volume_sd_m3[i]))
            own = curves.get(int(run_trees.id[i]))
            true = truth_curves.get(int(truth.id[j]))
            if own is None or true is None:
                continue
            there = np.interp(own[:, 0], true[:, 0], true[:, 1])
            for (height, diameter, sd, measured), right in zip(own, there):
                self.curve.append((away[j], height, diameter - right, sd, measured))

    def tell(self):
        print("| diameter | within | expected | found | listed | false |\n|---|---|---|---|---|---|")
        for k, (least, most, reach) in enumerate(CLASSES):
            share = lambda part, whole: f"{part} ({100 * part / whole:.1f} %)" if whole else "-"
            size = f"{100 * least:.0f} cm and more" if most > 1 else f"{100 * least:.0f} to {100 * most:.0f} cm"
            print(f"| {size} | {reach:.0f} m | {self.expected[k]} | {share(self.found[k], self.expected[k])} | {self.listed[k]} | {share(self.false[k], self.listed[k])} |")
        print("\n| from the path | quantity | number | bias | RMSE | median | within 1 sd | within 2 sd |\n|---|---|---|---|---|---|---|---|")
        dbh = np.array(self.dbh)
        for least, most in ((0, 8), (8, 15), (0, 15), (15, 30)):
            near = dbh[(dbh[:, 0] >= least) & (dbh[:, 0] < most) & (dbh[:, 3] >= 0.10)]
            line(f"{least} to {most} m", "diameter at breast height, cm", near[:, 1], near[:, 2], 100)
        heights = np.array(self.height)
        for least, most in ((0, 8), (8, 15), (15, 30)):
            near = heights[(heights[:, 0] >= least) & (heights[:, 0] < most) & np.isfinite(heights[:, 1])]
            line(f"{least} to {most} m", "height, m", near[:, 1], None, 1)
        if self.curve:
            curve = np.array(self.curve)
            for low, high in ((0.3, 1), (1, 2), (2, 4), (4, 6), (6, 8), (8, 12), (0.3, 6)):
                for measured in (1, 0):
                    part = curve[(curve[:, 0] < 8) & (curve[:, 1] >= low) & (curve[:, 1] < high) & (curve[:, 4] == measured)]
                    if len(part):
                        line("0 to 8 m", f"diameter at {low:g} to {high:g} m, {'measured' if measured else 'by form'}, cm", part[:, 2], part[:, 3], 100)
        volume = np.array(self.volume)
        for least, most in ((0, 8), (8, 15)):
            part = volume[(volume[:, 0] >= least) & (volume[:, 0] < most) & np.isfinite(volume[:, 1]) & np.isfinite(volume[:, 2])]
            if len(part):
                error = part[:, 1] - part[:, 2]
                inside = [100 * np.mean(np.abs(error) < k * part[:, 3]) for k in (1, 2)]
                print(f"| {least} to {most} m | stem volume, m3 | {len(part)} | sum {100 * error.sum() / part[:, 2].sum():+.1f} % | "
                      f"{math.sqrt(np.mean(error ** 2)):.3f} | {np.median(error):+.3f} | {inside[0]:.0f} % | {inside[1]:.0f} % |")
        place = np.array(self.position)
        near = place[place[:, 0] < 15]
        print(f"\nposition within 15 m of the path: RMSE {100 * math.sqrt(np.mean(near[:, 1:] ** 2) * 2):.1f} cm")


def line(where, what, errors, sds, scale):
    if not len(errors):
        return
    inside = ["-", "-"]
    if sds is not None:
        inside = [f"{100 * np.mean(np.abs(errors) < k * sds):.0f} %" for k in (1, 2)]
    print(f"| {where} | {what} | {len(errors)} | {scale * errors.mean():+.2f} | {scale * math.sqrt(np.mean(errors ** 2)):.2f} | "
          f"{scale * np.median(errors):+.2f} | {inside[0]} | {inside[1]} |")


def main():
    arguments = sys.argv[1:]
    if not arguments or len(arguments) % 2:
        sys.exit(__doc__)
    pool = Pool()
    for run, truth in zip(arguments[::2], arguments[1::2]):
        pool.add(run, truth)
    pool.tell()


if __name__ == "__main__":
    main()
