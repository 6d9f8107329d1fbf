"""A harvester's 16 rings that mostly stand still. Every scan of a swing adds to the map, and the trees
near the way are found in it."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import simulated

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]


def run(*words):
    done = subprocess.run([PROGRAM, "--quiet", *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, f"{words} ended with {done.returncode}: {done.stderr}"
    return done.stdout


def main():
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        ride = simulated("lieksa2", 7, 60)
        run("map", ride, "-o", folder)
        truth = ride.with_suffix(".truth")
        seen = json.loads(run("evaluate", "trees", folder, truth, "--matching", "nearest", "--align", "yaw", "--truth-returns", truth,
                              "--path", truth, "--within-m", 15, "--min-returns", 30, "--json"))["visible"]
    said = f"{100 * seen['recall']:.0f} % of {seen['expected']} trees, {100 * seen['false_share']:.0f} % false"
    print(said)
    if not (seen["expected"] > 20 and seen["recall"] > 0.75 and seen["false_share"] < 0.05):
        sys.exit("sparse_map_trees: " + said)


if __name__ == "__main__":
    main()
