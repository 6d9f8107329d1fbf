#!/usr/bin/env python3
"""How well an inventory tells which of its heights are lower bounds.

    benchmarks/height_bounds.py [--same-frame] RUN TRUTH [RUN TRUTH ...]

RUN is the folder of `understory inventory` or `understory map`, TRUTH that of `understory simulate`.
Trees of 5 cm and more whose stems are within 15 m of the path, and those from there to 30 m, are
compared. A height is too low if it is more than 1 m below the true one, and right within 1 m. The
table tells the share of the first that is flagged (`height_is_lower_bound`), and the share of the
second that is. A second table has all trees, and the share of the heights without a flag whose error is within one and two
stated deviations (`height_sd_m`). The map is laid on the truth by the trees, as in inventory_table.py. Needs numpy.
"""
import sys

import inventory_table
import numpy as np

LEAST_DBH_M = 0.05
RIGHT_M = 1.0


def errors_of(run, truth_folder, same_frame):
    """Rows of distance, error of the height (NaN without one), flag, stated deviation."""
    own = inventory_table.Trees(f"{run}/trees.csv")
    listed = inventory_table.rows_of(f"{run}/trees.csv")
    flags, sds = (inventory_table.column(listed, name) for name in ("height_is_lower_bound", "height_sd_m"))
    truth = inventory_table.Trees(f"{truth_folder}/trees.csv")
    path = np.loadtxt(f"{truth_folder}/trajectory.tum")[:, 1:3]
    rotation, shift = (np.eye(3), np.zeros(3)) if same_frame else inventory_table.alignment(run, truth_folder)
    places = own.place @ rotation[:2, :2].T + shift[:2]
    away = inventory_table.distances(truth.place, path)
    return [(away[j], own.height_m[i] - truth.height_m[j], flags[i], sds[i])
            for i, j in inventory_table.pairs_of(places, truth.place).items() if truth.dbh_m[j] >= LEAST_DBH_M and not truth.felled[j]]


def tell(name, rows):
    for least, most in ((0, 15), (15, 30)):
        near = rows[(rows[:, 0] >= least) & (rows[:, 0] < most)]
        known = near[np.isfinite(near[:, 1])]
        low = known[known[:, 1] < -RIGHT_M]
        right = known[np.abs(known[:, 1]) <= RIGHT_M]
        free = known[known[:, 2] == 0]
        share = lambda part: f"{np.sum(part[:, 2] == 1)} of {len(part)} ({100 * np.mean(part[:, 2] == 1):.0f} %)" if len(part) else "-"
        bias = f"{np.median(free[:, 1]):+.2f} m, {np.mean(free[:, 1]):+.2f} m" if len(free) else "-"
        print(f"| {name} | {least} to {most} m | {len(near)} | {len(near) - len(known)} | {share(low)} | {share(right)} | {len(free)} | {bias} |")


def tell_sds(name, rows):
    free = rows[np.isfinite(rows[:, 1]) & (rows[:, 2] == 0)]
    within = [f"{100 * np.mean(np.abs(free[:, 1]) <= count * free[:, 3]):.0f} %" if len(free) else "-" for count in (1, 2)]
    print(f"| {name} | {len(free)} | {' | '.join(within)} |")


def main():
    same_frame = "--same-frame" in sys.argv
    arguments = [argument for argument in sys.argv[1:] if argument != "--same-frame"]
    if not arguments or len(arguments) % 2:
        sys.exit(__doc__)
    print("| run | from the path | trees | no height | too low: flagged | right: flagged | unflagged | their median error, bias |\n|---|---|---|---|---|---|---|---|")
    runs = {run: np.array(errors_of(run, truth, same_frame)) for run, truth in zip(arguments[::2], arguments[1::2])}
    if len(runs) > 1:
        runs["all"] = np.concatenate(list(runs.values()))
    for name, rows in runs.items():
        tell(name, rows)
    print("\n| run | heights without a flag | within 1 sd | within 2 sd |\n|---|---|---|---|")
    for name, rows in runs.items():
        tell_sds(name, rows)


if __name__ == "__main__":
    main()
