"""`understory map --max-memory-mb`: the limit is kept, and the results are the bytes of a run without
one, also when the run was killed and went on. A limit that is too small is refused before anything is
touched, with the least that works."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent / "bad_input"))
from program import PROGRAM, program, simulated

SAME = ["trajectory.tum", "keyframes.tum", "graph.g2o", "states.csv.gz", "gnss.csv", "map.laz", "trees.csv", "stem_curves.csv", "dead_wood.csv", "dtm.tif",
        "chm.tif", "dsm.tif"]
# Every point of every scan. A limit that is not shared among what the run holds leaves 0.74 of the memory, not 0.65.
EVERY_POINT = ["--inventory", "full", "--set", "map.thin_m=0", "--set", "map.keyframe_thin_m=0", "--set", "map.cloud_distance_m=0"]


def peak_mb(run):
    return json.loads((run / "run.json").read_text())["peak_memory_mb"]


def map_command(recording, run, *options):
    return ["map", recording, "-o", run, *EVERY_POINT, *options]


def refused(recording, run, *options):
    done = program(*map_command(recording, run, "--overwrite", *options))
    assert done.returncode == 2, (options, done.returncode, done.stderr)
    return done.stderr


def killed_among_tiles(recording, run, least):
    """The most memory that the run held until it was killed, in MB: all scans were positioned by then."""
    command = [PROGRAM, *map(str, map_command(recording, run, "--max-memory-mb", least))]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for _ in range(60_000):
        if any(run.rglob("*.tile")):
            break
        assert process.poll() is None, "the run ended before it could be killed"
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == -signal.SIGKILL, process.returncode
    return usage.ru_maxrss / 1024


with tempfile.TemporaryDirectory() as scratch:
    scratch = Path(scratch)
    recording = simulated("handheld", 5, 9, "stand.size_x_m=60", "stand.size_y_m=60", "carrier.length_m=120",
                          "stand.trees_per_ha=300")
    free, cut = scratch / "free", scratch / "cut"
    status = program(*map_command(recording, free)).returncode
    assert status in (0, 4)

    before = (free / "trees.csv").read_bytes()
    message = refused(recording, free, "--max-memory-mb", "100")
    least = int(re.search(r"expected (\d+) at least for a lidar of \d+ points a scan", message)[1])
    assert str(least - 1) in refused(recording, free, "--max-memory-mb", str(least - 1))
    assert "max_memory_mb" in refused(recording, free, "--max-memory-mb=-1")
    assert "max_memory_mb" in refused(recording, free, "--max-memory-mb", "many")
    assert "--front-end dense" in refused(recording, free, "--max-memory-mb", str(least), "--front-end", "sparse")
    assert (free / "trees.csv").read_bytes() == before, "a refusal touched the former results"

    # Cut in two: the first part positions the scans, the second makes map and trees of them.
    first = killed_among_tiles(recording, cut, least)
    # A process that starts the program and is large itself: its memory is none of the program's.
    ballast = bytearray(1_000_000_000)
    assert program("map", "--resume", cut).returncode == status
    del ballast
    print(f"least limit {least} MB; resident without a limit {peak_mb(free):.0f} MB, with it {first:.0f} and {peak_mb(cut):.0f} MB")
    assert max(first, peak_mb(cut)) <= min(least, 0.7 * peak_mb(free))
    warned = json.loads((cut / "run.json").read_text())["warnings"]
    assert "memory." not in json.dumps(warned), warned
    different = [name for name in SAME if (cut / name).read_bytes() != (free / name).read_bytes()]
    assert not different, f"{different} differ"
    assert not (cut / ".understory").exists()
    print(f"{len(SAME)} files have the same bytes")
