"""A power cut at chosen moments of a run, by either front end. The run is never lost, little is
processed again, and the results have the bytes of an undisturbed run. `./run accuracy --power-cut` draws
200 moments."""

import os
import pathlib
import sys
import tempfile

from cuts import Run
from disk import MAKE, RENAME, SYNC

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "bad_input"))
from program import simulated

INTERVAL_S = 2.0
SLACK_S = 1.0  # a checkpoint comes with the scan after its time, or the next one that closes a gap
program, front_end = os.environ["UNDERSTORY_PROGRAM"], sys.argv[1]
library = pathlib.Path(os.environ["UNDERSTORY_BUILD"]) / "tests" / "libpower_cut.so"
if not library.exists():
    print("skipped: the library is built on Linux on x86-64 only, without sanitizers")
    sys.exit(77)
SITES = {"dense": ("demo", 5, 9, "lidar.model=VLP-16", "carrier.still_s=1", "carrier.turn_interval_s=4"),
         "sparse": ("harvester", 5, 14, "lidar.model=VLP-16")}


def moments(run):
    """(what, calls before the cut, seed, mode, break the newest checkpoint too, most that may be done again)"""
    calls = len(run.calls)
    first = run.find(RENAME, "checkpoint.bin")
    second = run.find(RENAME, "checkpoint.2.bin")
    third = run.find(RENAME, "checkpoint.bin", second)
    late = run.find(RENAME, "checkpoint.2.bin", third)
    synced = next(i for i in range(late, calls) if run.calls[i].kind == SYNC) + 1
    results = run.find(MAKE, "trajectory.tum")
    most = INTERVAL_S + SLACK_S
    yield "before anything", 0, 1, None, False, 0.0
    yield "only the name of the first checkpoint is on the disk", first, 9, "newest", False, most
    yield "only the name of the second checkpoint is on the disk", second, 10, "newest", False, most
    yield "the second checkpoint is renamed, not synced", second, 2, "lost", False, most
    yield "in the middle of writing the fourth checkpoint", late - 2, 3, "drawn", False, most
    yield "the same, and the newest is broken", synced, 4, "drawn", True, most + INTERVAL_S
    yield "while results are written", results + 3, 5, "lost", False, most
    placing = run.find(RENAME, "run/trees.csv")
    yield "while results are put in place", placing, 6, "drawn", False, most
    yield "while the work folder is removed", calls - 4, 7, "drawn", False, most
    yield "at the end", calls, 8, "lost", False, 0.0


with tempfile.TemporaryDirectory() as scratch:
    scratch = pathlib.Path(scratch).resolve()
    run = Run(program, library, simulated(*SITES[front_end]), scratch, front_end, INTERVAL_S)
    print(f"{len(run.calls)} calls, {len(run.results)} results")
    failed = []
    for what, number, seed, mode, spoil, most in moments(run):
        cut = run.cut(number, seed, spoil=spoil, mode=mode)
        good = cut.good and cut.again_s <= most and cut.spoilt == spoil and cut.older == spoil
        print(f"{'ok' if good else 'FAILED':6} {what}: {cut.call}: {cut.outcome}, {cut.again_s:.1f} s again"
              f"{', from the checkpoint before' if cut.older else ''} {cut.different or ''}")
        failed += [] if good else [what]
    # The model bites: had nothing been synced, the run would be lost.
    cut = run.cut(len(run.calls) * 2 // 3, 9, syncs=False, mode="lost")
    print(f"without syncing: {cut.outcome}")
    assert not cut.good, "the disk kept what was never synced"
    assert not failed, failed
