"""`./run bench resume`: how long `--resume` takes to reach its place in a recording of each kind, after a run that was
killed near its end. UNDERSTORY_PROGRAM names another program to compare with. Python standard library only."""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from program import PROGRAM, TOP, say, understory

sys.path.insert(0, str(TOP / "tests" / "bad_input"))
from recordings import read_mcap, write_bag, write_db3  # noqa: E402: found by the line above

KINDS = ("MCAP, zstd", "MCAP, not packed", "ROS 1 bag", "ROS 2 bag (.db3)", "folder of clouds", "capture")
ROS1_TYPES = ("PointCloud2", "Imu", "TFMessage")
KILLED_AT = 0.9


def make(folder, site, settings, wanted):
    """A recording of each wanted kind."""
    files = dict(zip(KINDS, (folder / name for name in ("z.mcap", "n.mcap", "r.bag", "r.db3", "clouds", "c.pcap"))))
    words = [word for setting in settings for word in ("--set", setting)]
    understory("simulate", site, "-o", files["MCAP, zstd"], *words)
    if wanted & {"MCAP, not packed", "ROS 1 bag", "ROS 2 bag (.db3)"}:
        understory("convert", files["MCAP, zstd"], files["MCAP, not packed"], "--compression", "none")
        messages = read_mcap(files["MCAP, not packed"])
        write_db3(files["ROS 2 bag (.db3)"], messages)
        write_bag(files["ROS 1 bag"], [m for m in messages if m.type.split("/")[-1] in ROS1_TYPES], indexed=True)
    if "folder of clouds" in wanted:
        understory("convert", files["MCAP, zstd"], files["folder of clouds"], "--format", "pcd")
    if "capture" in wanted:
        understory("simulate", site, "-o", files["capture"], *words)
    return {kind: files[kind] for kind in KINDS if kind in wanted}


def journal_bytes(run):
    try:
        return max((path.stat().st_size for path in run.rglob("journal.bin")), default=0)
    except OSError:  # the run has just removed it
        return 0


def begin(recording, run):
    shutil.rmtree(run, ignore_errors=True)
    return subprocess.Popen([str(PROGRAM), "--quiet", "map", str(recording), "-o", str(run), "--set", "map.enabled=false"],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def kill_late(recording, run):
    """Runs once to see how far the journal grows, and once more until it is nearly there."""
    process, most = begin(recording, run), 0
    while process.poll() is None:
        most = max(most, journal_bytes(run))
        time.sleep(0.01)
    process = begin(recording, run)
    while process.poll() is None:
        if journal_bytes(run) > KILLED_AT * most:
            process.kill()
        time.sleep(0.01)


def reach(run):
    """(wall, CPU) seconds until the run goes on, and where."""
    start = time.perf_counter()
    with subprocess.Popen([str(PROGRAM), "map", "--resume", str(run), "--threads", "1"], stderr=subprocess.PIPE,
                          stdout=subprocess.DEVNULL, text=True) as process:
        for line in process.stderr:
            if "goes on at" in line:
                wall = time.perf_counter() - start
                fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
                process.kill()
                return wall, (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), line.split("at ")[-1].strip()
    raise AssertionError("the run ended before it could be killed")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--site", default="harvester")
    parser.add_argument("--seconds", type=float, default=120.0, help="of recording")
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--lidar", default="VLP-16", help="captures are written of a VLP-16 alone")
    parser.add_argument("--kind", action="append", choices=KINDS, help="only that one")
    options = parser.parse_args()
    settings = [f"seed={options.seed}", f"duration_s={options.seconds}", f"lidar.model={options.lidar}"]
    print("| recording | MB | goes on at | wall s | CPU s |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch).resolve()
        for kind, recording in make(folder, options.site, settings, set(options.kind or KINDS)).items():
            say(kind)
            kill_late(recording, folder / "run")
            wall, cpu, place = reach(folder / "run")
            files = recording.rglob("*") if recording.is_dir() else [recording]
            size = sum(path.stat().st_size for path in files) / 1e6
            print(f"| {kind} | {size:.0f} | {place} | {wall:.2f} | {cpu:.2f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
