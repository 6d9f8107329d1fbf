"""A run killed at work and resumed on another number of threads gives the bytes of an undisturbed one.
Runs are of a harvester's scans with an IMU, of sparse scans without one, of a full inventory, and by
stems alone with either."""

import pathlib
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "bad_input"))
from program import PROGRAM, simulated

DENSE = ["trajectory.tum", "keyframes.tum", "graph.g2o", "states.csv.gz", "gnss.csv", "global.csv.gz", "map.laz", "trees.csv"]
STEMS = ["stems.csv.gz", "trajectory.tum", "odometry.tum", "steps.csv", "gnss.csv", "global.csv.gz", "corrections.csv", "loops.csv",
         "trees.csv", "felled.csv"]
# Recording, a file that shows how far the run is, its least size then, options, files to compare.
CASES = {
    "harvester": (("harvester", 21, 16), "journal.bin", 40_000, ["--imu-rate", "--set", "scan_fraction=0.25", "--set", "output.world_frame=ned"],
                  [*DENSE, "trajectory_imu.tum", "trajectory_partial.tum"]),
    # What is adapted to sparse scans and what the user set of it are the same after the kill.
    "sparse_scans": (("lieksa2", 21, 60), "journal.bin", 60_000,
                     ["--set", "keyframe.distance_m=0.4"], DENSE),
    # Far points of the scans between are kept, too.
    "full_inventory": (("handheld", 5, 9), "far_clouds.bin", 3_000_000, ["--inventory", "full"],
                       [*DENSE, "stem_curves.csv", "dead_wood.csv"]),
    "stems": (("lieksa2", 21, 60), "views.bin", 100_000,
              ["--front-end", "sparse", "--set", "run.checkpoint_interval_s=2"], STEMS),
    "stems_imu": (("harvester", 21, 24), "views.bin", 80_000,
                  ["--front-end", "sparse", "--set", "run.checkpoint_interval_s=2"], STEMS),
}
site, growing, min_bytes, options, files = CASES[sys.argv[1]]
recording = str(simulated(*site))


def start(folder, threads):
    command = [PROGRAM, "map", recording, "-o", str(folder), "--threads", str(threads), "--quiet", *options]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


with tempfile.TemporaryDirectory() as scratch:
    whole, killed = pathlib.Path(scratch) / "whole", pathlib.Path(scratch) / "killed"
    assert start(whole, 2).wait() in (0, 4)
    run = start(killed, 2)
    for _ in range(6000):
        if any(path.stat().st_size > min_bytes for path in killed.rglob(growing)):
            break
        time.sleep(0.01)
    if sys.argv[-1] == "interrupted":  # by Ctrl-C: leaves what there is so far
        run.send_signal(signal.SIGINT)
        assert run.wait() == 4 and (killed / "trajectory.tum").exists()
        assert (killed / files[0]).read_bytes() != (whole / files[0]).read_bytes(), "the run had ended"
    else:
        run.send_signal(signal.SIGKILL)
        assert run.wait() == -signal.SIGKILL, "the run had ended before it could be killed"
        assert not (killed / "trajectory.tum").exists()
    command = [PROGRAM, "map", "--resume", str(killed), "--threads", "1", "--quiet"]
    assert subprocess.run(command, stdout=subprocess.DEVNULL).returncode in (0, 4)
    different = [f for f in files if (whole / f).read_bytes() != (killed / f).read_bytes()]
    assert not different, f"{different} differ"
    assert not (killed / ".understory").exists()
    print(f"{len(files)} files have the same bytes")
