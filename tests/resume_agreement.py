"""A run killed at work and resumed on another number of threads gives the bytes of an undisturbed one:
of a harvester's scans with an IMU, and of sparse scans without one."""

import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

# Recording, and the size of a checkpoint that holds more than the request alone.
CASES = {"harvester": ("sim:harvester?seed=21&duration_s=16", 100_000),
         "sparse_scans": ("sim:lieksa2?seed=21&duration_s=60", 300_000)}
FILES = ["trajectory.tum", "keyframes.tum", "graph.g2o", "states.csv.gz", "gnss.csv", "map.laz", "trees.csv"]
program = os.environ["UNDERSTORY_PROGRAM"]
recording, checkpoint_bytes = CASES[sys.argv[1]]


def start(folder, threads):
    command = [program, "map", recording, "-o", str(folder), "--threads", str(threads), "--quiet"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


with tempfile.TemporaryDirectory() as scratch:
    whole, killed = pathlib.Path(scratch) / "whole", pathlib.Path(scratch) / "killed"
    assert start(whole, 2).wait() in (0, 4)
    run = start(killed, 2)
    checkpoint = killed / "work" / "checkpoint.bin"
    for _ in range(6000):
        if checkpoint.exists() and checkpoint.stat().st_size > checkpoint_bytes:
            break
        time.sleep(0.01)
    run.send_signal(signal.SIGKILL)
    assert run.wait() == -signal.SIGKILL, "the run had ended before it could be killed"
    assert not (killed / "trajectory.tum").exists()
    command = [program, "map", "--resume", str(killed), "--threads", "1", "--quiet"]
    assert subprocess.run(command, stdout=subprocess.DEVNULL).returncode in (0, 4)
    different = [f for f in FILES if (whole / f).read_bytes() != (killed / f).read_bytes()]
    assert not different, f"{different} differ"
    print(f"{len(FILES)} files have the same bytes")
