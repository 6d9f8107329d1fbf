"""`understory evaluate` agrees with the Python package evo to six digits on real trajectories.

The trajectories of data/fomo: a robot's ground truth (UTM coordinates, no attitude) with an
estimate, and a second, shorter truth with wheel odometry. Both are compared as they are, with the
first pose aligned, and aligned by SE(3); RPE over several path lengths.
"""

import copy
import csv
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from evo.core import metrics, sync
from evo.core.metrics import PoseRelation, Unit
from evo.tools import file_interface

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
DATA = Path(os.environ["UNDERSTORY_DATA"]) / "fomo"
DELTAS_M = [1.0, 10.0, 100.0]
TOLERANCE_S = 0.01


def odometry_as_tum(source, target):
    """Wheel odometry comes as CSV with microseconds."""
    with open(source) as rows, open(target, "w") as out:
        for row in csv.reader(rows):
            if row[0] == "t":
                continue
            stamp = int(row[0])
            pose = " ".join(row[1:8])
            out.write(f"{stamp // 1000000}.{stamp % 1000000:06d} {pose}\n")
    return target


def figures_of_evo(estimate_file, truth_file, alignment):
    truth = file_interface.read_tum_trajectory_file(str(truth_file))
    estimate = file_interface.read_tum_trajectory_file(str(estimate_file))
    truth, estimate = sync.associate_trajectories(truth, estimate, max_diff=TOLERANCE_S)
    scale = copy.deepcopy(estimate).align(truth, correct_scale=True)[2]
    if alignment == "se3":
        estimate.align(truth)
    elif alignment == "first":
        estimate.align_origin(truth)
    figures = {"pairs": estimate.num_poses, "scale_percent": 100.0 * (1.0 / scale - 1.0)}
    ape = metrics.APE(PoseRelation.translation_part)
    ape.process_data((truth, estimate))
    for name in ("rmse", "mean", "median", "max"):
        figures[f"ape_{name}_m"] = ape.get_statistic(metrics.StatisticsType(name))
    ape = metrics.APE(PoseRelation.rotation_angle_deg)
    ape.process_data((truth, estimate))
    figures["ape_rotation_rmse_deg"] = ape.get_statistic(metrics.StatisticsType.rmse)
    for delta in DELTAS_M:
        for key, relation in (("translation_rmse_m", PoseRelation.translation_part),
                              ("rotation_rmse_deg", PoseRelation.rotation_angle_deg)):
            rpe = metrics.RPE(relation, delta=delta, delta_unit=Unit.meters)
            rpe.process_data((truth, estimate))
            figures[f"rpe_{delta}_{key}"] = rpe.get_statistic(metrics.StatisticsType.rmse)
    return figures


def figures_of_understory(estimate_file, truth_file, alignment):
    command = [PROGRAM, "evaluate", str(estimate_file), str(truth_file), "--json",
               "--align", alignment, "--tolerance-s", str(TOLERANCE_S), "--delta-m"]
    command += [str(delta) for delta in DELTAS_M]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["alignment"] == alignment
    for rpe in result.pop("rpe"):
        for key in ("translation_rmse_m", "rotation_rmse_deg"):
            result[f"rpe_{rpe['delta_m']}_{key}"] = rpe[key]
    return result


def compare(name, estimate_file, truth_file):
    worst = 0.0
    for alignment in ("none", "first", "se3"):
        ours = figures_of_understory(estimate_file, truth_file, alignment)
        for key, theirs in figures_of_evo(estimate_file, truth_file, alignment).items():
            if ours[key] is None:  # a rotation that the positions do not determine
                assert alignment == "se3" and key == "ape_rotation_rmse_deg", (name, alignment, key)
                continue
            difference = abs(ours[key] - theirs) / max(abs(theirs), 1e-9)
            worst = max(worst, difference)
            if difference > 5e-7:
                print(f"{name}, alignment {alignment}: {key} is {ours[key]}, evo says {theirs}")
                return False
    print(f"{name}: every figure agrees with evo, largest relative difference {worst:.1e}")
    return True


def main():
    if not DATA.is_dir():
        print(f"skipped: no data in {DATA}")
        return 77
    estimate = next(DATA.glob("yellow_*.txt"))
    with tempfile.TemporaryDirectory() as folder:
        odometry = odometry_as_tum(DATA / "red_2025-10-14" / "odom.csv", Path(folder) / "odom.tum")
        good = [compare("estimate", estimate, DATA / "gt.txt"),
                compare("wheel odometry", odometry, DATA / "red_2025-10-14" / "gt.txt")]
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
