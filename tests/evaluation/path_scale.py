"""Paths have the right size. What a lidar sees of stems and crowns is their near side, which goes along
with it, and flakes go along altogether. Both would make paths too short (docs/method/registration.md).
Each is switched off once, through the whole program, so that its share shows."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import simulated

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
AS_SEEN = ["registration.ndt.near_side_line=0", "registration.ndt.near_side_volume=0"]
WITH_FLAKES = ["preprocess.isolated.within_m=0"]


def run(*words):
    done = subprocess.run([PROGRAM, "--quiet", *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, f"{words} ended with {done.returncode}: {done.stderr}"
    return done.stdout


def scale_percent(recording, folder, settings=()):
    run("map", recording, "-o", folder, "--set", "map.enabled=false",
        *(word for setting in settings for word in ("--set", setting)))
    truth = recording.with_suffix(".truth")
    return json.loads(run("evaluate", folder, truth, "--json"))["scale_percent"]


def main():
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        recording = simulated("skidoo", 7, 30, "lidar.snow_fall_per_m=0.01")
        shipped = scale_percent(recording, work / "shipped")
        near_side = scale_percent(recording, work / "near_side", AS_SEEN)
        flakes = scale_percent(recording, work / "flakes", WITH_FLAKES)
    said = (f"{shipped:+.3f} % as shipped, {near_side:+.3f} with near sides taken for middles, "
            f"{flakes:+.3f} with flakes")
    print(said)
    if not (abs(shipped) < 0.05 and near_side < shipped - 0.03 and flakes < shipped - 0.03):
        sys.exit("path_scale: " + said)


if __name__ == "__main__":
    main()
