#!/usr/bin/env python3
"""Stand figures of sample plots against the truth of a simulation.

    benchmarks/stand_table.py --plots TRUTH [--radius M] [--step M] > plots.csv
    understory inventory TRUTH/points.laz --plots plots.csv -o RUN
    benchmarks/stand_table.py [--align] RUN TRUTH [RUN TRUTH ...]

The first call writes circles of 15 m along a path, one every 4 m. The last one compares plots.csv of
each RUN with the true trees of 5 cm and more on the whole plot, and pools all plots. It gives mean
error, root mean square error, and that of the error over its stated standard deviation (1 where the
deviations are right). The frame of RUN must be that of the truth. A map that is made from a recording is
not: the plots lie along the path of the run (--plots RUN). --align lays the truth on the map by the
trees. Of a run on the globe, --plots writes the plots in the map projection of its layers, as `inventory
--plots` takes them. Its trees tell how both frames lie to each other: trees.gpkg and trees.csv have them.
Needs numpy.
"""
import argparse
import csv
import math
import pathlib
import sqlite3
import struct
import sys

import inventory_table
import numpy as np

MIN_DBH_M = 0.05
LEAST_SEEN = 0.5
FIGURES = {
    "stems_per_ha": "stems_per_ha_sd",
    "basal_area_m2_per_ha": "basal_area_sd_m2_per_ha",
    "mean_dbh_m": "mean_dbh_sd_m",
    "weighted_dbh_m": "weighted_dbh_sd_m",
    "weighted_height_m": "weighted_height_sd_m",
    "dominant_height_m": "dominant_height_sd_m",
    "volume_m3_per_ha": "volume_sd_m3_per_ha",
}


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def number(text):
    return float(text) if text else math.nan


class LayerFrame:
    """From the frame of a run's tables to that of its layers, in plane: a turn, a scale and a shift, metres."""

    def __init__(self, folder):
        self.turn, self.middle, self.layer_middle = 1.0 + 0.0j, 0.0j, 0.0j
        layers = pathlib.Path(folder, "trees.gpkg")
        if not layers.exists():
            return
        own, other = trees_in_both(folder, layers)
        if len(own) and np.abs(own - other).max() < 0.01:
            return
        if len(own) < 2 or np.abs(own - own.mean()).max() < 1.0:
            sys.exit(f"{layers} lies in a map projection, and fewer than two trees tell how")
        self.middle, self.layer_middle = own.mean(), other.mean()
        a, b = own - self.middle, other - self.layer_middle
        self.turn = np.vdot(a, b) / np.vdot(a, a)
        worst = np.abs(b - self.turn * a).max()
        if worst > 0.05:
            sys.exit(f"trees.csv and {layers} do not have the same trees: they differ by {worst:.2f} m")

    def to_layers(self, places):
        return as_rows(self.layer_middle + self.turn * (as_complex(places) - self.middle))


def as_complex(places):
    places = np.asarray(places, dtype=float).reshape(-1, 2)
    return places[:, 0] + 1j * places[:, 1]


def as_rows(numbers):
    return np.column_stack([numbers.real, numbers.imag])


def trees_in_both(folder, layers):
    """Places of the same trees in trees.csv and in the layer of them, as complex numbers."""
    with sqlite3.connect(f"file:{layers}?mode=ro", uri=True) as database:
        rows = database.execute("SELECT id, geom FROM trees").fetchall()
    # Bits 1 to 3 of the fourth byte name the envelope before the well-known bytes (OGC 12-128).
    skip = (8, 40, 56, 56, 72)
    there = {}
    for tree, blob in rows:
        at = skip[blob[3] >> 1 & 7]
        there[int(tree)] = complex(*struct.unpack_from("<dd" if blob[at] else ">dd", blob, at + 5))
    own = {int(row["id"]): complex(float(row["x"]), float(row["y"])) for row in rows_of(f"{folder}/trees.csv")}
    both = sorted(own.keys() & there.keys())
    return np.array([own[i] for i in both]), np.array([there[i] for i in both])


def write_plots(folder, radius, step):
    path = LayerFrame(folder).to_layers(np.loadtxt(f"{folder}/trajectory.tum", ndmin=2)[:, 1:3])
    print("id,x,y,radius_m")
    last = None
    count = 0
    for place in path:
        if last is not None and np.hypot(*(place - last)) < step:
            continue
        last = place
        count += 1
        print(f"{count},{place[0]:.3f},{place[1]:.3f},{radius:g}")


def figures_of_truth(trees, x, y, radius):
    on_plot = [t for t in trees if t["dbh_m"] >= MIN_DBH_M and math.hypot(t["x"] - x, t["y"] - y) < radius]
    hectares = math.pi * radius ** 2 / 1e4
    d = np.array([t["dbh_m"] for t in on_plot])
    h = np.array([t["height_m"] for t in on_plot])
    if not len(d):
        return None
    area = math.pi / 4 * d ** 2
    wanted = 100 * hectares
    weights = np.clip(wanted - np.arange(len(d)), 0, 1)
    dominant = (weights * h[np.argsort(-d, kind="stable")]).sum() / wanted if len(d) >= wanted else math.nan
    return {
        "stems_per_ha": len(d) / hectares,
        "basal_area_m2_per_ha": area.sum() / hectares,
        "mean_dbh_m": math.sqrt(np.mean(d ** 2)),
        "weighted_dbh_m": (area * d).sum() / area.sum(),
        "weighted_height_m": (area * h).sum() / area.sum(),
        "dominant_height_m": dominant,
        "volume_m3_per_ha": sum(t["stem_volume_m3"] for t in on_plot) / hectares,
    }


def compare(run, truth, align, errors, shares):
    trees = [{k: number(v) for k, v in row.items() if k not in ("species", "felled_at")} for row in rows_of(f"{truth}/trees.csv")]
    if align:
        rotation, shift = inventory_table.alignment(run, truth)  # from the map to the truth
        for tree in trees:
            tree["x"], tree["y"] = (rotation.T @ (np.array([tree["x"], tree["y"], tree["z"]]) - shift))[:2]
    for row in rows_of(f"{run}/plots.csv"):
        if row["kind"] != "circle":
            continue
        shares.append(number(row["seen_share"]))
        true = figures_of_truth(trees, number(row["x"]), number(row["y"]), number(row["radius_m"]))
        if shares[-1] < LEAST_SEEN or true is None:
            continue
        for name, sd in FIGURES.items():
            errors[name].append((number(row[name]), true[name], number(row[sd])))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plots", metavar="FOLDER")
    parser.add_argument("--radius", type=float, default=15.0)
    parser.add_argument("--step", type=float, default=4.0)
    parser.add_argument("--align", action="store_true")
    parser.add_argument("folders", nargs="*")
    arguments = parser.parse_args()
    if arguments.plots:
        write_plots(arguments.plots, arguments.radius, arguments.step)
        return
    folders = arguments.folders
    if not folders or len(folders) % 2:
        parser.error("expected RUN TRUTH [RUN TRUTH ...]")
    errors = {name: [] for name in FIGURES}
    shares = []
    for run, truth in zip(folders[::2], folders[1::2]):
        compare(run, truth, arguments.align, errors, shares)
    print(f"{len(shares)} plots, seen {100 * np.mean(shares):.1f} % of them on average, least {100 * min(shares):.1f} %\n")
    print("| figure | plots | mean error | RMS error | error over its deviation, RMS |\n|---|---|---|---|---|")
    for name, rows in errors.items():
        rows = np.array(rows).reshape(-1, 3)
        rows = rows[np.isfinite(rows).all(axis=1)]
        if not len(rows):
            print(f"| {name} | 0 | | | |")
            continue
        relative = rows[:, 0] / rows[:, 1] - 1
        score = (rows[:, 0] - rows[:, 1]) / np.maximum(rows[:, 2], 1e-12)
        print(f"| {name} | {len(rows)} | {100 * relative.mean():+.1f} % | {100 * math.sqrt(np.mean(relative ** 2)):.1f} % | {math.sqrt(np.mean(score ** 2)):.2f} |")


if __name__ == "__main__":
    main()
