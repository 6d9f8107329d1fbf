#!/usr/bin/env python3
"""Whether the errors of a tree list are as large as it states, by classes of range and size.

    benchmarks/stated_errors.py [--same-frame] RUN TRUTH [RUN TRUTH ...]

RUN is the folder of `understory map` (by any front end) or of `understory inventory`, TRUTH that of
`understory simulate`. Diameters, heights and stem volumes are compared, as far as the list states their standard
deviations. Heights that are lower bounds, and volumes up to them, have rows of their own. Trees of 5 cm and more
count. Ranges are from the true path, sizes are true ones. A class has 20 trees at least (--least). All runs are pooled.
The floor is 64 to 72 % of the errors within one deviation, and 93 to 97 % within two.

Felled trees are left out. Maps are laid on the truth as in inventory_table.py. Needs numpy.
"""
import argparse

import inventory_table
import numpy as np

RANGES_M = (0, 8, 15, 22, 30, 60)
SIZES_M = (0.05, 0.10, 0.20, 9.0)
QUANTITIES = {"dbh_m": ("diameter, cm", 100), "height_m": ("height, m", 1), "stem_volume_m3": ("stem volume, dm3", 1000)}


def rows_of(run, truth_folder, same_frame):
    """Of each tree: range, true diameter, lower bound, and error and deviation of each quantity."""
    own, truth = inventory_table.Trees(f"{run}/trees.csv"), inventory_table.Trees(f"{truth_folder}/trees.csv")
    bound = inventory_table.column(inventory_table.rows_of(f"{run}/trees.csv"), "height_is_lower_bound")
    path = np.loadtxt(f"{truth_folder}/trajectory.tum")[:, 1:3]
    rotation, shift = (np.eye(3), np.zeros(3)) if same_frame else inventory_table.alignment(run, truth_folder)
    pairs = inventory_table.pairs_of(own.place @ rotation[:2, :2].T + shift[:2], truth.place)
    away = inventory_table.distances(truth.place, path)
    sd_of = {"dbh_m": own.dbh_sd_m, "height_m": own.height_sd_m, "stem_volume_m3": own.stem_volume_sd_m3}
    return np.array([[away[j], truth.dbh_m[j], bound[i] == 1.0]
                     + [value for name, sds in sd_of.items() for value in (getattr(own, name)[i] - getattr(truth, name)[j], sds[i])]
                     for i, j in pairs.items() if truth.dbh_m[j] >= SIZES_M[0] and not truth.felled[j]]).reshape(-1, 9)


def classes_of(rows):
    """Name and rows of each class."""
    ranges = [(f"{low} to {high} m", (rows[:, 0] >= low) & (rows[:, 0] < high)) for low, high in zip(RANGES_M, RANGES_M[1:])]
    sizes = [(f"{100 * low:.0f} cm and more" if high > 1 else f"{100 * low:.0f} to {100 * high:.0f} cm", (rows[:, 1] >= low) & (rows[:, 1] < high))
             for low, high in zip(SIZES_M, SIZES_M[1:])]
    yield "all", np.ones(len(rows), dtype=bool)
    yield from ranges
    yield from sizes
    yield from ((f"{where}, {size}", near & thick) for where, near in ranges for size, thick in sizes)


def tell(what, scale, rows, least):
    """`rows`: range, true diameter, error, deviation."""
    rows = rows[np.isfinite(rows).all(axis=1)]
    for name, inside in classes_of(rows):
        error, sd = rows[inside, 2], rows[inside, 3]
        if len(error) < least:
            continue
        within = ", ".join(f"{100 * np.mean(np.abs(error) <= times * sd):.0f}" for times in (1, 2))
        print(f"| {what} | {name} | {len(error)} | {scale * error.mean():+.2f} | {scale * np.sqrt(np.mean(error ** 2)):.2f} | "
              f"{scale * np.sqrt(np.mean(sd ** 2)):.2f} | {within} % |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--same-frame", action="store_true")
    parser.add_argument("--least", type=int, default=20)
    parser.add_argument("folders", nargs="+")
    options = parser.parse_args()
    if len(options.folders) % 2:
        parser.error("expected a truth for each run")
    rows = np.concatenate([rows_of(run, truth, options.same_frame) for run, truth in zip(options.folders[::2], options.folders[1::2])])
    print("| quantity | trees | number | bias | RMSE | stated | within 1, 2 sd |\n|---|---|---|---|---|---|---|")
    for k, (name, (what, scale)) in enumerate(QUANTITIES.items()):
        columns = rows[:, [0, 1, 3 + 2 * k, 4 + 2 * k]]
        bounds = rows[:, 2] == 1.0
        if name == "dbh_m":
            tell(what, scale, columns, options.least)
            continue
        tell(what, scale, columns[~bounds], options.least)
        tell(f"{what}, lower bounds", scale, columns[bounds], options.least)


if __name__ == "__main__":
    main()
