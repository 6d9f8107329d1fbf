#!/usr/bin/env python3
"""Errors of the diameters of an inventory by the distance from the path.

    benchmarks/far_diameters.py [--same-frame] RUN TRUTH [RUN TRUTH ...]

RUN is the folder of `understory inventory` or `understory map`, TRUTH that of `understory simulate`. Trees of 5 cm and more
count. The table tells how many there are, mean error, root mean square error, and the shares within one and two
stated deviations (`dbh_sd_m`). The last rows pool all runs. The map is laid on the truth by the trees, as in inventory_table.py.
Needs numpy.
"""
import sys

import inventory_table
import numpy as np

CLASSES_M = (0, 8, 15, 22, 30, 40, 60)
LEAST_DBH_M = 0.05


def errors_of(run, truth_folder, same_frame):
    """Rows of distance from the path, error and stated deviation, metres."""
    own = inventory_table.Trees(f"{run}/trees.csv")
    sds = inventory_table.column(inventory_table.rows_of(f"{run}/trees.csv"), "dbh_sd_m")
    truth = inventory_table.Trees(f"{truth_folder}/trees.csv")
    path = np.loadtxt(f"{truth_folder}/trajectory.tum")[:, 1:3]
    rotation, shift = (np.eye(3), np.zeros(3)) if same_frame else inventory_table.alignment(run, truth_folder)
    places = own.place @ rotation[:2, :2].T + shift[:2]
    away = inventory_table.distances(truth.place, path)
    rows = [(away[j], own.dbh_m[i] - truth.dbh_m[j], sds[i]) for i, j in inventory_table.pairs_of(places, truth.place).items()
            if truth.dbh_m[j] >= LEAST_DBH_M and not truth.felled[j]]
    return np.array([row for row in rows if np.isfinite(row).all()]).reshape(-1, 3)


def tell(name, rows):
    for least, most in zip(CLASSES_M, CLASSES_M[1:]):
        part = rows[(rows[:, 0] >= least) & (rows[:, 0] < most)]
        if not len(part):
            continue
        errors = part[:, 1]
        within = ", ".join(f"{100 * np.mean(np.abs(errors) <= times * part[:, 2]):.0f}" for times in (1, 2))
        print(f"| {name} | {least} to {most} m | {len(part)} | {100 * np.mean(errors):+.2f} | {100 * np.sqrt(np.mean(errors**2)):.2f} | {within} % |")


def main():
    same_frame = "--same-frame" in sys.argv
    arguments = [argument for argument in sys.argv[1:] if argument != "--same-frame"]
    if not arguments or len(arguments) % 2:
        sys.exit(__doc__)
    print("| run | from the path | stems | bias cm | RMSE cm | within 1, 2 sd |\n|---|---|---|---|---|---|")
    runs = {run: errors_of(run, truth, same_frame) for run, truth in zip(arguments[::2], arguments[1::2])}
    if len(runs) > 1:
        runs["all"] = np.concatenate(list(runs.values()))
    for name, rows in runs.items():
        tell(name, rows)


if __name__ == "__main__":
    main()
