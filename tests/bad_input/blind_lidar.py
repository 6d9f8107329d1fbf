"""A lidar that sees nothing for 3 s on a sleigh at 3.5 m/s: the IMU carries the path over it. What it sees afterwards is
not in the map, so a new piece begins. It began where the old one had ended, 16 m behind, as 30 scans without points
counted as 30 failed matches."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
SITE = "sim:lake?seed=3&duration_s=26&blindness.interval_s=36&blindness.length_s=3"  # blind from 18 to 21 s


def main():
    run = Path(tempfile.mkdtemp()) / "run"
    mapped = subprocess.run([PROGRAM, "--quiet", "map", SITE, "-o", run, "--threads", "2", "--set",
                             "map.enabled=false"], capture_output=True, text=True)
    report = json.loads((run / "run.json").read_text())
    errors = json.loads(subprocess.run([PROGRAM, "evaluate", run, f"{run}.truth", "--align", "se3", "--json"],
                                       capture_output=True, text=True, check=True).stdout)
    keys = [warning["key"] for warning in report["warnings"]]
    print(mapped.returncode, report["status"], f"{errors['ape_rmse_m']:.3f} m", keys)
    if errors["ape_rmse_m"] > 0.6:
        sys.exit("blind_lidar: the new piece is not where the IMU knows it to be")
    if report["status"] == "complete" or "scan.few_points" not in keys:
        sys.exit("blind_lidar: nothing tells that 3 s are missing in the map")


if __name__ == "__main__":
    main()
