"""A lidar that sees nothing for 3 s on a sleigh at 3.5 m/s: the IMU carries the path over it. What it sees afterwards is
not in the map, so a new piece begins. It began where the old one had ended, 16 m behind, as 30 scans without points
counted as 30 failed matches. The new piece is levelled after a second or two, and the old one, which is level, stays."""

import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from program import simulated

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
BLIND = ("blindness.interval_s=36", "blindness.length_s=3")  # from 18 to 21 s


def ups(path):
    """Time -> where the vertical lies in the body."""
    poses = ([float(cell) for cell in line.split()] for line in path.read_text().splitlines() if line[0] in "0123456789")
    return {round(t, 3): (2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), 1 - 2 * (qx * qx + qy * qy))
            for t, _, _, _, qx, qy, qz, qw in poses}


def tilts_deg(run, truth):
    """Angles between the verticals of path and truth at the same times, in the order of time."""
    own, true = ups(run / "trajectory.tum"), ups(truth / "trajectory.tum")
    cosines = (sum(a * b for a, b in zip(own[t], true[t])) for t in sorted(own) if t in true)
    return [math.degrees(math.acos(min(1.0, cosine))) for cosine in cosines]


def main():
    run = Path(tempfile.mkdtemp()) / "run"
    ride = simulated("lake", 3, 26, *BLIND)
    truth = ride.with_suffix(".truth")
    mapped = subprocess.run([PROGRAM, "--quiet", "map", ride, "-o", run, "--threads", "2", "--set",
                             "map.enabled=false"], capture_output=True, text=True)
    report = json.loads((run / "run.json").read_text())
    errors = json.loads(subprocess.run([PROGRAM, "evaluate", run, truth, "--align", "se3", "--json"],
                                       capture_output=True, text=True, check=True).stdout)
    keys = [warning["key"] for warning in report["warnings"]]
    print(mapped.returncode, report["status"], f"{errors['ape_rmse_m']:.3f} m", keys)
    if errors["ape_rmse_m"] > 0.6:
        sys.exit("blind_lidar: the new piece is not where the IMU knows it to be")
    tilts = tilts_deg(run, truth)
    print(f"tilt of the first piece {max(tilts[:150]):.2f}, of the last second {max(tilts[-10:]):.2f} degrees")
    if max(tilts[:150]) > 1.0 or max(tilts[-10:]) > 1.0:
        sys.exit("blind_lidar: levelling the new piece tilted the old one, or did not level the new one")
    if report["status"] == "complete" or "scan.few_points" not in keys:
        sys.exit("blind_lidar: nothing tells that 3 s are missing in the map")


if __name__ == "__main__":
    main()
