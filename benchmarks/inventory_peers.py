#!/usr/bin/env python3
"""`./run bench inventory`: other programs that make trees of a cloud, and this one, on the same clouds.

  ./run bench inventory                      a simulated square of 14 m, and treels/pine_plot where the data is
  ./run bench inventory --half-m 10 --seed 3
  ./run bench inventory --clouds simulated --only understory 3DFin

From PyPI, each in an environment of its own: 3DFin, pointtree (treeX), PyTLidar (TreeQSM, whose trees are cut
by the truth), by their authors' defaults. The cloth simulation filter alone is in ground_table.py. A peer that
cannot be installed, or ends without trees, is a row with the reason. One after another, two processors.

Simulated: trees of 10 cm and more with 30 returns whose foot lies a metre inside of the square. A tree is found
within 0.5 m; a false one has a diameter of 10 cm or more and no tree there. Real: only numbers of trees.
"""

import argparse
import csv
import gzip
import math
import os
import sys
import tempfile
from pathlib import Path

from program import Failed, PROGRAM, TOP, machine, own_cpus, run, say, understory, version

PEERS = TOP / "benchmarks" / "peers" / "inventory"
STANDS = {"3DFin": ("3dfin", "three_d_fin"), "pointtree (treeX)": ("pointtree", "tree_x")}
QSM = ("pytlidar", "tree_qsm")
SAME_M, INSIDE_M, BIG_M, FEWEST_RETURNS = 0.5, 1.0, 0.10, 30
QSM_TREES = 3
LONGEST_S = 900


def environment(packages):
    made = run(TOP / "tools" / "python-env.sh", f"benchmarks/peers/inventory/{packages}.txt")
    if made.code != 0:
        raise Failed((made.stderr.strip().splitlines() or ["no environment for it"])[-1])
    return made.stdout.strip().splitlines()[-1]


def number(text):
    return float(text) if text else math.nan


def rows_of(path):
    with open(path, newline="") as file:
        return [{name: number(value) for name, value in row.items() if name in FIELDS} for row in csv.DictReader(file)]


FIELDS = {"id", "x", "y", "dbh_m", "height_m", "stem_volume_m3", "volume_m3"}


def peer(packages, script, cloud, work):
    """Trees of a peer, and what they cost."""
    try:
        python = environment(packages)
    except Failed as error:
        return {"failed": str(error)}
    out = work / f"{script}.csv"
    out.unlink(missing_ok=True)
    done = run("timeout", LONGEST_S, python, PEERS / f"{script}_peer.py", cloud, out, cpus=own_cpus())
    if done.code != 0:
        return {"failed": (done.stderr.strip().splitlines() or [f"ended with {done.code}"])[-1][:160], "cost": done}
    return {"trees": rows_of(out), "cost": done}


def ours(cloud, work):
    done = run(PROGRAM, "--quiet", "inventory", cloud, "-o", work / "ours", "--overwrite", "--threads", 2, cpus=own_cpus())
    if done.code not in (0, 4):
        return {"failed": (done.stderr.strip().splitlines() or [f"ended with {done.code}"])[-1][:160]}
    return {"trees": rows_of(work / "ours" / "trees.csv"), "cost": done}


def pairs_of(trees, truth):
    near = sorted((math.hypot(t["x"] - s["x"], t["y"] - s["y"]), i, j) for i, t in enumerate(trees) for j, s in enumerate(truth)
                  if abs(t["x"] - s["x"]) < SAME_M and abs(t["y"] - s["y"]) < SAME_M)
    pairs, taken = {}, set()
    for gap, i, j in near:
        if gap <= SAME_M and i not in pairs and j not in taken:
            pairs[i] = j
            taken.add(j)
    return pairs


def spread(errors, scale=1.0):
    known = [e for e in errors if math.isfinite(e)]
    if not known:
        return ["", "", "0"]
    return [f"{scale * sum(known) / len(known):+.2f}", f"{scale * math.sqrt(sum(e * e for e in known) / len(known)):.2f}", str(len(known))]


def cost_of(done):
    return [f"{done.wall_s:.0f}", f"{done.cpu_s:.0f}", f"{done.peak_memory_mb:.0f}"] if done else ["", "", ""]


def judged(name, result, truth, inside):
    """A row of the table of a simulated square."""
    if "failed" in result:
        return [name, f"no trees: {result['failed']}"] + [""] * 6 + cost_of(result.get("cost"))
    trees = result["trees"]
    pairs = pairs_of(trees, truth)
    wanted = {j for j, tree in enumerate(truth) if tree["expected"]}
    found = {i: j for i, j in pairs.items() if j in wanted}
    false = sum(1 for i, tree in enumerate(trees) if i not in pairs and inside(tree) and tree["dbh_m"] >= BIG_M)
    dbh = spread([trees[i]["dbh_m"] - truth[j]["dbh_m"] for i, j in found.items()], 100.0)
    height = spread([trees[i]["height_m"] - truth[j]["height_m"] for i, j in found.items()])
    volumes = [(trees[i].get("stem_volume_m3", math.nan), truth[j]["stem_volume_m3"]) for i, j in found.items()]
    volumes = [pair for pair in volumes if math.isfinite(pair[0])]
    volume = f"{100 * (sum(a for a, _ in volumes) / sum(b for _, b in volumes) - 1):+.1f}" if volumes else ""
    return [name, f"{len(found)} of {len(wanted)}", str(false), f"{dbh[0]}, {dbh[1]} ({dbh[2]})", f"{height[0]}, {height[1]}", volume,
            *cost_of(result["cost"])]


HEAD = ["", "found", "false", "diameter: bias, RMSE cm (trees)", "height: bias, RMSE m", "stem volume %", "wall s", "CPU s", "memory MB"]


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join((row + [""] * len(head))[:len(head)]) + " |" for row in rows]
    return "\n".join(lines)


def cut(folder, half, out):
    """The square about the middle of the path as a cloud; returns its middle."""
    import laspy
    import numpy as np
    path = np.loadtxt(folder / "trajectory.tum")[:, 1:3]
    middle = path[len(path) // 2]
    cloud = laspy.read(folder / "points.laz")
    kept = (np.abs(cloud.x - middle[0]) < half) & (np.abs(cloud.y - middle[1]) < half)
    square = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
    square.header.scales = [0.001] * 3
    square.x, square.y, square.z = (np.asarray(axis)[kept] for axis in (cloud.x, cloud.y, cloud.z))
    square.write(str(out))
    return middle, cloud


def true_trees(folder, middle, half):
    returns = {}
    with gzip.open(folder / "returns.csv.gz", "rt") as file:
        for row in csv.DictReader(file):
            returns[int(row["tree_id"])] = returns.get(int(row["tree_id"]), 0) + int(row["returns"])
    trees = rows_of(folder / "trees.csv")
    for tree in trees:
        inside = max(abs(tree["x"] - middle[0]), abs(tree["y"] - middle[1])) < half - INSIDE_M
        tree["expected"] = inside and tree["dbh_m"] >= BIG_M and returns.get(int(tree["id"]), 0) >= FEWEST_RETURNS
    return trees


def single_trees(cloud, truth, work):
    """Clouds of the expected trees with most points, thinned to one in 2 cm, as QSMs want them."""
    import laspy
    import numpy as np
    points = np.column_stack([cloud.x, cloud.y, cloud.z])
    ids = np.asarray(cloud.tree_id)
    counts = {int(tree["id"]): int((ids == int(tree["id"])).sum()) for tree in truth if tree["expected"]}
    for tree_id in sorted(counts, key=counts.get, reverse=True)[:QSM_TREES]:
        own = points[ids == tree_id]
        own = own[np.unique(np.floor(own / 0.02).astype(int), axis=0, return_index=True)[1]]
        single = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
        single.header.scales = [0.001] * 3
        single.x, single.y, single.z = own.T
        single.write(str(work / f"tree{tree_id}.las"))
        yield tree_id, work / f"tree{tree_id}.las"


def compare_single(cloud, truth, own, work):
    """TreeQSM on trees cut by the truth, beside this program's figures of the same trees."""
    pairs = {j: i for i, j in pairs_of(own, truth).items()}
    place = {int(tree["id"]): j for j, tree in enumerate(truth)}
    rows = []
    for tree_id, path in single_trees(cloud, truth, work):
        say(f"  PyTLidar, tree {tree_id}")
        true = truth[place[tree_id]]
        result = peer(*QSM, path, work)
        mine = own[pairs[place[tree_id]]] if place[tree_id] in pairs else {}
        theirs = result.get("trees", [{}])[0]
        show = lambda value, digits: f"{value:.{digits}f}" if value is not None and math.isfinite(value) else "-"
        rows.append([str(tree_id), *(f"{show(true[a], d)}; {show(mine.get(a), d)}; {show(theirs.get(b), d)}" for a, b, d in (
            ("dbh_m", "dbh_m", 3), ("height_m", "height_m", 1), ("stem_volume_m3", "volume_m3", 3))), result.get("failed", ""), *cost_of(result.get("cost"))])
    return table(["tree", "diameter m: truth; this; TreeQSM", "height m", "stem volume m3", "failed", "wall s", "CPU s", "memory MB"], rows)


def stands(cloud, work, only):
    for name, job in {"understory": lambda: ours(cloud, work),
                      **{name: lambda where=where: peer(*where, cloud, work) for name, where in STANDS.items()}}.items():
        if not only or name.split(" ")[0] in only:
            say(f"  {name}")
            yield name, job()


def simulated(options, work):
    what = f"{options.site}, seed {options.seed}, {options.duration_s:g} s, a square of {2 * options.half_m:g} m"
    say(what)
    understory("simulate", options.site, "-o", work / "s.mcap", "--overwrite", "--seed", options.seed, "--duration-s",
               options.duration_s, "--set", "truth.points=true")
    square = work / "square.las"
    middle, cloud = cut(work / "s.truth", options.half_m, square)
    truth = true_trees(work / "s.truth", middle, options.half_m)
    inside = lambda tree: max(abs(tree["x"] - middle[0]), abs(tree["y"] - middle[1])) < options.half_m - INSIDE_M
    rows, own = [], []
    for name, result in stands(square, work, options.only):
        rows.append(judged(name, result, truth, inside))
        print("| " + " | ".join(rows[-1]) + " |", flush=True)
        own = result.get("trees", []) if name == "understory" else own
    print(f"\n**{what}** ({version()}, {machine()})\n\n{table(HEAD, rows)}\n")
    if not options.only or "PyTLidar" in options.only:
        print(compare_single(cloud, truth, own, work) + "\n", flush=True)


def real(cloud, options, work):
    rows = []
    for name, result in stands(cloud, work, options.only):
        if "failed" in result:
            rows.append([name, f"none: {result['failed']}", "", "", *cost_of(result.get("cost"))])
            continue
        big = [tree for tree in result["trees"] if tree["dbh_m"] >= BIG_M]
        rows.append([name, str(len(result["trees"])), str(len(big)), f"{100 * sum(t['dbh_m'] for t in big) / max(1, len(big)):.1f}", *cost_of(result["cost"])])
    print(f"\n**{cloud.name}**\n\n" + table(["", "trees", "of 10 cm and more", "their mean diameter cm", "wall s", "CPU s", "memory MB"], rows) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clouds", nargs="+", choices=["simulated", "real"], default=["simulated", "real"])
    parser.add_argument("--site", default="random")
    parser.add_argument("--seed", type=int, default=4)
    parser.add_argument("--duration-s", type=float, default=30.0)
    parser.add_argument("--half-m", type=float, default=7.0)
    parser.add_argument("--only", nargs="+", help="understory, 3DFin, pointtree, PyTLidar")
    options = parser.parse_args()
    data = Path(os.environ.get("UNDERSTORY_DATA", TOP.parent / "shared" / "data"))
    with tempfile.TemporaryDirectory(prefix="understory-inventory-") as scratch:
        if "real" in options.clouds:
            plot = data / "treels" / "pine_plot.laz"
            real(plot, options, Path(scratch)) if plot.exists() else say(f"{plot} is not here: no real cloud")
        if "simulated" in options.clouds:
            simulated(options, Path(scratch))
    return 0


if __name__ == "__main__":
    sys.exit(main())
