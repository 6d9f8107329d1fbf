"""How well a full inventory tells forks, snags and sweep, on stands with more of them than sites draw.

    benchmarks/stem_forms.py [--seeds 1 2 4] [--seconds 20] [--near 15] [--work FOLDER]

Site `random` with a fork in a fifth of its trees and a broken top in a tenth. Each seed is simulated, mapped by our own
SLAM and measured. Lists are laid on the truth by their paths. A tree belongs to the nearest true foot within 60 cm.
Counted are trees within --near metres of the path. Needs numpy. The program is build/understory, or the one that
UNDERSTORY_PROGRAM names."""

import argparse
import csv
import pathlib
import tempfile

import numpy as np

import program

SETTINGS = ("--set", "stand.fork_share=0.2", "--set", "stand.broken_share=0.1")


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def number(text):
    return float(text) if text else float("nan")


def understory(*words):
    done = program.run(program.PROGRAM, "--quiet", *map(str, words))
    assert done.code in (0, 4), done.stderr


def matched(folder, run, truth, near_m):
    """Pairs of a listed tree and its true one, by the paths of run and truth in the plane."""
    own, true = np.loadtxt(run / "trajectory.tum"), np.loadtxt(truth / "trajectory.tum")
    _, i, j = np.intersect1d(own[:, 0].round(2), true[:, 0].round(2), return_indices=True)
    a, b = own[i, 1:3], true[j, 1:3]
    x, y = a - a.mean(0), b - b.mean(0)
    turn = np.arctan2((x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]).sum(), (x * y).sum())
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    grown = rows(truth / "trees.csv")
    feet = np.array([[float(tree["x"]), float(tree["y"])] for tree in grown])
    for tree in rows(folder / "trees.csv"):
        place = rotation @ (np.array([float(tree["x"]), float(tree["y"])]) - a.mean(0)) + b.mean(0)
        gaps = np.linalg.norm(feet - place, axis=1)
        if tree["dbh_m"] and gaps.min() <= 0.6 and np.linalg.norm(b - place, axis=1).min() <= near_m:
            yield tree, grown[int(gaps.argmin())]


def report(pairs):
    forks = [(number(tree["fork_m"]), number(true["fork_m"]), number(true["crown_base_m"])) for tree, true in pairs]
    low = [said for said, true, base in forks if true < base]
    high = [said for said, true, base in forks if true == true and not true < base]
    none = [said for said, true, _ in forks if true != true]
    errors = [said - true for said, true, _ in forks if said == said and true == true]
    print(f"forks below the crown: {np.isfinite(low).sum()} of {len(low)}; within it: {np.isfinite(high).sum()} of {len(high)}; "
          f"trees without one that got one: {np.isfinite(none).sum()} of {len(none)}")
    if errors:
        print("height of the fork, errors: median %.2f, 10 %% %.2f, 90 %% %.2f m" % tuple(np.percentile(errors, (50, 10, 90))))
    snags = [(tree["snag"], number(true["snag"])) for tree, true in pairs]
    dead = [said for said, true in snags if true == 1.0]
    living = [said for said, true in snags if true == 0.0]
    print(f"snags: told {dead.count('1')}, open {dead.count('')}, called living {dead.count('0')} of {len(dead)}; "
          f"living ones called snags: {living.count('1')} of {len(living)}")
    off = np.array([number(tree["sweep_m"]) - number(true["sweep_m"]) for tree, true in pairs])
    off = off[np.isfinite(off)]
    if len(off):
        print(f"sweep of {len(off)} stems: bias {100 * off.mean():.1f}, RMSE {100 * np.sqrt((off ** 2).mean()):.1f} cm")
    shared = [true for tree, true in pairs if tree["foot_id"] != tree["id"]]
    print(f"stems that share a foot: of forked trees {sum(bool(true['fork_m']) for true in shared)} of {len(shared)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 4, 5, 6, 7, 8, 9, 10, 13])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--near", type=float, default=15.0)
    parser.add_argument("--work", type=pathlib.Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        work = options.work or pathlib.Path(scratch)
        pairs = []
        for seed in options.seeds:
            walk, run, trees = work / f"{seed}.mcap", work / f"run{seed}", work / f"trees{seed}"
            if not (trees / "trees.csv").exists():
                understory("simulate", "random", "-o", walk, "--overwrite", "--seed", seed, "--duration-s", options.seconds,
                           *SETTINGS)
                understory("map", walk, "-o", run, "--overwrite")
                understory("inventory", run, "-o", trees, "--overwrite")
            pairs += matched(trees, run, walk.with_suffix(".truth"), options.near)
    print(f"{len(pairs)} trees within {options.near:g} m of the path, seeds {' '.join(map(str, options.seeds))}")
    report(pairs)


if __name__ == "__main__":
    main()
