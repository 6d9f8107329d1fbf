"""`map` and `inventory RUN` list the same trees, and whatever frame the layers are in.

Walks are mapped with layers in the world frame, in a national grid and in degrees. The map of each
run is taken stock of twice: from memory and in tiles. Where the recording names its lidar, both
commands correct diameters for its wide beams.
"""

import csv
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
    assert done.returncode == 0, (words, done.returncode, done.stderr)


def measured(folder):
    """The trees as both commands measure them; volumes and crowns are of the full inventory."""
    columns = ("id", "x", "y", "z", "dbh_m", "dbh_sd_m", "height_m", "height_sd_m",
               "height_is_lower_bound", "lean_deg", "x_sd_m", "y_sd_m")
    with open(folder / "trees.csv", newline="") as file:
        return [tuple(row[column] for column in columns) for row in csv.DictReader(file)]


def check(folder, recording, name, *options, tiled=True):
    extent = () if name == "world" else ("--set", "extent=basic")
    walked = folder / f"{name}-run"
    run("map", recording, "-o", walked, *options)
    listed = measured(walked)
    assert len(listed) > 50, (name, len(listed))
    for way, tiles in (("memory", ()), ("tiles", ("--set", "tiles.size_m=30")))[:2 if tiled else 1]:
        stock = folder / f"{name}-{way}"
        run("inventory", walked, "-o", stock, *extent, *tiles)
        again = measured(stock)
        assert len(again) == len(listed), (name, way, len(listed), len(again))
        for mine, theirs in zip(listed, again):
            assert mine == theirs, (name, way, mine, theirs)
    return listed


def main():
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        small = ("stand.size_x_m=60", "stand.size_y_m=60")
        handheld = simulated("handheld", 19, 8, *small, "carrier.length_m=120")
        harvester = simulated("harvester", 6, 8, *small, "carrier.length_m=60")
        world = check(folder, handheld, "world", "--set", "georeference.enabled=false")
        assert world == check(folder, handheld, "grid", "--crs", "EPSG:3067", tiled=False)
        assert world == check(folder, handheld, "degrees", "--crs", "EPSG:4979")
        check(folder, harvester, "harvester")
        # The simulated beams have no width, so that all that is taken away is too much.
        (folder / "lidar.yaml").write_text("lidar_model: OS-0-128\n")
        named = check(folder, handheld, "named", "--set", "georeference.enabled=false", "--extrinsics", folder / "lidar.yaml")
        assert len(named) == len(world), (len(named), len(world))
        thinner = sorted(float(tree[4]) - float(wide[4]) for tree, wide in zip(world, named))
        assert 0.0005 < thinner[len(thinner) // 2] < 0.02, thinner


if __name__ == "__main__":
    main()
