"""Posts and boom of a machine without boxes are no trees. The finished map leaves out what stays beside the lidar and is
not seen there from elsewhere. With map.carrier.reach_m=0 they stand on the machine's own path. A stem near a path where
nothing is carried stays, and so does everything where boxes are given."""

import csv
import json
import math
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "bad_input"))
from program import program, simulated  # noqa: E402

NEAR_M = 1.2  # half of the machine's width: no tree stands so near to its path


def mapped(recording, folder, *settings):
    run = folder / "run{}".format(len(list(folder.iterdir())))
    done = program("map", recording, "-o", run, *(word for setting in settings for word in ("--set", setting)))
    assert done.returncode in (0, 4), done.stderr
    path = [[float(word) for word in line.split()[1:3]] for line in (run / "trajectory.tum").read_text().splitlines()
            if not line.startswith("#")]
    with open(run / "trees.csv", newline="") as file:
        trees = [(float(row["x"]), float(row["y"])) for row in csv.DictReader(file)]
    report = json.loads((run / "run.json").read_text())
    on_path = sum(min(math.dist(tree, place) for place in path) < NEAR_M for tree in trees)
    return report, len(trees), on_path, done.stdout + done.stderr, (run / "report.html").read_text()


def main():
    folder = pathlib.Path(tempfile.mkdtemp())
    machine = simulated("tuusniemi1", 5, 15, "lidar.columns=512")
    kept, all_trees, kept_on_path, _, _ = mapped(machine, folder, "map.carrier.reach_m=0")
    left, trees, on_path, said, page = mapped(machine, folder)
    print(all_trees, kept_on_path, trees, on_path, left["quality"].get("carrier_points_percent"))
    assert kept_on_path >= 1 and "carrier_points" not in kept["counts"], kept_on_path
    assert on_path == 0, on_path
    assert trees >= all_trees - kept_on_path - 1, (trees, all_trees)
    assert left["counts"]["carrier_points"] + left["counts"]["map_points"] > kept["counts"]["map_points"]
    assert 2.0 < left["quality"]["carrier_points_percent"] < 60.0
    assert "what carries the lidar was found" in said and "of the points are of the carrier" in page
    boxes = folder / "boxes.yaml"
    boxes.write_text("boxes:\n  - {name: far, frame: body, center_m: [50, 0, 90], size_m: [1, 1, 1]}\n")
    told, _, told_on_path, _, _ = mapped(machine, folder, f"preprocess.machine_boxes_file={boxes}")
    assert told_on_path == kept_on_path and "carrier_points" not in told["counts"]
    walk, _, _, said, _ = mapped(simulated("handheld", 5, 9), folder)
    assert "carrier_points" not in walk["counts"] and "carries the lidar" not in said


if __name__ == "__main__":
    main()
