#!/usr/bin/env python3
"""Figures of an inventory against the truth of a simulation, by class of size and distance.

    benchmarks/inventory_table.py [--same-frame] RUN TRUTH [RUN TRUTH ...]

RUN is the folder of `understory inventory` or of `understory map --inventory full`, TRUTH that of
`understory simulate`. The figures of all pairs are pooled. The program is build/understory, or the
one that UNDERSTORY_PROGRAM names. Needs numpy.

The map is laid on the truth by turning it about the vertical, from the trees alone. With --same-frame it
stays where it is (an inventory of points.laz). A tree of the list and one of the truth are the same
within 0.5 m, nearest first. Distances are those from the true path.

A truth with objects.csv tells on what the false stems stand. A truth with points.laz (`understory
simulate --set truth.points=true`) tells how many points of RUN's map.laz have the right tree. It also
tells the tops of which trees were seen. A point is one of the truth if both have one time and lie within
0.5 m of each other. This needs laspy.
"""
import csv
import gzip
import json
import math
import os
import pathlib
import subprocess
import sys

import inventory_truth
import numpy as np

PROGRAM = os.environ.get("UNDERSTORY_PROGRAM", str(pathlib.Path(__file__).resolve().parents[1] / "build/understory"))
SAME_M = 0.5
FEWEST_RETURNS = 30
BIG_M = 0.10
CROWN = {"crown_base_m": "crown base, m", "crown_area_m2": "crown area, m2", "crown_volume_m3": "crown volume, m3"}
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
        self.ground = column(rows, "z")
        for name in ("dbh_m", "dbh_sd_m", "height_m", "height_sd_m", "stem_volume_m3", "stem_volume_sd_m3", "crown_base_m", "crown_area_m2", "crown_volume_m3"):
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


def alignment(run, truth):
    """Rotation and translation that lay the map on the truth, by the trees."""
    said = subprocess.run([PROGRAM, "evaluate", "trees", run, truth, "--align", "yaw", "--json"], capture_output=True, text=True, check=True)
    found = json.loads(said.stdout)["alignment_found"]
    turn = math.radians(found["yaw_deg"])
    rotation = np.array([[math.cos(turn), -math.sin(turn), 0.0], [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    return rotation, np.array(found["translation_m"])


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
    """What the pairs of all runs add to. With `same_frame` maps lie where their truth does."""

    def __init__(self, same_frame):
        self.same_frame = same_frame
        self.expected = [0] * len(CLASSES)
        self.found = [0] * len(CLASSES)
        self.listed = [0] * len(CLASSES)
        self.false = [0] * len(CLASSES)
        self.dbh = []  # distance, error, stated sd, true
        self.height = []  # distance, error, stated sd, true diameter
        self.curve = []  # distance, height, error, stated sd, measured
        self.volume = []  # distance, estimate, true, stated sd
        self.position = []
        self.kinds = {}  # what false stems stand on -> how many
        self.things = {}  # kind -> how many there are
        self.owned = [0, 0, 0]  # points of trees; given to theirs; given to another tree
        self.claimed = [0, 0]  # points given to a listed tree; of its own
        self.crown = {name: [] for name in CROWN}  # distance, estimate, true
        self.seen_height = []  # error, of trees whose tops were seen; NaN without a height

    def add(self, run, truth_folder):
        run_trees = Trees(f"{run}/trees.csv")
        truth = Trees(f"{truth_folder}/trees.csv")
        path = np.loadtxt(f"{truth_folder}/trajectory.tum")[:, 1:3]
        returns = {}
        with gzip.open(f"{truth_folder}/returns.csv.gz", "rt") as file:
            for row in csv.DictReader(file):
                tree = int(row["tree_id"])
                returns[tree] = returns.get(tree, 0) + int(row["returns"])
        rotation, shift = (np.eye(3), np.zeros(3)) if self.same_frame else alignment(run, truth_folder)
        places = run_trees.place @ rotation[:2, :2].T + shift[:2]
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
        self.add_false(places, own_away, pairs, truth, truth_folder, path)
        for name in CROWN:
            own, true = getattr(run_trees, name), getattr(truth, name)
            self.crown[name] += [(away[j], own[i], true[j]) for i, j in pairs.items() if truth.dbh_m[j] >= BIG_M]
        if os.path.exists(f"{truth_folder}/points.laz") and os.path.exists(f"{run}/map.laz"):
            self.add_points(run, truth_folder, (rotation, shift), run_trees, truth, pairs, away)
        curves = curves_of(f"{run}/stem_curves.csv")
        truth_curves = curves_of(f"{truth_folder}/stem_curves.csv")
        for i, j in pairs.items():
            self.position.append((away[j], *(places[i] - truth.place[j])))
            self.dbh.append((away[j], run_trees.dbh_m[i] - truth.dbh_m[j], run_trees.dbh_sd_m[i], truth.dbh_m[j]))
            self.height.append((away[j], run_trees.height_m[i] - truth.height_m[j], run_trees.height_sd_m[i], truth.dbh_m[j]))
            self.volume.append((away[j], run_trees.stem_volume_m3[i], truth.stem_volume_m3[j], run_trees.stem_volume_sd_m3[i]))
            own = curves.get(int(run_trees.id[i]))
            true = truth_curves.get(int(truth.id[j]))
            if own is None or true is None:
                continue
            there = np.interp(own[:, 0], true[:, 0], true[:, 1])
            for (height, diameter, sd, measured), right in zip(own, there):
                self.curve.append((away[j], height, diameter - right, sd, measured))

    def add_false(self, places, own_away, pairs, truth, truth_folder, path):
        things = inventory_truth.things_of(truth_folder)
        for thing in things:
            self.things[thing["kind"]] = self.things.get(thing["kind"], 0) + 1
        for i in range(len(places)):
            if i in pairs or own_away[i] > 15.0:
                continue
            kind = inventory_truth.kind_of_false(places[i], things, truth.place, path)
            self.kinds[kind] = self.kinds.get(kind, 0) + 1

    def add_points(self, run, truth_folder, moved, run_trees, truth, pairs, away):
        true_points = inventory_truth.read_points(f"{truth_folder}/points.laz")
        places, ticks, own = inventory_truth.thinned(inventory_truth.read_points(f"{run}/map.laz"))
        true = inventory_truth.true_trees_of(places @ moved[0].T + moved[1], ticks, true_points)
        most = int(max(truth.id.max(initial=0), true.max(initial=0), own.max(initial=0), run_trees.id.max(initial=0))) + 1
        same_as = np.full(most, -1)  # id of the list -> id of the truth
        for i, j in pairs.items():
            same_as[run_trees.id[i]] = truth.id[j]
        counts = np.zeros(most, dtype=bool)
        counts[truth.id[(truth.dbh_m >= BIG_M) & (away <= 15.0) & ~truth.felled]] = True
        of_trees = (true > 0) & counts[np.maximum(true, 0)]
        right = of_trees & (own > 0) & (same_as[own] == true)
        self.owned[0] += int(of_trees.sum())
        self.owned[1] += int(right.sum())
        self.owned[2] += int((of_trees & (own > 0) & ~right).sum())
        claimed = (own > 0) & (same_as[own] > 0) & counts[np.maximum(same_as[own], 0)] & (true >= 0)
        self.claimed[0] += int(claimed.sum())
        self.claimed[1] += int((claimed & (same_as[own] == true)).sum())
        tops = inventory_truth.tops_seen(true_points, truth.id, truth.ground + truth.height_m)
        self.seen_height += [run_trees.height_m[i] - truth.height_m[j] for i, j in pairs.items() if tops[j] and away[j] <= 15.0]

    def tell_truth(self):
        if self.things or self.kinds:
            things = ", ".join(f"{count} {kind}" for kind, count in sorted(self.things.items()))
            false = ", ".join(f"{count} {kind}" for kind, count in sorted(self.kinds.items(), key=lambda item: -item[1]))
            print(f"\nthings that are no trees: {things or 'none'}\nfalse stems within 15 m stand on: {false or 'none'}")
        if self.owned[0]:
            print(f"\npoints of trees of 10 cm and more within 15 m: {self.owned[0]}, given to their tree {100 * self.owned[1] / self.owned[0]:.1f} %, "
                  f"to another {100 * self.owned[2] / self.owned[0]:.1f} %")
            print(f"points given to such trees of the list: {self.claimed[0]}, of their own {100 * self.claimed[1] / max(1, self.claimed[0]):.1f} %")
        if self.seen_height:
            errors = np.array(self.seen_height)
            known = errors[np.isfinite(errors)]
            print(f"heights within 15 m where the top was seen ({len(errors)} trees, {len(errors) - len(known)} without a height): median error "
                  f"{np.median(np.abs(known)):.2f} m, bias {known.mean():+.2f} m, within 1 m {100 * np.mean(np.abs(known) < 1.0):.0f} %")
        for name, what in CROWN.items():
            rows = np.array(self.crown[name]).reshape(-1, 3)
            rows = rows[(rows[:, 0] <= 15.0) & np.isfinite(rows[:, 1]) & np.isfinite(rows[:, 2])]
            if not len(rows):
                continue
            error = rows[:, 1] - rows[:, 2]
            mean = rows[:, 2].mean()
            print(f"{what} within 15 m ({len(rows)} trees of 10 cm and more): bias {error.mean():+.2f}, RMSE {math.sqrt(np.mean(error ** 2)):.2f}, "
                  f"mean of the truth {mean:.2f}, RMSE {100 * math.sqrt(np.mean(error ** 2)) / mean:.0f} %, median {np.median(error):+.2f}")

    def tell(self):
        print("| diameter | within | expected | found | listed | false |\n|---|---|---|---|---|---|")
        for k, (least, most, reach) in enumerate(CLASSES):
            share = lambda part, whole: f"{part} ({100 * part / whole:.1f} %)" if whole else "-"
            print(f"| {size_of(least, most)} | {reach:.0f} m | {self.expected[k]} | {share(self.found[k], self.expected[k])} | {self.listed[k]} | {share(self.false[k], self.listed[k])} |")
        print("\n| from the path | quantity | number | bias | RMSE | median | within 1 sd | within 2 sd |\n|---|---|---|---|---|---|---|---|")
        dbh = np.array(self.dbh)
        for least, most in ((0, 8), (8, 15), (0, 15), (15, 30)):
            near = dbh[(dbh[:, 0] >= least) & (dbh[:, 0] < most) & (dbh[:, 3] >= 0.10)]
            line(f"{least} to {most} m", "diameter at breast height, cm", near[:, 1], near[:, 2], 100)
        heights = np.array(self.height)
        for least, most in ((0, 8), (8, 15), (15, 30)):
            near = heights[(heights[:, 0] >= least) & (heights[:, 0] < most) & np.isfinite(heights[:, 1])]
            line(f"{least} to {most} m", "height, m", near[:, 1], None, 1)
        for least, most, reach in CLASSES[1:]:
            for rows, what, scale in ((dbh, "diameter, cm", 100), (heights, "height, m", 1)):
                part = rows[(rows[:, 0] <= reach) & (rows[:, 3] >= least) & (rows[:, 3] < most) & np.isfinite(rows[:, 1])]
                line(f"0 to {reach:.0f} m", f"of {size_of(least, most)}: {what}", part[:, 1], part[:, 2], scale)
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
        self.tell_truth()


def size_of(least, most):
    return f"{100 * least:.0f} cm and more" if most > 1 else f"{100 * least:.0f} to {100 * most:.0f} cm"


def line(where, what, errors, sds, scale):
    if not len(errors):
        return
    inside = ["-", "-"]
    if sds is not None:
        inside = [f"{100 * np.mean(np.abs(errors) < k * sds):.0f} %" for k in (1, 2)]
    print(f"| {where} | {what} | {len(errors)} | {scale * errors.mean():+.2f} | {scale * math.sqrt(np.mean(errors ** 2)):.2f} | "
          f"{scale * np.median(errors):+.2f} | {inside[0]} | {inside[1]} |")


def main():
    same_frame = "--same-frame" in sys.argv
    arguments = [argument for argument in sys.argv[1:] if argument != "--same-frame"]
    if not arguments or len(arguments) % 2:
        sys.exit(__doc__)
    pool = Pool(same_frame)
    for run, truth in zip(arguments[::2], arguments[1::2]):
        pool.add(run, truth)
    pool.tell()


if __name__ == "__main__":
    main()
