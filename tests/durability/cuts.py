"""Cuts the power at a moment of a run of `understory map`, goes on with --resume and says what it cost."""

import os
import pathlib
import re
import shutil
import struct
import subprocess

from disk import Disk, MAKE, WRITE, read_log

DENSE = ["trajectory.tum", "keyframes.tum", "graph.g2o", "states.csv.gz", "map.laz", "trees.csv", "dtm.tif", "chm.tif", "dsm.tif"]
STEMS = ["stems.csv.gz", "trajectory.tum", "odometry.tum", "steps.csv", "corrections.csv", "loops.csv", "trees.csv"]
# The file that tells how far a run has come, the length of the record of a scan in it, and where its stamp stands.
PROGRESS = {"dense": ("journal.bin", None, 0), "sparse": ("views.bin", 66, 2)}
CHECKPOINTS = ("checkpoint.bin", "checkpoint.2.bin")
DONE = (0, 4)


class Cut:
    """What a cut at one moment came to."""

    def __init__(self, number, seed):
        self.number, self.seed = number, seed
        self.call = ""           # the last one before it
        self.mode = ""           # what of the bytes that were not synced is left
        self.spoilt = False      # the newest checkpoint was broken as well
        self.outcome = ""        # "resumed", "begun anew", "finished", or what failed
        self.again_s = 0.0       # of recording that was processed twice
        self.older = False       # gone on from the checkpoint before the newest
        self.different = []      # files that differ from the undisturbed run's

    @property
    def good(self):
        return self.outcome in ("resumed", "begun anew", "finished") and not self.different


class Run:
    """An undisturbed run, and every call by which it changed the disk."""

    def __init__(self, program, library, recording, scratch, front_end, interval_s, options=()):
        self.program, self.recording, self.front_end = program, recording, front_end
        self.scratch = pathlib.Path(scratch).resolve()
        self.top = self.scratch / f"{front_end}_disk"
        self.top.mkdir(parents=True)
        self.options = ["--front-end", front_end, "--set", f"run.checkpoint_interval_s={interval_s}", *options]
        log = self.scratch / f"{front_end}.log"
        watched = dict(os.environ, LD_PRELOAD=str(library), UNDERSTORY_POWER_CUT_FOLDER=str(self.top),
                       UNDERSTORY_POWER_CUT_LOG=str(log))
        done = self.understory("map", recording, "-o", self.top / "run", *self.options, env=watched)
        assert done.returncode in DONE, done.stderr
        self.whole = self.top / "run"
        self.calls = read_log(log)
        names = DENSE if front_end == "dense" else STEMS
        self.results = [name for name in names if (self.whole / name).exists()]
        assert "trajectory.tum" in self.results and "trees.csv" in self.results, self.results
        self.reached = self.stamps()

    def understory(self, *arguments, **options):
        return subprocess.run([self.program, "--threads", "1", *map(str, arguments)], capture_output=True, text=True,
                              **options)

    def stamps(self):
        """After each call, the stamp of the last scan that the run has positioned, or None."""
        name, length, at = PROGRESS[self.front_end]
        inodes, last, stamps = set(), None, []
        for call in self.calls:
            if call.kind == MAKE:
                (inodes.add if call.path.endswith(name) else inodes.discard)(call.inode)
            elif call.kind == WRITE and call.inode in inodes and len(call.data) > 8 and (
                    length is None or len(call.data) == length):
                last = struct.unpack_from("<q", call.data, at)[0] * 1e-9
            stamps.append(last)
        assert last is not None, "no scan was seen in the log"
        return stamps

    def find(self, kind, ending, after=0):
        """The number of calls after the first of that kind on a path with that ending."""
        for i in range(after, len(self.calls)):
            call = self.calls[i]
            if call.kind == kind and (call.path.endswith(ending) or call.second.endswith(ending)):
                return i + 1
        raise AssertionError(f"no call of kind {kind} on {ending}")

    def cut(self, number, seed, syncs=True, spoil=False, mode=None):
        """Cuts the power after `number` calls; `spoil` breaks the newest checkpoint as well."""
        cut = Cut(number, seed)
        cut.call = str(self.calls[number - 1]) if number else "nothing"
        disk = Disk(self.top, syncs)
        for call in self.calls[:number]:
            disk.do(call)
        place = self.scratch / f"{self.front_end}_{number}_{seed}"
        try:
            cut.mode = disk.write(place, seed, mode)
            cut.spoilt = spoil and spoil_newest(place)
            self.go_on(place / "run", cut, self.reached[number - 1] if number else None)
        finally:
            shutil.rmtree(place, ignore_errors=True)
        return cut

    def go_on(self, folder, cut, reached):
        done = self.understory("map", "--resume", folder)
        if "is finished" in done.stderr:
            cut.outcome = "finished"
        elif done.returncode in DONE:
            cut.outcome = "resumed"
            begun = re.search(r"goes on at (?:([\d.]+) s|the beginning)", done.stderr)
            assert begun, done.stderr
            first = next(stamp for stamp in self.reached if stamp)
            cut.again_s = max(0.0, reached - float(begun[1] or first)) if reached else 0.0
            cut.older = "newest checkpoint is not whole" in done.stderr
        elif "no unfinished run" in done.stderr and not reached:
            cut.outcome = "begun anew"  # nothing had been mapped
            done = self.understory("map", self.recording, "-o", folder, "--overwrite", *self.options)
            if done.returncode not in DONE:
                cut.outcome = done.stderr[-300:]
        else:
            cut.outcome = f"exit code {done.returncode}: {done.stderr[-300:]}"
        if cut.outcome in ("resumed", "begun anew", "finished"):
            cut.different = [name for name in self.results
                             if not (folder / name).exists()
                             or (folder / name).read_bytes() != (self.whole / name).read_bytes()]


def spoil_newest(place):
    """Changes one byte of the newer of two checkpoints; False if there are no two."""
    files = [path for name in CHECKPOINTS for path in place.rglob(name)]
    if len(files) < 2 or any(path.stat().st_size < 40 for path in files):
        return False
    newest = max(files, key=lambda path: struct.unpack_from("<Q", path.read_bytes(), 24)[0])
    content = bytearray(newest.read_bytes())
    content[len(content) // 2] ^= 0x10
    newest.write_bytes(content)
    return True
