"""`./run accuracy --checkpoint-cost`: bytes that a run writes for its checkpoints, early and late, and the time that
it waits for the disk, by each front end. Python standard library only."""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from power_cut import INTERVAL_S, SITES, record
from program import TOP, say

sys.path.insert(0, str(TOP / "tests" / "durability"))
from disk import MAKE, RENAME, SYNC, WRITE  # noqa: E402: found by the line above


def checkpoints(run):
    """Of each: its bytes, the bytes appended since the one before, bytes of poses written anew."""
    names, done = {}, []
    whole = appended = poses = 0
    for call in run.calls:
        if call.kind == MAKE:
            names[call.inode] = Path(call.path).name
        elif call.kind == WRITE:
            name = names.get(call.inode, "")
            if "checkpoint" in name:
                whole += len(call.data)
            elif name.startswith("poses"):
                poses += len(call.data)
            elif name.endswith(".bin"):
                appended += len(call.data)
        elif call.kind == RENAME and "checkpoint" in call.second:
            done.append((whole, appended, poses))
            whole = appended = poses = 0
    return done[1:]  # the first is written before anything is read


def row(front_end, run):
    done = checkpoints(run)
    third = len(done) // 3

    def means(column):
        early, late = (sum(each[column] for each in part) / len(part) / 1e6 for part in (done[:third], done[-third:]))
        return f"{early:.2f}, {late:.2f}"

    syncs = [call.offset * 1e-9 for call in run.calls if call.kind == SYNC]
    wall = json.loads((run.whole / "run.json").read_text())["wall_s"]
    return (f"| {front_end} | {len(done)} | {means(0)} | {means(1)} | {means(2)} | {len(syncs)} | {sum(syncs):.2f} "
            f"| {100 * sum(syncs) / wall:.1f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=180.0, help="of recording")
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--front-end", choices=["dense", "sparse"], help="only that one")
    parser.add_argument("--folder", help="for the run, on the disk that is to be measured")
    options = parser.parse_args()
    print(f"A checkpoint every {INTERVAL_S:g} s. MB, first third and last third of the run:\n")
    print("| front end | checkpoints | checkpoint | appended since the one before | poses written anew | syncs "
          "| s | % of the run |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(dir=options.folder) as scratch:
        for front_end in [options.front_end] if options.front_end else ["dense", "sparse"]:
            say(f"{front_end}: {options.seconds:g} s of recording")
            run = record(SITES[front_end], front_end, options.seconds, options.seed, Path(scratch).resolve())
            print(row(front_end, run), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
