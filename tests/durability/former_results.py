"""A power cut while a run puts its results in the place of a former run's. What the former run made and
this one does not is never lost, and its run.json stays with it."""

import os
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "bad_input"))
from disk import FOLDER, Disk, read_log  # noqa: E402
from program import PROGRAM, good_recording  # noqa: E402: found by the line above

SEEDS = 12
library = pathlib.Path(os.environ["UNDERSTORY_BUILD"]) / "tests" / "libpower_cut.so"
if not library.exists():
    print("skipped: the library is built on Linux on x86-64 only, without sanitizers")
    sys.exit(77)


def watched(top, log, recording, *options):
    environment = dict(os.environ, LD_PRELOAD=str(library), UNDERSTORY_POWER_CUT_FOLDER=str(top),
                       UNDERSTORY_POWER_CUT_LOG=str(log))
    done = subprocess.run([PROGRAM, "--quiet", "--threads", "1", "map", str(recording), "-o", str(top / "run"), *options],
                          env=environment, capture_output=True, text=True)
    assert done.returncode in (0, 4), done.stderr
    return read_log(log)


def lost(run, former):
    """What of the former run is in none of the places where it may be."""
    homes = [run, *run.glob("former-*")]
    return [name for name, content in former.items()
            if not any((home / name).exists() and (home / name).read_bytes() == content for home in homes)]


with tempfile.TemporaryDirectory() as scratch:
    scratch = pathlib.Path(scratch).resolve()
    recording, _, _ = good_recording(seconds=4)
    top = scratch / "disk"
    top.mkdir()
    disk = Disk(top)
    for call in watched(top, scratch / "first.log", recording):
        disk.do(call)
    disk.sync_all(disk.root)
    before = {path.name: path.read_bytes() for path in (top / "run").iterdir() if path.is_file()}
    calls = watched(top, scratch / "second.log", recording, "--overwrite", "--set", "map.enabled=false")
    moved = {path.name for path in (top / "run" / "former-1").iterdir()}
    former = {name: before[name] for name in moved}
    assert {"map.laz", "run.json"} <= moved and lost(top / "run", former) == [], moved
    begin = next(i for i, call in enumerate(calls) if call.kind == FOLDER and call.path.endswith("former-1"))
    states, failed = 0, []
    for number, call in enumerate(calls, 1):
        disk.do(call)
        if number < begin:
            continue
        for seed in range(SEEDS):
            place = scratch / f"{number}_{seed}"
            disk.write(place, seed, "drawn")
            missing = lost(place / "run", former)
            failed += [f"after call {number} ({call}), seed {seed}: {missing} lost"] if missing else []
            states += 1
            subprocess.run(["rm", "-r", str(place)], check=True)
    print(f"{states} states of the disk after {len(calls) - begin} calls: {len(failed)} with a loss", *failed[:5], sep="\n")
    assert not failed
