"""A Mid-360 by stems: its scans are gathered, every scan gets a pose, and the path is that of the truth."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "bad_input"))
from program import simulated

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
SECONDS = 12


def program(*arguments):
    return subprocess.run([PROGRAM, "--quiet", *map(str, arguments)], capture_output=True, text=True)


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        walk = simulated("mid360", 3, SECONDS, "stand.size_x_m=80", "stand.size_y_m=80", "carrier.length_m=60",
                         "gnss.enabled=false")
        done = program("map", walk, "-o", folder / "run", "--front-end", "sparse")
        assert done.returncode in (0, 4), done.stderr
        poses = (folder / "run" / "trajectory.tum").read_text().splitlines()
        assert len(poses) >= 10 * SECONDS - 1, len(poses)
        done = program("evaluate", folder / "run", walk.with_suffix(".truth"), "--align", "se3", "--json")
        assert done.returncode in (0, 4), done.stderr
        error = json.loads(done.stdout)["ape_rmse_m"]
        assert error < 0.3, error
        steps = [line.split(",")[2] for line in (folder / "run" / "steps.csv").read_text().splitlines()[1:]]
        tracked = steps.count("tracked")
        assert len(steps) >= SECONDS and tracked > 0.7 * len(steps), steps
        print(f"{len(poses)} poses, {tracked} of {len(steps)} views tracked, {100 * error:.1f} cm")


main()
